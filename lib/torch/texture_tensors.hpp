// Textures and materials as the operator's users give them, and as its numbers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dpr/renderer.hpp"
#include "torch/render.hpp"
#include "torch/surface.hpp"
#include "torch/view_tensors.hpp"

namespace dpr::torch_op {

/// What has gradients. Undefined or empty where there is none.
struct SurfaceNumbers {
  at::Tensor texcoords;  ///< [texcoord, 2]
  at::Tensor texels;     ///< [texel, 3] linear RGB, row 0 on top, one texture after the other
  at::Tensor specular;   ///< [material, 3]
  at::Tensor shininess;  ///< [material]; none: that of the lights
};

/// The same, contiguous. Throws InvalidArgument for types, devices and shapes that do not fit.
SurfaceNumbers checked(const SurfaceNumbers& numbers);

/// How they lie on the faces.
struct SurfaceLayout {
  at::Tensor face_texcoords;  ///< int64 [face, 3]; undefined or empty: texture coordinates are the vertices'
  at::Tensor face_textures;   ///< int64 [face], -1 for none; undefined or empty: all have the first
  at::Tensor face_materials;  ///< int64 [face]; undefined or empty: all have the first
  std::vector<std::int64_t> texture_sizes;  ///< height and width of each texture
  std::vector<std::string> wraps, filters;  ///< one of each texture, or of all; none: those of a Texture
};

/// Of checked numbers. Throws InvalidArgument for what does not fit them.
Surface make_surface(const SurfaceLayout& layout, const SurfaceNumbers& numbers, const Faces& faces,
                     std::int64_t vertices);

/// Of checked numbers, to a renderer whose scene has their surface.
void upload_surface(Renderer& renderer, const SurfaceNumbers& numbers);

/// Which of the numbers need a gradient.
struct WantedOfSurface {
  bool texcoords = false, texels = false, specular = false, shininess = false;
};

/// Undefined where not wanted; 0 of materials without lights.
SurfaceNumbers surface_gradients(const Mesh& mesh, const MeshGradient& gradient,
                                 const WantedOfSurface& wanted);

/// Textures and materials without their numbers, and these.
struct PackedSurface {
  SurfaceLayout layout;
  SurfaceNumbers numbers;
};

/// By torch's own operations, which differentiate the packing. Throws InvalidArgument for names that there
/// are not, and tensors of other shapes.
PackedSurface pack(const TextureTensors& given);

/// Whether a texture has a leading dimension of views.
bool is_of_views(const TextureTensors& given);
/// What a view has of them. Throws InvalidArgument for leading dimensions of another size.
TextureTensors of_view(TextureTensors given, const ViewOfBatch& view);

}  // namespace dpr::torch_op
