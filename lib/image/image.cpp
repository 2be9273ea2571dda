// Images in memory: for viewers, and side by side.
#include "dpr/image.hpp"

#include <string>

#include "dpr/error.hpp"

namespace dpr {
namespace {

// `side` is the one along which the images touch.
void require_stackable(const std::vector<Image>& images, int Image::*side, const std::string& side_name,
                       int gap, const std::string& function) {
  if (gap < 0)
    throw InvalidArgument("gap (" + function + ")", std::to_string(gap), "a number of pixels >= 0");
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (images[i].*side == images[0].*side) continue;
    throw InvalidArgument("images[" + std::to_string(i) + "] (" + function + ")",
                          "a " + side_name + " of " + std::to_string(images[i].*side),
                          "that of the first, " + std::to_string(images[0].*side));
  }
}

void paste(const Image& part, int left, int top, Image& whole) {
  for (int row = 0; row < part.height; ++row) {
    for (int column = 0; column < part.width; ++column)
      whole.at(left + column, top + row) = part.at(column, row);
  }
}

int stacked_length(const std::vector<Image>& images, int Image::*side, int gap) {
  int length = gap * static_cast<int>(images.size() - 1);
  for (const Image& image : images) length += image.*side;
  return length;
}

}  // namespace

Image opaque(Image image) {
  for (glm::vec4& pixel : image.pixels) pixel.a = 1;
  return image;
}

Image hstack(const std::vector<Image>& images, int gap, glm::vec4 fill) {
  if (images.empty()) return {};
  require_stackable(images, &Image::height, "height", gap, "hstack");
  Image strip(stacked_length(images, &Image::width, gap), images[0].height, fill);
  int left = 0;
  for (const Image& image : images) {
    paste(image, left, 0, strip);
    left += image.width + gap;
  }
  return strip;
}

Image vstack(const std::vector<Image>& images, int gap, glm::vec4 fill) {
  if (images.empty()) return {};
  require_stackable(images, &Image::width, "width", gap, "vstack");
  Image sheet(images[0].width, stacked_length(images, &Image::height, gap), fill);
  int top = 0;
  for (const Image& image : images) {
    paste(image, 0, top, sheet);
    top += image.height + gap;
  }
  return sheet;
}

}  // namespace dpr
