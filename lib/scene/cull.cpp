#include "scene/cull.hpp"

#include <string>

#include "dpr/error.hpp"

namespace dpr {

Cull parse_cull(std::string_view word, std::string_view where) {
  if (word == "none") return Cull::none;
  if (word == "back") return Cull::back;
  if (word == "front") return Cull::front;
  throw InvalidArgument(std::string(where), "\"" + std::string(word) + "\"", "none, back or front");
}

}  // namespace dpr
