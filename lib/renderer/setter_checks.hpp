// Checks of the setters' arguments, of renderers on one device or several.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "device/opencl_bindings.hpp"
#include "dpr/renderer.hpp"
#include "renderer/pixel_noise.hpp"
#include "smoothing/blur_kernel.hpp"

namespace dpr {

/// Throws InvalidArgument for another number of layers than Renderer::set_layers() takes.
void check_layers(std::int64_t count, const std::string& argument);

/// Throws InvalidArgument if there is no device, or the same Device twice: each needs a queue of its own.
void check_devices(std::span<const Device> devices);

/// These throw InvalidArgument for what does not suit the scene.
void check_views(const Scene& scene, std::span<const View> views);
void check_lights(const Scene& scene, std::span<const View> views, const std::optional<Lights>& lights);

/// Throws InvalidArgument unless there are as many pixels as the views have.
void require_pixel_count(std::size_t found, std::size_t expected);

/// The pixels of the images, one after the other, whose derivative by which these are has that size.
std::vector<cl_float4> checked_pixels(std::span<const Image> grad_images, int width, int height);

/// Samples along a side of the frame, with the margin.
std::size_t samples_of_side(int pixels, const Raster& raster);

/// The blur of noise on the pixel in frames of the scene's size. Throws as blur_kernel().
BlurKernel pixel_blur(const Smoothing& smoothing, const Scene& of);
/// The shifts by which it is sampled.
ShiftTable pixel_shifts(const Smoothing& smoothing, const Scene& of);

/// Raster that the scene's own smoothing needs around its frame. Throws as blur_kernel().
Raster raster_of(const Scene& scene);

/// Most views of the scene that a frame may have, so that all counts over them fit their types: pixels, the
/// raster's samples, vertices and faces.
/// `views_of_faces`: see Renderer::Impl::set_scene().
std::size_t most_views(const Scene& scene, const Raster& raster = {}, std::size_t views_of_faces = 1);

/// Throws InvalidArgument where the depth range, or gamma in it, or the lengths that lighting squares are
/// beyond single precision.
void require_scales(const Camera& camera, const Smoothing& smoothing, bool lit);

}  // namespace dpr
