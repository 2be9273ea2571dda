// Images on disk, by way of OpenImageIO.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include "base/checks.hpp"
#include "image/codec.hpp"

namespace dpr {
namespace {

// Alpha is the silhouette, not a factor of the colours. OpenImageIO multiplies it in while reading PNG and
// the like, and takes it out again while writing, unless both sides are told that it is not there.
constexpr const char* k_unassociated_alpha = "oiio:UnassociatedAlpha";

// Reasons span lines at times; an error is one line.
std::string one_line(std::string reason) {
  std::replace(reason.begin(), reason.end(), '\n', ' ');
  while (!reason.empty() && reason.back() == ' ') reason.pop_back();
  return reason.empty() ? "OpenImageIO gives no reason" : reason;
}

std::unique_ptr<OIIO::ImageInput> open(const std::string& file, OIIO::Filesystem::IOProxy* content) {
  OIIO::ImageSpec configuration, spec;
  configuration.attribute(k_unassociated_alpha, 1);
  auto input = content ? OIIO::ImageInput::create(file) : OIIO::ImageInput::open(file, &configuration);
  if (!input) throw std::runtime_error("cannot be read: " + one_line(OIIO::geterror()));
  if (content && (!input->set_ioproxy(content) || !input->open(file, spec, configuration)))
    throw std::runtime_error("cannot be read: " + one_line(input->geterror()));
  return input;
}

// Numbers of the file's channels that are red, green, blue and alpha; -1 where there is none.
std::array<int, 4> channels_of(const OIIO::ImageSpec& spec) {
  if (spec.nchannels == 1) return {0, 0, 0, -1};
  if (spec.nchannels == 2) return {0, 0, 0, 1};
  if (spec.nchannels == 4) return {0, 1, 2, 3};
  return {0, 1, 2, spec.alpha_channel > 2 ? spec.alpha_channel : -1};
}

/// The values of the channels that the format has.
std::vector<float> values_of(const Image& image, const PixelFormat& format) {
  std::vector<float> values;
  values.reserve(image.pixels.size() * static_cast<std::size_t>(format.channels));
  for (const glm::vec4& pixel : image.pixels) {
    const glm::vec4 value = format.bytes ? glm::clamp(pixel, 0.0F, 1.0F) : pixel;
    for (int c = 0; c < format.channels; ++c) values.push_back(value[c]);
  }
  return values;
}

/// The image as a file's bytes, in memory: OpenImageIO takes some writes to a full disk for successes, and
/// libjpeg ends the process at one.
std::vector<unsigned char> encode(const Image& image, const PixelFormat& format) {
  const auto output = OIIO::ImageOutput::create(format.extension);
  if (!output) throw std::runtime_error("cannot be written: " + one_line(OIIO::geterror()));
  OIIO::ImageSpec spec(image.width, image.height, format.channels,
                       format.bytes ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::FLOAT);
  spec.attribute(k_unassociated_alpha, 1);
  // In a TIFF file this would make a second directory, and OpenImageIO could not read the file again.
  const bool is_tiff = format.extension.starts_with("tif");
  if (format.bytes && !is_tiff) spec.attribute("oiio:ColorSpace", format.srgb ? "sRGB" : "Linear");
  // Equal images are equal files. An OpenEXR or TIFF file without a date would get the present one, and
  // OpenImageIO 3 complains of an empty one.
  spec.attribute("DateTime", "1970:01:01 00:00:00");
  // From version 2.5 on rows of a PPM file would be flipped as those of a PFM file.
  spec.attribute("pnm:pfmflip", 0);
  OIIO::Filesystem::IOVecOutput bytes;
  if (!output->set_ioproxy(&bytes) || !output->open("image." + format.extension, spec) ||
      !output->write_image(OIIO::TypeDesc::FLOAT, values_of(image, format).data()) || !output->close()) {
    throw std::runtime_error("cannot be written: " + one_line(output->geterror()));
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
    return input.read_scanlines(input.current_subimage(), 0, top, bottom, spec.z, 0, spec.nchannels,
                                OIIO::TypeDesc::FLOAT, values.data());
  }
  return input.read_tiles(input.current_subimage(), 0, spec.x, spec.x + spec.width, top, bottom, spec.z,
                          spec.z + 1, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, values.data());
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

/// The image as a camera's owner held it; `orientation` is Exif's, 1 to 8: cameras store rows as the sensor
/// has them.
Image upright(Image stored, int orientation) {
  if (orientation < 2 || orientation > 8) return stored;
  const bool transposes = orientation > 4;
  const bool flips_x = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  const bool flips_y = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  Image image(transposes ? stored.height : stored.width, transposes ? stored.width : stored.height);
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const int x = transposes ? row : column, y = transposes ? column : row;
      image.at(column, row) =
          stored.at(flips_x ? stored.width - 1 - x : x, flips_y ? stored.height - 1 - y : y);
    }
  }
  return image;
}

/// The image at which the file is open.
Image read(OIIO::ImageInput& input, PixelFacts& facts) {
  const OIIO::ImageSpec& spec = input.spec();
  if (spec.width < 1 || spec.height < 1 || spec.width > checks::k_largest_side ||
      spec.height > checks::k_largest_side || spec.depth > 1 || spec.nchannels < 1) {
    throw std::runtime_error("got " + checks::size(spec.width, spec.height) + " pixels in " +
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
    if (!read_rows(input, row, std::min(row + rows, spec.height), values))
      throw std::runtime_error("cannot be read: " + one_line(input.geterror()));
    append_pixels(values, static_cast<std::size_t>(spec.nchannels), source, image.pixels);
  }
  // A JPEG file that ends too soon is read to its end, grey below, and is an error by its message alone.
  if (input.has_error()) throw std::runtime_error("cannot be read: " + one_line(input.geterror()));
  const bool floats = spec.format.is_floating_point();
  constexpr int k_bits = 8;  // of a byte
  const float largest = floats ? 1.0F : std::exp2(static_cast<float>(k_bits * spec.format.size())) - 1;
  const int focal = spec.get_int_attribute("Exif:FocalLengthIn35mmFilm", 0);
  facts = {source[3] >= 0, floats, largest, static_cast<float>(std::max(focal, 0))};
  return upright(std::move(image), spec.get_int_attribute("Orientation", 1));
}

Image read(const std::string& file, std::span<const unsigned char> content, PixelFacts& facts) {
  OIIO::Filesystem::IOMemReader reader(const_cast<unsigned char*>(content.data()),
                                       content.size());  // read only
  const auto input = open(file, content.empty() ? nullptr : &reader);
  return read(*input, facts);
}

/// OpenImageIO has the frames of a video as images of one file.
class Frames final : public StoredImages {
 public:
  explicit Frames(const std::string& file) : input_(open(file, nullptr)) {}

  bool next(Image& image, PixelFacts& facts) override {
    if (!input_->seek_subimage(number_, 0)) return false;
    ++number_;
    image = read(*input_, facts);
    return true;
  }

 private:
  std::unique_ptr<OIIO::ImageInput> input_;
  int number_ = 0;
};

std::unique_ptr<StoredImages> read_all(const std::string& file) { return std::make_unique<Frames>(file); }

constexpr ImageCodec k_codec{read, encode, read_all};

}  // namespace
}  // namespace dpr

extern "C" DPR_API const dpr::ImageCodec* dpr_image_codec() { return &dpr::k_codec; }
