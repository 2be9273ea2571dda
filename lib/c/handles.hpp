// Contents of the C interface's handles, and the frame of its functions: no exception leaves them.
#pragma once

#include <cfenv>
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
  static constexpr const char* k_handle = "dpr_device";
  dpr::Device device;
};

struct dpr_scene {
  static constexpr const char* k_handle = "dpr_scene";
  dpr::Scene scene;
  dpr::SmoothingOptions smoothing;             ///< what was set of it
  std::optional<dpr::Smoothing> of_file = {};  ///< what that changes, of a scene that was read
};

struct dpr_renderer {
  static constexpr const char* k_handle = "dpr_renderer";
  /// A scene of a batch, which lives as long as one of its handles.
  struct OfBatch {
    std::shared_ptr<dpr::SceneBatch> batch;
    std::size_t scene;
  };
  std::variant<dpr::Renderer, OfBatch> held;
};

struct dpr_batch {
  static constexpr const char* k_handle = "dpr_batch";
  std::shared_ptr<dpr::SceneBatch> batch;
};

struct dpr_loss {
  static constexpr const char* k_handle = "dpr_loss";
  dpr::ImageLoss loss;
};

struct dpr_mesh_loss {
  static constexpr const char* k_handle = "dpr_mesh_loss";
  dpr::MeshLoss loss;
};

struct dpr_attribute {
  static constexpr const char* k_handle = "dpr_attribute";
  dpr::AttributeImages images;
};

struct dpr_gradient {
  static constexpr const char* k_handle = "dpr_gradient";
  struct Array {
    std::string name;
    std::vector<double> values;
  };
  std::vector<Array> arrays;
};

namespace dpr::c {

/// Keeps the message of the exception that is being handled for dpr_last_error(); its status.
dpr_status status_of_exception() noexcept;

/// Puts the caller's floating-point environment aside: a division by zero would raise its traps.
class QuietFloats {
 public:
  QuietFloats() { std::feholdexcept(&callers_); }
  ~QuietFloats() { std::fesetenv(&callers_); }
  QuietFloats(const QuietFloats&) = delete;
  QuietFloats& operator=(const QuietFloats&) = delete;

 private:
  std::fenv_t callers_;
};

/// Work was enqueued, and earlier frames are known by now to have been emptied.
struct FramesEmptied : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Throws FramesEmptied if there are any.
void require_none_emptied(std::size_t frames);

/// Runs a function's body; what it throws becomes a status.
template <class Body>
dpr_status guarded(const Body& body) noexcept {
  const QuietFloats quiet;
  try {
    body();
    return DPR_SUCCESS;
  } catch (...) {
    return status_of_exception();
  }
}

// All handles that callers have are known, of whatever kind: a pointer that is none of them is never looked
// into. By this a handle of another kind and one that is destroyed already are refused.

/// `kind` is the handle's k_handle.
void remember_handle(const void* handle, const char* kind);
/// Throws InvalidArgument for what is not remembered as that kind.
void require_handle(const void* handle, const char* kind, const char* argument);
/// The same, and forgets it.
void forget_handle(const void* handle, const char* kind);

/// Object at a pointer. Throws for NULL, and where a handle is wanted for what is none.
template <class Type>
Type& deref(Type* pointer, const char* argument) {
  if (!pointer) throw InvalidArgument(argument, "NULL", "a pointer");
  if constexpr (requires { Type::k_handle; }) require_handle(pointer, Type::k_handle, argument);
  return *pointer;
}

/// Without NULL; a handle that is destroyed already is left alone, with a message for dpr_last_error().
template <class Handle>
void destroy(Handle* handle) noexcept {
  static_cast<void>(guarded([&] {
    if (!handle) return;
    forget_handle(handle, Handle::k_handle);
    delete handle;
  }));
}

struct Destroy {
  template <class Handle>
  void operator()(Handle* handle) const noexcept {
    destroy(handle);
  }
};

template <class Handle, class... Content>
std::unique_ptr<Handle, Destroy> make_handle(Content&&... content) {
  std::unique_ptr<Handle> made(new Handle{std::forward<Content>(content)...});
  remember_handle(made.get(), Handle::k_handle);
  return std::unique_ptr<Handle, Destroy>(made.release());
}

/// Hands a new handle to the caller, at the end of a body that has checked `out` at its begin.
template <class Handle, class... Content>
void give(Handle** out, Content&&... content) {
  *out = make_handle<Handle>(std::forward<Content>(content)...).release();
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
/// The scene as a renderer takes it now.
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

/// Number of floats of RGBA images.
std::size_t image_floats(std::size_t views, int width, int height);
/// Floats as pixels, of which there is a whole number.
std::span<const glm::vec4> to_pixels(const float* values, std::size_t count, const char* argument);
/// A caller's `expected` floats as pixels.
std::span<glm::vec4> to_pixels(float* values, std::size_t count, std::size_t expected);

}  // namespace dpr::c
