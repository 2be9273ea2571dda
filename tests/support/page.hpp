// The HTML pages of reports, as tests read them.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace dpr::test {

/// A page without the text of three.js, which names addresses that it does not load.
inline std::string own_text(const std::string& page) {
  const std::size_t begin = page.find("<script>\n// three.js");
  if (begin == std::string::npos) return page;
  return page.substr(0, begin) + page.substr(page.find("</script>", begin));
}

inline std::size_t count_of(std::string_view text, std::string_view part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string_view::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

}  // namespace dpr::test
