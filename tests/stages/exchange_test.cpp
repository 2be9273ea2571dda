// Vectors from one layout to another, and numbers from sums, against plain loops in double precision.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "stages/exchange.hpp"

namespace exchange_test {

using namespace dpr;
using dpr::test::pipeline::Random;

namespace {

std::vector<float> random_floats(std::size_t count, unsigned seed) {
  Random random(seed);
  std::vector<float> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(random(-1.0F, 1.0F));
  return values;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("exchange: vectors come out of a caller's layout, in order, with zeros behind") {
    const Device device = open_device();
    Exchange exchange(impl_of(device));
    // Groups of two vectors of three floats, eight floats apart, from the fifth float on.
    const std::vector<float> floats = random_floats(40, 3);
    const Buffer<float> source(impl_of(device), floats);
    constexpr std::size_t k_count = 7, k_first = 2;
    const std::vector<cl_float4> poison(k_first + k_count + 1, cl_float4{{-9, -9, -9, -9}});
    Buffer<cl_float4> target(impl_of(device), poison);
    exchange.take({source.cl_buffer()(), 5, 8, 3, 2}, k_count, target, k_first);
    const std::vector<cl_float4> found = target.download();
    for (std::size_t i = 0; i < k_count; ++i) {
      CAPTURE(i);
      for (std::size_t k = 0; k < 3; ++k)
        CHECK(found[k_first + i].s[k] == floats[5 + i / 2 * 8 + i % 2 * 3 + k]);
      CHECK(found[k_first + i].s[3] == 0.0F);
    }
    CHECK(found[k_first - 1].s[0] == -9.0F);
    CHECK(found[k_first + k_count].s[0] == -9.0F);
  }

  TEST_CASE("exchange: some numbers of vectors become rows and come back") {
    const Device device = open_device();
    Exchange exchange(impl_of(device));
    constexpr std::size_t k_count = 7, k_first = 2, k_stride = 5;
    for (std::size_t components = 1; components <= 4; ++components) {
      CAPTURE(components);
      const std::vector<float> floats = random_floats(k_stride * k_count, 4);
      const Buffer<float> packed(impl_of(device), floats);
      Buffer<cl_float4> rows(impl_of(device),
                             std::vector<cl_float4>(k_first + k_count, cl_float4{{-9, -9, -9, -9}}));
      exchange.give({packed.cl_buffer()(), 1, k_stride, components}, k_count, vectors_of(rows, k_first, 4));
      const std::vector<cl_float4> found = rows.download();
      CHECK(found[k_first - 1].s[0] == -9.0F);
      for (std::size_t i = 0; i < k_count; ++i) {
        for (std::size_t k = 0; k < 4; ++k)
          CHECK(found[k_first + i].s[k] == (k < components ? floats[k_stride * i + 1 + k] : 0.0F));
      }
      Buffer<float> again(impl_of(device), std::vector<float>(floats.size(), -7));
      exchange.give(vectors_of(rows, k_first, 4), k_count, {again.cl_buffer()(), 1, k_stride, components});
      const std::vector<float> back = again.download();
      for (std::size_t i = 0; i < floats.size(); ++i) {
        const std::size_t place = i % k_stride;
        CHECK(back[i] == (place >= 1 && place <= components ? floats[i] : -7.0F));
      }
    }
  }

  TEST_CASE("exchange: what comes in is finite, what goes out is as it is") {
    const Device device = open_device();
    Exchange exchange(impl_of(device));
    const float infinite = std::numeric_limits<float>::infinity(), nan = std::nanf("");
    const std::vector<float> floats{1, infinite, nan, -infinite, 2, 3};
    const Buffer<float> source(impl_of(device), floats);
    Buffer<cl_float4> taken(impl_of(device), 2);
    exchange.take({source.cl_buffer()(), 0, 3, 3}, 2, taken, 0);
    CHECK(taken.download()[0].s[0] == 1.0F);
    CHECK(taken.download()[0].s[1] == 0.0F);
    CHECK(taken.download()[0].s[2] == 0.0F);
    CHECK(taken.download()[1].s[0] == 0.0F);
    Buffer<float> given(impl_of(device), 6);
    exchange.give(vectors_of(source, 0, 3), 2, vectors_of(given, 0, 3));
    CHECK(given.download()[1] == infinite);
    CHECK(std::isnan(given.download()[2]));
    Buffer<float> packed(impl_of(device), 6);
    exchange.take({source.cl_buffer()(), 0, 3, 3}, 2, packed, 3);
    CHECK(packed.download() == std::vector<float>{1, 0, 0, 0, 2, 3});
    // Integers keep every bit too: these are small numbers beyond floats', and one that is no number.
    const Buffer<cl_uint> integers(impl_of(device), std::vector<cl_uint>{5, 0xffffffffU, 0x7f800001U});
    Buffer<cl_uint> copied(impl_of(device), 3);
    exchange.give({integers.cl_buffer()(), 0, 1, 1}, 3, {copied.cl_buffer()(), 0, 1, 1});
    CHECK(copied.download() == integers.download());
  }

  TEST_CASE("exchange: cameras of matrices have the eye that the inverse gives") {
    const Device device = open_device();
    Exchange exchange(impl_of(device));
    const std::vector<float> matrices = random_floats(3 * 16, 9);
    const Buffer<float> source(impl_of(device), matrices);
    for (const bool orthographic : {false, true}) {
      shared::ViewParams before{};
      before.znear = 7.0F;
      Buffer<shared::ViewParams> cameras(impl_of(device), std::vector<shared::ViewParams>(3, before));
      exchange.take_cameras({source.cl_buffer()(), 0, 16, 4, 3}, 3, orthographic, cameras);
      const std::vector<shared::ViewParams> found = cameras.download();
      for (std::size_t v = 0; v < 3; ++v) {
        CAPTURE(v);
        glm::dmat4 view(1);
        for (int row = 0; row < 3; ++row) {
          for (int column = 0; column < 4; ++column) {
            const float value = matrices[16 * v + static_cast<std::size_t>(4 * row + column)];
            view[column][row] = static_cast<double>(value);
            CHECK(found[v].row[row].s[column] == value);
          }
        }
        const glm::dvec4 eye = glm::inverse(view)[orthographic ? 2 : 3];
        for (int axis = 0; axis < 3; ++axis)
          CHECK(static_cast<double>(found[v].eye.s[axis]) == doctest::Approx(eye[axis]).epsilon(1e-4));
        CHECK(found[v].eye.s[3] == (orthographic ? 0.0F : 1.0F));
        CHECK(found[v].znear == 7.0F);
      }
    }
  }

  TEST_CASE("exchange: numbers of sums are rounded once") {
    const Device device = open_device();
    Exchange exchange(impl_of(device));
    const std::vector<float> sums = random_floats(50, 5), factors = random_floats(60, 6);
    SparseMap map;
    std::vector<cl_uint> starts{0}, terms;
    for (cl_uint k = 0; k < factors.size(); ++k) terms.push_back(k * 7 % 50);
    for (const cl_uint length : {0U, 1U, 2U, 17U, 40U}) starts.push_back(starts.back() + length);
    map.numbers = starts.size() - 1;
    map.starts.upload(impl_of(device), starts);
    map.terms.upload(impl_of(device), terms);
    map.factors.upload(impl_of(device), factors);
    Buffer<float> numbers;
    exchange.map(map, Buffer<float>(impl_of(device), sums), numbers);
    const std::vector<float> found = numbers.download();
    REQUIRE(found.size() == map.numbers);
    for (std::size_t i = 0; i < map.numbers; ++i) {
      CAPTURE(i);
      double exact = 0;
      for (cl_uint k = starts[i]; k < starts[i + 1]; ++k)
        exact += static_cast<double>(factors[k]) * static_cast<double>(sums[terms[k]]);
      CHECK(std::abs(static_cast<double>(found[i]) - exact) <= std::abs(exact) * 6e-8);
    }
  }
}

}  // namespace exchange_test
