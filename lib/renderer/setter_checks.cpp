#include "renderer/setter_checks.hpp"

#include <algorithm>

#include "base/checks.hpp"
#include "shared_types.h"

namespace dpr {

void check_layers(std::int64_t count, const std::string& argument) {
  constexpr std::int64_t k_most = 256;
  if (count < 1 || count > k_most)
    throw InvalidArgument(argument, std::to_string(count),
                          "a whole number from 1 to " + std::to_string(k_most));
}

void check_devices(std::span<const Device> devices) {
  if (devices.empty()) throw InvalidArgument("devices", "none", "at least one");
  for (std::size_t d = 0; d < devices.size(); ++d) {
    for (std::size_t other = 0; other < d; ++other) {
      if (&impl_of(devices[d]) != &impl_of(devices[other])) continue;
      throw InvalidArgument(checks::element("devices", d),
                            "the same Device as " + checks::element("devices", other),
                            "one with a queue of its own, open_device() or split_device()");
    }
  }
}

void check_views(const Scene& scene, std::span<const View> views) {
  if (views.empty()) throw InvalidArgument("views", "none", "at least one");
  for (std::size_t v = 0; v < views.size(); ++v) {
    const View& view = views[v];
    validate(view.camera);
    if (view.camera.orthographic_height.has_value() != views[0].camera.orthographic_height.has_value()) {
      throw InvalidArgument(checks::element("views", v) + ".camera.orthographic_height",
                            "perspective and orthographic cameras in one batch", "all of one kind");
    }
    require_scales(view.camera, scene.smoothing, scene.lights.has_value());
    const std::string name = checks::element("views", v) + ".transforms";
    if (view.transforms.size() != scene.meshes.size()) {
      throw InvalidArgument(name, std::to_string(view.transforms.size()),
                            "one for each of the " + std::to_string(scene.meshes.size()) + " meshes");
    }
    for (std::size_t m = 0; m < view.transforms.size(); ++m)
      checks::require_affine(view.transforms[m], checks::element(name, m));
  }
}

void check_lights(const Scene& scene, std::span<const View> views, const std::optional<Lights>& lights) {
  if (!lights) return;
  validate(*lights);
  for (const View& view : views) require_scales(view.camera, scene.smoothing, true);
}

void require_pixel_count(std::size_t found, std::size_t expected) {
  if (found == expected) return;
  throw InvalidArgument("pixels", std::to_string(found),
                        std::to_string(expected) + ", views x height x width");
}

std::vector<cl_float4> checked_pixels(std::span<const Image> grad_images, int width, int height) {
  std::vector<cl_float4> pixels;
  for (const Image& image : grad_images) {
    if (image.width != width || image.height != height) {
      throw InvalidArgument("size (grad_images)", checks::size(image.width, image.height),
                            checks::size(width, height));
    }
    checks::require_pixels(image, "grad_images");
    for (const glm::vec4& p : image.pixels) pixels.push_back({{p.x, p.y, p.z, p.w}});
  }
  return pixels;
}

std::size_t samples_of_side(int pixels, const Raster& raster) {
  return static_cast<std::size_t>(pixels) * static_cast<std::size_t>(raster.supersampling) +
         2 * static_cast<std::size_t>(raster.margin);
}

namespace {

double scale_in_pixels(const Smoothing& smoothing, const Scene& of) {
  return pixel_scale(smoothing, std::min(of.width, of.height)).value;
}

}  // namespace

BlurKernel pixel_blur(const Smoothing& smoothing, const Scene& of) {
  return blur_kernel(smoothing.occupancy_prior, scale_in_pixels(smoothing, of),
                     static_cast<int>(smoothing.supersampling));
}

ShiftTable pixel_shifts(const Smoothing& smoothing, const Scene& of) {
  return shift_table(smoothing.occupancy_prior, scale_in_pixels(smoothing, of),
                     static_cast<int>(smoothing.supersampling));
}

Raster raster_of(const Scene& scene) {
  if (scene.smoothing.noise != Noise::pixel) return {};
  const BlurKernel kernel = pixel_blur(scene.smoothing, scene);
  return {kernel.supersampling, kernel.margin};
}

std::size_t most_views(const Scene& scene, const Raster& raster, std::size_t views_of_faces) {
  std::size_t vertices = 0, faces = 0;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    vertices += mesh_of(scene, m).positions.size();
    faces += mesh_of(scene, m).faces.size() / views_of_faces;
  }
  const std::size_t samples = samples_of_side(scene.width, raster) * samples_of_side(scene.height, raster);
  const std::size_t largest =
      std::max({samples * DPR_PIXEL_CHANNELS, vertices * DPR_LENS_CHANNELS, faces * 3});
  return 0xfffffffeU / largest;
}

void require_scales(const Camera& camera, const Smoothing& smoothing, bool lit) {
  constexpr float k_largest = 1e36F, k_largest_length = 1e9F;
  const float range = camera.zfar - camera.znear;
  if (!(range <= k_largest && 1 / range <= k_largest)) {
    throw InvalidArgument("zfar - znear (camera)", checks::text(range),
                          "a length from 1e-36 to 1e36, whose inverse single precision holds");
  }
  if (!(1 / range / smoothing.gamma <= k_largest)) {
    throw InvalidArgument(
        "gamma (smoothing)", checks::text(smoothing.gamma),
        "at least " + checks::text(1 / range / k_largest) +
            " with these clipping planes: single precision holds 1 / (gamma (zfar - znear))");
  }
  if (lit && (camera.znear > k_largest_length || camera.zfar < 1 / k_largest_length)) {
    throw InvalidArgument(
        "znear to zfar (camera)",
        checks::text(camera.znear) + " to " + checks::text(camera.zfar) + " with lights",
        "lengths from 1e-9 to 1e9, whose powers single precision holds: another unit of length");
  }
}

}  // namespace dpr
