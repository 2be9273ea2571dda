// Arrays by their names: what a batch is made of, and what is read from it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dpr::batch {

enum class Element { float32, int32, int64 };

/// Packed and row-major, in the caller's memory.
struct NamedArray {
  std::string name;
  void* data = nullptr;
  Element element = Element::float32;
  std::vector<std::size_t> shape;

  std::size_t count() const;  ///< of the elements
  /// The memory of a float32 array whose rows are vectors.
  template <typename Vector>
  std::span<Vector> rows() const {
    return {static_cast<Vector*>(data), count() * sizeof(float) / sizeof(Vector)};
  }
};

using NamedArrays = std::span<const NamedArray>;

/// "[2, 642, 3]"
std::string text_of(const std::vector<std::size_t>& shape);
/// "lights.point (batch)": of messages.
std::string argument(const NamedArray& array);
/// The array of a name; null where there is none.
const NamedArray* find(NamedArrays arrays, std::string_view name);
/// The array of a name. Throws InvalidArgument where there is none.
const NamedArray& require(NamedArrays arrays, std::string_view name);

inline constexpr std::size_t k_any = 0;  ///< of a shape: any size
using Shape = std::initializer_list<std::size_t>;
/// Throws InvalidArgument for elements of another type, or a shape that is none of these; `expected` is what
/// the message says of them.
void require_form(const NamedArray& array, Element element, std::initializer_list<Shape> shapes,
                  const std::string& expected);
/// The same for floats of one shape.
void require_floats(const NamedArray& array, Shape shape, const std::string& expected);

/// Throws InvalidArgument unless these are floats of the other's shape.
void require_like(const NamedArray& array, const NamedArray& other);

/// Throws InvalidArgument unless these are whole numbers of either type, [F, 3], of several views
/// [views, F, 3].
void require_triples(const NamedArray& array, std::size_t views = 1);
/// True if these are those triples. Copies nothing.
bool holds(const NamedArray& array, std::span<const glm::uvec3> triples);
/// Whole numbers of either type, [F, 3] from 0, or [count] from `least`, of several views with their number in front;
/// -1 becomes the largest number there is. Throw InvalidArgument for a smaller one, another type and another shape.
std::vector<glm::uvec3> read_triples(const NamedArray& array, std::size_t views = 1);
std::vector<std::uint32_t> read_indices(const NamedArray& array, std::size_t views, std::size_t count,
                                        std::int64_t least);

}  // namespace dpr::batch
