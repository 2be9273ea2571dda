// Where the cameras look, and how large things are there.
#pragma once

#include "dpr/shape.hpp"

namespace dpr {

/// What all cameras see.
struct CommonView {
  glm::dvec3 centre{0.0};  ///< nearest to the axes through the images' centres
  double radius = 0;       ///< of a sphere about it: half of the narrowest image, and inside znear and zfar
  double pixel = 0;        ///< of the images, at the centre; world units, mean over the views
  double depth_range = 0;  ///< zfar - znear, mean over the views
};

/// Throws InvalidArgument where the centre is not between znear and zfar of every camera.
CommonView common_view(const ShapeViews& views);

}  // namespace dpr
