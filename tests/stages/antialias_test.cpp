// Blending across contours: areas, what hides a contour, and the gradients against differences.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "dpr/image.hpp"
#include "pipeline/scenes.hpp"
#include "support/contour_frame.hpp"
#include "support/reduced.hpp"

namespace antialias_test {

using namespace dpr;
using dpr::test::ContourFrame;
using dpr::test::device_impl;
using dpr::test::ends_of;
using dpr::test::reduced;
using dpr::test::pipeline::Random;

namespace {

constexpr float k_nothing = std::numeric_limits<float>::infinity();

/// Samples of the nearest triangle: its colour, its depth and which it is.
struct SampleGrid {
  std::vector<cl_float4> colors;
  std::vector<float> front;
  std::vector<cl_uint> face;
};

/// By brute force in double precision; no sample lies on an edge.
SampleGrid rigid_samples(const ContourFrame& frame, const Mesh& mesh) {
  SampleGrid samples{std::vector<cl_float4>(frame.samples()), std::vector<float>(frame.samples(), k_nothing),
                     std::vector<cl_uint>(frame.samples(), DPR_NO_FACE)};
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const glm::dvec3 a(mesh.positions[mesh.faces[f].x]), b(mesh.positions[mesh.faces[f].y]),
        c(mesh.positions[mesh.faces[f].z]);
    const auto side = [](const glm::dvec3& p, const glm::dvec3& q, const glm::dvec2& s) {
      return (q.x - p.x) * (s.y - p.y) - (q.y - p.y) * (s.x - p.x);
    };
    const double area = side(a, b, glm::dvec2(c));
    for (std::size_t i = 0; i < frame.samples(); ++i) {
      const double unit = static_cast<double>(frame.p.pixel_size);
      const glm::dvec2 s((static_cast<double>(i % frame.p.width) + 0.5 - 0.5 * frame.p.width) * unit,
                         (0.5 * frame.p.height - 0.5 - static_cast<double>(i / frame.p.width)) * unit);
      const double u = side(b, c, s) / area, v = side(c, a, s) / area, w = side(a, b, s) / area;
      if (!(u > 0 && v > 0 && w > 0)) continue;
      const auto depth = static_cast<float>(1 / (u / a.z + v / b.z + w / c.z));
      if (depth >= samples.front[i]) continue;
      samples.front[i] = depth;
      samples.face[i] = static_cast<cl_uint>(f);
      const glm::vec3 color = mesh.face_colors.empty() ? glm::vec3(1) : mesh.face_colors[f];
      samples.colors[i] = {{color.x, color.y, color.z, 1}};
    }
  }
  return samples;
}

struct Blended {
  std::vector<cl_float4> image;
  KeptSamples kept;
};

/// `unknown` is in the steps before they are looked at.
Blended blend_and_keep(ContourFrame& frame, const SampleGrid& samples, cl_uint unknown = 0xdeadbeefU) {
  frame.contour.forward(frame.inputs());
  frame.antialias.front.upload(device_impl(), samples.front);
  frame.antialias.front_face.upload(device_impl(), samples.face);
  test::poison(frame.antialias.winner, 2 * frame.samples(), unknown);
  frame.antialias.cross(frame.inputs(), frame.contour);
  Buffer<cl_float4> raster(device_impl(), samples.colors);
  KeptSamples kept;
  for (Buffer<cl_float4>* buffer : {&kept.samples, &kept.faded})
    test::poison(*buffer, frame.samples(),
                 cl_float4{{test::k_poison, test::k_poison, test::k_poison, test::k_poison}});
  frame.antialias.forward(frame.p, frame.contour, raster, kept);
  return {raster.download(), std::move(kept)};
}

void backward(ContourFrame& frame, const KeptSamples& kept, Buffer<cl_float4>& grad) {
  Buffer<cl_float4> samples;
  Buffer<float> cuts;
  frame.antialias.backward(frame.inputs(), frame.contour, kept, grad, {samples, cuts});
}

std::vector<cl_float4> blend(ContourFrame& frame, const SampleGrid& samples) {
  return blend_and_keep(frame, samples).image;
}

bool has_same_bits(const std::vector<cl_float4>& a, const std::vector<cl_float4>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(cl_float4)) == 0;
}

double sum_of(const std::vector<cl_float4>& image, int channel) {
  double sum = 0;
  for (const cl_float4& pixel : image) sum += static_cast<double>(pixel.s[channel]);
  return sum;
}

/// A convex polygon as a fan, of one depth.
Mesh fan(const std::vector<glm::vec2>& corners, float depth) {
  Mesh mesh;
  for (const glm::vec2& p : corners) mesh.positions.emplace_back(p, depth);
  for (unsigned i = 2; i < corners.size(); ++i) mesh.faces.emplace_back(0, i - 1, i);
  return mesh;
}

std::vector<glm::vec2> circle(glm::vec2 middle, float radius, int corners) {
  std::vector<glm::vec2> points;
  for (int i = 0; i < corners; ++i) {
    const float angle = 6.2831853F * (static_cast<float>(i) + 0.3F) / static_cast<float>(corners);
    points.emplace_back(middle.x + radius * std::cos(angle), middle.y + radius * std::sin(angle));
  }
  return points;
}

double area_of(const std::vector<glm::vec2>& corners) {
  double area = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const glm::dvec2 a(corners[i]), b(corners[(i + 1) % corners.size()]);
    area += (a.x * b.y - a.y * b.x) / 2;
  }
  return area;
}

/// Sectors around a point, the first of 14 degrees, each of a colour of its own.
Mesh sectors(glm::vec2 middle, float radius, float depth, Random& random) {
  Mesh mesh;
  mesh.positions.emplace_back(middle, depth);
  float angle = random(0.0F, 6.0F);
  const float narrow = 0.25F, others = (6.2831853F - narrow) / 6;
  for (unsigned i = 0; i < 7; ++i) {
    mesh.positions.emplace_back(middle.x + radius * std::cos(angle), middle.y + radius * std::sin(angle),
                                depth);
    mesh.faces.emplace_back(0, i + 1, (i + 1) % 7 + 1);
    mesh.face_colors.push_back(random.vector(0, 1));
    angle += i == 0 ? narrow : others;
  }
  return mesh;
}

/// The integral of a mesh's colours over the image plane.
glm::dvec3 area_by_colors(const Mesh& mesh) {
  glm::dvec3 sum(0);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto corner = [&](int i) { return glm::vec2(mesh.positions[mesh.faces[f][i]]); };
    sum += area_of({corner(0), corner(1), corner(2)}) * glm::dvec3(mesh.face_colors[f]);
  }
  return sum;
}

Mesh joined(const Mesh& a, const Mesh& b) {
  Mesh mesh = a;
  const auto first = static_cast<unsigned>(a.positions.size());
  mesh.positions.insert(mesh.positions.end(), b.positions.begin(), b.positions.end());
  for (const glm::uvec3& f : b.faces) mesh.faces.push_back(f + first);
  mesh.face_colors.assign(a.faces.size(), {1, 0, 0});
  mesh.face_colors.resize(mesh.faces.size(), {0, 1, 0});
  return mesh;
}

/// Smooth numbers, so that which of two neighbours is taken makes little difference.
std::vector<cl_float4> smooth_values(const ContourFrame& frame, float phase) {
  std::vector<cl_float4> values;
  for (std::size_t i = 0; i < frame.samples(); ++i) {
    const float x = static_cast<float>(i % frame.p.width) / static_cast<float>(frame.p.width),
                y = static_cast<float>(i / frame.p.width) / static_cast<float>(frame.p.height);
    values.push_back({{std::sin(3 * x + 2 * y + phase), std::cos(2 * x - 4 * y + phase),
                       std::sin(4 * x * y + phase), std::cos(3 * y + x - phase)}});
  }
  return values;
}

double dot(const std::vector<cl_float4>& a, const std::vector<cl_float4>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (int c = 0; c < 4; ++c) sum += static_cast<double>(a[i].s[c]) * static_cast<double>(b[i].s[c]);
  }
  return sum;
}

Mesh sphere_of_edges() {
  Mesh mesh = make_icosphere(1);
  const glm::mat4 placed = test::pipeline::placed(23.0F);
  for (glm::vec3& p : mesh.positions) {
    const glm::vec3 v = glm::vec3(placed * glm::vec4(p, 1)) - glm::vec3(0, 0, 4);
    p = {2.6F * v.x / -v.z, 2.6F * v.y / -v.z, -v.z};
  }
  Random random(9);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) mesh.face_colors.push_back(random.vector(0, 1));
  mesh.vertex_colors.clear();
  return mesh;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("antialias: an edge takes of a sample's tent what lies beyond it") {
    const float left = -0.71F, right = 0.33F, top = 0.62F, bottom = -0.55F;
    const Mesh mesh = fan({{left, bottom}, {right, bottom}, {right, top}, {left, top}}, 5);
    ContourFrame frame(mesh, 16, 16);
    const std::vector<cl_float4> image = blend(frame, rigid_samples(frame, mesh));
    // The tent's integral from a sample's left neighbour on, along an axis.
    const auto before = [](int sample, float end) {
      const float way = std::clamp((end + 1) * 8 - 0.5F - static_cast<float>(sample), -1.0F, 1.0F);
      return way < 0 ? (1 + way) * (1 + way) / 2 : 1 - (1 - way) * (1 - way) / 2;
    };
    const auto covered = [&](int sample, float low, float high) {
      return before(sample, high) - before(sample, low);
    };
    for (int i = 0; i < 16; ++i) {
      CAPTURE(i);
      CHECK(image[static_cast<std::size_t>(8 * 16 + i)].s[3] ==
            doctest::Approx(covered(i, left, right)).epsilon(1e-5));
      CHECK(image[static_cast<std::size_t>(i * 16 + 8)].s[3] ==
            doctest::Approx(covered(15 - i, bottom, top)).epsilon(1e-5));
    }
  }

  TEST_CASE("antialias: no jump where an edge passes over a sample, however steep the colours") {
    for (const int axis : {0, 1}) {
      CAPTURE(axis);
      const auto image_at = [&](float beyond_sample) {
        const float edge = 0.0625F + beyond_sample;
        const Mesh mesh = axis == 0 ? fan({{-5, -3}, {edge, -3}, {edge, 3}, {-5, 3}}, 5)
                                    : fan({{-3, -5}, {3, -5}, {3, edge}, {-3, edge}}, 5);
        ContourFrame frame(mesh, 16, 16);
        SampleGrid samples = rigid_samples(frame, mesh);
        for (std::size_t i = 0; i < samples.colors.size(); ++i) {
          const std::size_t place = axis == 0 ? i % 16 : 15 - i / 16;
          const float at = (static_cast<float>(place) + 0.5F) / 8 - 1;
          for (int c = 0; c < 3; ++c) samples.colors[i].s[c] *= std::sqrt(std::abs(edge - at));
        }
        return blend(frame, samples);
      };
      const std::vector<cl_float4> covered = image_at(1e-5F), uncovered = image_at(-1e-5F);
      for (std::size_t i = 0; i < covered.size(); ++i) {
        CAPTURE(i);
        CHECK(covered[i].s[0] == doctest::Approx(uncovered[i].s[0]).epsilon(1e-3));
        CHECK(covered[i].s[3] == doctest::Approx(uncovered[i].s[3]).epsilon(1e-3));
      }
    }
  }

  TEST_CASE("antialias: colours continue to the edge as they came") {
    const float edge = 0.33F;
    const Mesh mesh = fan({{-3, -3}, {edge, -3}, {edge, 3}, {-3, 3}}, 5);
    ContourFrame frame(mesh, 16, 16);
    SampleGrid samples = rigid_samples(frame, mesh);
    const auto within = [](float x) { return 1 + 0.3F * x; };
    const auto beyond = [](float x) { return 0.2F - 0.1F * x; };
    for (std::size_t i = 0; i < samples.colors.size(); ++i) {
      const auto x = static_cast<float>(i % 16);
      samples.colors[i].s[0] = samples.colors[i].s[3] > 0 ? within(x) : beyond(x);
    }
    const std::vector<cl_float4> image = blend(frame, samples);
    const double at = (static_cast<double>(edge) + 1) * 8 - 0.5;
    for (int i = 2; i < 14; ++i) {
      // The integral of the tent times the colours, by midpoints.
      double expected = 0;
      const int parts = 2000;
      for (int k = 0; k < parts; ++k) {
        const double way = (k + 0.5) * 2 / parts - 1, x = i + way;
        const auto color =
            static_cast<double>(x < at ? within(static_cast<float>(x)) : beyond(static_cast<float>(x)));
        expected += (1 - std::abs(way)) * color * 2 / parts;
      }
      CAPTURE(i);
      CHECK(static_cast<double>(image[static_cast<std::size_t>(8 * 16 + i)].s[0]) ==
            doctest::Approx(expected).epsilon(1e-3));
    }
  }

  TEST_CASE("antialias: areas of polygons, wherever they lie") {
    Random random(4);
    double largest = 0, sum = 0;
    const int polygons = reduced(60, 4), size = reduced(40, 20);
    for (int i = 0; i < polygons; ++i) {
      const std::vector<glm::vec2> corners =
          circle({random(-0.1F, 0.1F), random(-0.1F, 0.1F)}, random(0.5F, 0.8F), 3 + i % 30);
      const Mesh mesh = fan(corners, 5);
      ContourFrame frame(mesh, size, size);
      const double pixels = area_of(corners) / static_cast<double>(frame.p.pixel_size * frame.p.pixel_size);
      const double error = sum_of(blend(frame, rigid_samples(frame, mesh)), 3) - pixels;
      largest = std::max(largest, std::abs(error));
      sum += error;
    }
    CHECK(largest < reduced(3, 8) * 0.1);
    CHECK(std::abs(sum) / polygons < reduced(2, 40) * 0.01);
  }

  TEST_CASE("antialias: areas of the sectors that meet in a point, wherever it lies, before other edges") {
    Random random(8);
    double largest = 0;
    const int meshes = reduced(60, 1);
    for (int i = 0; i < meshes; ++i) {
      const glm::vec2 middle(random(-0.1F, 0.1F), random(-0.1F, 0.1F));
      const Mesh front = sectors(middle, 0.6F, 5, random), behind = sectors(middle, 0.4F, 7, random);
      Mesh mesh = joined(front, behind);
      mesh.face_colors = front.face_colors;
      mesh.face_colors.insert(mesh.face_colors.end(), behind.face_colors.begin(), behind.face_colors.end());
      ContourFrame frame(mesh, 40, 40);
      const std::vector<cl_float4> image = blend(frame, rigid_samples(frame, mesh));
      const glm::dvec3 expected =
          area_by_colors(front) / static_cast<double>(frame.p.pixel_size * frame.p.pixel_size);
      for (int c = 0; c < 3; ++c) largest = std::max(largest, std::abs(sum_of(image, c) - expected[c]));
    }
    CHECK(largest < 0.15);
  }

  TEST_CASE("antialias: a contour behind a surface is hidden, one before it is not") {
    const std::vector<glm::vec2> near = circle({0, 0}, 0.8F, 24), far = circle({0.05F, 0.02F}, 0.4F, 5);
    for (const bool is_hidden : {true, false}) {
      const Mesh mesh = joined(fan(near, is_hidden ? 3.0F : 5.0F), fan(far, 4));
      ContourFrame frame(mesh, 32, 32);
      const std::vector<cl_float4> image = blend(frame, rigid_samples(frame, mesh));
      const double unit = static_cast<double>(frame.p.pixel_size * frame.p.pixel_size);
      CHECK(sum_of(image, 3) == doctest::Approx(area_of(near) / unit).epsilon(2e-3));
      if (is_hidden) CHECK(sum_of(image, 1) == 0);
      if (!is_hidden) CHECK(sum_of(image, 1) == doctest::Approx(area_of(far) / unit).epsilon(2e-2));
      const std::vector<cl_uint> winners = frame.antialias.winner.download();
      const auto rim = static_cast<cl_uint>(near.size());
      const std::vector<cl_uint2> edges = frame.edges.edges.download();
      const auto is_inner = [&](cl_uint w) {
        const std::size_t edge = w / DPR_CONTOUR_FLAGS;
        return edge < edges.size() && ends_of(edges[edge], mesh.faces).x >= rim;
      };
      CHECK(std::ranges::any_of(winners, is_inner) == !is_hidden);
    }
  }

  TEST_CASE("antialias: what a depth's noise may show is not hidden") {
    const Mesh mesh = joined(fan(circle({0, 0}, 0.8F, 24), 3.0F), fan(circle({0.05F, 0.02F}, 0.4F, 5), 4));
    ContourFrame frame(mesh, 32, 32);
    static_cast<void>(blend(frame, rigid_samples(frame, mesh)));
    const std::vector<cl_uint> before = frame.antialias.winner.download();
    frame.depth_reach = 1.1F / 99;
    frame.antialias.cross(frame.inputs(), frame.contour);
    CHECK(frame.antialias.winner.download() != before);
    frame.depth_reach = 0.9F / 99;
    frame.antialias.cross(frame.inputs(), frame.contour);
    CHECK(frame.antialias.winner.download() == before);
  }

  TEST_CASE("antialias: steps away from contours are not looked at, and samples there stay as they are") {
    Random random(12);
    for (int i = 0; i < reduced(40, 1); ++i) {
      const glm::vec2 middle(random(-1.1F, 1.1F), random(-0.9F, 0.9F));
      const Mesh mesh = fan(circle(middle, random(0.02F, 0.3F), 5), 5);
      ContourFrame frame(mesh, 75, 60);
      const SampleGrid samples = rigid_samples(frame, mesh);
      const auto passes = [&](cl_uint unknown) {
        const Blended blended = blend_and_keep(frame, samples, unknown);
        std::vector<std::vector<cl_float4>> results{blended.image};
        Buffer<cl_float4> grad(device_impl(), smooth_values(frame, 1));
        backward(frame, blended.kept, grad);
        results.push_back(grad.download());
        results.push_back(frame.antialias.grad_ends.download());
        return results;
      };
      const auto found = passes(0xdeadbeefU), expected = passes(DPR_NO_CROSSING);
      for (std::size_t k = 0; k < found.size(); ++k) CHECK(has_same_bits(found[k], expected[k]));
    }
  }

  TEST_CASE("antialias: what is cut on all sides is shared by its neighbours") {
    const Mesh mesh = fan(circle({0.0625F, 0.0625F}, 0.03F, 4), 5);  // within a pixel, about its centre
    ContourFrame frame(mesh, 16, 16);
    const std::vector<cl_float4> image = blend(frame, rigid_samples(frame, mesh));
    for (const cl_float4& pixel : image) {
      CHECK(pixel.s[3] >= -1e-6F);
      CHECK(pixel.s[3] <= 1 + 1e-6F);
    }
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("antialias: samples get the transpose of what they gave") {
    const Mesh mesh = sphere_of_edges();
    const int size = reduced(48, 16);
    ContourFrame frame(mesh, size, size - 5);
    SampleGrid samples = rigid_samples(frame, mesh);
    samples.colors = smooth_values(frame, 0);
    for (std::size_t i = 0; i < samples.colors.size(); ++i) {
      if (samples.face[i] % 2 != 0) continue;
      for (float& value : samples.colors[i].s) value *= -0.5F;
    }
    const Blended blended = blend_and_keep(frame, samples);
    const std::vector<cl_float4> grad = smooth_values(frame, 1);
    Buffer<cl_float4> grad_raster(device_impl(), grad);
    backward(frame, blended.kept, grad_raster);
    const double sum = dot(grad, blended.image);
    CHECK(sum == doctest::Approx(dot(grad_raster.download(), samples.colors)).epsilon(1e-5));
    CHECK(sum != doctest::Approx(dot(grad, samples.colors)).epsilon(1e-4));
  }

  TEST_CASE("antialias: ends of edges against differences, of colours that vary") {
    const Mesh mesh = sphere_of_edges();
    const int size = reduced(48, 16);
    ContourFrame frame(mesh, size, size - 5);
    const SampleGrid samples = rigid_samples(frame, mesh);
    const std::vector<cl_float4> grad = smooth_values(frame, 1);
    const Blended blended = blend_and_keep(frame, samples);
    Buffer<cl_float4> grad_raster(device_impl(), grad), grad_ndc, no_clip;
    test::poison(grad_ndc, mesh.positions.size(), cl_float4{});
    backward(frame, blended.kept, grad_raster);
    frame.contour.gather(frame.inputs(), frame.antialias.grad_ends, grad_ndc, no_clip);
    const std::vector<cl_float4> found = grad_ndc.download();
    const float step = 1e-4F;
    const auto stride = static_cast<std::size_t>(reduced(1, 21));
    double error = 0, size2 = 0;
    for (std::size_t v = 0; v < mesh.positions.size(); v += stride) {
      CHECK(found[v].s[2] == 0);
      for (int axis = 0; axis < 2; ++axis) {
        double difference = 0;
        for (const float sign : {1.0F, -1.0F}) {
          Mesh moved = mesh;
          moved.positions[v][axis] += sign * step;
          frame.place(moved.positions);
          difference += static_cast<double>(sign) * dot(grad, blend(frame, rigid_samples(frame, moved)));
        }
        difference /= 2 * static_cast<double>(step);
        error += std::pow(difference - static_cast<double>(found[v].s[axis]), 2);
        size2 += difference * difference;
      }
    }
    CHECK(size2 > 0);
    CHECK(std::sqrt(error / size2) < 1e-3);
  }
}

}  // namespace antialias_test
