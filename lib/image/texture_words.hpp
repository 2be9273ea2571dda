// Names of texture wraps and filters in files, in the order of their enumerations.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "base/name_list.hpp"
#include "dpr/texture.hpp"

namespace dpr {

struct WrapRow {
  std::string_view name;
  float period;  ///< after which the texture is the same again; 0: never
};

inline constexpr std::array<WrapRow, 3> k_wraps{{{"repeat", 1}, {"mirror", 2}, {"clamp", 0}}};
inline constexpr std::array<std::string_view, 3> k_filter_names{"nearest", "bilinear", "trilinear"};

inline constexpr auto k_wrap_names = [] {
  std::array<std::string_view, k_wraps.size()> names;
  std::ranges::transform(k_wraps, names.begin(), &WrapRow::name);
  return names;
}();

inline std::string_view to_string(Wrap wrap) { return k_wrap_names.at(static_cast<std::size_t>(wrap)); }
inline std::string_view to_string(Filter filter) {
  return k_filter_names.at(static_cast<std::size_t>(filter));
}
/// Throws InvalidArgument unless a texture may have this size and these ways; `name` says which texture it is.
void require_form(int width, int height, Wrap wrap, Filter filter, const std::string& name);
inline float period_of(Wrap wrap) { return k_wraps.at(static_cast<std::size_t>(wrap)).period; }

}  // namespace dpr
