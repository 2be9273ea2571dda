// Images on disk, by way of OpenImageIO.
#include "dpr/image.hpp"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "base/output_file.hpp"
#include "dpr/error.hpp"
#include "image/image_file.hpp"

namespace dpr {
namespace {

// Alpha is the silhouette, not a factor of the colours. OpenImageIO multiplies it in while reading PNG and
// the like, and takes it out again while writing, unless both sides are told that it is not there.
constexpr const char* k_unassociated_alpha = "oiio:UnassociatedAlpha";

struct Format {
  std::string_view extension;
  int channels;
  OIIO::TypeDesc::BASETYPE type;
};

constexpr std::array<Format, 9> k_formats{{{".exr", 4, OIIO::TypeDesc::FLOAT},
                                           {".png", 4, OIIO::TypeDesc::UINT8},
                                           {".tif", 4, OIIO::TypeDesc::UINT8},
                                           {".tiff", 4, OIIO::TypeDesc::UINT8},
                                           {".tga", 4, OIIO::TypeDesc::UINT8},
                                           {".bmp", 3, OIIO::TypeDesc::UINT8},
                                           {".jpg", 3, OIIO::TypeDesc::UINT8},
                                           {".jpeg", 3, OIIO::TypeDesc::UINT8},
                                           {".ppm", 3, OIIO::TypeDesc::UINT8}}};

const Format& format_of(const std::filesystem::path& file) {
  const std::string extension = lower_case_extension(file);
  std::string known;
  for (const Format& format : k_formats) {
    if (format.extension == extension) return format;
    if (!known.empty()) known += ", ";
    known += format.extension;
  }
  throw IoError(file, "got the extension \"" + extension + "\", expected one of " + known);
}

std::string pixel_name(std::size_t index, int width) {
  const auto row_length = static_cast<std::size_t>(width);
  return "column " + std::to_string(index % row_length) + ", row " + std::to_string(index / row_length);
}

bool is_finite(const glm::vec4& pixel) {
  return std::isfinite(pixel.r) && std::isfinite(pixel.g) && std::isfinite(pixel.b) && std::isfinite(pixel.a);
}

void require_finite(const std::filesystem::path& file, const Image& image) {
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (is_finite(image.pixels[i])) continue;
    throw IoError(file, "the pixel in " + pixel_name(i, image.width) + " is not finite");
  }
}

// Reasons span lines at times; an error is one line.
std::string one_line(std::string reason) {
  std::replace(reason.begin(), reason.end(), '\n', ' ');
  while (!reason.empty() && reason.back() == ' ') reason.pop_back();
  return reason.empty() ? "OpenImageIO gives no reason" : reason;
}

std::unique_ptr<OIIO::ImageInput> open(const std::filesystem::path& file) {
  require_file(file);
  OIIO::ImageSpec configuration;
  configuration.attribute(k_unassociated_alpha, 1);
  auto input = OIIO::ImageInput::open(file.string(), &configuration);
  if (!input) throw IoError(file, "cannot be read: " + one_line(OIIO::geterror()));
  return input;
}

// Which of the file's channels is red, green, blue and alpha; -1 where there is none.
std::array<int, 4> channels_of(const OIIO::ImageSpec& spec) {
  if (spec.nchannels == 1) return {0, 0, 0, -1};
  if (spec.nchannels == 2) return {0, 0, 0, 1};
  if (spec.nchannels == 4) return {0, 1, 2, 3};
  return {0, 1, 2, spec.alpha_channel > 2 ? spec.alpha_channel : -1};
}

/// The values of the channels that the format has.
std::vector<float> values_of(const Image& image, const Format& format) {
  std::vector<float> values;
  values.reserve(image.pixels.size() * static_cast<std::size_t>(format.channels));
  const bool clamps = format.type == OIIO::TypeDesc::UINT8;
  for (const glm::vec4& pixel : image.pixels) {
    const glm::vec4 value = clamps ? glm::clamp(pixel, 0.0F, 1.0F) : pixel;
    for (int c = 0; c < format.channels; ++c) values.push_back(value[c]);
  }
  return values;
}

/// The image as a file's bytes, in memory: OpenImageIO takes some writes to a full disk for successes, and
/// libjpeg ends the process at one.
std::vector<unsigned char> encode(const std::filesystem::path& file, const Image& image,
                                  const Format& format) {
  const auto output = OIIO::ImageOutput::create(std::string(format.extension.substr(1)));
  if (!output) throw IoError(file, "cannot be written: " + one_line(OIIO::geterror()));
  OIIO::ImageSpec spec(image.width, image.height, format.channels, OIIO::TypeDesc(format.type));
  spec.attribute(k_unassociated_alpha, 1);
  spec.attribute("DateTime", "");  // none: equal images are equal files
  OIIO::Filesystem::IOVecOutput bytes;
  if (!output->set_ioproxy(&bytes) || !output->open(file.string(), spec) ||
      !output->write_image(OIIO::TypeDesc::FLOAT, values_of(image, format).data()) || !output->close()) {
    throw IoError(file, "cannot be written: " + one_line(output->geterror()));
  }
  return std::move(bytes.buffer());
}

/// The rows from `begin` to `end`, all channels.
bool read_rows(OIIO::ImageInput& input, int begin, int end, std::vector<float>& values) {
  const OIIO::ImageSpec& spec = input.spec();
  values.resize(static_cast<std::size_t>(end - begin) * static_cast<std::size_t>(spec.width) *
                static_cast<std::size_t>(spec.nchannels));
  const int top = spec.y + begin, bottom = spec.y + end;
  if (spec.tile_height == 0) {
    return input.read_scanlines(0, 0, top, bottom, spec.z, 0, spec.nchannels, OIIO::TypeDesc::FLOAT,
                                values.data());
  }
  return input.read_tiles(0, 0, spec.x, spec.x + spec.width, top, bottom, spec.z, spec.z + 1, 0,
                          spec.nchannels, OIIO::TypeDesc::FLOAT, values.data());
}

/// Appends the pixels of some rows; what their file does not have is one.
void append_pixels(const std::vector<float>& values, std::size_t channels, const std::array<int, 4>& source,
                   std::vector<glm::vec4>& pixels) {
  for (std::size_t i = 0; i < values.size(); i += channels) {
    glm::vec4& pixel = pixels.emplace_back(1);
    for (int c = 0; c < 4; ++c) {
      const int from = source[static_cast<std::size_t>(c)];
      if (from >= 0) pixel[c] = values[i + static_cast<std::size_t>(from)];
    }
  }
}

}  // namespace

bool holds_floats(const std::filesystem::path& file) { return open(file)->spec().format.is_floating_point(); }

Image read_image(const std::filesystem::path& file, bool* has_alpha) {
  const auto input = open(file);
  const OIIO::ImageSpec& spec = input->spec();
  if (spec.width < 1 || spec.height < 1 || spec.width > checks::k_largest_side ||
      spec.height > checks::k_largest_side || spec.depth > 1 || spec.nchannels < 1) {
    throw IoError(file, "got " + checks::size(spec.width, spec.height) + " pixels in " +
                            std::to_string(spec.nchannels) + " channels, expected 1 to " +
                            std::to_string(checks::k_largest_side) +
                            " pixels on a side in one channel or more");
  }
  const std::array<int, 4> source = channels_of(spec);
  Image image;
  image.width = spec.width;
  image.height = spec.height;
  // In bands, so that a few bytes that claim to be a large image do not take the memory of one.
  constexpr int k_rows = 64;
  const int rows = spec.tile_height > 0 ? spec.tile_height : k_rows;
  std::vector<float> values;
  for (int row = 0; row < spec.height; row += rows) {
    if (!read_rows(*input, row, std::min(row + rows, spec.height), values))
      throw IoError(file, "cannot be read: " + one_line(input->geterror()));
    append_pixels(values, static_cast<std::size_t>(spec.nchannels), source, image.pixels);
  }
  require_finite(file, image);
  if (has_alpha) *has_alpha = source[3] >= 0;
  return image;
}

void write_image(const std::filesystem::path& file, const Image& image) {
  const Format& format = format_of(file);
  const auto width = static_cast<std::size_t>(std::max(image.width, 0));
  if (image.width < 1 || image.height < 1 ||
      image.pixels.size() != width * static_cast<std::size_t>(image.height)) {
    throw InvalidArgument(
        "image (for " + file.string() + ")",
        checks::size(image.width, image.height) + " with " + std::to_string(image.pixels.size()) + " pixels",
        "at least 1x1, and width times height pixels");
  }
  require_finite(file, image);
  const std::vector<unsigned char> bytes = encode(file, image, format);
  write_whole_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace dpr
