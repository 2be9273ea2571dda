// The blur of rasters against a dense convolution in double precision: forward, transposed, derivative by the
// scale; on odd sizes, several views, with and without a coarse grid.
#include "stages/blur.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "support/blur_matrix.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"
#include "support/worst.hpp"

namespace blur_test {

namespace {

using dpr::Blur;
using dpr::BlurKernel;
using dpr::Buffer;
using dpr::Prior;
using dpr::test::BlurMatrix;
using dpr::test::device_impl;
using dpr::test::is_reduced;
using dpr::test::Worst;

using Pixels = std::vector<cl_float4>;

struct Case {
  Prior prior;
  double scale;
  int supersampling;
  int width, height;
};

/// Both sides of the coarse grid's beginning, and several of its spacings.
std::vector<Case> cases() {
  if (is_reduced()) return {{Prior::gaussian, 0.6, 1, 5, 3}, {Prior::gaussian, 4, 2, 3, 2}};
  return {
      {Prior::gaussian, 0, 1, 13, 9},    {Prior::gaussian, 0, 2, 13, 9},    {Prior::gaussian, 0.4, 1, 17, 11},
      {Prior::gaussian, 1.3, 1, 16, 12}, {Prior::gaussian, 1.3, 4, 7, 9},   {Prior::gaussian, 6.1, 1, 21, 14},
      {Prior::gaussian, 9, 1, 19, 23},   {Prior::gaussian, 20, 1, 33, 18},  {Prior::gaussian, 7.3, 4, 15, 11},
      {Prior::gaussian, 40, 1, 40, 40},  {Prior::logistic, 2.2, 2, 11, 15}, {Prior::logistic, 12, 1, 14, 13},
      {Prior::cauchy, 1.5, 1, 12, 17},   {Prior::uniform, 5.5, 2, 13, 13}};
}

constexpr std::size_t k_views = 2;

Pixels random_pixels(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  Pixels pixels(count);
  for (cl_float4& pixel : pixels) {
    for (float& channel : pixel.s) channel = static_cast<float>(engine()) * 0x1p-32F;
  }
  return pixels;
}

std::size_t raster_side(int pixels, const BlurKernel& kernel) {
  return static_cast<std::size_t>(pixels * kernel.supersampling + 2 * kernel.margin);
}

/// A blur that has been set, and one raster and one gradient of the image through it.
struct Run {
  explicit Run(const Case& c, std::size_t views = k_views, dpr::Device::Impl& device_ = device_impl())
      : device(device_),
        blur(device_),
        size{views, static_cast<std::size_t>(c.width), static_cast<std::size_t>(c.height)} {
    blur.set(blur.prepare(dpr::blur_kernel(c.prior, c.scale, c.supersampling)));
    raster =
        random_pixels(views * raster_side(c.width, blur.kernel()) * raster_side(c.height, blur.kernel()), 1);
    grad_image = random_pixels(views * size.width * size.height, 2);
  }

  Pixels forward() {
    raster_buffer.upload(device, raster);
    poison(size.views * size.width * size.height, image_buffer);
    blur.forward(size, raster_buffer, image_buffer);
    return image_buffer.download();
  }
  Pixels backward(bool keeps_forward = true) {
    grad_buffer.upload(device, grad_image);
    poison(raster.size(), grad_raster_buffer);
    blur.backward(size, grad_buffer, grad_raster_buffer, keeps_forward);
    return grad_raster_buffer.download();
  }
  std::vector<float> backward_scale() {
    blur.backward_scale(size, raster_buffer, grad_buffer);
    return blur.grad_scale.download();
  }
  void poison(std::size_t count, Buffer<cl_float4>& buffer) const {
    buffer.resize(device, count);
    buffer.fill(cl_float4{{dpr::test::k_poison, 0, 0, dpr::test::k_poison}});
  }

  /// Parameters that the extents need, of the frame whose samples the raster holds.
  dpr::shared::FrameParams frame(const Case& c) const {
    dpr::shared::FrameParams p{};
    p.views = static_cast<cl_uint>(size.views);
    p.tiles_x = static_cast<cl_uint>(tiles(raster_side(c.width, blur.kernel())));
    p.tiles_y = static_cast<cl_uint>(tiles(raster_side(c.height, blur.kernel())));
    return p;
  }
  std::size_t tile_count(const Case& c) const {
    const dpr::shared::FrameParams p = frame(c);
    return std::size_t{p.views} * p.tiles_x * p.tiles_y;
  }
  static std::size_t tiles(std::size_t samples) { return (samples + DPR_TILE - 1) / DPR_TILE; }

  dpr::Device::Impl& device;
  Blur blur;
  Buffer<cl_uint> tile_starts;
  Blur::Size size;
  Pixels raster, grad_image;
  Buffer<cl_float4> raster_buffer, image_buffer, grad_buffer, grad_raster_buffer;
};

/// Leaves a raster as it is in one tile of each view, each in another place, and makes all else the
/// background.
void cover_some_tiles(const Case& c, Run& run) {
  const dpr::shared::FrameParams p = run.frame(c);
  const std::size_t width = raster_side(c.width, run.blur.kernel()),
                    height = raster_side(c.height, run.blur.kernel());
  std::vector<cl_uint> starts{0};
  for (std::size_t tile = 0; tile < run.tile_count(c); ++tile) {
    const std::size_t view = tile / (p.tiles_x * p.tiles_y), place = tile % (p.tiles_x * p.tiles_y);
    const bool is_covered = place % p.tiles_x == p.tiles_x / (view + 2) && place / p.tiles_x == p.tiles_y / 2;
    starts.push_back(starts.back() + (is_covered ? 1 : 0));
  }
  for (std::size_t i = 0; i < run.raster.size(); ++i) {
    const std::size_t x = i % width / DPR_TILE, y = i / width % height / DPR_TILE, view = i / width / height;
    const std::size_t tile = (view * p.tiles_y + y) * p.tiles_x + x;
    if (starts[tile] == starts[tile + 1]) run.raster[i] = {{0.25F, 0.5F, 0.75F, 0}};
  }
  run.tile_starts.upload(run.device, starts);
}

/// rows * in * columns^T, for every view and channel; [view][row][column][channel].
std::vector<double> apply(const BlurMatrix& rows, const BlurMatrix& columns, const Pixels& in) {
  const std::size_t in_height = rows.front().size(), in_width = columns.front().size();
  const std::size_t views = in.size() / (in_height * in_width);
  std::vector<double> out(views * rows.size() * columns.size() * 4);
  for (std::size_t view = 0; view < views; ++view) {
    for (std::size_t channel = 0; channel < 4; ++channel) {
      BlurMatrix image(in_height, std::vector<double>(columns.size()));
      for (std::size_t y = 0; y < in_height; ++y) {
        for (std::size_t x = 0; x < columns.size(); ++x) {
          for (std::size_t k = 0; k < in_width; ++k)
            image[y][x] +=
                columns[x][k] * static_cast<double>(in[(view * in_height + y) * in_width + k].s[channel]);
        }
      }
      const BlurMatrix result = dpr::test::product(rows, image);
      for (std::size_t y = 0; y < rows.size(); ++y) {
        for (std::size_t x = 0; x < columns.size(); ++x)
          out[((view * rows.size() + y) * columns.size() + x) * 4 + channel] = result[y][x];
      }
    }
  }
  return out;
}

Worst difference(const Pixels& found, const std::vector<double>& expected) {
  Worst worst;
  REQUIRE(found.size() * 4 == expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i)
    worst.add(std::abs(static_cast<double>(found[i / 4].s[i % 4]) - expected[i]), "pixel", i / 4, "channel",
              i % 4);
  return worst;
}

std::vector<double> doubles(const Pixels& pixels) {
  std::vector<double> values;
  for (const cl_float4& pixel : pixels) values.insert(values.end(), pixel.s, pixel.s + 4);
  return values;
}

double inner(const Pixels& a, const Pixels& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < 4; ++k)
      sum += static_cast<double>(a[i].s[k]) * static_cast<double>(b[i].s[k]);
  }
  return sum;
}

bool same_bits(const Pixels& a, const Pixels& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(cl_float4)) == 0;
}

std::string text(const Case& c) {
  return "prior " + std::to_string(static_cast<int>(c.prior)) + ", scale " + std::to_string(c.scale) + ", " +
         std::to_string(c.supersampling) + " samples, " + std::to_string(c.width) + "x" +
         std::to_string(c.height);
}

dpr::reference::Prior reference(Prior prior) {
  return dpr::reference::k_priors.at(static_cast<std::size_t>(prior));
}

/// The image of a raster with the true density of the scale.
std::vector<double> reference_image(const Case& c, double scale, int margin, const Pixels& raster) {
  const auto matrix = [&](int pixels) {
    return dpr::reference::blur_matrix(reference(c.prior), scale * c.supersampling, pixels, c.supersampling,
                                       margin);
  };
  return apply(matrix(c.height), matrix(c.width), raster);
}

/// True if the density is smooth enough to be sampled.
bool has_reference(const Case& c) { return c.prior != Prior::uniform && c.scale * c.supersampling >= 1; }

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("an image is the raster times the kernel's matrices, to single precision") {
    for (const Case& c : cases()) {
      Run run(c);
      const BlurKernel& kernel = run.blur.kernel();
      const auto matrix = [&](int pixels) { return dpr::test::matrix_of(kernel, kernel.weights, pixels); };
      CAPTURE(text(c));
      DPR_CHECK_WORST(difference(run.forward(), apply(matrix(c.height), matrix(c.width), run.raster)), 1e-6);
    }
  }

  TEST_CASE("what no tile covers is the background, and the rest is as it is without asking") {
    for (const Case& c : cases()) {
      Run run(c);
      CAPTURE(text(c));
      cover_some_tiles(c, run);
      const Pixels all = run.forward();
      run.backward();
      const std::vector<float> scale_of_all = run.backward_scale();
      run.blur.find_extents(run.frame(c), run.tile_starts);
      DPR_CHECK_WORST(difference(run.forward(), doubles(all)), 2e-6);
      const std::vector<float> scale = run.backward_scale();
      for (std::size_t view = 0; view < scale.size(); ++view)
        CHECK(scale[view] == doctest::Approx(scale_of_all[view]).epsilon(1e-4));
    }
  }

  TEST_CASE("nothing is summed up where no tile is covered") {
    const Case c{Prior::gaussian, 1.3, 1, 40, 40};
    Run run(c);
    run.tile_starts.upload(run.device, std::vector<cl_uint>(run.tile_count(c) + 1, 0));
    run.blur.find_extents(run.frame(c), run.tile_starts);
    // The raster is not all alike, so that means are told from samples.
    for (const cl_float4& pixel : run.forward()) {
      CHECK(std::ranges::any_of(run.raster, [&](const cl_float4& sample) {
        return std::memcmp(&sample, &pixel, sizeof pixel) == 0;
      }));
    }
  }

  TEST_CASE("an image is the raster convolved with the density") {
    for (const Case& c : cases()) {
      if (!has_reference(c)) continue;
      Run run(c);
      CAPTURE(text(c));
      const Pixels image = run.forward();
      const int margin = run.blur.kernel().margin;
      DPR_CHECK_WORST(difference(image, reference_image(c, c.scale, margin, run.raster)), 3e-5);
      CHECK(difference(image, reference_image(c, 1.03 * c.scale, margin, run.raster)).error > 1e-4);
    }
  }

  TEST_CASE("a constant stays what it is, up to the border") {
    for (const Case& c : cases()) {
      Run run(c);
      run.raster.assign(run.raster.size(), cl_float4{{1, 0.3F, 7, 0}});
      Worst worst;
      for (const cl_float4& pixel : run.forward()) {
        for (std::size_t k = 0; k < 4; ++k) {
          const double expected = static_cast<double>(run.raster[0].s[k]);
          worst.add(std::abs(static_cast<double>(pixel.s[k]) - expected) / std::max(expected, 1.0), "channel",
                    k);
        }
      }
      CAPTURE(text(c));
      DPR_CHECK_WORST(worst, 1e-6);
    }
  }

  TEST_CASE("a disc keeps its area") {
    for (const double scale : {0.0, 0.7, 3.0, 9.0}) {
      const int side = dpr::test::reduced(120, 0);
      if (side == 0) continue;
      Run run({Prior::gaussian, scale, 1, side, side}, 1);
      const auto samples = raster_side(side, run.blur.kernel());
      double area = 0;
      for (std::size_t i = 0; i < run.raster.size(); ++i) {
        const double x = static_cast<double>(i % samples) - 0.5 * static_cast<double>(samples - 1);
        const double y = static_cast<double>(i / samples) - 0.5 * static_cast<double>(samples - 1);
        const float alpha = x * x + y * y < 100 ? 1.0F : 0.0F;
        run.raster[i] = {{0, 0, 0, alpha}};
        area += static_cast<double>(alpha);
      }
      double found = 0;
      for (const cl_float4& pixel : run.forward()) found += static_cast<double>(pixel.s[3]);
      CHECK(found == doctest::Approx(area).epsilon(1e-6));
    }
  }

  TEST_CASE("views do not see each other") {
    const Case c = cases().back();
    Run both(c), first(c, 1);
    first.raster.assign(both.raster.begin(),
                        both.raster.begin() + static_cast<std::ptrdiff_t>(first.raster.size()));
    const Pixels batch = both.forward(), single = first.forward();
    CHECK(
        same_bits(single, Pixels(batch.begin(), batch.begin() + static_cast<std::ptrdiff_t>(single.size()))));
  }

  TEST_CASE("every width of the lanes does the same") {
    for (const unsigned lanes : {1U, 8U, 16U}) {
      const dpr::Device device = dpr::open_device(dpr::test::test_device().info().name);
      impl_of(device).info.lanes = lanes;
      for (const Case& c : cases()) {
        Run run(c, k_views, impl_of(device)), usual(c);
        CAPTURE(lanes);
        CAPTURE(text(c));
        DPR_CHECK_WORST(difference(run.forward(), doubles(usual.forward())), 1e-6);
        DPR_CHECK_WORST(difference(run.backward(), doubles(usual.backward())), 1e-6);
        const std::vector<float> found = run.backward_scale(), expected = usual.backward_scale();
        for (std::size_t view = 0; view < k_views; ++view)
          CHECK(std::abs(found[view] - expected[view]) <=
                1e-4F * static_cast<float>(usual.grad_image.size()));
      }
    }
  }

  TEST_CASE("one blur serves kernels and sizes that change, to the same bits") {
    Run run(cases().back());
    const Pixels image = run.forward(), grad = run.backward();
    const std::vector<float> grad_scale = run.backward_scale();
    Run other(cases()[1]);
    other.forward();
    other.backward();
    other.backward_scale();
    other.blur.set(other.blur.prepare(run.blur.kernel()));
    other.size = run.size;
    other.raster = run.raster;
    other.grad_image = run.grad_image;
    CHECK(same_bits(other.forward(), image));
    CHECK(same_bits(other.backward(), grad));
    CHECK(other.backward_scale() == grad_scale);
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("backward is the transpose of forward") {
    for (const Case& c : cases()) {
      Run run(c);
      const double there = inner(run.forward(), run.grad_image);
      const Pixels back = run.backward();
      CAPTURE(text(c));
      CHECK(inner(run.raster, back) == doctest::Approx(there).epsilon(1e-6));
      CHECK(same_bits(back, run.backward(/*keeps_forward*/ false)));
    }
  }

  TEST_CASE("the derivative by the scale is that of the matrices, view by view") {
    for (const Case& c : cases()) {
      Run run(c);
      run.forward();
      run.backward();
      const std::vector<float> found = run.backward_scale();
      const BlurKernel& kernel = run.blur.kernel();
      const auto matrix = [&](const std::vector<float>& weights, int pixels) {
        return dpr::test::matrix_of(kernel, weights, pixels);
      };
      const auto by_rows =
          apply(matrix(kernel.weights_by_scale, c.height), matrix(kernel.weights, c.width), run.raster);
      const auto by_columns =
          apply(matrix(kernel.weights, c.height), matrix(kernel.weights_by_scale, c.width), run.raster);
      REQUIRE(found.size() == k_views);
      for (std::size_t view = 0; view < k_views; ++view) {
        double expected = 0, size = 0;
        const std::size_t values = by_rows.size() / k_views;
        for (std::size_t i = view * values; i < (view + 1) * values; ++i) {
          const double term =
              (by_rows[i] + by_columns[i]) * static_cast<double>(run.grad_image[i / 4].s[i % 4]);
          expected += term;
          size += std::abs(term);
        }
        CAPTURE(text(c));
        CHECK(std::abs(static_cast<double>(found[view]) - expected) <= 5e-6 * size + 1e-9);
      }
    }
  }

  TEST_CASE("the derivative by the scale is that of the true convolution") {
    for (const Case& c : cases()) {
      if (!has_reference(c)) continue;
      Run run(c, 1);
      // A smooth picture: of noise little is left to change.
      const std::size_t side = raster_side(c.width, run.blur.kernel());
      for (std::size_t i = 0; i < run.raster.size(); ++i) {
        const double x = static_cast<double>(i % side), y = static_cast<double>(i / side);
        const double period = 2 + c.scale * c.supersampling;
        run.raster[i].s[0] = static_cast<float>(std::sin(x / period) * std::cos(0.7 * y / period));
      }
      run.forward();
      run.backward();
      const double step = 1e-3 * c.scale;
      const int margin = run.blur.kernel().margin;
      const auto above = reference_image(c, c.scale + step, margin, run.raster);
      const auto below = reference_image(c, c.scale - step, margin, run.raster);
      double expected = 0, size = 0;
      for (std::size_t i = 0; i < above.size(); ++i) {
        const double term =
            (above[i] - below[i]) / (2 * step) * static_cast<double>(run.grad_image[i / 4].s[i % 4]);
        expected += term;
        size += std::abs(term);
      }
      // A handful of pixels averages little of the coarse grid's error.
      const double tolerance = c.width < 8 ? 2e-3 : 1e-3;
      CAPTURE(text(c));
      CHECK(std::abs(static_cast<double>(run.backward_scale()[0]) - expected) <= tolerance * size);
    }
  }
}

}  // namespace blur_test
