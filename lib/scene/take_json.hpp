// Members of JSON objects that may be left out: a value stays as it is then.
#pragma once

#include <span>
#include <string_view>

#include "base/name_list.hpp"
#include "scene/scene_json.hpp"

namespace dpr {

/// What `parse` makes of a member.
template <typename Value, typename Parse>
void take(const JsonNode& node, std::string_view key, Value& value, Parse parse) {
  if (const auto member = node.find(key)) value = parse(*member);
}

inline void take_number(const JsonNode& node, std::string_view key, float& value) {
  take(node, key, value, [](const JsonNode& n) { return n.number(); });
}

/// A value of an enumeration, by its name.
template <typename Word>
void take_word(const JsonNode& node, std::string_view key, Word& value,
               std::span<const std::string_view> names) {
  take(node, key, value,
       [names](const JsonNode& n) { return static_cast<Word>(position_of(n.string(), names, n.name())); });
}

}  // namespace dpr
