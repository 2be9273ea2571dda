#include "scene/cull.hpp"

#include <array>
#include <string>

#include "base/name_list.hpp"

namespace dpr {

Cull parse_cull(std::string_view word, std::string_view where) {
  constexpr std::array<std::string_view, 3> k_names{"none", "back", "front"};  // in the order of Cull
  return static_cast<Cull>(position_of(word, k_names, std::string(where)));
}

}  // namespace dpr
