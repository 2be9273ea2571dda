// Cameras: a pinhole, with a lens that distorts or without, or orthographic; and those of other programs.
#pragma once

#include <optional>
#include <string>

#include "dpr/export.h"
#include "dpr/vectors.hpp"

namespace dpr {

/// Pinhole intrinsics in pixels; the origin is the corner of the top-left pixel, x right, y down.
struct Intrinsics {
  float fx = 0, fy = 0, cx = 0, cy = 0;

  bool operator==(const Intrinsics&) const = default;
};

/// Formula of a lens: Brown's, as cv::projectPoints has it, or that of cv::fisheye::projectPoints.
enum class LensModel { brown, fisheye };

/// Distortion of a lens, with OpenCV's coefficients. With x and y in OpenCV's axes (y down) over depth,
/// r^2 = x^2 + y^2 and a = atan r, the angle from the axis, Brown's model shows a point at
///
///   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2), and y' alike with p1 and p2
///   exchanged,
///
/// and a fisheye, which fisheye() makes, at
///
///   x' = x / r a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8), and y' alike.
///
/// A fisheye too sees only what lies in front of the near plane, less than 90 degrees from the axis.
///
/// The lens moves vertices. Between them edges and what is on faces stay straight, an edge of length l in
/// tangents off by up to about 3/4 |k1| l^2 r (of a fisheye k1 - 1/3 for k1): subdivide_for_lens()
/// (dpr/subdivision.hpp) cuts faces that are too large for that. From the radius on where the image would
/// fold over (largest_radius()) points are held at it. What clipping leaves of faces is distorted.
struct Distortion {
  float k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;  ///< p1 and p2 are 0 of a fisheye
  float k4 = 0;                                  ///< 0 of Brown's model
  LensModel model = LensModel::brown;

  bool operator==(const Distortion&) const = default;
};

/// The lens of cv::fisheye. Coefficients of 0 are a lens as well, the equidistant one.
inline Distortion fisheye(float k1, float k2, float k3, float k4) {
  return {.k1 = k1, .k2 = k2, .k3 = k3, .k4 = k4, .model = LensModel::fisheye};
}

/// Tangent of the angle from the axis where the radius x' of a point on the x axis stops rising, without p1
/// and p2; infinity where it rises everywhere.
DPR_API double largest_radius(const Distortion& distortion);

/// An OpenGL camera: right-handed, looks down -z, y up. Column vectors. Its field of view is the one without
/// the lens.
struct Camera {
  mat4 view{1.0F};              ///< world to camera; affine and invertible
  float fov_y_degrees = 60.0F;  ///< full vertical field of view, in (0, 180); ignored if intrinsics are given
  std::optional<Intrinsics> intrinsics;  ///< instead of fov_y_degrees
  float znear = 1.0F;                    ///< > 0, distance along the view direction; faces are clipped there
  float zfar = 100.0F;                   ///< > znear; faces that do not cross znear are clipped there
  std::optional<Distortion> distortion{};  ///< by the lens of a perspective camera
  /// Orthographic instead of perspective: > 0, world units from the lower to the upper edge of the image.
  /// Then there are neither intrinsics nor distortion, and fov_y_degrees is ignored.
  std::optional<float> orthographic_height{};

  bool operator==(const Camera&) const = default;
};

/// NDC of a camera-space point at depth d = -z: (scale.x * x / d + offset.x, scale.y * y / d + offset.y), of
/// an orthographic camera without the division. NDC spans [-1, 1] on the short side of the image, x right, y
/// up. A lens distorts x / d and y / d before.
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

/// OpenCV's camera matrix counts from the centre of the top-left pixel: its cx and cy are less by a half.
/// Focal lengths and distortion are the same.
DPR_API Intrinsics to_opencv_intrinsics(const Intrinsics& intrinsics);
DPR_API Intrinsics from_opencv_intrinsics(const Intrinsics& intrinsics);

/// Arguments of PyTorch3D's PerspectiveCameras and OrthographicCameras, in its NDC (in_ndc=True).
struct PyTorch3dProjection {
  vec2 focal_length, principal_point;
};
DPR_API PyTorch3dProjection to_pytorch3d_projection(const Camera& camera, int width, int height);
/// Intrinsics from those of PerspectiveCameras.
DPR_API Intrinsics from_pytorch3d_projection(const PyTorch3dProjection& projection, int width, int height);

/// OpenGL's projection matrix: clip coordinates from camera space, for a viewport of that many pixels.
/// Without the lens' distortion, which no matrix has.
DPR_API mat4 to_opengl_projection(const Camera& camera, int width, int height);
/// The camera of OpenGL's view and projection matrices: with intrinsics, or orthographic. Throws
/// InvalidArgument for a matrix that is of neither kind, or skewed; orthographic also if its pixels are not
/// square or the axis does not pass the image's centre.
DPR_API Camera from_opengl(const mat4& view, const mat4& projection, int width, int height);

}  // namespace dpr
