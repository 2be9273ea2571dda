// What the handles of the C interface hold, and how its functions end: no exception leaves them.
#pragma once

#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "dpr/attribute_images.hpp"
#include "dpr/dpr.h"
#include "dpr/error.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/mesh_loss.hpp"
#include "dpr/renderer.hpp"
#include "dpr/scene_batch.hpp"
#include "dpr/smoothing_options.hpp"

struct dpr_device {
  dpr::Device device;
};

struct dpr_scene {
  dpr::Scene scene;
  dpr::SmoothingOptions smoothing;             ///< what was set of it
  std::optional<dpr::Smoothing> of_file = {};  ///< what that changes, of a scene that was read
};

struct dpr_renderer {
  /// A scene of a batch, which lives as long as one of its handles.
  struct OfBatch {
    std::shared_ptr<dpr::SceneBatch> batch;
    std::size_t scene;
  };
  std::variant<dpr::Renderer, OfBatch> held;
};

struct dpr_batch {
  std::shared_ptr<dpr::SceneBatch> batch;
};

struct dpr_loss {
  dpr::ImageLoss loss;
};

struct dpr_mesh_loss {
  dpr::MeshLoss loss;
};

struct dpr_attribute {
  dpr::AttributeImages images;
};

struct dpr_gradient {
  struct Array {
    std::string name;
    std::vector<double> values;
  };
  std::vector<Array> arrays;
};

namespace dpr::c {

/// Keeps the message of the exception that is being handled for dpr_last_error(); its status.
dpr_status status_of_exception() noexcept;

/// Runs a function's body; what it throws becomes a status.
template <class Body>
dpr_status guarded(const Body& body) noexcept {
  try {
    body();
    return DPR_SUCCESS;
  } catch (...) {
    return status_of_exception();
  }
}

/// What a pointer points to. Throws for NULL.
template <class Type>
Type& deref(Type* pointer, const char* argument) {
  if (!pointer) throw InvalidArgument(argument, "NULL", "a pointer");
  return *pointer;
}

/// Hands a new handle to the caller, at the end of a body that has checked `out` at its begin.
template <class Handle, class... Content>
void give(Handle** out, Content&&... content) {
  *out = new Handle{std::forward<Content>(content)...};
}

/// The renderer of a handle. Throws for NULL, and for a scene that its batch does not have any more.
Renderer& renderer_of(dpr_renderer* renderer);
const Renderer& renderer_of(const dpr_renderer* renderer);
SceneBatch& batch_of(const dpr_batch* batch);

/// A versioned struct of the caller's: what an older program does not know keeps its default.
template <class Struct>
Struct versioned(const Struct* given, Struct defaults, const char* argument) {
  const std::size_t size = deref(given, argument).size;
  if (size < sizeof(std::size_t) || size > sizeof(Struct)) {
    throw InvalidArgument(std::string(argument) + ".size", std::to_string(size),
                          "1 to " + std::to_string(sizeof(Struct)) + ", as the struct's DPR_..._INIT has it");
  }
  std::memcpy(&defaults, given, size);
  return defaults;
}

/// Fills a versioned struct of the caller's, as much as it knows of it.
template <class Struct>
void fill(Struct* given, Struct values, const char* argument) {
  const std::size_t size = versioned(given, Struct(), argument).size;
  values.size = size;
  std::memcpy(given, &values, size);
}

/// `count` numbers behind a pointer, of which there are [n][width]. Throws for NULL, and where n would not be
/// whole.
template <class Number>
std::span<Number> numbers(Number* pointer, std::size_t count, std::size_t width, const char* argument) {
  deref(pointer, argument);
  if (count % width != 0) {
    throw InvalidArgument(std::string("count (") + argument + ")", std::to_string(count) + " floats",
                          "a multiple of " + std::to_string(width));
  }
  return {pointer, count};
}

/// Vectors of three numbers.
std::vector<glm::vec3> to_vectors(std::span<const float> values);
/// Vectors of two.
std::vector<glm::vec2> to_pairs(std::span<const float> values);
/// Row-major.
glm::mat4 to_matrix(const float* values);
Camera to_camera(const dpr_camera* camera, const char* argument);
glm::vec3 to_vector(const float* values);
/// NULL: none.
std::optional<Lights> to_lights(const dpr_lights* given);
/// What a renderer takes of a scene now.
Scene resolved(const dpr_scene& scene);
/// A mesh without its transform.
Mesh to_mesh(const dpr_mesh& given);
std::vector<Material> to_materials(const dpr_material* given, std::size_t count, const char* argument);
/// The smoothing that the scene has now.
Smoothing smoothing_of(const dpr_scene& scene);
/// Turns on the gradients that the words name.
GradientRequest to_request(const char* const* names, std::size_t count);

/// The arrays that the renderer's scene asked for and has.
std::vector<dpr_gradient::Array> arrays_of(const Renderer& renderer, SceneGradient gradient);

/// Throw InvalidArgument unless there are as many floats as are expected of the argument, a number of views
/// that a device may have room for, and an image that may be rendered.
void require_count(std::size_t count, std::size_t expected, const char* argument);
void require_views(std::size_t views);
void require_size(int width, int height, const char* argument);

/// Of RGBA images.
std::size_t image_floats(std::size_t views, int width, int height);
/// Floats as pixels, of which there is a whole number.
std::span<const glm::vec4> to_pixels(const float* values, std::size_t count, const char* argument);
/// Where a caller wants `expected` floats of pixels.
std::span<glm::vec4> to_pixels(float* values, std::size_t count, std::size_t expected);

}  // namespace dpr::c
