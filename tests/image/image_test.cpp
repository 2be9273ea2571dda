// Images on disk: what is written is read back, and nothing half-written stays.
#include "dpr/image.hpp"

#include <doctest/doctest.h>

#include <chrono>
#include <limits>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "support/file_size_limit.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace image_test {

using namespace dpr;
using dpr::test::TempDir;

namespace {

// Colours beside small alphas: they do not survive being multiplied by alpha in eight bits.
Image sample() {
  Image image(3, 2);
  image.pixels = {{1, 0.5F, 0.25F, 0}, {0.2F, 0.4F, 0.6F, 0.1F}, {1, 1, 1, 1},
                  {0, 0, 0, 1},        {0.9F, 0.8F, 0.7F, 0.5F}, {0.1F, 0.2F, 0.3F, 0.004F}};
  return image;
}

float largest_difference(const Image& a, const Image& b) {
  REQUIRE(a.width == b.width);
  REQUIRE(a.height == b.height);
  float largest = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const glm::vec4 difference = glm::abs(a.pixels[i] - b.pixels[i]);
    for (int c = 0; c < 4; ++c) largest = std::max(largest, difference[c]);
  }
  return largest;
}

/// An image comes back as it is written, to half a step of 8 bits: a step of sRGB is at most 2.3 linear ones.
/// `image` is what the file keeps of the sample.
void check_kept(const std::filesystem::path& file, const Image& image, bool alpha) {
  for (const auto& [encoding, steps] : {std::pair{Encoding::linear, 0.5F}, {Encoding::srgb, 1.15F}}) {
    bool has_alpha = !alpha;
    write_image(file, sample(), encoding);
    CHECK(largest_difference(read_image(file, &has_alpha, encoding), image) <= steps / 255 + 1e-6F);
    CHECK(has_alpha == alpha);
  }
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("photographs are turned as Exif says") {
    const TempDir folder;
    // Corners: red on top, black at the lower left, blue at the lower right.
    Image image(32, 16, glm::vec4(1, 0, 0, 1));
    for (int row = 8; row < 16; ++row) {
      for (int column = 0; column < 32; ++column)
        image.at(column, row) = glm::vec4(0, 0, column < 16 ? 0 : 1, 1);
    }
    write_image(folder / "plain.jpg", image);
    const std::string plain = folder.read("plain.jpg");
    // Where the stored corners, upper left and lower right, go; Exif 2.3, table of the tag 0x0112.
    const auto corner = [](const Image& of, bool right, bool low) {
      return of.at(right ? of.width - 2 : 1, low ? of.height - 2 : 1);
    };
    struct Place {
      int orientation;
      bool portrait, red_right, red_low, black_right, black_low;
    };
    for (const Place& p :
         {Place{1, false, false, false, false, true}, Place{2, false, true, false, true, true},
          Place{3, false, true, true, true, false}, Place{4, false, false, true, false, false},
          Place{5, true, false, false, true, false}, Place{6, true, true, false, false, false},
          Place{7, true, true, true, false, true}, Place{8, true, false, true, true, true}}) {
      CAPTURE(p.orientation);
      const std::string exif{
          "\xff\xe1\x00\x22"
          "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0",
          29};
      const std::string tail{"\0\0\0\0\0\0", 6};
      const std::string segment = exif + static_cast<char>(p.orientation) + tail;
      const Image turned =
          read_image(folder.write("turned.jpg", plain.substr(0, 2) + segment + plain.substr(2)));
      CHECK((turned.height > turned.width) == p.portrait);
      CHECK(corner(turned, p.red_right, p.red_low).r > 0.8F);
      const glm::vec4 black = corner(turned, p.black_right, p.black_low);
      CHECK(black.r + black.b < 0.2F);
    }
  }

  TEST_CASE("rows and columns") {
    Image image(3, 2, glm::vec4(0.5F));
    image.at(2, 1).g = 7;
    CHECK(image.pixels[5] == glm::vec4(0.5F, 7, 0.5F, 0.5F));
    CHECK(image.pixels[0] == glm::vec4(0.5F));
  }

  TEST_CASE("EXR keeps the floats, whatever alpha is") {
    const TempDir folder;
    Image image = sample();
    image.at(0, 0) = {-3, 1e-20F, 12345.678F, 0};
    write_image(folder / "a.exr", image);
    bool has_alpha = false;
    CHECK(read_image(folder / "a.exr", &has_alpha).pixels == image.pixels);
    CHECK(has_alpha);
    CHECK(folder.entries() == 1);
  }

  TEST_CASE("formats of eight bits with alpha keep colour and alpha apart") {
    const TempDir folder;
    for (const char* name : {"a.png", "a.tif", "a.tga"}) {
      CAPTURE(name);
      check_kept(folder / name, sample(), true);
    }
  }

  TEST_CASE("formats without alpha") {
    const TempDir folder;
    for (const char* name : {"a.bmp", "a.ppm"}) {
      CAPTURE(name);
      check_kept(folder / name, dpr::opaque(sample()), false);
    }
    write_image(folder / "a.jpg", Image(16, 16, {0.5F, 0.25F, 0.75F, 0}));
    CHECK(largest_difference(read_image(folder / "a.jpg"), Image(16, 16, {0.5F, 0.25F, 0.75F, 1})) < 0.03F);
  }

  TEST_CASE("eight bits hold sRGB and say so, unless they are linear; alpha is linear") {
    const TempDir folder;
    const Image image(1, 1, {0.25F, 0.001F, 1, 0.4F});
    for (const char* name : {"a.png", "a.tif", "a.tga"}) {
      CAPTURE(name);
      write_image(folder / name, image);
      const glm::vec4 stored = read_image(folder / name, nullptr, Encoding::linear).pixels[0];
      CHECK(glm::length(stored - glm::vec4(137, 3, 255, 102) / 255.0F) < 1e-6F);
    }
    CHECK(folder.read("a.png").find("sRGB") != std::string::npos);
    write_image(folder / "a.png", image, Encoding::linear);
    CHECK(folder.read("a.png").find("sRGB") == std::string::npos);
    write_image(folder / "a.exr", image);
    for (const Encoding encoding : {Encoding::srgb, Encoding::linear})
      CHECK(read_image(folder / "a.exr", nullptr, encoding).pixels == image.pixels);
  }

  TEST_CASE("eight bits are clamped, not wrapped") {
    const TempDir folder;
    write_image(folder / "a.png", Image(1, 1, {-0.5F, 1.5F, 300, 2}));
    CHECK(read_image(folder / "a.png").pixels[0] == glm::vec4(0, 1, 1, 1));
  }

  TEST_CASE("grey images") {
    const TempDir folder;
    bool has_alpha = true;
    const auto file = folder.write("grey.pgm", std::string("P5\n2 1\n255\n") + '\x33' + '\xff');
    const Image image = read_image(file, &has_alpha, Encoding::linear);
    CHECK_FALSE(has_alpha);
    CHECK(image.width == 2);
    CHECK(glm::length(image.pixels[0] - glm::vec4(0.2F, 0.2F, 0.2F, 1)) < 1e-6F);
    CHECK(image.pixels[1] == glm::vec4(1));
  }

  TEST_CASE("an existing file is replaced whole") {
    const TempDir folder;
    write_image(folder / "a.png", Image(4, 4, glm::vec4(1)));
    write_image(folder / "a.png", sample());
    CHECK(read_image(folder / "a.png").width == 3);
    CHECK(folder.entries() == 1);
  }

  TEST_CASE("side by side") {
    CHECK(hstack({}).pixels.empty());
    const Image strip = hstack({Image(1, 2, glm::vec4(0)), Image(2, 2, glm::vec4(0.5F))}, 1, glm::vec4(1));
    CHECK(strip.width == 4);
    CHECK(strip.height == 2);
    for (int row = 0; row < 2; ++row) {
      CHECK(strip.at(0, row) == glm::vec4(0));
      CHECK(strip.at(1, row) == glm::vec4(1));
      CHECK(strip.at(2, row) == glm::vec4(0.5F));
      CHECK(strip.at(3, row) == glm::vec4(0.5F));
    }
  }

  TEST_CASE("below each other") {
    CHECK(vstack({}).pixels.empty());
    const Image sheet =
        vstack({Image(3, 1, glm::vec4(0)), sample(), Image(3, 1, glm::vec4(0.5F))}, 2, glm::vec4(1));
    CHECK(sheet.width == 3);
    CHECK(sheet.height == 8);
    for (int column = 0; column < 3; ++column) {
      CHECK(sheet.at(column, 0) == glm::vec4(0));
      for (const int row : {1, 2, 5, 6}) CHECK(sheet.at(column, row) == glm::vec4(1));
      for (const int row : {0, 1}) CHECK(sheet.at(column, 3 + row) == sample().at(column, row));
      CHECK(sheet.at(column, 7) == glm::vec4(0.5F));
    }
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("files that cannot be read") {
    const TempDir folder;
    DPR_CHECK_MESSAGE_HAS(IoError, read_image(folder / "no.png"), "does not exist");
    DPR_CHECK_MESSAGE_HAS(IoError, read_image(folder.path()), "folder");
    DPR_CHECK_MESSAGE_HAS(IoError, read_image(folder.write("noise.png", "not a picture")),
                          "noise.png: cannot be read");
    DPR_CHECK_MESSAGE_HAS(IoError, read_image(folder.write("a.xyz", "not a picture")),
                          "a.xyz: cannot be read");
  }

  TEST_CASE("PNG files of other kinds than those that are written") {
    const TempDir folder;
    const auto read = [&](const std::string& digits) {
      std::string bytes;
      for (std::size_t i = 0; i < digits.size(); i += 2)
        bytes += static_cast<char>(std::stoi(digits.substr(i, 2), nullptr, 16));
      return read_image(folder.write("a.png", bytes), nullptr, Encoding::linear);
    };
    const Image grey = read(  // of 2 bits
        "89504e470d0a1a0a0000000d494844520000000400000001020000000096e748b00000000a4944415478da63900600001d00"
        "1c237c8fac"
        "0000000049454e44ae426082");
    REQUIRE(grey.pixels.size() == 4);
    for (int i = 0; i < 4; ++i)
      CHECK(grey.at(i, 0) == glm::vec4(glm::vec3(static_cast<float>(85 * i) * (1.0F / 255)), 1));
    const Image with_alpha = read(  // grey and alpha of 16 bits
        "89504e470d0a1a0a0000000d4948445200000001000000011004000000e58cd0410000000d4944415478da63103269600000"
        "01e900c7a5"
        "4989370000000049454e44ae426082");
    REQUIRE(with_alpha.pixels.size() == 1);
    CHECK(with_alpha.pixels[0] == glm::vec4(glm::vec3(4660 * (1.0F / 65535)), 32768 * (1.0F / 65535)));
    const Image palette = read(  // whose first colour is a fifth opaque
        "89504e470d0a1a0a0000000d49484452000000020000000108030000"
        "00c3fc8fb800000006504c5445ff00000000ff6ca1fd8e0000000174524e5333ff36b9700000000b4944415478da63606004"
        "000004"
        "00022cde48ad0000000049454e44ae426082");
    REQUIRE(palette.pixels.size() == 2);
    CHECK(palette.at(0, 0) == glm::vec4(1, 0, 0, 51 * (1.0F / 255)));
    CHECK(palette.at(1, 0) == glm::vec4(0, 0, 1, 1));
    const Image in_turns = read(  // Adam7
        "89504e470d0a1a0a0000000d49484452000000020000000208020000018ad3aae50000000f4944415478da63f8cf00041002"
        "0800"
        "20ee05fb4c50558d0000000049454e44ae426082");
    REQUIRE(in_turns.pixels.size() == 4);
    CHECK(in_turns.at(0, 0) == glm::vec4(1, 0, 0, 1));
    CHECK(in_turns.at(1, 0) == glm::vec4(0, 1, 0, 1));
    CHECK(in_turns.at(0, 1) == glm::vec4(0, 0, 1, 1));
    CHECK(in_turns.at(1, 1) == glm::vec4(1));
  }

  TEST_CASE("a file named PNG that is a JPEG file is read") {
    const TempDir folder;
    write_image(folder / "a.jpg", Image(8, 8, glm::vec4(0.3F)));
    const Image image = read_image(folder.write("b.png", folder.read("a.jpg")));
    REQUIRE(image.width == 8);
    CHECK(image.pixels[0].x == doctest::Approx(0.3).epsilon(0.05));
  }

  TEST_CASE("truncated images") {
    const TempDir folder;
    write_image(folder / "a.png", Image(64, 64, glm::vec4(0.3F)));
    std::string png = folder.read("a.png");
    DPR_CHECK_MESSAGE_HAS(IoError, read_image(folder.write("b.png", png.substr(0, png.size() - 20))),
                          "b.png: cannot be read: the file ends too soon");
    png.replace(16, 4, std::string("\0\0\x40\0", 4));  // 16384 pixels wide, without the sum that says so
    DPR_CHECK_MESSAGE_HAS(IoError, read_image(folder.write("b.png", png)), "IHDR: CRC error");
    for (const std::string extension : {".png", ".exr", ".tif", ".tga", ".jpg"}) {
      write_image(folder / ("whole" + extension), Image(64, 64, glm::vec4(0.3F)));
      const std::string whole = folder.read("whole" + extension);
      const auto cut = folder.write("cut" + extension, whole.substr(0, whole.size() / 2));
      CHECK_THROWS_AS(read_image(cut), IoError);
    }
  }

  TEST_CASE("images that cannot be written leave nothing behind") {
    const TempDir folder;
    DPR_CHECK_MESSAGE_HAS(IoError, write_image(folder / "a.gif", sample()), "expected one of .exr, .png");
    DPR_CHECK_MESSAGE_HAS(IoError, write_image(folder / "a", sample()), "got the extension \"\"");
    DPR_CHECK_MESSAGE_HAS(IoError, write_image(folder / "no" / "a.png", sample()), "does not exist");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, write_image(folder / "a.png", Image()), "got 0x0 with 0 pixels");
    Image short_of_pixels = sample();
    short_of_pixels.pixels.pop_back();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, write_image(folder / "a.png", short_of_pixels), "with 5 pixels");
    Image not_finite = sample();
    not_finite.at(2, 1).b = std::numeric_limits<float>::quiet_NaN();
    DPR_CHECK_MESSAGE_HAS(IoError, write_image(folder / "a.exr", not_finite), "the pixel in column 2, row 1");
    CHECK(folder.entries() == 0);
  }

  TEST_CASE("an image that finds no room is an error in every format, and leaves what was there") {
    const TempDir folder;
    Image noise(32, 32);
    std::mt19937 generator(1);
    for (glm::vec4& pixel : noise.pixels) {
      for (int c = 0; c < 4; ++c) pixel[c] = static_cast<float>(generator() % 256) / 255;
    }
    for (const std::string name :
         {"a.exr", "a.png", "a.tif", "a.tiff", "a.tga", "a.bmp", "a.jpg", "a.jpeg", "a.ppm"}) {
      CAPTURE(name);
      write_image(folder / name, Image(4, 4, glm::vec4(0.5F)));
      const std::string before = folder.read(name);
      const std::size_t entries = folder.entries();
      {
        const dpr::test::FileSizeLimit limit(1000);
        DPR_CHECK_MESSAGE_HAS(IoError, write_image(folder / name, noise),
                              "cannot be written: File too large");
      }
      CHECK(folder.read(name) == before);
      CHECK(folder.entries() == entries);
      write_image(folder / name, noise);
      CHECK(read_image(folder / name).width == 32);
    }
  }

  TEST_CASE("equal images are equal files, whenever they are written") {
    const TempDir folder;
    const std::vector<std::string> formats{".exr", ".png", ".tif", ".tga", ".bmp", ".jpg", ".ppm"};
    for (const std::string& format : formats) write_image(folder / ("a" + format), sample());
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // dates in files are in seconds
    for (const std::string& format : formats) {
      write_image(folder / ("b" + format), sample());
      CHECK_MESSAGE(folder.read("a" + format) == folder.read("b" + format), format);
    }
  }

  TEST_CASE("a float file with a pixel that is not finite") {
    const TempDir folder;
    // PFM: floats from the bottom row up; the third of them is a NaN.
    std::string bytes = "Pf\n2 2\n-1.0\n";
    bytes += std::string(8, '\0') + std::string("\0\0\xc0\x7f", 4) + std::string(4, '\0');
    DPR_CHECK_MESSAGE_HAS(IoError, read_image(folder.write("a.pfm", bytes)), "the pixel in column 0, row 0");
  }

  TEST_CASE("strips of different heights") {
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, hstack({Image(1, 2), Image(1, 3)}), "images[1] (hstack)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, hstack({Image(1, 2)}, -1), "gap (hstack)");
  }

  TEST_CASE("sheets of different widths") {
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, vstack({Image(2, 1), Image(2, 1), Image(3, 1)}),
                          "images[2] (vstack): got a width of 3");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, vstack({Image(1, 2)}, -1), "gap (vstack)");
  }
}

}  // namespace image_test
