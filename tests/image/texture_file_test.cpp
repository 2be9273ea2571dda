// Textures as data and as files: what is valid, and that 8-bit files hold sRGB and files of floats linear
// RGB.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "dpr/image.hpp"
#include "dpr/texture.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace texture_file_test {

using namespace dpr;
using dpr::test::TempDir;

namespace {

Texture grey_ramp() { return {3, 1, {glm::vec3(0), glm::vec3(0.25F), glm::vec3(1)}}; }

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("texture: 8-bit files are decoded from sRGB, and encoded to it") {
    const TempDir folder;
    Image bytes(4, 1);
    constexpr std::array<float, 4> k_values{0, 8, 128, 255};
    for (int i = 0; i < 4; ++i)
      bytes.at(i, 0) = glm::vec4(glm::vec3(k_values[static_cast<std::size_t>(i)] / 255.0F), 0.5F);
    write_image(folder / "bytes.png", bytes, Encoding::linear);
    const Texture texture = read_texture(folder / "bytes.png");
    CHECK(texture.width == 4);
    CHECK(texture.height == 1);
    CHECK(texture.wrap == Wrap::repeat);
    CHECK(texture.texels[0] == glm::vec3(0));
    CHECK(texture.texels[1].g == doctest::Approx(8 / 255.0 / 12.92));
    CHECK(texture.texels[2].r == doctest::Approx(std::pow((128 / 255.0 + 0.055) / 1.055, 2.4)));
    CHECK(texture.texels[3].b == doctest::Approx(1));
    REQUIRE(texture.opacities.size() == 4);
    CHECK(texture.opacities[2] == doctest::Approx(0.5).epsilon(0.01));
    write_texture(folder / "again.png", texture);
    const Image again = read_image(folder / "again.png", nullptr, Encoding::linear);
    for (int i = 0; i < 4; ++i) CHECK(again.at(i, 0).r == bytes.at(i, 0).r);
    CHECK(again.at(1, 0).a == texture.opacities[1]);
  }

  TEST_CASE("texture: files of floats are taken as they are, rows from the top") {
    const TempDir folder;
    Texture texture = grey_ramp();
    texture.width = 1;
    texture.height = 3;
    write_texture(folder / "a.exr", texture);
    CHECK(read_texture(folder / "a.exr").texels == texture.texels);
    CHECK(read_texture(folder / "a.exr").opacities.empty());
    CHECK(read_image(folder / "a.exr").at(0, 1).g == 0.25F);
  }

  TEST_CASE("texture: files that are missing or no images") {
    const TempDir folder;
    DPR_CHECK_MESSAGE_HAS(IoError, read_texture(folder / "gone.png"), "gone.png");
    folder.write("text.png", "not a picture");
    DPR_CHECK_MESSAGE_HAS(IoError, read_texture(folder / "text.png"), "text.png");
    DPR_CHECK_MESSAGE_HAS(IoError, write_texture(folder / "a.bin", grey_ramp()), "a.bin");
  }

  TEST_CASE("texture: what is not valid is named") {
    const Texture good = grey_ramp();
    CHECK_NOTHROW(validate(good));
    Texture bad = good;
    bad.width = 0;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(bad), "size (texture): got 0x1");
    bad = good;
    bad.height = 2;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(bad), "texels (texture): got 3, expected 6");
    bad = good;
    bad.texels[1].g = std::numeric_limits<float>::quiet_NaN();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(bad, "oak"), "texels[1] (oak)");
    bad = good;
    bad.wrap = static_cast<Wrap>(7);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(bad), "wrap (texture): got 7");
    bad = good;
    bad.filter = static_cast<Filter>(-1);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(bad), "filter (texture): got -1");
  }
}

}  // namespace texture_file_test
