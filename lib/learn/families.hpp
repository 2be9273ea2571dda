// Families of shapes, one for each of the thirteen classes of objects: closed, coloured, drawn at random.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "dpr/mesh.hpp"

namespace dpr::learn {

/// A class of objects: its WordNet synset, which names it in ShapeNet, and a word.
struct ObjectClass {
  std::string_view synset, name;
};

/// The thirteen classes of the published experiments, in the order of their synsets.
std::span<const ObjectClass> object_classes();

/// The index of a class by its synset or its name. Throws InvalidArgument.
std::size_t find_class(std::string_view word);

/// A member of the family of a class, within [-0.5, 0.5]^3 and centred, y up: solids that may overlap, each
/// closed and oriented outwards, with face colours. The same seed gives the same mesh.
Mesh make_object(std::size_t object_class, std::uint64_t seed);

}  // namespace dpr::learn
