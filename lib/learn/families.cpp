// The families. Lengths are relative: the finished object is scaled. No part is much thinner than a voxel.
#include "learn/families.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "dpr/error.hpp"
#include "learn/draw.hpp"
#include "learn/solids.hpp"

namespace dpr::learn {
namespace {

/// Four legs under a rectangle of half extents x, z, from the floor at 0 to `height`.
void add_legs(Solids& solids, float x, float z, float height, float thickness, bool is_round,
              const glm::vec3& color) {
  for (const float sx : {-1.0F, 1.0F}) {
    for (const float sz : {-1.0F, 1.0F}) {
      const glm::vec3 center(sx * (x - thickness), height / 2, sz * (z - thickness));
      if (is_round) {
        solids.cylinder(Axis::y, center, height / 2, thickness, color);
      } else {
        solids.box(center, {thickness, height / 2, thickness}, color);
      }
    }
  }
}

Solids airplane(Draw& draw) {
  Solids s;
  const glm::vec3 body = draw.grey(0.6F, 0.95F), trim = draw.color();
  const float length = 1, radius = draw.between(0.06F, 0.1F), span = draw.between(0.38F, 0.55F);
  const Section fuselage[] = {{-length / 2, {0, radius * 0.4F}, glm::vec2(radius * 0.3F)},
                              {-length * 0.25F, {0, 0}, glm::vec2(radius)},
                              {length * 0.3F, {0, 0}, glm::vec2(radius)},
                              {length * 0.43F, {0, -radius * 0.1F}, glm::vec2(radius * 0.75F)},
                              {length / 2, {0, -radius * 0.2F}, glm::vec2(radius * 0.25F)}};
  s.loft(Axis::z, fuselage, 12, body);
  const float sweep = draw.between(0.02F, 0.2F), chord = draw.between(0.09F, 0.15F),
              height = draw.between(-0.04F, 0.06F);
  const float rise = draw.between(0, 0.06F), wing = 0.028F;
  const Section wings[] = {{-span, {height + rise, -sweep}, {wing * 0.7F, chord * 0.4F}},
                           {0, {height, 0.05F}, {wing, chord}},
                           {span, {height + rise, -sweep}, {wing * 0.7F, chord * 0.4F}}};
  s.loft(Axis::x, wings, 4, trim);
  const float tail = span * draw.between(0.3F, 0.45F), fin = draw.between(0.13F, 0.22F);
  const bool is_high = draw.chance(0.3F);
  const float tail_height = is_high ? fin : radius * 0.5F;
  const Section tailplane[] = {{-tail, {tail_height, -0.46F}, {0.02F, 0.035F}},
                               {0, {tail_height, -0.42F}, {0.025F, 0.07F}},
                               {tail, {tail_height, -0.46F}, {0.02F, 0.035F}}};
  s.loft(Axis::x, tailplane, 4, trim);
  const Section rudder[] = {{0, {0, -0.4F}, {0.025F, 0.09F}}, {fin, {0, -0.45F}, {0.02F, 0.05F}}};
  s.loft(Axis::y, rudder, 4, trim);
  const int engines = draw.integer(0, 2);
  for (int e = 0; e < engines; ++e) {
    const float x = span * (0.35F + 0.3F * static_cast<float>(e)), z = 0.1F - sweep * x / span;
    for (const float side : {-1.0F, 1.0F}) {
      s.cylinder(Axis::z, {side * x, height - 0.045F, z}, 0.075F, 0.035F, draw.grey(0.3F, 0.5F));
    }
  }
  return s;
}

Solids bench(Draw& draw) {
  Solids s;
  const glm::vec3 seat = draw.chance(0.6F) ? draw.wood() : draw.color(), frame = draw.grey(0.2F, 0.5F);
  const float x = 0.5F, z = draw.between(0.12F, 0.2F), height = draw.between(0.2F, 0.3F), thickness = 0.03F;
  s.box({0, height, 0}, {x, thickness, z}, seat);
  if (draw.chance(0.5F)) {
    const bool round_legs = draw.chance(0.4F);
    const float width = draw.between(0.025F, 0.04F);
    add_legs(s, x * 0.95F, z, height, width, round_legs, frame);
  } else {
    const float inset = draw.between(0.6F, 0.9F) * x;
    for (const float side : {-inset, inset})
      s.box({side, height / 2, 0}, {0.04F, height / 2, z * 0.9F}, frame);
  }
  if (draw.chance(0.6F)) {
    const float back = draw.between(0.15F, 0.3F);
    s.box({0, height + thickness + back / 2, -z + thickness}, {x, back / 2, thickness}, seat);
    if (draw.chance(0.5F)) {
      for (const float side : {-x + 0.03F, x - 0.03F}) {
        s.box({side, height + 0.1F, 0}, {0.03F, 0.1F, z}, frame);
      }
    }
  }
  return s;
}

Solids dresser(Draw& draw) {
  Solids s;
  const glm::vec3 body = draw.chance(0.7F) ? draw.wood() : draw.color();
  const glm::vec3 front = glm::clamp(body * draw.between(1.1F, 1.5F), 0.0F, 1.0F),
                  knob = draw.grey(0.15F, 0.4F);
  const float x = draw.between(0.25F, 0.5F), y = draw.between(0.25F, 0.5F), z = draw.between(0.15F, 0.28F);
  const float legs = draw.chance(0.5F) ? draw.between(0.05F, 0.12F) : 0;
  if (legs > 0) add_legs(s, x, z, legs + 0.02F, 0.035F, draw.chance(0.5F), knob);
  s.box({0, legs + y, 0}, {x, y, z}, body);
  const int rows = draw.integer(1, 4), columns = draw.integer(1, 2);
  const float height = 2 * y / static_cast<float>(rows), width = 2 * x / static_cast<float>(columns);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const glm::vec3 center(-x + width * (static_cast<float>(c) + 0.5F),
                             legs + height * (static_cast<float>(r) + 0.5F), z);
      s.box(center, {width * 0.44F, height * 0.42F, 0.012F}, front);
      s.box(center + glm::vec3(0, 0, 0.02F), {0.03F, 0.015F, 0.012F}, knob);
    }
  }
  return s;
}

Solids car(Draw& draw) {
  Solids s;
  const glm::vec3 paint = draw.color(), glass(0.15F, 0.2F, 0.25F);
  const float x = draw.between(0.18F, 0.23F), length = 0.5F, belt = draw.between(0.16F, 0.22F);
  const float wheel = draw.between(0.065F, 0.09F), floor = wheel * 0.8F, hood = draw.between(0.75F, 0.95F);
  const float middle = (floor + belt) / 2, half = (belt - floor) / 2;
  const Section body[] = {{-length, {0, middle}, {x * 0.92F, half * 0.8F}},
                          {-length * 0.8F, {0, middle}, {x, half}},
                          {length * 0.4F, {0, middle}, {x, half}},
                          {length, {0, middle - half * (1 - hood)}, {x * 0.9F, half * hood * 0.85F}}};
  s.loft(Axis::z, body, 4, paint);
  const float roof = draw.between(0.1F, 0.2F), back = draw.between(-0.48F, -0.25F),
              front = draw.between(0.1F, 0.3F);
  const float slant = draw.between(0.04F, 0.15F);
  const float low = (front + back) / 2, high = low - slant * 0.3F;
  const Section cabin[] = {{belt - 0.02F, {0, low}, {x * 0.93F, (front - back) / 2}},
                           {belt + roof, {0, high}, {x * 0.78F, (front - back) / 2 - slant}}};
  s.loft(Axis::y, cabin, 4, glass);
  s.box({0, belt + roof, high}, {x * 0.78F, 0.02F, (front - back) / 2 - slant}, paint);
  for (const float z : {-length * 0.6F, length * 0.62F}) {
    for (const float side : {-1.0F, 1.0F}) {
      s.cylinder(Axis::x, {side * (x - 0.02F), wheel, z}, 0.035F, wheel, draw.grey(0.1F, 0.2F));
    }
  }
  return s;
}

Solids chair(Draw& draw) {
  Solids s;
  const glm::vec3 seat = draw.color(), frame = draw.chance(0.5F) ? draw.wood() : draw.grey(0.2F, 0.6F);
  const float x = draw.between(0.2F, 0.26F), z = draw.between(0.2F, 0.26F),
              height = draw.between(0.35F, 0.48F);
  const float thickness = draw.between(0.03F, 0.06F), back = draw.between(0.35F, 0.55F);
  s.box({0, height, 0}, {x, thickness, z}, seat);
  const float lean = draw.between(0, 0.08F), top = draw.between(0.7F, 1.0F);
  const Section rest[] = {{height, {0, -z + 0.03F}, {x, 0.03F}},
                          {height + thickness + back, {0, -z + 0.03F - lean}, {x * top, 0.028F}}};
  s.loft(Axis::y, rest, 4, draw.chance(0.5F) ? seat : frame);
  if (draw.chance(0.8F)) {
    const bool round_legs = draw.chance(0.5F);
    const float width = draw.between(0.025F, 0.035F);
    add_legs(s, x, z, height, width, round_legs, frame);
  } else {
    s.cylinder(Axis::y, {0, height / 2, 0}, height / 2, 0.035F, frame);
    s.cylinder(Axis::y, {0, 0.03F, 0}, 0.03F, x * 0.9F, frame);
  }
  if (draw.chance(0.35F)) {
    for (const float side : {-x + 0.025F, x - 0.025F}) {
      s.box({side, height + 0.18F, 0}, {0.025F, 0.025F, z}, frame);
      s.box({side, height + 0.09F, z - 0.03F}, {0.025F, 0.09F, 0.025F}, frame);
    }
  }
  return s;
}

Solids display(Draw& draw) {
  Solids s;
  const glm::vec3 frame = draw.grey(0.15F, 0.75F), panel = 0.6F * draw.color();
  const float x = 0.5F, y = draw.between(0.28F, 0.38F), depth = draw.between(0.03F, 0.09F);
  const float neck = draw.between(0.05F, 0.15F), floor = y + neck;
  s.box({0, floor, 0}, {x, y, depth}, frame);
  s.box({0, floor, depth}, {x * 0.92F, y * 0.88F, 0.012F}, panel);
  const float width = draw.between(0.04F, 0.1F);
  s.box({0, (neck + y * 0.3F) / 2, -depth * 0.5F}, {width, (neck + y * 0.3F) / 2, 0.035F}, frame);
  if (draw.chance(0.5F)) {
    s.box({0, 0.015F, 0}, {draw.between(0.15F, 0.3F), 0.025F, draw.between(0.1F, 0.16F)}, frame);
  } else {
    s.cylinder(Axis::y, {0, 0.015F, 0}, 0.025F, draw.between(0.13F, 0.19F), frame);
  }
  return s;
}

Solids lamp(Draw& draw) {
  Solids s;
  const glm::vec3 shade = draw.color(), pole = draw.grey(0.2F, 0.6F);
  const float height = draw.between(0.45F, 0.8F), low = draw.between(0.13F, 0.24F),
              high = draw.between(0.07F, 0.14F);
  const float tall = draw.between(0.16F, 0.3F);
  const Section cone[] = {{height, {0, 0}, glm::vec2(low)}, {height + tall, {0, 0}, glm::vec2(high)}};
  s.loft(Axis::y, cone, draw.chance(0.75F) ? 16 : 4, shade);
  if (draw.chance(0.4F)) {
    const glm::vec3 body = draw.color();
    const float wide = draw.between(0.08F, 0.13F), deep = draw.between(0.08F, 0.13F);
    s.ellipsoid({0, height * 0.4F, 0}, {wide, height * 0.4F, deep}, body);
  }
  s.cylinder(Axis::y, {0, height / 2, 0}, height / 2 + 0.02F, draw.between(0.025F, 0.035F), pole);
  s.cylinder(Axis::y, {0, 0.025F, 0}, 0.025F, draw.between(0.1F, 0.17F), pole);
  return s;
}

Solids speaker(Draw& draw) {
  Solids s;
  const glm::vec3 body = draw.chance(0.5F) ? draw.wood() : draw.grey(0.15F, 0.5F),
                  cone = draw.grey(0.1F, 0.85F);
  const float x = draw.between(0.14F, 0.24F), y = draw.between(0.3F, 0.5F), z = draw.between(0.14F, 0.25F);
  s.box({0, y, 0}, {x, y, z}, body);
  const int cones = draw.integer(1, 3);
  for (int i = 0; i < cones; ++i) {
    const float room = 2 * y / static_cast<float>(cones);
    const float radius = std::min(x, room / 2) * (i == 0 ? 0.85F : draw.between(0.45F, 0.8F));
    s.cylinder(Axis::z, {0, room * (static_cast<float>(i) + 0.5F), z}, 0.02F, radius, cone);
    s.cylinder(Axis::z, {0, room * (static_cast<float>(i) + 0.5F), z}, 0.03F, radius * 0.35F, body * 0.5F);
  }
  if (draw.chance(0.3F)) s.box({0, 0.0F, 0}, {x * 1.2F, 0.025F, z * 1.2F}, draw.grey(0.1F, 0.3F));
  return s;
}

Solids rifle(Draw& draw) {
  Solids s;
  const glm::vec3 metal = draw.grey(0.15F, 0.4F), grip = draw.chance(0.7F) ? draw.wood() : metal;
  const float barrel = draw.between(0.3F, 0.5F);
  s.box({0, 0, 0}, {0.032F, 0.05F, 0.18F}, metal);
  s.cylinder(Axis::z, {0, 0.015F, 0.15F + barrel / 2}, barrel / 2 + 0.03F, 0.026F, metal);
  if (draw.chance(0.6F)) s.box({0, -0.01F, 0.26F}, {0.035F, 0.04F, 0.13F}, grip);
  const float butt = draw.between(0.25F, 0.38F), drop = draw.between(0.02F, 0.08F);
  const Section stock[] = {{-0.16F - butt, {0, -drop}, {0.028F, draw.between(0.06F, 0.09F)}},
                           {-0.16F, {0, -0.01F}, {0.028F, 0.04F}}};
  s.loft(Axis::z, stock, 4, grip);
  s.box({0, -0.09F, -0.12F}, {0.028F, 0.06F, 0.035F}, grip);
  if (draw.chance(0.7F)) {
    const float magazine = draw.between(0.05F, 0.1F);
    s.box({0, -0.05F - magazine, 0.08F}, {0.028F, magazine, 0.045F}, metal);
  }
  if (draw.chance(0.5F)) s.cylinder(Axis::z, {0, 0.085F, 0}, draw.between(0.08F, 0.14F), 0.03F, metal * 0.7F);
  return s;
}

Solids sofa(Draw& draw) {
  Solids s;
  const glm::vec3 cloth = draw.color(), cushion = glm::clamp(cloth * draw.between(1.05F, 1.4F), 0.0F, 1.0F);
  const float x = 0.5F, z = draw.between(0.2F, 0.26F), seat = draw.between(0.1F, 0.15F),
              back = draw.between(0.14F, 0.25F);
  const float arm = draw.between(0.05F, 0.09F), feet = draw.between(0.02F, 0.06F);
  add_legs(s, x, z, feet + 0.02F, 0.04F, false, draw.grey(0.1F, 0.3F));
  s.box({0, feet + seat / 2, 0}, {x, seat / 2, z}, cloth);
  s.box({0, feet + (seat + back) / 2, -z + 0.06F}, {x, (seat + back) / 2, 0.06F}, cloth);
  if (draw.chance(0.85F)) {
    const float height = seat + back * draw.between(0.3F, 0.7F);
    for (const float side : {-x + arm, x - arm})
      s.box({side, feet + height / 2, 0}, {arm, height / 2, z}, cloth);
  }
  const int cushions = draw.integer(2, 3);
  const float room = 2 * (x - 2 * arm) / static_cast<float>(cushions);
  for (int i = 0; i < cushions; ++i) {
    const float center = -(x - 2 * arm) + room * (static_cast<float>(i) + 0.5F);
    s.box({center, feet + seat + 0.02F, 0.06F}, {room * 0.47F, 0.035F, z - 0.07F}, cushion);
  }
  if (draw.chance(0.25F)) s.box({x - 0.15F, feet + seat / 2, z + 0.12F}, {0.15F, seat / 2, 0.13F}, cloth);
  return s;
}

Solids table(Draw& draw) {
  Solids s;
  const glm::vec3 top = draw.chance(0.6F) ? draw.wood() : draw.color(),
                  legs = draw.chance(0.5F) ? top * 0.7F : draw.grey(0.2F, 0.6F);
  const float height = draw.between(0.25F, 0.5F), x = draw.between(0.35F, 0.5F),
              z = draw.between(0.25F, 0.4F);
  const float thickness = draw.between(0.022F, 0.04F);
  const bool is_round = draw.chance(0.3F);
  if (is_round) {
    s.cylinder(Axis::y, {0, height, 0}, thickness, x, top);
  } else {
    s.box({0, height, 0}, {x, thickness, z}, top);
  }
  if (is_round && draw.chance(0.6F)) {
    s.cylinder(Axis::y, {0, height / 2, 0}, height / 2, draw.between(0.03F, 0.06F), legs);
    s.cylinder(Axis::y, {0, 0.025F, 0}, 0.025F, x * draw.between(0.4F, 0.6F), legs);
    return s;
  }
  const float inset = is_round ? 0.65F : 0.95F;
  const bool round_legs = draw.chance(0.4F);
  const float width = draw.between(0.025F, 0.04F);
  add_legs(s, x * inset, (is_round ? x : z) * inset, height, width, round_legs, legs);
  if (!is_round && draw.chance(0.3F)) s.box({0, height * 0.35F, 0}, {x * 0.9F, 0.025F, z * 0.9F}, legs);
  return s;
}

Solids phone(Draw& draw) {
  Solids s;
  const glm::vec3 body = draw.chance(0.5F) ? draw.grey(0.1F, 0.85F) : draw.color(),
                  screen = 0.5F * draw.color();
  const float x = draw.between(0.2F, 0.27F), y = 0.5F, z = draw.between(0.03F, 0.08F);
  s.box({0, 0, 0}, {x, y, z}, body);
  const bool has_keys = draw.chance(0.5F);
  const float low = has_keys ? draw.between(-0.05F, 0.1F) : -0.38F;
  s.box({0, (low + 0.42F) / 2, z}, {x * 0.85F, (0.42F - low) / 2, 0.012F}, screen);
  if (has_keys) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        s.box({x * 0.55F * static_cast<float>(column - 1), low - 0.1F - 0.12F * static_cast<float>(row), z},
              {x * 0.2F, 0.04F, 0.015F}, draw.grey(0.6F, 0.7F));
      }
    }
  }
  if (draw.chance(0.25F)) s.cylinder(Axis::y, {x * 0.7F, y + 0.05F, 0}, 0.06F, 0.028F, body);
  return s;
}

Solids vessel(Draw& draw) {
  Solids s;
  const glm::vec3 hull = draw.color(), deck = draw.grey(0.6F, 0.95F);
  const float x = draw.between(0.1F, 0.16F), depth = draw.between(0.06F, 0.1F),
              bow = draw.between(0.2F, 0.35F);
  const Section body[] = {{-0.5F, {0, 0}, {x * 0.8F, depth * 0.8F}},
                          {-0.3F, {0, 0}, {x, depth}},
                          {0.5F - bow, {0, 0}, {x, depth}},
                          {0.5F, {0, depth * 0.35F}, {x * 0.12F, depth * 0.7F}}};
  s.loft(Axis::z, body, draw.chance(0.5F) ? 4 : 12, hull);
  const float first = draw.between(-0.3F, 0.05F), height = draw.between(0.05F, 0.12F),
              half = draw.between(0.1F, 0.2F);
  s.box({0, depth + height / 2, first}, {x * 0.7F, height / 2 + 0.02F, half}, deck);
  if (draw.chance(0.6F))
    s.box({0, depth + height + 0.04F, first}, {x * 0.5F, 0.05F, half * 0.6F}, deck * 0.85F);
  if (draw.chance(0.5F)) {
    s.cylinder(Axis::y, {0, depth + height + 0.1F, first - half * 0.3F}, 0.09F, 0.035F, draw.color());
  } else {
    const float mast = draw.between(0.15F, 0.4F);
    s.cylinder(Axis::y, {0, depth + mast / 2, first + half + 0.06F}, mast / 2 + 0.02F, 0.026F, draw.wood());
  }
  return s;
}

struct Family {
  ObjectClass object_class;
  Solids (*make)(Draw&);
};

constexpr std::array<Family, 13> k_families{{{{"02691156", "airplane"}, airplane},
                                             {{"02828884", "bench"}, bench},
                                             {{"02933112", "dresser"}, dresser},
                                             {{"02958343", "car"}, car},
                                             {{"03001627", "chair"}, chair},
                                             {{"03211117", "display"}, display},
                                             {{"03636649", "lamp"}, lamp},
                                             {{"03691459", "speaker"}, speaker},
                                             {{"04090263", "rifle"}, rifle},
                                             {{"04256520", "sofa"}, sofa},
                                             {{"04379243", "table"}, table},
                                             {{"04401088", "phone"}, phone},
                                             {{"04530566", "vessel"}, vessel}}};

constexpr auto k_classes = [] {
  std::array<ObjectClass, k_families.size()> classes;
  for (std::size_t i = 0; i < classes.size(); ++i) classes[i] = k_families[i].object_class;
  return classes;
}();

// All corners stay within the view of the data's cameras, which see a sphere of radius 0.7.
constexpr float k_longest_side = 1.0F;
constexpr float k_longest_diagonal = 1.2F;

}  // namespace

std::span<const ObjectClass> object_classes() { return k_classes; }

std::size_t find_class(std::string_view word) {
  std::string names;
  for (std::size_t i = 0; i < k_classes.size(); ++i) {
    if (word == k_classes[i].synset || word == k_classes[i].name) return i;
    names += (i == 0 ? "" : ", ") + std::string(k_classes[i].name);
  }
  throw InvalidArgument("class", "\"" + std::string(word) + "\"", names + ", or a synset of theirs");
}

Mesh make_object(std::size_t object_class, std::uint64_t seed) {
  Draw draw(seed);
  return k_families.at(object_class).make(draw).fitted(k_longest_side, k_longest_diagonal);
}

}  // namespace dpr::learn
