#include "renderer/setter_checks.hpp"

#include <algorithm>

#include "base/checks.hpp"
#include "renderer/finite.hpp"
#include "shared_types.h"

namespace dpr {

View own_view(const Scene& scene) {
  View view{scene.camera, {}};
  for (const Instance& instance : scene.meshes) view.transforms.push_back(instance.transform);
  return view;
}

void check_devices(std::span<const Device> devices) {
  if (devices.empty()) throw InvalidArgument("devices", "none", "at least one");
  for (std::size_t d = 0; d < devices.size(); ++d) {
    for (std::size_t other = 0; other < d; ++other) {
      if (&devices[d].impl() != &devices[other].impl()) continue;
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

void check_values(const char* name, std::span<const glm::vec3> values, std::size_t expected) {
  if (values.size() != expected) {
    throw InvalidArgument(name, std::to_string(values.size()) + " vectors", std::to_string(expected));
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!checks::is_finite(values[i])) checks::require_finite(values[i], checks::element(name, i));
  }
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

void check_mesh(const Scene& scene, std::size_t mesh) {
  if (mesh >= scene.meshes.size())
    throw InvalidArgument("mesh", std::to_string(mesh), "below " + std::to_string(scene.meshes.size()));
  if (const auto source = scene.meshes[mesh].instance_of) {
    throw InvalidArgument("mesh", std::to_string(mesh) + ", an instance of mesh " + std::to_string(*source),
                          std::to_string(*source) + ": what is set there is its instances' too");
  }
}

void check_texture(const Scene& scene, std::size_t mesh, std::size_t texture) {
  check_mesh(scene, mesh);
  const std::size_t textures = scene.meshes[mesh].mesh.textures.size();
  if (texture >= textures)
    throw InvalidArgument("texture", std::to_string(texture), "below " + std::to_string(textures));
}

void check_has_texcoords(const Scene& scene, std::size_t mesh) {
  check_mesh(scene, mesh);
  if (scene.meshes[mesh].mesh.textures.empty())
    throw InvalidArgument("mesh (set_texcoords)", "a mesh without textures", "one that has some");
}

void check_has_normals(const Scene& scene, std::size_t mesh) {
  check_mesh(scene, mesh);
  if (scene.meshes[mesh].mesh.face_normals.empty())
    throw InvalidArgument("mesh (set_normals)", "a mesh without normals of its own", "one that gives some");
}

void check_has_materials(const Scene& scene, std::size_t mesh) {
  check_mesh(scene, mesh);
  if (scene.meshes[mesh].mesh.materials.empty())
    throw InvalidArgument("mesh (set_materials)", "a mesh without materials", "one that has some");
}

void check_positions(const Scene& scene, std::size_t mesh, std::span<const glm::vec3> positions) {
  check_mesh(scene, mesh);
  check_values("positions", positions, scene.meshes[mesh].mesh.positions.size());
}

void check_colors(const Scene& scene, std::size_t mesh, std::span<const glm::vec3> colors) {
  check_mesh(scene, mesh);
  check_values("colors", colors, colors_of(scene.meshes[mesh].mesh).size());
}

void check_texels(const Scene& scene, std::size_t mesh, std::size_t texture,
                  std::span<const glm::vec3> texels) {
  check_texture(scene, mesh, texture);
  check_values("texels", texels, scene.meshes[mesh].mesh.textures[texture].texels.size());
}

void check_texcoords(const Scene& scene, std::size_t mesh, std::span<const glm::vec2> texcoords) {
  check_has_texcoords(scene, mesh);
  std::vector<glm::vec3> values;
  for (const glm::vec2& uv : texcoords) values.emplace_back(uv, 0);
  check_values("texcoords", values, scene.meshes[mesh].mesh.texcoords.size());
}

void check_normals(const Scene& scene, std::size_t mesh, std::span<const glm::vec3> normals) {
  check_has_normals(scene, mesh);
  check_values("normals", normals, scene.meshes[mesh].mesh.normals.size());
}

void check_materials(const Scene& scene, std::size_t mesh, std::span<const Material> materials) {
  check_has_materials(scene, mesh);
  const std::size_t expected = scene.meshes[mesh].mesh.materials.size();
  if (materials.size() != expected)
    throw InvalidArgument("materials", std::to_string(materials.size()), std::to_string(expected));
  for (std::size_t i = 0; i < expected; ++i) validate(materials[i], checks::element("materials", i));
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

std::size_t most_views(const Scene& scene, const Raster& raster) {
  std::size_t vertices = 0, faces = 0;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    vertices += mesh_of(scene, m).positions.size();
    faces += mesh_of(scene, m).faces.size();
  }
  const std::size_t samples = samples_of_side(scene.width, raster) * samples_of_side(scene.height, raster);
  const std::size_t largest =
      std::max({samples * DPR_PIXEL_CHANNELS, vertices * DPR_LENS_CHANNELS, faces * 3});
  return 0xfffffffeU / largest;
}

}  // namespace dpr
