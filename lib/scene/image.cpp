// Images in memory: for viewers, and side by side.
#include "dpr/image.hpp"

#include <string>

#include "dpr/error.hpp"

namespace dpr {

Image opaque(Image image) {
  for (glm::vec4& pixel : image.pixels) pixel.a = 1;
  return image;
}

Image hstack(const std::vector<Image>& images, int gap, glm::vec4 fill) {
  if (images.empty()) return {};
  if (gap < 0) throw InvalidArgument("gap (hstack)", std::to_string(gap), "a number of pixels >= 0");
  int width = gap * static_cast<int>(images.size() - 1);
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (images[i].height != images[0].height) {
      throw InvalidArgument("images[" + std::to_string(i) + "] (hstack)",
                            "a height of " + std::to_string(images[i].height),
                            "that of the first, " + std::to_string(images[0].height));
    }
    width += images[i].width;
  }
  Image strip(width, images[0].height, fill);
  int left = 0;
  for (const Image& image : images) {
    for (int row = 0; row < image.height; ++row) {
      for (int column = 0; column < image.width; ++column)
        strip.at(left + column, row) = image.at(column, row);
    }
    left += image.width + gap;
  }
  return strip;
}

}  // namespace dpr
