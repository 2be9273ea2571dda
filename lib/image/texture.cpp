// Textures: what makes one that can be rendered.
#include "dpr/texture.hpp"

#include "base/checks.hpp"
#include "image/texture_words.hpp"

namespace dpr {

void require_form(int width, int height, Wrap wrap, Filter filter, const std::string& name) {
  for (const int side : {width, height}) {
    if (side >= 1 && side <= checks::k_largest_side) continue;
    throw InvalidArgument(checks::in("size", name), checks::size(width, height),
                          "1 to " + std::to_string(checks::k_largest_side) + " texels a side");
  }
  const auto wrap_number = static_cast<int>(wrap), filter_number = static_cast<int>(filter);
  if (wrap_number < 0 || wrap_number >= static_cast<int>(k_wraps.size()))
    throw InvalidArgument(checks::in("wrap", name), std::to_string(wrap_number), one_of(k_wrap_names));
  if (filter_number < 0 || filter_number >= static_cast<int>(k_filter_names.size()))
    throw InvalidArgument(checks::in("filter", name), std::to_string(filter_number), one_of(k_filter_names));
}

void validate(const Texture& texture, const std::string& name) {
  require_form(texture.width, texture.height, texture.wrap, texture.filter, name);
  const std::size_t expected =
      static_cast<std::size_t>(texture.width) * static_cast<std::size_t>(texture.height);
  if (texture.texels.size() != expected)
    throw InvalidArgument(checks::in("texels", name), std::to_string(texture.texels.size()),
                          std::to_string(expected) + ", width x height");
  for (std::size_t i = 0; i < texture.texels.size(); ++i) {
    if (checks::is_finite(texture.texels[i])) continue;
    throw InvalidArgument(checks::in(checks::element("texels", i), name), checks::text(texture.texels[i]),
                          "finite numbers");
  }
  if (!texture.opacities.empty() && texture.opacities.size() != texture.texels.size())
    throw InvalidArgument(checks::in("opacities", name), std::to_string(texture.opacities.size()),
                          std::to_string(texture.texels.size()) + ", one for each texel, or none");
  for (std::size_t i = 0; i < texture.opacities.size(); ++i)
    checks::require_opacity(texture.opacities[i],
                            [&] { return checks::in(checks::element("opacities", i), name); });
}

}  // namespace dpr
