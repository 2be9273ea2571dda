// Triangle meshes: the data, their files, and the shapes the library makes itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "dpr/export.h"
#include "dpr/texture.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// The texture of a face that has none.
inline constexpr std::uint32_t k_no_texture = std::numeric_limits<std::uint32_t>::max();

/// Highlights of a surface. Lights has their formula.
struct Material {
  vec3 specular{1.0F};             ///< the lights' specular is multiplied by it; microfacet: F0
  std::optional<float> shininess;  ///< >= 1; none: that of the lights

  bool operator==(const Material&) const = default;
};

/// Throws InvalidArgument for a coefficient that is not finite, and a shininess below 1. `name` says in the
/// message which material it is.
DPR_API void validate(const Material& material, const std::string& name = "material");

/// A surface's colour beside its material.
struct ColoredMaterial {
  vec3 color;
  Material material;
};

/// glTF's metal and roughness, from 0 to 1, for Shading::microfacet: the colour base_color (1 - metallic), the
/// reflectance 0.04 + (base_color - 0.04) metallic, and the shininess 2 / alpha^2 - 1 of alpha = roughness^2, at least
/// 0.001. Throws InvalidArgument for numbers beyond 0 to 1, and a colour (linear RGB) that is not finite.
DPR_API ColoredMaterial metallic_roughness(const vec3& base_color, float metallic, float roughness);

/// An indexed triangle mesh in object space. Any soup will do: shared or unshared vertices, non-manifold
/// edges, duplicate or degenerate faces. At most one of the two colour arrays is filled; with neither, the
/// mesh is white. A texture is multiplied by the colours.
struct Mesh {
  std::vector<vec3> positions;        ///< [vertex] object space
  std::vector<uvec3> faces;           ///< [face] indices into positions
  std::vector<vec3> vertex_colors;    ///< [vertex] linear RGB, or empty
  std::vector<vec3> face_colors;      ///< [face] linear RGB, or empty
  std::vector<vec2> texcoords;        ///< texture coordinates that corners refer to, or empty
  std::vector<uvec3> face_texcoords;  ///< [face] indices into texcoords, or empty
  std::vector<Texture> textures;      ///< of the base colour, or empty; they need face_texcoords
  /// [face] index into textures, or k_no_texture; empty: all faces have the first.
  std::vector<std::uint32_t> face_textures;
  /// Normals that corners refer to, of any length; without, those of vertices come from the faces around
  /// them. They stay what they are where positions move, and flat shading does not look at them.
  std::vector<vec3> normals{};
  std::vector<uvec3> face_normals{};            ///< [face] indices into normals, or empty
  std::vector<Material> materials{};            ///< or empty: one that changes nothing
  std::vector<std::uint32_t> face_materials{};  ///< [face] index into materials; empty: all have the first
  /// The probability that a surface is there where it may cover a pixel, from 0 to 1: at most one of the two is
  /// filled; with neither it is opaque. Below 1 sampled aggregation in the joint composition is refused, and
  /// frames take longer: nothing is hidden. Images count 0 as 1e-6 (barrier:
  /// 1e-20), and where the gradient is asked for 1 as 1 - 1e-6, so that both have theirs. Those of textures multiply
  /// them.
  std::vector<float> vertex_opacities{};  ///< [vertex], or empty
  std::vector<float> face_opacities{};    ///< [face], or empty
};

/// Throws InvalidArgument unless the mesh can be rendered: at least one face, indices in range, finite
/// positions, colours, normals, materials, texture coordinates and texels, opacities from 0 to 1, arrays of matching
/// length. `name` says in the message which mesh it is. O(vertices + faces + texels).
DPR_API void validate(const Mesh& mesh, const std::string& name = "mesh");

/// Reads OBJ, PLY, OFF, STL, or glTF 2.0 (.gltf, .glb); vertices are in the order of the file. Polygons become
/// triangle fans; non-manifold, duplicate and degenerate faces are kept, and the colours of vertices, else of
/// faces, white where others have one; dpr/notes.hpp tells what is left out.
///
/// OBJ: the diffuse colours of materials are face colours, their textures (map_Kd, without alpha) are the mesh's, and
/// what they say of highlights (Ks, Ns, illum) its materials, if libraries and textures are regular files. Normals are
/// kept if every corner has one, texture coordinates (u, v; v up) if every corner has some, or where there are
/// textures; then faces without coordinates get (0, 0) and no texture.
/// PLY: textures (comment TextureFile, without alpha) take the place of colours, by the corners' or else the vertices'
/// coordinates; normals and texture coordinates are kept if they are floats.
/// STL: equal positions become one, and facets with two equal corners are left out.
/// glTF: all meshes of the scene to show, where their nodes place them, as one; equal positions become one
/// unless there are colours or opacities of vertices. Base colours are colours, their textures (PNG and JPEG, also
/// within the file) the mesh's; alpha is opacity where alphaMode is BLEND, an opacity of 0 or 1 by alphaCutoff where it
/// is MASK; of what else a surface is, nothing is read. Normals and texture coordinates are kept if all triangles have
/// them.
///
/// Throws IoError where the file is missing, malformed, truncated, goes on after its end or has none; and
/// InvalidArgument where its content cannot be rendered.
DPR_API Mesh read_mesh(const std::filesystem::path& file);

/// Writes OBJ, PLY or GLB, by the extension, each file through a temporary one that is renamed at the end. GLB takes
/// all but materials; textures become PNG within it, sRGB in 8 bits, clamped to [0, 1]; vertices are numbered anew, in
/// the order of the faces. OBJ has no face colours, nor highlights below 0: asking for them is an error, not a silent
/// loss. Its textures become such PNG files beside it (x.png; x.0.png, x.1.png of several), named by the materials of
/// x.mtl, which keep Wrap::clamp, but neither Wrap::mirror (they repeat) nor filters; a textured mesh without materials
/// is written as one without highlights. PLY colours are bytes, as other programs expect them: clamped to [0, 1] and
/// rounded; it has no texture coordinates, textures, normals or materials. Throws IoError, and
/// InvalidArgument where the mesh is not valid, or has opacities below 1.
DPR_API void write_mesh(const std::filesystem::path& file, const Mesh& mesh);

/// The six-coloured cube [-1, 1]^3 of the paper's experiments: 24 vertices (each side its own, so that
/// lighting sees flat sides), 12 triangles, one colour a side.
DPR_API Mesh make_cube();

/// A sphere about the origin from a subdivided icosahedron: 20 * 4^subdivisions triangles,
/// 10 * 4^subdivisions + 2 vertices; coloured smoothly by position.
DPR_API Mesh make_icosphere(unsigned subdivisions, float radius = 1.0F);

/// A torus about the y axis: 2 * major_segments * minor_segments triangles; coloured smoothly by position.
DPR_API Mesh make_torus(float major_radius, float minor_radius, unsigned major_segments,
                        unsigned minor_segments);

}  // namespace dpr
