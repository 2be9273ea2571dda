// The arrays of meshes that setters replace and backward passes differentiate, each once. Setters from the host
// and from buffers, of one device and of several, their checks, the C interface, and gradients on the host and on
// the device walk this table.
#pragma once

#include <cstddef>
#include <glm/glm.hpp>
#include <span>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "base/checks.hpp"
#include "device/buffer.hpp"
#include "dpr/opencl_handles.hpp"
#include "dpr/renderer.hpp"
#include "shared_types.h"

namespace dpr {

struct Geometry;

inline glm::vec3 to_vec3(const glm::vec3& vector) { return vector; }
inline glm::vec3 to_vec3(const glm::vec2& pair) { return {pair, 0}; }
inline glm::vec3 to_vec3(float number) { return {number, 0, 0}; }

/// Place of an array's elements on the host.
using HostArray = std::variant<std::vector<glm::vec3>*, std::vector<glm::vec2>*, std::vector<Material>*,
                               std::vector<float>*>;

struct MeshArray {
  const char* name;        ///< argument of the setter, which is set_<name>
  std::size_t components;  ///< floats of an element in a buffer
  bool GradientRequest::*wanted;
  bool is_lit = false;  ///< has a gradient in lit scenes alone
  HostArray (*host)(Mesh& mesh, std::size_t texture);
  /// The joined buffer of all meshes, and the first element of this one.
  Buffer<cl_float4>& (*device)(Geometry& geometry);
  std::size_t (*first)(const Geometry& geometry, const ArrayRef& at);
  /// Gradient that a backward pass leaves, element by element as in that buffer.
  const Buffer<cl_float4>& (*gradient)(const Renderer::Impl& renderer);
  /// Elements between two views that have arrays of their own, or 0 where they share the mesh's. Null: always.
  cl_uint shared::FrameParams::*stride = nullptr;
  /// Marks what the renderer derives from the array. `on_host`: the host knows the new elements.
  void (*changed)(Renderer::Impl& renderer, std::size_t mesh, bool on_host) = [](auto&, auto, bool) {};
  bool (*exists)(const Mesh& mesh) = [](const Mesh&) { return true; };
  bool may_be_empty = false;  ///< a mesh without the array takes an empty list from the host
  const char* what = "";      ///< that a mesh without the array lacks
};

const MeshArray& row_of(ArrayId id);
/// True if an array is of one of a mesh's textures.
constexpr bool is_of_texture(ArrayId id) { return id == ArrayId::texels || id == ArrayId::texel_opacities; }
constexpr bool is_of_opacity(ArrayId id) {
  return id == ArrayId::opacities || id == ArrayId::texel_opacities;
}
/// "set_positions"
std::string setter_of(const ArrayRef& at);
/// The array whose gradient the member asks for.
ArrayId id_of(bool GradientRequest::*wanted);

/// The scene's array. Throws InvalidArgument for a mesh or texture that is not there, an instance of another
/// mesh, and a mesh that lacks an array which may not be empty.
HostArray require_array(Scene& scene, const ArrayRef& at);
/// The same, which the values can replace: throws InvalidArgument for those of another type or number, too.
HostArray require_array(Scene& scene, const ArrayRef& at, const ArrayValues& values);
std::size_t count_of(const HostArray& array);
ArrayValues values_of(const HostArray& array);
/// Copies as many elements as the array has.
void assign(const HostArray& array, const ArrayValues& values);

/// Throws InvalidArgument unless there are as many values as expected; `name` says of what.
void require_count(const char* name, const ArrayValues& values, std::size_t expected);
/// Throws InvalidArgument unless all values are valid.
void check_values(const char* name, const ArrayValues& values);
/// The same of vectors, or of opacities, of which the first is element `first`.
template <class Vector>
void require_valid(const char* name, std::span<const Vector> vectors, std::size_t first) {
  if constexpr (std::is_same_v<Vector, float>) {
    for (std::size_t i = 0; i < vectors.size(); ++i)
      checks::require_opacity(vectors[i], [&] { return checks::element(name, first + i); });
  } else {
    const std::span<const float> numbers = checks::floats_of(vectors);
    const std::size_t place = checks::first_not_finite(numbers) / static_cast<std::size_t>(Vector::length());
    if (place < vectors.size())
      checks::require_finite(to_vec3(vectors[place]), checks::element(name, first + place));
  }
}

}  // namespace dpr
