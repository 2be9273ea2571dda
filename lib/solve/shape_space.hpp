// The region that the cameras look at, and its size.
#pragma once

#include <string>

#include "dpr/shape.hpp"

namespace dpr {

/// The initial mesh with vertex colours, as ShapeViews::initial has them. Nothing else of its surface stays.
Mesh with_vertex_colors(Mesh mesh);

/// Throws InvalidArgument where a camera is to be found first; `where` is in its message.
void require_known_cameras(const ShapeViews& views, const std::string& where);

/// The region that all cameras see.
struct CommonView {
  glm::dvec3 centre{0.0};  ///< nearest to the axes through the images' centres
  double radius = 0;       ///< of a sphere about it: half of the narrowest image, and inside znear and zfar
  double pixel = 0;        ///< of the images, at the centre; world units, mean over the views
  double depth_range = 0;  ///< zfar - znear, mean over the views
};

/// Throws InvalidArgument where the centre is not between znear and zfar of every camera.
CommonView common_view(const ShapeViews& views);

}  // namespace dpr
