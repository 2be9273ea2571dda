// Gradients of texels from lists of what fragments see, against sums in double precision.
#include "stages/texels.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace texels_test {

using namespace dpr;

namespace {

/// What fragments see, by tile, as surface_list and surface_place leave it.
struct Places {
  std::vector<cl_uint> cells;
  std::vector<shared::SeenTexels> seen;
};

/// Textures of one level and of five, behind each other.
Textures two_textures(Device::Impl& device) {
  Textures textures;
  shared::Texture flat{}, pyramid{};
  flat.width = 5;
  flat.height = 3;
  flat.levels = 1;
  pyramid.first = flat.width * flat.height;
  pyramid.width = pyramid.height = 16;
  pyramid.levels = 5;
  textures.list = {flat, pyramid};
  textures.texels = pyramid.first + 256 + 64 + 16 + 4 + 1;
  textures.textures.upload(device, textures.list);
  return textures;
}

/// Tiles far apart and beside each other, with runs from one place to more than a block in one cell; a fifth of the
/// places is of no texture.
Places random_places(std::size_t texels, std::size_t tiles) {
  std::mt19937 random(7);
  const auto below = [&](std::size_t end) { return static_cast<cl_uint>(random() % end); };
  const auto real = [&](float least, float most) {
    return least + (most - least) * static_cast<float>(random()) * 0x1p-32F;
  };
  Places places;
  cl_uint tile = 0;
  for (std::size_t i = 0; i < tiles; ++i) {
    tile += below(10) == 0 ? 100 : 1;
    const cl_uint hot = below(texels), last = below(texels);
    const std::size_t count = i % 50 == 49 ? 3 * DPR_TEXEL_BLOCK : 1 + below(DPR_TEXEL_BLOCK);
    for (std::size_t k = 0; k < count; ++k) {
      const cl_uint kind = below(10);
      places.cells.push_back(static_cast<cl_uint>(kind < 2   ? texels
                                                  : kind < 4 ? below(texels)
                                                  : kind < 5 ? last
                                                  : kind < 7 ? 3
                                                             : hot));
      places.seen.push_back({.red = real(-1, 1),
                             .green = real(-1, 1),
                             .blue = real(-1, 1),
                             .tile = tile,
                             .right = real(0, 1),
                             .below = real(0, 1)});
    }
  }
  return places;
}

void add_band(Device::Impl& device, Texels& texels, const Textures& textures, const Places& places,
              std::size_t first, std::size_t last) {
  const auto count = to_uint(last - first);
  Surface surface(device);
  surface.cells.upload(device, std::span(places.cells).subspan(first, count));
  surface.seen.upload(device, std::span(places.seen).subspan(first, count));
  surface.place_count.upload(device, std::span(&count, 1));
  texels.add(textures, surface);
}

/// A texel's gradient, and the sum of the magnitudes of the gradients that it has parts of.
struct Expected {
  std::array<double, 3> sum{}, magnitude{};
};

std::vector<Expected> expected_of(const Textures& textures, const Places& places) {
  std::vector<Expected> all(textures.texels);
  for (std::size_t i = 0; i < places.cells.size(); ++i) {
    const cl_uint cell = places.cells[i];
    if (cell >= textures.texels) continue;
    const shared::SeenTexels& seen = places.seen[i];
    const shared::Texture& texture = textures.list[cell < textures.list[1].first ? 0 : 1];
    cl_uint first = texture.first, width = texture.width, height = texture.height;
    for (; cell >= first + width * height; width /= 2, height /= 2) first += width * height;
    for (cl_uint k = 0; k < 4; ++k) {
      const cl_uint x = ((cell - first) % width + k % 2) % width,
                    y = ((cell - first) / width + k / 2) % height;
      const double part = (k % 2 != 0 ? double{seen.right} : 1.0 - double{seen.right}) *
                          (k / 2 != 0 ? double{seen.below} : 1.0 - double{seen.below});
      Expected& texel = all[first + y * width + x];
      const std::array<float, 3> grad{seen.red, seen.green, seen.blue};
      for (std::size_t c = 0; c < 3; ++c) {
        texel.sum[c] += part * double{grad[c]};
        texel.magnitude[c] += std::abs(double{grad[c]});
      }
    }
  }
  return all;
}

std::vector<float> numbers_of(const Texels& texels) {
  std::vector<float> numbers;
  for (const cl_float4& grad : texels.grad.download()) numbers.insert(numbers.end(), grad.s, grad.s + 4);
  return numbers;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("texels: sums of runs of every length on CPUs and on GPUs, in one band or in several") {
    Device own = open_device();
    Device::Impl& device = impl_of(own);
    for (const unsigned lanes : {1U, 8U}) {
      if (dpr::test::is_reduced() && lanes != device.info.lanes) continue;
      CAPTURE(lanes);
      device.info.lanes = lanes;
      const Textures textures = two_textures(device);
      const Places places =
          random_places(textures.texels, static_cast<std::size_t>(dpr::test::reduced(400, 20)));
      const std::vector<Expected> expected = expected_of(textures, places);
      std::vector<float> whole;
      for (const bool in_bands : {false, true}) {
        Texels texels(device);
        texels.start(textures);
        std::size_t first = 0;
        while (first < places.cells.size()) {
          std::size_t last = in_bands ? first + places.cells.size() / 7 : places.cells.size();
          while (last < places.cells.size() && places.seen[last].tile == places.seen[last - 1].tile) ++last;
          last = std::min(last, places.cells.size());
          add_band(device, texels, textures, places, first, last);
          first = last;
        }
        const std::vector<float> found = numbers_of(texels);
        if (in_bands) {
          CHECK(found == whole);
          continue;
        }
        whole = found;
        double worst = 0;
        for (std::size_t i = 0; i < textures.texels; ++i) {
          for (std::size_t c = 0; c < 3; ++c) {
            const double error = std::abs(double{found[4 * i + c]} - expected[i].sum[c]);
            worst = std::max(worst, error / std::max(expected[i].magnitude[c], 1e-30));
          }
          CHECK(found[4 * i + 3] == 0.0F);
        }
        CHECK(worst < 1e-6);
      }
    }
  }
}

}  // namespace texels_test
