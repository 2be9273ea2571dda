// Auxiliary outputs: what is seen in each pixel, beside its colour.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "dpr/export.h"
#include "dpr/image.hpp"
#include "dpr/renderer.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// The auxiliary outputs that an image can show.
enum class Aov { depth, normal, face_id, barycentrics, uv, effective_faces };

DPR_API std::string_view to_string(Aov);
/// The inverse; `where` names the argument in the InvalidArgument thrown for an unknown word.
DPR_API Aov parse_aov(std::string_view word, std::string_view where);

/// Auxiliary outputs of a view's pixels. Every list is [height * width], row 0 on top. The fragments of a
/// pixel count by their weights in its colour, those of the estimator in force; exact weights hold the
/// expectation.
struct AuxiliaryOutputs {
  int width = 0, height = 0;
  /// Expected depth along the view direction, world units: sum w_j z_j / sum w_j; 0 where no face has weight.
  std::vector<float> depth;
  /// Expected normal of the faces, world space, of length 1, on the side from which they wind
  /// counter-clockwise; 0 where no face has weight.
  std::vector<vec3> normal;
  /// The face of the largest weight, counted through the meshes of the scene in order; -1 where the
  /// background has more.
  std::vector<std::int32_t> face_id;
  /// Barycentrics of that face at the pixel, or at the face's nearest point: >= 0, sum 1; 0 on the
  /// background.
  std::vector<vec3> barycentrics;
  /// Texture coordinates of that face there; 0 on the background. Empty unless all meshes have some.
  std::vector<vec2> uv;
  /// Participation ratio of the faces' weights, (sum w_j)^2 / sum w_j^2: 1 where one face is seen, n where n
  /// faces share the pixel evenly; 0 where no face has weight.
  std::vector<float> effective_faces;
};

/// Auxiliary outputs of a view of the last forward(). Blocks; costs an aggregation backward pass. Throws
/// InvalidArgument before the first forward(), and for a view that does not exist.
DPR_API AuxiliaryOutputs auxiliary_outputs(Renderer& renderer, std::size_t view = 0);

/// One of them as an image: numbers in red, green and blue (uv in red and green, single numbers in all three;
/// face_id is exact up to 2^24), alpha 1 where face_id names a face, 0 on the background. Throws
/// InvalidArgument for uv of meshes without texture coordinates.
DPR_API Image aov_image(const AuxiliaryOutputs& outputs, Aov aov);

}  // namespace dpr
