#include "batch/named_arrays.hpp"

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>
#include <numeric>

#include "dpr/error.hpp"

namespace dpr::batch {
namespace {

bool has_shape(const NamedArray& array, Shape shape) {
  return std::ranges::equal(array.shape, shape,
                            [](std::size_t got, std::size_t size) { return size == k_any || got == size; });
}

std::string_view name_of(Element element) {
  switch (element) {
    case Element::float32:
      return "float32";
    case Element::int32:
      return "int32";
    case Element::int64:
      break;
  }
  return "int64";
}

/// visit(values) for the elements of an array of indices.
template <class Visit>
auto visit_indices(const NamedArray& array, const Visit& visit) {
  return array.element == Element::int64 ? visit(static_cast<const std::int64_t*>(array.data))
                                         : visit(static_cast<const std::int32_t*>(array.data));
}

std::uint32_t to_index(const NamedArray& array, std::int64_t index, std::int64_t least) {
  if (index < least || index >= std::numeric_limits<std::uint32_t>::max())
    throw InvalidArgument(argument(array), std::to_string(index),
                          "indices from " + std::to_string(least) + " on");
  return static_cast<std::uint32_t>(index);
}

void require_indices(const NamedArray& array, std::initializer_list<Shape> shapes,
                     const std::string& expected) {
  if (array.element == Element::float32)
    throw InvalidArgument(argument(array), "float32", "int64 or int32, indices");
  require_form(array, array.element, shapes, expected);
}

}  // namespace

std::size_t NamedArray::count() const {
  return std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>());
}

std::string text_of(const std::vector<std::size_t>& shape) {
  std::string text = "[";
  for (const std::size_t size : shape) text.append(text.size() > 1 ? ", " : "").append(std::to_string(size));
  return text + "]";
}

std::string argument(const NamedArray& array) { return array.name + " (batch)"; }

const NamedArray* find(NamedArrays arrays, std::string_view name) {
  const auto found = std::ranges::find(arrays, name, &NamedArray::name);
  return found == arrays.end() ? nullptr : &*found;
}

const NamedArray& require(NamedArrays arrays, std::string_view name) {
  if (const NamedArray* const found = find(arrays, name)) return *found;
  throw InvalidArgument(std::string(name) + " (batch)", "none", "an array of this name");
}

void require_like(const NamedArray& array, const NamedArray& other) {
  if (array.element != Element::float32 || array.shape != other.shape)
    throw InvalidArgument(argument(array), text_of(array.shape), text_of(other.shape) + " of float32");
}

void require_form(const NamedArray& array, Element element, std::initializer_list<Shape> shapes,
                  const std::string& expected) {
  if (array.element != element)
    throw InvalidArgument(argument(array), std::string(name_of(array.element)),
                          std::string(name_of(element)));
  if (std::ranges::any_of(shapes, [&](Shape shape) { return has_shape(array, shape); })) return;
  throw InvalidArgument(argument(array), text_of(array.shape), expected);
}

void require_floats(const NamedArray& array, Shape shape, const std::string& expected) {
  require_form(array, Element::float32, {shape}, expected);
}

void require_triples(const NamedArray& array, std::size_t views) {
  if (views == 1) {
    require_indices(array, {{k_any, 3}, {1, k_any, 3}}, "[F, 3]");
  } else {
    require_indices(array, {{views, k_any, 3}}, "[" + std::to_string(views) + ", F, 3]");
  }
}

bool holds(const NamedArray& array, std::span<const glm::uvec3> triples) {
  constexpr std::size_t k_block = 4096;  // compared without a branch
  if (array.count() != 3 * triples.size()) return false;
  if (array.element == Element::int32)
    return std::memcmp(array.data, triples.data(), triples.size_bytes()) == 0;
  return visit_indices(array, [&](const auto* values) {
    for (; !triples.empty(); triples = triples.subspan(std::min(k_block, triples.size()))) {
      std::uint64_t differences = 0;
      for (const glm::uvec3& triple : triples.first(std::min(k_block, triples.size()))) {
        for (int corner = 0; corner < 3; ++corner)
          differences |= static_cast<std::uint64_t>(std::int64_t{*values++}) ^ triple[corner];
      }
      if (differences != 0) return false;
    }
    return true;
  });
}

std::vector<glm::uvec3> read_triples(const NamedArray& array, std::size_t views) {
  require_triples(array, views);
  std::vector<glm::uvec3> triples(array.count() / 3);
  visit_indices(array, [&](const auto* values) {
    for (glm::uvec3& triple : triples) {
      for (int corner = 0; corner < 3; ++corner) triple[corner] = to_index(array, *values++, 0);
    }
  });
  return triples;
}

std::vector<std::uint32_t> read_indices(const NamedArray& array, std::size_t views, std::size_t count,
                                        std::int64_t least) {
  const std::string of_view = std::to_string(count) + "]";
  if (views == 1) {
    require_indices(array, {{count}, {1, count}}, "[" + of_view);
  } else {
    require_indices(array, {{views, count}}, "[" + std::to_string(views) + ", " + of_view);
  }
  std::vector<std::uint32_t> indices(array.count());
  visit_indices(array, [&](const auto* values) {
    for (std::uint32_t& index : indices) index = to_index(array, *values++, least);
  });
  return indices;
}

}  // namespace dpr::batch
