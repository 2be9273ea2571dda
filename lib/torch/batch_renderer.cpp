// Faces, size, smoothing and device from Python's values, and renderers to lend to graphs.
#include "torch/batch_renderer.hpp"

#include <limits>
#include <utility>

#include "base/checks.hpp"
#include "scene/cull.hpp"
#include "scene/light_table.hpp"
#include "smoothing/option_fields.hpp"
#include "torch/errors.hpp"

namespace dpr::torch_op {

BatchRenderer::BatchRenderer(std::vector<glm::uvec3> faces, int width, int height, const Smoothing& smoothing,
                             const Device& device)
    : faces_(std::move(faces)), width_(width), height_(height), device_(device) {
  set_smoothing(smoothing);
}

namespace {

std::vector<glm::uvec3> read_faces(const at::Tensor& faces) {
  if (faces.scalar_type() != at::kLong || faces.dim() != 2 || faces.size(1) != 3 ||
      !faces.device().is_cpu()) {
    throw InvalidArgument("faces (dpr::Renderer)", faces.toString() + " " + shape_text(faces),
                          "an int64 tensor [face, 3] on the CPU");
  }
  const at::Tensor values = faces.contiguous();
  const auto* index = values.data_ptr<std::int64_t>();
  std::vector<glm::uvec3> result(static_cast<std::size_t>(faces.size(0)));
  for (glm::uvec3& face : result) {
    for (int corner = 0; corner < 3; ++corner, ++index) {
      if (*index < 0 || *index > std::numeric_limits<std::uint32_t>::max()) {
        throw InvalidArgument("faces (dpr::Renderer)", std::to_string(*index), "indices of vertices");
      }
      face[corner] = static_cast<std::uint32_t>(*index);
    }
  }
  return result;
}

int image_side(std::int64_t value, const char* name) {
  if (value >= 1 && value <= checks::k_largest_side) return static_cast<int>(value);
  throw InvalidArgument(std::string(name) + " (dpr::Renderer)", std::to_string(value),
                        "1 to " + std::to_string(checks::k_largest_side));
}

OptionValue option_value(const at::IValue& value, const std::string& name) {
  if (value.isDouble()) return value.toDouble();
  if (value.isInt()) return value.toInt();
  if (value.isString()) return value.toStringRef();
  throw InvalidArgument(name + " (dpr::Renderer)", value.tagKind(), "a number or a word");
}

float number_of(const OptionValue& value, const std::string& name) {
  if (const auto* const whole = std::get_if<std::int64_t>(&value)) return static_cast<float>(*whole);
  if (const auto* const number = std::get_if<double>(&value)) return static_cast<float>(*number);
  throw InvalidArgument(name + " (dpr::Renderer)", "\"" + std::get<std::string>(value) + "\"", "a number");
}

/// Sets one of the camera's planes; false for another name.
bool set_clipping(Camera& camera, const std::string& name, const OptionValue& value) {
  float* const plane = name == "znear" ? &camera.znear : name == "zfar" ? &camera.zfar : nullptr;
  if (plane == nullptr) return false;
  *plane = number_of(value, name);
  return true;
}

/// Sets how lights shade; false for another name.
bool set_shading(Lights& lights, const std::string& name, const OptionValue& value) {
  if (name == "shininess") {
    lights.shininess = number_of(value, name);
    return true;
  }
  if (name != "shading") return false;
  const auto* const word = std::get_if<std::string>(&value);
  lights.shading = parse_shading(word ? *word : "a number", name + " (dpr::Renderer)");
  return true;
}

Cull cull_value(const OptionValue& value) {
  constexpr const char* k_where = "cull (dpr::Renderer)";
  const auto* const word = std::get_if<std::string>(&value);
  if (word == nullptr) throw InvalidArgument(k_where, "a number", "none, back or front");
  return parse_cull(*word, k_where);
}

[[noreturn]] void fail_name(const std::string& name) {
  std::vector<std::string_view> names = option_keys();
  names.insert(names.end(), {"znear", "zfar", "shading", "shininess", "cull"});
  throw InvalidArgument("name (dpr::Renderer.set)", "\"" + name + "\"", one_of(names));
}

}  // namespace

BatchRenderer::BatchRenderer(const at::Tensor& faces, std::int64_t width, std::int64_t height,
                             const std::string& preset, const std::string& device)
    : faces_(with_torch_errors([&] { return read_faces(faces); })),
      width_(with_torch_errors([&] { return image_side(width, "width"); })),
      height_(with_torch_errors([&] { return image_side(height, "height"); })),
      options_{.preset = preset},
      smoothing_(with_torch_errors([&] { return resolve_smoothing(options_, width_, height_); })),
      device_(with_torch_errors([&] { return open_device(device); })) {}

void BatchRenderer::set_smoothing(const Smoothing& smoothing) {
  validate(smoothing);
  smoothing_ = smoothing;
  otherwise_ = smoothing;
  options_ = {};
}

void BatchRenderer::set(const std::string& name, const at::IValue& value) {
  with_torch_errors([&] {
    const OptionValue given = option_value(value, name);
    SmoothingOptions options = options_;
    Camera clipping;
    clipping.znear = znear_;
    clipping.zfar = zfar_;
    Lights lights = lights_;
    Cull cull = cull_;
    if (set_clipping(clipping, name, given)) {
      validate(clipping);
    } else if (set_shading(lights, name, given)) {
      validate(lights);
    } else if (name == "cull") {
      cull = cull_value(given);
    } else if (!set_option(options, name, given, name + " (dpr::Renderer)")) {
      fail_name(name);
    }
    smoothing_ = resolve_smoothing(options, width_, height_, otherwise_);
    options_ = std::move(options);
    znear_ = clipping.znear;
    zfar_ = clipping.zfar;
    lights_ = std::move(lights);
    cull_ = cull;
  });
}

Renderer BatchRenderer::take(const Topology& topology) {
  {
    const std::lock_guard lock(mutex_);
    if (topology == topology_ && !free_.empty()) {
      Renderer renderer = std::move(free_.back());
      free_.pop_back();
      return renderer;
    }
  }
  Scene scene;
  scene.width = width_;
  scene.height = height_;
  Mesh mesh;
  mesh.positions.resize(topology.vertices);
  mesh.faces = faces_;
  if (topology.face_colors) {
    mesh.face_colors.resize(faces_.size());
  } else {
    mesh.vertex_colors.resize(topology.vertices);
  }
  scene.meshes.push_back({std::move(mesh)});
  Renderer renderer(device_);
  renderer.set_scene(scene);
  return renderer;
}

void BatchRenderer::put_back(Renderer renderer, const Topology& topology) {
  const std::lock_guard lock(mutex_);
  if (topology != topology_) free_.clear();
  topology_ = topology;
  free_.push_back(std::move(renderer));
}

}  // namespace dpr::torch_op
