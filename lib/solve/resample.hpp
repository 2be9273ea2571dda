// Images and cameras at another resolution; depths.
#pragma once

#include <vector>

#include "dpr/camera.hpp"
#include "dpr/image.hpp"
#include "dpr/renderer.hpp"

namespace dpr {

/// The mean over the area of every new pixel; linear in the image, alpha included. Sizes at least 1.
Image resample(const Image& image, int width, int height);

/// The same of numbers that count by their alpha: the means of what counts, and of how much it does.
Image resample_weighted(Image image, int width, int height);

/// True if a pixel of a depth image has one.
bool has_depth(const glm::vec4& pixel);

/// [pixel] True if it has no depth and lies between such that have one: a sensor's holes, two pixels wide at most.
std::vector<bool> holes_of(const Image& depth);

/// Medians of the first channel over the areas of new pixels, among those that have an alpha above 0; alpha is
/// the part of the area that has. Means would mix what lies before an edge with what lies behind it.
Image resample_medians(const Image& image, int width, int height);

/// How far a point of the world lies in front of a camera, along its axis.
double view_depth(const Camera& camera, const glm::dvec3& point);

/// The perspective camera with intrinsics, for images of that size.
Camera in_pixels(Camera camera, int width, int height);

/// The camera that sees the same picture in images of another size. An orthographic one keeps its height:
/// where rounding changes the ratio of the sides, it sees a little more or less at the left and right.
Camera resample(const Camera& camera, int width, int height, int new_width, int new_height);

/// The camera with another focal length, `scale` times as long; orthographic: with so much less height.
Camera zoomed(Camera camera, double scale);
/// How the camera changes with the logarithm of that scale.
CameraGradient zoom_tangent(const Camera& camera);

}  // namespace dpr
