// The table of gradients: whether every number of a gradient is in it once, and every word of a request has
// rows.
#include <doctest/doctest.h>

#include <algorithm>
#include <set>
#include <string>

#include "scene/gradient_table.hpp"
#include "support/messages.hpp"

namespace gradient_table_test {

using namespace dpr;

namespace {

/// Two views of two meshes, two point lights, three directional ones, one spot, and an environment.
SceneGradient sample_gradient() {
  SceneGradient gradient;
  gradient.meshes = {{std::vector<glm::vec3>(3),
                      std::vector<glm::vec3>(2),
                      std::vector<glm::vec2>(5),
                      {std::vector<glm::vec3>(6), std::vector<glm::vec3>(1)}},
                     {std::vector<glm::vec3>(4), {}, {}, {}}};
  gradient.shapes = {std::vector<glm::vec3>(5), std::vector<glm::vec3>(1)};
  gradient.lights.resize(2);
  gradient.directional.resize(3);
  gradient.spot.resize(1);
  gradient.harmonics.resize(k_harmonics);
  gradient.views.resize(2);
  for (ViewGradient& view : gradient.views) view.transforms.resize(2);
  return gradient;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("adding gradients: lights that one of them lacks count as 0, whichever it is") {
    SceneGradient lit = sample_gradient();
    double count = 0;
    transform_numbers(lit, [&](double) { return ++count; });
    SceneGradient unlit = sample_gradient();
    unlit.lights.clear();
    unlit.directional.clear();
    unlit.spot.clear();
    unlit.harmonics.clear();
    SceneGradient sum = unlit, other = lit;
    add(sum, lit);
    add(other, unlit);
    for (SceneGradient* found : {&sum, &other}) {
      REQUIRE(found->spot.size() == 1);
      double expected = 0;
      transform_numbers(*found, [&](double value) {
        CHECK(value == ++expected);
        return value;
      });
      CHECK(expected == count);
    }
    add(sum, lit);
    CHECK(sum.spot[0].position.x == 2 * lit.spot[0].position.x);
    CHECK(sum.harmonics[1].z == 2 * lit.harmonics[1].z);
  }

  TEST_CASE("adding gradients: what cannot be added leaves the sum as it was") {
    SceneGradient sum = sample_gradient(), ones = sample_gradient();
    transform_numbers(ones, [](double) { return 1.0; });
    ones.harmonics.pop_back();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, add(sum, ones), "gradient (add)");
    ones.harmonics.emplace_back(1.0F);
    ones.spot.resize(2);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, add(sum, ones), "lights.spot");
    transform_numbers(sum, [](double value) {
      CHECK(value == 0);
      return value;
    });
  }

  TEST_CASE("gradient table: every number is visited once, whatever it belongs to") {
    SceneGradient gradient = sample_gradient();
    double count = 0;
    transform_numbers(gradient, [&](double value) {
      CHECK(value == 0);  // visited before, it would hold its number
      return ++count;
    });
    constexpr int k_meshes = 3 * (3 + 2 + 4) + 2 * 5 + 3 * (6 + 1), k_shapes = 3 * (5 + 1),
                  k_lights = 3 + 3 * 9 + (2 + 3) * 9 + 14;
    constexpr int k_views = 2 * (6 + 1 + 4 + 1 + 5 + 4 + 2 * 6), k_rest = 3 + 3;
    CHECK(count == k_meshes + k_shapes + k_lights + k_views + k_rest);
    CHECK(gradient.meshes[0].texcoords[4].y != 0);
    CHECK(gradient.meshes[0].textures[1][0].z != 0);
    CHECK(gradient.views[1].transforms[1].translation.z != 0);
    CHECK(gradient.views[0].camera.intrinsics[3] != 0);
  }

  TEST_CASE("gradient table: names are different, and every request has rows") {
    SceneGradient gradient = sample_gradient();
    std::set<std::string> names;
    std::size_t arrays = 0;
    for_each_array(gradient, [&](const GradientRow& row, GradientIndex index, const GradientArray&) {
      names.insert(name_of(row, index));
      ++arrays;
    });
    CHECK(names.size() == arrays);
    CHECK(names.contains("views[1].meshes[0].rotation"));
    CHECK(names.contains("lights.point[1].diffuse"));
    CHECK(names.contains("lights.directional[2].direction"));
    CHECK(names.contains("lights.spot[0].inner_angle_degrees"));
    CHECK(names.contains("lights.harmonics"));
    CHECK_FALSE(names.contains("lights.spot[1].position"));
    CHECK_FALSE(names.contains("meshes[2].positions"));
    for (const GradientName& name : gradient_names()) {
      CAPTURE(name.word);
      CHECK(std::ranges::any_of(gradient_rows(),
                                [&](const GradientRow& row) { return row.wanted == name.wanted; }));
      const GradientRequest none = no_gradients();
      CHECK_FALSE(none.*name.wanted);
    }
  }
}

}  // namespace gradient_table_test
