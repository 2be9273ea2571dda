// Files of images as named arrays, in the C interface.
#include <algorithm>
#include <string>

#include "base/checks.hpp"
#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"
#include "dpr/image.hpp"

using namespace dpr::c;

struct dpr_image_file {
  static constexpr const char* k_handle = "dpr_image_file";
  dpr::Image image;
};

namespace dpr::batch {
namespace {

Encoding encoding_of(const char* word) {
  const std::string name = word ? word : "srgb";
  if (name != "srgb" && name != "linear")
    throw InvalidArgument("encoding", "'" + name + "'", "srgb or linear");
  return name == "srgb" ? Encoding::srgb : Encoding::linear;
}

Image make_image(const NamedArray& pixels) {
  require_form(pixels, Element::float32, {{k_any, k_any, 4}}, "[height, width, 4]");
  const std::size_t height = pixels.shape[0], width = pixels.shape[1];
  const std::size_t most = checks::k_largest_side;
  if (std::min(height, width) == 0 || std::max(height, width) > most) {
    throw InvalidArgument(pixels.name + " (image)", text_of(pixels.shape),
                          "1 to " + std::to_string(most) + " pixels a side");
  }
  Image image(static_cast<int>(width), static_cast<int>(height));
  std::ranges::copy(pixels.rows<const glm::vec4>(), image.pixels.begin());
  return image;
}

}  // namespace
}  // namespace dpr::batch

dpr_status dpr_image_file_read(const char* path, const char* encoding, dpr_image_file** file) {
  return guarded([&] {
    deref(file, "file");
    const std::string from = &deref(path, "path");
    give(file, dpr::read_image(from, nullptr, dpr::batch::encoding_of(encoding)));
  });
}

dpr_status dpr_image_file_pixels(const dpr_image_file* file, dpr_array* pixels) {
  return guarded([&] {
    const dpr::Image& image = deref(file, "file").image;
    dpr_array& array = deref(pixels, "pixels");
    array = {"pixels", const_cast<glm::vec4*>(image.pixels.data()), DPR_FLOAT32, 3, {}};
    array.shape[0] = static_cast<std::size_t>(image.height);
    array.shape[1] = static_cast<std::size_t>(image.width);
    array.shape[2] = 4;
  });
}

void dpr_image_file_destroy(dpr_image_file* file) { destroy(file); }

dpr_status dpr_image_file_write(const char* path, const char* encoding, const dpr_array* pixels) {
  return guarded([&] {
    const std::string to = &deref(path, "path");
    const auto arrays = dpr::batch::to_arrays(pixels, 1, "pixels");
    dpr::write_image(to, dpr::batch::make_image(arrays[0]), dpr::batch::encoding_of(encoding));
  });
}
