// Pictures put together for reports.
#include "cli/pictures.hpp"

namespace dpr::cli {

Image vstack(const std::vector<Image>& rows, int gap) {
  Image sheet;
  sheet.width = rows.front().width;
  for (const Image& row : rows) {
    if (sheet.height > 0) {
      sheet.pixels.insert(sheet.pixels.end(), static_cast<std::size_t>(gap * sheet.width), glm::vec4(1));
      sheet.height += gap;
    }
    sheet.pixels.insert(sheet.pixels.end(), row.pixels.begin(), row.pixels.end());
    sheet.height += row.height;
  }
  return sheet;
}

}  // namespace dpr::cli
