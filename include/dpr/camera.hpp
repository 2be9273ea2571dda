// The pinhole camera.
#pragma once

#include <optional>
#include <string>

#include "dpr/export.h"
#include "dpr/vectors.hpp"

namespace dpr {

/// Pinhole intrinsics in pixels; the origin is the corner of the top-left pixel, x right, y down.
struct Intrinsics {
  float fx = 0, fy = 0, cx = 0, cy = 0;
};

/// An OpenGL camera: right-handed, looks down -z, y up. Column vectors.
struct Camera {
  mat4 view{1.0F};              ///< world to camera; affine and invertible
  float fov_y_degrees = 60.0F;  ///< full vertical field of view, in (0, 180); ignored if intrinsics are given
  std::optional<Intrinsics> intrinsics;  ///< instead of fov_y_degrees
  float znear = 1.0F;                    ///< > 0, distance along the view direction
  float zfar = 100.0F;                   ///< > znear
};

/// NDC of a camera-space point at depth d = -z: (scale.x * x / d + offset.x, scale.y * y / d + offset.y).
/// NDC spans [-1, 1] on the short side of the image, x right, y up.
struct Projection {
  vec2 scale, offset;
};

/// The projection of a camera for an image of that many pixels.
DPR_API Projection projection(const Camera& camera, int width, int height);

/// Throws InvalidArgument if the view is singular, not affine or not finite, or a parameter is out of its
/// range; `name` says which camera it is.
DPR_API void validate(const Camera& camera, const std::string& name = "camera");

/// A camera on a sphere about `target`, looking at it, up is +y. At elevation 0 and azimuth 0 it stands on
/// +z; azimuth turns it towards +x, elevation lifts it. Degrees; elevation strictly between -90 and 90.
DPR_API Camera orbit_camera(float distance, float elevation_degrees, float azimuth_degrees,
                            vec3 target = vec3(0));

/// World to camera in OpenCV axes (x right, y down, z forward): the rows y and z change sign.
DPR_API mat4 to_opencv_view(const mat4& view);
/// The inverse of to_opencv_view.
DPR_API mat4 from_opencv_view(const mat4& view);

/// PyTorch3D's R and T (x left, y up, z forward; row vectors: x_cam = x_world R + T).
struct PyTorch3dView {
  mat3 R;  ///< PyTorch3D's R[row][column] is element (row, column), which GLM stores as R[column][row]
  vec3 T;
};
DPR_API PyTorch3dView to_pytorch3d_view(const mat4& view);
DPR_API mat4 from_pytorch3d_view(const PyTorch3dView& view);

}  // namespace dpr
