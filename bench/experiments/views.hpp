// Cameras around an object of size 2 or less, images as files have them, and how like two lists of images
// are.
#pragma once

#include <cstddef>
#include <vector>

#include "dpr/camera.hpp"
#include "dpr/image.hpp"

namespace dpr::experiments {

/// Spread evenly over a sphere about the origin (a Fibonacci lattice), turned by an angle.
std::vector<Camera> cameras_around(std::size_t count, double turn_degrees);

/// As a file has the colours.
void round_to_8_bits(Image& image);

/// Peak signal-to-noise ratio over the colours of the pixels whose target has an alpha of at least
/// `least_alpha`, decibels, of a signal of 1.
double psnr(const std::vector<Image>& images, const std::vector<Image>& targets, float least_alpha = 0);

}  // namespace dpr::experiments
