// Textures for the caller's own shading: against the double-precision reference, a function on a cube's faces,
// differences, and backward against forward mode.
#include "dpr/texture_map.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <vector>

#include "check/comparison.hpp"
#include "check/scenes.hpp"
#include "reference/texture.hpp"
#include "support/messages.hpp"

namespace texture_map_test {

using namespace dpr;

namespace {

constexpr int k_width = 7, k_height = 5;

std::vector<float> drawn(std::size_t count, float low, float high, unsigned seed) {
  check::Random random(seed);
  std::vector<float> numbers(count);
  for (float& number : numbers) number = random(low, high);
  return numbers;
}

reference::Texture to_reference(const Texture& texture) {
  reference::Texture result{texture.width, texture.height, check::to_reference(texture.texels)};
  result.wrap = static_cast<reference::Wrap>(texture.wrap);
  result.filter = static_cast<reference::Filter>(texture.filter);
  return result;
}

double dot(std::span<const float> a, std::span<const float> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0, std::plus<>(),
                            [](float x, float y) { return static_cast<double>(x) * static_cast<double>(y); });
}

double size_of(std::span<const float> a) { return std::sqrt(dot(a, a)); }

/// The singular value of a footprint in texels: the longest way that a pixel to the right and down can mean.
double longest(std::span<const float> steps, double width, double height) {
  const double ux = static_cast<double>(steps[0]) * width, uy = static_cast<double>(steps[1]) * width,
               vx = static_cast<double>(steps[2]) * height, vy = static_cast<double>(steps[3]) * height;
  const double trace = ux * ux + uy * uy + vx * vx + vy * vy, determinant = ux * vy - uy * vx;
  return std::sqrt(0.5 * (trace + std::sqrt(std::max(trace * trace - 4 * determinant * determinant, 0.0))));
}

/// A smooth function of directions.
std::array<double, 2> shown(const glm::dvec3& direction) {
  const glm::dvec3 d = glm::normalize(direction);
  return {0.5 + 0.3 * d.x - 0.2 * d.y + 0.4 * d.z, d.x * d.y + 0.5 * d.z * d.z};
}

/// A cube map of that, by OpenGL's table of faces.
std::vector<float> cube_texels(int side) {
  std::vector<float> texels;
  for (int face = 0; face < 6; ++face) {
    for (int row = 0; row < side; ++row) {
      for (int column = 0; column < side; ++column) {
        const double s = 2 * (column + 0.5) / side - 1, t = 2 * (row + 0.5) / side - 1;
        const std::array<glm::dvec3, 6> directions{
            {{1, -t, -s}, {-1, -t, s}, {s, 1, t}, {s, -1, -t}, {s, -t, 1}, {-s, -t, -1}}};
        for (const double number : shown(directions[static_cast<std::size_t>(face)]))
          texels.push_back(static_cast<float>(number));
      }
    }
  }
  return texels;
}

/// Numbers of places that lie in no texel's middle line, where bilinear values have kinks.
struct Places {
  std::vector<float> coordinates, steps, levels;

  TexturePlaces view() const { return {coordinates, steps, levels}; }
};

Places places_in_texels(std::size_t count) {
  check::Random random(5);
  Places places;
  for (std::size_t i = 0; i < count; ++i) {
    for (const int size : {k_width, k_height})
      places.coordinates.push_back((std::floor(random(-7, 14)) + random(0.6F, 0.9F)) /
                                   static_cast<float>(size));
  }
  places.steps = drawn(4 * count, -0.3F, 0.3F, 6);
  places.levels = drawn(count, -0.2F, 0.2F, 7);
  return places;
}

/// Backward against forward mode, and forward mode against differences.
void check_derivatives(const std::function<TextureMap(std::vector<float>)>& make,
                       const std::vector<float>& texels, const Places& at) {
  const TextureMap map = make(texels);
  const std::vector<float> values = map.values(at.view());
  const std::vector<float> weights = drawn(values.size(), -1, 1, 11);
  const TextureMapGradient found = map.backward(at.view(), weights);
  const auto along = [](const std::vector<float>& like, unsigned seed) {
    return drawn(like.size(), -1, 1, seed);
  };
  const Places moves{along(at.coordinates, 12), along(at.steps, 13), along(at.levels, 14)};
  const std::vector<float> texel_moves = along(texels, 15);
  const std::vector<float> tangent = map.tangent(at.view(), moves.view(), texel_moves);
  const double backward = dot(found.texels, texel_moves) + dot(found.coordinates, moves.coordinates) +
                          dot(found.steps, moves.steps) + dot(found.levels, moves.levels);
  CHECK(std::abs(dot(weights, tangent) - backward) <= 1e-5 * size_of(weights) * size_of(tangent));

  const auto moved = [](const std::vector<float>& from, const std::vector<float>& by, float step) {
    std::vector<float> to = from;
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += step * by[i];
    return to;
  };
  constexpr float k_step = 1e-3F;
  const auto values_at = [&](float step) {
    const Places there{moved(at.coordinates, moves.coordinates, step), moved(at.steps, moves.steps, step),
                       moved(at.levels, moves.levels, step)};
    return make(moved(texels, texel_moves, step)).values(there.view());
  };
  const std::vector<float> ahead = values_at(k_step);
  const std::vector<float> behind = values_at(-k_step);
  // Some cross the middle of a smaller version's texels, where values have kinks.
  std::size_t wrong = 0;
  const double bound = 1e-2 * size_of(tangent) / std::sqrt(static_cast<double>(tangent.size()));
  for (std::size_t i = 0; i < ahead.size(); ++i) {
    const float change = (ahead[i] - behind[i]) / (2 * k_step);
    wrong += std::abs(static_cast<double>(change - tangent[i])) > bound;
  }
  CHECK(wrong <= tangent.size() / 20);
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("texture maps read what the reference does") {
    const std::vector<float> coordinates = drawn(200, -3, 4, 1), levels = drawn(100, -1, 4, 2);
    for (const Wrap wrap : {Wrap::repeat, Wrap::mirror, Wrap::clamp}) {
      for (const Filter filter : {Filter::nearest, Filter::bilinear, Filter::trilinear}) {
        Texture texture = check::random_texture(k_width, k_height, wrap, filter);
        texture.opacities = drawn(texture.texels.size(), 0, 1, 3);
        const TextureMap map(texture);
        REQUIRE(map.channels() == 4);
        const std::vector<float> values = map.values({.coordinates = coordinates, .levels = levels});
        reference::Texture expected = to_reference(texture), alpha = expected;
        for (std::size_t i = 0; i < texture.opacities.size(); ++i)
          alpha.texels[i] = check::to_reference(glm::vec3(texture.opacities[i]));
        double worst = 0;
        for (std::size_t i = 0; i < levels.size(); ++i) {
          const reference::Vec2d uv{coordinates[2 * i], coordinates[2 * i + 1]};
          const double level = filter == Filter::trilinear ? static_cast<double>(levels[i]) : 0.0;
          const reference::Vec3d rgb = sample_pyramid(expected, uv, level),
                                 a = sample_pyramid(alpha, uv, level);
          const std::array<double, 4> wanted{rgb.x, rgb.y, rgb.z, a.x};
          for (std::size_t c = 0; c < 4; ++c)
            worst = std::max(worst, std::abs(static_cast<double>(values[4 * i + c]) - wanted[c]));
        }
        CAPTURE(static_cast<int>(wrap));
        CAPTURE(static_cast<int>(filter));
        CHECK(worst < 2e-5);
      }
    }
  }

  TEST_CASE("levels by the longest way over texels that a pixel can mean") {
    const Texture texture = check::random_texture(16, 8, Wrap::repeat, Filter::trilinear);
    const TextureMap map(texture);
    const std::vector<float> coordinates = drawn(120, 0, 1, 1), steps = drawn(240, -0.3F, 0.3F, 2),
                             more = drawn(60, -1, 1, 3);
    for (const bool has_levels : {false, true}) {
      const std::vector<float> values = map.values(
          {coordinates, steps, has_levels ? std::span<const float>(more) : std::span<const float>()});
      double worst = 0;
      for (std::size_t i = 0; i < more.size(); ++i) {
        const double level = std::log2(longest(std::span(steps).subspan(4 * i, 4), 16, 8)) +
                             (has_levels ? static_cast<double>(more[i]) : 0);
        const reference::Vec3d wanted = sample_pyramid(
            to_reference(texture), {coordinates[2 * i], coordinates[2 * i + 1]}, std::max(level, 0.0));
        worst = std::max(worst, std::abs(static_cast<double>(values[3 * i]) - wanted.x));
      }
      CHECK(worst < 2e-5);
    }
    // Neither no step at all nor one of 1e30 textures is out of numbers.
    const std::vector<float> at{0.3F, 0.4F, 0.3F, 0.4F}, wild{0, 0, 0, 0, 1e30F, -1e30F, 1e30F, 1e30F};
    const std::vector<float> ends = map.values({at, wild});
    const reference::Vec3d sharp = sample_texture(to_reference(texture), {0.3, 0.4}).color,
                           mean = sample_pyramid(to_reference(texture), {0.3, 0.4}, 9);
    CHECK(static_cast<double>(ends[0]) == doctest::Approx(sharp.x).epsilon(1e-5));
    CHECK(static_cast<double>(ends[3]) == doctest::Approx(mean.x).epsilon(1e-5));
    const TextureMapGradient none = map.backward({at, wild}, std::vector<float>(6, 1.0F));
    for (const float number : none.steps) CHECK(number == 0);
  }

  TEST_CASE("cube maps go on beyond the borders of their faces") {
    constexpr int k_side = 32;
    for (const Filter filter : {Filter::nearest, Filter::bilinear}) {
      const TextureMap map = TextureMap::cube(cube_texels(k_side), k_side, filter);
      check::Random random(4);
      std::vector<float> directions;
      for (int i = 0; i < 400; ++i) {
        glm::vec3 d = random.vector(-1, 1);
        if (i % 2 == 0) d /= std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
        if (i % 4 == 0) d[i / 4 % 3] = 0.995F;                                     // by an edge
        if (i % 8 == 0) d = glm::sign(d) * (1.0F + 0.01F * random.vector(-1, 1));  // by a corner
        for (int k = 0; k < 3; ++k) directions.push_back(d[k]);
      }
      const std::vector<float> values = map.values({.coordinates = directions});
      double worst = 0;
      for (std::size_t i = 0; i < values.size() / 2; ++i) {
        const auto wanted = shown({directions[3 * i], directions[3 * i + 1], directions[3 * i + 2]});
        for (std::size_t c = 0; c < 2; ++c)
          worst = std::max(worst, std::abs(static_cast<double>(values[2 * i + c]) - wanted[c]));
      }
      CHECK(worst < (filter == Filter::nearest ? 0.08 : 0.01));
    }
  }

  TEST_CASE("derivatives of texture maps") {
    const Places at = places_in_texels(60);
    const std::vector<float> texels = drawn(2 * k_width * k_height, 0, 1, 9);
    for (const Wrap wrap : {Wrap::repeat, Wrap::mirror, Wrap::clamp}) {
      for (const Filter filter : {Filter::nearest, Filter::bilinear, Filter::trilinear}) {
        CAPTURE(static_cast<int>(wrap));
        CAPTURE(static_cast<int>(filter));
        const auto make = [&](std::vector<float> from) {
          return TextureMap(std::move(from), k_width, k_height, wrap, filter);
        };
        check_derivatives(make, texels, {at.coordinates, {}, {}});
        if (filter != Filter::trilinear) continue;
        check_derivatives(make, texels, {at.coordinates, {}, drawn(60, 0.2F, 0.8F, 8)});
        check_derivatives(make, texels,
                          {at.coordinates, drawn(240, 0.02F, 0.05F, 8), drawn(60, 1.2F, 1.4F, 8)});
      }
    }
    constexpr int k_side = 4;
    check::Random random(2);
    Places directions{{}, drawn(60 * 6, -0.1F, 0.1F, 3), drawn(60, 0.9F, 1.1F, 4)};
    for (int i = 0; i < 60; ++i) {  // within a texel
      glm::vec3 d{1, (std::floor(random(-2, 2)) + random(0.6F, 0.9F)) / 2,
                  (std::floor(random(-2, 2)) + random(0.6F, 0.9F)) / 2};
      d = random(0.5F, 2) * (i % 2 == 0 ? d : glm::vec3(d.y, d.z, -1));
      for (int k = 0; k < 3; ++k) directions.coordinates.push_back(d[k]);
    }
    for (const Filter filter : {Filter::nearest, Filter::bilinear, Filter::trilinear}) {
      CAPTURE(static_cast<int>(filter));
      const auto make = [&](std::vector<float> from) {
        return TextureMap::cube(std::move(from), k_side, filter);
      };
      const std::vector<float> of_cube = drawn(6 * k_side * k_side, 0, 1, 9);
      check_derivatives(make, of_cube, {directions.coordinates, {}, {}});
      if (filter == Filter::nearest) continue;
      const std::vector<float> ahead{0.5F, 0.3F, 1}, one(1, 1.0F);
      const std::vector<float> unit = make(of_cube).backward({.coordinates = ahead}, one).coordinates;
      for (const float length : {1e-25F, 1e25F}) {  // whose squares are no numbers
        std::vector<float> far = ahead;
        for (float& number : far) number *= length;
        const std::vector<float> found = make(of_cube).backward({.coordinates = far}, one).coordinates;
        for (std::size_t i = 0; i < 3; ++i)
          CHECK(found[i] * length == doctest::Approx(unit[i]).epsilon(1e-4));
      }
      if (filter == Filter::trilinear) check_derivatives(make, of_cube, directions);
    }
  }

  TEST_CASE("what texture maps refuse") {
    const auto map_of = [](std::size_t numbers, int width, int height) {
      return TextureMap(std::vector<float>(numbers), width, height, Wrap::repeat, Filter::bilinear);
    };
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, map_of(5, 2, 2), "texels (texture map): got 5 numbers");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, map_of(0, 2, 2), "texels (texture map)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, map_of(4, 0, 4), "size (texture map)");
    const TextureMap map = map_of(4, 2, 2);
    const std::vector<float> odd(3), bad{0, std::numeric_limits<float>::infinity()}, good(2);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, map.values({.coordinates = odd}), "coordinates (texture map)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, map.values({.coordinates = bad}), "coordinates (texture map)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, map.values({.coordinates = good, .steps = odd}),
                          "steps (texture map)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, map.backward({.coordinates = good}, odd), "grad_values");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, map.tangent({.coordinates = good}, {.coordinates = odd}),
                          "tangents");
    CHECK(map.values({}).empty());
  }
}

}  // namespace texture_map_test
