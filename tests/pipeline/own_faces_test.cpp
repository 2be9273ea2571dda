// Views with faces and lights of their own in one frame: images and gradients are those of a frame for each.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "batch/batch.hpp"
#include "batch/inputs.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/reduced.hpp"

namespace own_faces_test {

using namespace dpr;
using namespace dpr::batch;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

constexpr std::size_t k_views = 2;

/// Arrays with memory of their own.
struct Arrays {
  std::vector<std::vector<float>> floats;
  std::vector<std::vector<std::int32_t>> indices;
  std::vector<NamedArray> named;

  Arrays() { floats.reserve(8), indices.reserve(2); }
  void add(const char* name, std::vector<std::size_t> shape, std::vector<float> values) {
    floats.push_back(std::move(values));
    named.push_back({name, floats.back().data(), Element::float32, std::move(shape)});
  }
  void add(const char* name, std::vector<std::size_t> shape, std::vector<std::int32_t> values) {
    indices.push_back(std::move(values));
    named.push_back({name, indices.back().data(), Element::int32, std::move(shape)});
  }
};

std::vector<float> numbers(std::span<const glm::vec3> vectors) {
  std::vector<float> list;
  for (const glm::vec3& v : vectors) list.insert(list.end(), {v.x, v.y, v.z});
  return list;
}

std::vector<std::int32_t> numbers(std::span<const glm::uvec3> faces) {
  std::vector<std::int32_t> list;
  for (const glm::uvec3& f : faces)
    for (int corner = 0; corner < 3; ++corner) list.push_back(static_cast<std::int32_t>(f[corner]));
  return list;
}

/// A closed mesh, and a cube of which each side has vertices of its own: edges are joined by where they lie.
std::array<Mesh, k_views> meshes() {
  std::array<Mesh, k_views> list{make_icosphere(0), make_cube()};
  for (Mesh& mesh : list) {
    mesh.vertex_colors.clear();
    mesh.face_colors.clear();
    for (glm::vec3& position : mesh.positions) position *= 0.8F;
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      const auto k = static_cast<float>(i);
      mesh.vertex_colors.emplace_back(0.5F + 0.4F * std::sin(k), 0.5F + 0.4F * std::cos(2 * k), 0.3F);
    }
  }
  return list;
}

void add_cameras(Arrays& arrays, std::size_t first, std::size_t count, float side) {
  std::vector<float> views, lenses;
  for (std::size_t v = first; v < first + count; ++v) {
    const glm::mat4 view =
        glm::transpose(orbit_camera(2.6F, 20, 35 + 50 * static_cast<float>(v)).view);  // row-major
    for (int row = 0; row < 4; ++row) views.insert(views.end(), &view[row].x, &view[row].x + 4);
    lenses.insert(lenses.end(), {1.3F * side, 1.3F * side, side / 2, side / 2});
  }
  arrays.add("views", {count, 4, 4}, std::move(views));
  arrays.add("intrinsics", {count, 4}, std::move(lenses));
}

/// Rows behind a list's own repeat its first.
template <class Vector>
std::vector<Vector> padded(std::vector<Vector> list, std::size_t count, const Vector& with) {
  list.resize(count, with);
  return list;
}

/// A point light of each view, [1][9].
void add_lights(Arrays& arrays, std::size_t first, std::size_t count) {
  std::vector<float> lights;
  for (std::size_t v = first; v < first + count; ++v) {
    const auto k = static_cast<float>(v);
    lights.insert(lights.end(), {1 + 2 * k, 3, 2 - k, 0.5F, 0.3F + 0.4F * k, 0.6F, 0.4F, 0.2F, 0.3F});
  }
  arrays.add("lights.point", {count, 1, 9}, std::move(lights));
}

struct Found {
  std::vector<float> image, normals, vertices, colors, lights, opacities;
};

Found rendered(const Arrays& arrays, const RenderSettings& settings, std::size_t views,
               std::size_t vertices) {
  const auto side = static_cast<std::size_t>(settings.width());
  const bool is_lit = find(arrays.named, "lights.point"), fades = find(arrays.named, "opacities");
  std::vector<std::string> wanted{"vertices", "colors"};
  if (is_lit) wanted.emplace_back("lights.point");
  if (fades) wanted.emplace_back("opacities");
  Batch batch(RendererPools::of_process().get(""), arrays.named, {settings, is_lit, 0, wanted});
  Found found;
  found.image.resize(views * side * side * 4);
  const std::vector<std::size_t> pixels{views, side, side, 4};
  std::vector<NamedArray> outputs{{"image", found.image.data(), Element::float32, pixels}};
  if (!fades) {
    found.normals.resize(found.image.size());
    outputs.push_back({"normal", found.normals.data(), Element::float32, pixels});
  }
  batch.read(outputs);
  std::vector<float> grad(found.image.size());
  for (std::size_t i = 0; i < grad.size(); ++i)
    grad[i] = 0.5F + std::sin(static_cast<float>(i % (side * side * 4)));  // the same of every view
  found.vertices.resize(views * vertices * 3);
  found.colors = found.vertices;
  const std::vector<std::size_t> shape{views, vertices, 3};
  std::vector<NamedArray> gradients{{"vertices", found.vertices.data(), Element::float32, shape},
                                    {"colors", found.colors.data(), Element::float32, shape}};
  if (is_lit) {
    found.lights.resize(views * 9);
    gradients.push_back({"lights.point", found.lights.data(), Element::float32, {views, 1, 9}});
  }
  if (fades) {
    found.opacities.resize(views * vertices);
    gradients.push_back({"opacities", found.opacities.data(), Element::float32, {views * vertices}});
  }
  for (NamedArray& output : outputs) output.data = grad.data();
  batch.backward(outputs, gradients);
  return found;
}

/// Largest difference from what `found` has from `first` on, relative to the largest number.
double difference(std::span<const float> found, std::span<const float> expected) {
  double largest = 0, scale = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    largest = std::max(largest, std::abs(double{found[i]} - double{expected[i]}));
    scale = std::max(scale, std::abs(double{expected[i]}));
  }
  CHECK(scale > 1e-3);
  return largest / scale;
}

void check(const std::vector<std::string>& texts, bool is_lit, bool fades = false) {
  const int side = reduced(24, 10);
  const RenderSettings settings = settings_from_texts(side, side, texts);
  const std::array<Mesh, k_views> list = meshes();
  const std::size_t most_vertices = std::max(list[0].positions.size(), list[1].positions.size()),
                    most_faces = std::max(list[0].faces.size(), list[1].faces.size());
  REQUIRE(list[0].positions.size() != list[1].positions.size());
  REQUIRE(list[0].faces.size() != list[1].faces.size());
  Arrays together;
  std::vector<glm::vec3> positions, colors;
  std::vector<float> opacities;
  std::vector<glm::uvec3> faces;
  const auto opacities_of = [](const Mesh& mesh) {
    std::vector<float> all;
    for (const glm::vec3& color : mesh.vertex_colors) all.push_back(color.x);
    return all;
  };
  for (const Mesh& mesh : list) {
    const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    append(positions, padded(mesh.positions, most_vertices, mesh.positions[0]));
    append(colors, padded(mesh.vertex_colors, most_vertices, glm::vec3(0)));
    append(opacities, padded(opacities_of(mesh), most_vertices, 1.0F));
    append(faces, padded(mesh.faces, most_faces, glm::uvec3(0)));
  }
  together.add("vertices", {k_views, most_vertices, 3}, numbers(positions));
  together.add("faces", {k_views, most_faces, 3}, numbers(faces));
  together.add("colors", {k_views, most_vertices, 3}, numbers(colors));
  add_cameras(together, 0, k_views, static_cast<float>(side));
  if (fades) together.add("opacities", {k_views, most_vertices}, opacities);
  if (is_lit) add_lights(together, 0, k_views);
  const Found found = rendered(together, settings, k_views, most_vertices);
  for (std::size_t v = 0; v < k_views; ++v) {
    const Mesh& mesh = list[v];
    const std::size_t count = mesh.positions.size();
    Arrays alone;
    alone.add("vertices", {1, count, 3}, numbers(mesh.positions));
    alone.add("faces", {mesh.faces.size(), 3}, numbers(mesh.faces));
    alone.add("colors", {1, count, 3}, numbers(mesh.vertex_colors));
    add_cameras(alone, v, 1, static_cast<float>(side));
    if (fades) alone.add("opacities", {count}, opacities_of(mesh));
    if (is_lit) add_lights(alone, v, 1);
    const Found expected = rendered(alone, settings, 1, count);
    CAPTURE(v);
    const auto of_view = [&](const std::vector<float>& all) {
      return std::span(all).subspan(v * all.size() / k_views);
    };
    CHECK(difference(of_view(found.image), expected.image) < 1e-6);
    CHECK(difference(of_view(found.vertices), expected.vertices) < 1e-5);
    CHECK(difference(of_view(found.colors), expected.colors) < 1e-5);
    if (is_lit) CHECK(difference(of_view(found.lights), expected.lights) < 1e-5);
    if (!fades) CHECK(difference(of_view(found.normals), expected.normals) < 1e-6);
    if (fades) CHECK(difference(of_view(found.opacities), expected.opacities) < 1e-5);
  }
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("own faces: a view shows its mesh as a frame of its own does") {
    check({"preset=pixel", "sigma=1e-2"}, false, true);
    check({"preset=pixel", "sigma=1e-2", "shading=flat", "znear=2.1", "zfar=3.1"}, true);  // both planes cut
    check({"preset=joint_gaussian", "sigma=1e-3", "gamma=0.05", "shading=gouraud"}, true);
    if (dpr::test::is_reduced()) return;
    check({"preset=pixel", "sigma=1e-2"}, false);
    check({"preset=gaussian", "sigma=1e-3", "gamma=0.05"}, true, true);
    check({"preset=joint_gaussian", "sigma=1e-3", "gamma=0.05", "znear=2.1", "zfar=3.1"}, false);
  }
}

}  // namespace own_faces_test
