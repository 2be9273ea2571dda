// Faces cut for lenses: what is drawn lies where OpenCV's formula puts it, without cracks, with all that the
// mesh carries, and its gradients by differences.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "check/scenes.hpp"
#include "dpr/subdivision.hpp"
#include "mesh/mesh_facts.hpp"
#include "support/messages.hpp"

namespace subdivide_for_lens_test {

using namespace dpr;
using dpr::check::Random;

namespace {

constexpr float k_tolerance = 0.25F;

/// A wide lens, from within a room or before a wall.
Scene lens_scene(Mesh mesh, const Distortion& lens = {-0.22F, 0.03F, 0.01F, -0.006F, 0.001F}) {
  Scene scene;
  scene.width = 160;
  scene.height = 120;
  scene.camera.intrinsics = Intrinsics{90, 92, 78, 63};
  scene.camera.distortion = lens;
  scene.camera.znear = 0.1F;
  scene.meshes.push_back({std::move(mesh)});
  return scene;
}

Mesh wall() {
  Mesh mesh;
  mesh.positions = {{-2, -1.6F, -2}, {2.1F, -1.5F, -2.2F}, {2, 1.6F, -2.3F}, {-2.2F, 1.5F, -1.9F}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// 24 vertices, each side its own; the camera stands off the middle.
Mesh room() {
  Mesh mesh = make_cube();
  for (glm::vec3& p : mesh.positions) p = 3.0F * p + glm::vec3(0.4F, -0.7F, -0.9F);
  return mesh;
}

/// Pixels of a tangent, y down: OpenCV's formula.
glm::dvec2 opencv_pixel(const Camera& camera, glm::dvec2 t) {
  const Distortion& d = *camera.distortion;
  const double x = t.x, y = -t.y, r2 = x * x + y * y;
  const Intrinsics& k = *camera.intrinsics;
  if (d.model == LensModel::fisheye) {
    const double r = std::sqrt(r2), a = std::atan(r), a2 = a * a;
    const double shown = a * (1 + a2 * (d.k1 + a2 * (d.k2 + a2 * (d.k3 + a2 * double{d.k4}))));
    const double factor = r > 0 ? shown / r : 1;
    return {k.fx * factor * x + k.cx, k.fy * factor * y + k.cy};
  }
  const double radial = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * double{d.k3}));
  const double shown_x = x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x);
  const double shown_y = y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y;
  return {k.fx * shown_x + k.cx, k.fy * shown_y + k.cy};
}

/// How far a point at these parts of a triangle's tangents is drawn from where the lens shows it; 0 outside
/// of the image.
double drawn_off(const Scene& scene, const std::array<glm::dvec2, 3>& t, const glm::dvec3& parts) {
  const glm::dvec2 shown = opencv_pixel(scene.camera, parts.x * t[0] + parts.y * t[1] + parts.z * t[2]);
  if (shown.x < 0 || shown.y < 0 || shown.x > scene.width || shown.y > scene.height) return 0;
  glm::dvec2 drawn(0);
  for (int i = 0; i < 3; ++i) drawn += parts[i] * opencv_pixel(scene.camera, t[static_cast<std::size_t>(i)]);
  return glm::distance(shown, drawn);
}

struct Worst {
  double edge = 0, inside = 0;
};

/// Worst error of the faces wholly before the camera.
Worst worst_drawn(const Scene& scene) {
  constexpr int k_steps = 12;
  Worst worst;
  const Mesh& mesh = scene.meshes[0].mesh;
  for (const glm::uvec3& face : mesh.faces) {
    std::array<glm::dvec2, 3> t;
    bool is_before = true;
    for (int i = 0; i < 3; ++i) {
      const glm::dvec3 p(mesh.positions[face[i]]);
      t[static_cast<std::size_t>(i)] = glm::dvec2(p) / -p.z;
      is_before = is_before && -p.z > double{scene.camera.znear};
    }
    for (int i = 0; is_before && i <= k_steps; ++i) {
      for (int j = 0; i + j <= k_steps; ++j) {
        const glm::dvec3 parts = glm::dvec3(i, j, k_steps - i - j) / double{k_steps};
        double& place = i * j * (k_steps - i - j) == 0 ? worst.edge : worst.inside;
        place = std::max(place, drawn_off(scene, t, parts));
      }
    }
  }
  return worst;
}

Mesh with_everything(Mesh mesh) {
  Random random(31);
  mesh.vertex_colors.clear();
  mesh.face_colors.clear();
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) mesh.vertex_colors.push_back(random.vector(0, 1));
  mesh = check::textured(std::move(mesh), check::random_texture(4, 3, Wrap::repeat, Filter::bilinear));
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    mesh.face_normals.emplace_back(f, f + 1, f);  // some twice in a face
    mesh.face_materials.push_back(static_cast<std::uint32_t>(f % 2));
    mesh.face_textures.push_back(f % 3 == 0 ? k_no_texture : 0);
  }
  for (std::size_t n = 0; n <= mesh.faces.size(); ++n)
    mesh.normals.push_back(random(0.5F, 3.0F) * (glm::vec3(0, 0, 1) + random.vector(-0.4F, 0.4F)));
  mesh.materials = {{{1, 0.5F, 0}, 5.0F}, {{0, 0.5F, 1}, 9.0F}};
  return mesh;
}

template <typename Vector>
Vector interpolated(const std::vector<Vector>& values, const glm::uvec3& corners, const glm::vec3& parts) {
  return parts.x * values[corners.x] + parts.y * values[corners.y] + parts.z * values[corners.z];
}

/// <weights, values>
template <typename Vector>
double weighted(const std::vector<Vector>& weights, const std::vector<Vector>& values) {
  double sum = 0;
  for (std::size_t i = 0; i < weights.size(); ++i)
    for (int axis = 0; axis < Vector::length(); ++axis)
      sum += static_cast<double>(weights[i][axis]) * static_cast<double>(values[i][axis]);
  return sum;
}

double weighted(const MeshGradient& weights, const Mesh& mesh) {
  return weighted(weights.positions, mesh.positions) +
         weighted(weights.colors, mesh.face_colors.empty() ? mesh.vertex_colors : mesh.face_colors) +
         weighted(weights.texcoords, mesh.texcoords) + weighted(weights.normals, mesh.normals);
}

template <typename Vector>
void fill(std::vector<Vector>& values, std::size_t count, Random& random, float size) {
  values.resize(count);
  for (Vector& value : values)
    for (int axis = 0; axis < Vector::length(); ++axis) value[axis] = random(-size, size);
}

/// Random numbers in the place of a gradient of all that a mesh has.
MeshGradient random_gradient(const Mesh& mesh, float size, unsigned seed) {
  Random random(seed);
  MeshGradient gradient;
  fill(gradient.positions, mesh.positions.size(), random, size);
  fill(gradient.colors, std::max(mesh.vertex_colors.size(), mesh.face_colors.size()), random, size);
  fill(gradient.texcoords, mesh.texcoords.size(), random, size);
  fill(gradient.normals, mesh.normals.size(), random, size);
  return gradient;
}

template <typename Vector>
void add(std::vector<Vector>& to, const std::vector<Vector>& way, float step) {
  for (std::size_t i = 0; i < way.size(); ++i) to[i] += step * way[i];
}

Mesh moved(Mesh mesh, const MeshGradient& way, float step) {
  add(mesh.positions, way.positions, step);
  add(mesh.face_colors.empty() ? mesh.vertex_colors : mesh.face_colors, way.colors, step);
  add(mesh.texcoords, way.texcoords, step);
  add(mesh.normals, way.normals, step);
  return mesh;
}

double dot(const MeshGradient& a, const MeshGradient& b) {
  return weighted(a.positions, b.positions) + weighted(a.colors, b.colors) +
         weighted(a.texcoords, b.texcoords) + weighted(a.normals, b.normals);
}

/// The pulled back gradient along a random way against differences of the pieces, relative.
double pull_back_error(const Scene& scene) {
  const SubdividedScene cut = subdivide_for_lens(scene);
  REQUIRE(cut.meshes[0].is_cut());
  const Mesh& mesh = scene.meshes[0].mesh;
  const MeshGradient of_pieces = random_gradient(cut.scene.meshes[0].mesh, 1, 41);
  const MeshGradient found = pull_back(mesh, cut.meshes[0], of_pieces);
  const MeshGradient way = random_gradient(mesh, 1, 42);
  constexpr float k_step = 1.0F / 256;
  const auto value = [&](float step) {
    return weighted(of_pieces, subdivide(moved(mesh, way, step), cut.meshes[0]));
  };
  const double expected = (value(k_step) - value(-k_step)) / (2 * double{k_step});
  return std::abs(dot(found, way) - expected) / std::sqrt(dot(found, found));
}

bool is_same(const Mesh& a, const Mesh& b) {
  return a.positions == b.positions && a.faces == b.faces && a.vertex_colors == b.vertex_colors &&
         a.face_colors == b.face_colors && a.texcoords == b.texcoords && a.normals == b.normals;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("subdivision for a lens: what is drawn of walls and rooms is where the lens shows it") {
    const Distortion barrel{-0.22F, 0.03F, 0.01F, -0.006F, 0.001F}, cushion{0.3F, 0.05F, 0, 0.01F, 0};
    for (const Distortion& lens : {barrel, cushion, fisheye(0.06F, -0.03F, 0.015F, -0.005F)}) {
      for (const Mesh& mesh : {wall(), room()}) {
        const Scene scene = lens_scene(mesh, lens);
        const SubdividedScene cut = subdivide_for_lens(scene);
        const Worst worst = worst_drawn(cut.scene);
        CHECK(worst.edge < 1.02 * double{k_tolerance});
        CHECK(worst.inside < 1.4 * double{k_tolerance});
        CHECK(worst_drawn(scene).edge > 2);
        CHECK(cut.scene.meshes[0].mesh.faces.size() < 6000);
        const Scene coarser = subdivide_for_lens(scene, {.tolerance = 2}).scene;
        CHECK(worst_drawn(coarser).edge > 2 * double{k_tolerance});
        CHECK(coarser.meshes[0].mesh.faces.size() < cut.scene.meshes[0].mesh.faces.size());
      }
    }
  }

  TEST_CASE("subdivision for a lens: a room seen by a fisheye that shows 180 degrees") {
    Scene scene = lens_scene(room(), fisheye(0, 0, 0, 0));
    scene.camera.intrinsics = Intrinsics{38, 38, 80, 60};  // 60 pixels for a right angle
    const Scene cut = subdivide_for_lens(scene).scene;
    CHECK(worst_drawn(cut).edge < 1.02 * double{k_tolerance});
    CHECK(worst_drawn(cut).inside < 1.4 * double{k_tolerance});
    CHECK(cut.meshes[0].mesh.faces.size() < 12000);
  }

  TEST_CASE("subdivision for a lens: no crack opens, at seams neither") {
    const Scene scene = lens_scene(room());
    CHECK(mesh_facts(scene.meshes[0].mesh).is_closed());
    const Mesh cut = subdivide_for_lens(scene).scene.meshes[0].mesh;
    const MeshFacts facts = mesh_facts(cut);
    CHECK(facts.is_closed());
    CHECK(facts.is_manifold());
    CHECK(facts.is_oriented());
    CHECK(facts.unused_vertices == 0);
    CHECK(facts.faces_without_area == 0);
    CHECK(facts.distinct_positions < cut.positions.size());
    validate(cut);
  }

  TEST_CASE("subdivision for a lens: pieces have what their faces have") {
    const Scene scene = lens_scene(with_everything(room()));
    const SubdividedScene subdivided = subdivide_for_lens(scene);
    const MeshSubdivision& how = subdivided.meshes[0];
    const Mesh &old = scene.meshes[0].mesh, &cut = subdivided.scene.meshes[0].mesh;
    validate(cut);
    REQUIRE(how.face_of.size() == cut.faces.size());
    CHECK(std::ranges::is_sorted(how.face_of));
    for (std::size_t f = 0; f < cut.faces.size(); ++f) {
      const std::uint32_t face = how.face_of[f];
      CHECK(cut.face_materials[f] == old.face_materials[face]);
      CHECK(cut.face_textures[f] == old.face_textures[face]);
      for (int c = 0; c < 3; ++c) {
        const glm::vec3& parts = how.barycentrics[f][static_cast<std::size_t>(c)];
        const std::uint32_t vertex = cut.faces[f][c], place = cut.face_texcoords[f][c];
        CHECK(glm::distance(cut.positions[vertex], interpolated(old.positions, old.faces[face], parts)) <
              1e-5F);
        CHECK(glm::distance(cut.vertex_colors[vertex],
                            interpolated(old.vertex_colors, old.faces[face], parts)) < 1e-6F);
        CHECK(glm::distance(cut.texcoords[place],
                            interpolated(old.texcoords, old.face_texcoords[face], parts)) < 1e-6F);
        std::vector<glm::vec3> directions;
        for (const glm::vec3& normal : old.normals) directions.push_back(glm::normalize(normal));
        CHECK(glm::distance(cut.normals[cut.face_normals[f][c]],
                            interpolated(directions, old.face_normals[face], parts)) < 1e-6F);
      }
    }
    // Other numbers at the vertices, as images of attributes show them.
    const std::vector<float> heat(old.positions.size(), 0.5F);
    CHECK(how.vertices.combine(heat, 1) == std::vector<float>(cut.positions.size(), 0.5F));
  }

  TEST_CASE("subdivision for a lens: numbers at the vertices of what was not cut stay as they are") {
    Scene scene = lens_scene(wall());
    scene.camera.distortion.reset();
    const MeshSubdivision how = subdivide_for_lens(scene).meshes[0];
    CHECK_FALSE(how.is_cut());
    const std::vector<float> heat{1, 2, 3, 4, 5, 6, 7, 8};
    CHECK(how.vertices.combine(heat, 2) == heat);
    CHECK(how.vertices.pull_back(heat, 4, 2) == heat);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, how.vertices.pull_back(heat, 5, 2), "gradient");
  }

  TEST_CASE("subdivision for a lens: without lights, or with flat ones, no normals are made") {
    Scene scene = lens_scene(wall());
    CHECK(subdivide_for_lens(scene).scene.meshes[0].mesh.normals.empty());
    scene.lights = check::two_lights(Shading::flat);
    CHECK(subdivide_for_lens(scene).scene.meshes[0].mesh.normals.empty());
    scene.lights->shading = Shading::phong;
    const SubdividedScene lit = subdivide_for_lens(scene);
    CHECK(lit.meshes[0].computed_normals == 1);
    CHECK(lit.scene.gradients.normals);
    CHECK_FALSE(scene.gradients.normals);
    const Mesh& mesh = lit.scene.meshes[0].mesh;
    REQUIRE(mesh.normals.size() == mesh.positions.size());
    for (const glm::vec3& normal : mesh.normals) CHECK(normal.z > 0.9F);
    scene.meshes[0].transform[0][0] = -1;
    CHECK(subdivide_for_lens(scene).meshes[0].computed_normals == -1);
  }

  TEST_CASE("subdivision for a lens: all is the same where nothing is off") {
    const auto is_unchanged = [](const Scene& scene, std::span<const View> views = {}) {
      const SubdividedScene cut = subdivide_for_lens(scene, {}, views);
      return !cut.meshes[0].is_cut() && is_same(cut.scene.meshes[0].mesh, scene.meshes[0].mesh) &&
             cut.scene.gradients == scene.gradients;
    };
    Scene scene = lens_scene(room());
    CHECK_FALSE(is_unchanged(scene));
    scene.lights = check::two_lights(Shading::phong);
    scene.camera.distortion = Distortion{};
    CHECK(is_unchanged(scene));
    scene.camera.distortion.reset();
    CHECK(is_unchanged(scene));
    scene = lens_scene(wall());
    scene.meshes[0].transform[3] = {0, 0, 8, 1};  // behind the camera
    CHECK(is_unchanged(scene));
    scene.meshes[0].transform[3] = {30, 0, 0, 1};  // beside the image
    CHECK(is_unchanged(scene));
    scene.meshes[0].transform[3] = {0, 0, -1000, 1};  // beyond zfar
    CHECK(is_unchanged(scene));
    // Another view sees it.
    CHECK_FALSE(is_unchanged(scene, std::vector<View>{{scene.camera, {glm::mat4(1)}}}));
  }

  TEST_CASE("subdivision for a lens: what no image shows ends too") {
    Mesh floor;  // from far behind the camera to the horizon, close below it
    floor.positions = {{-900, -0.11F, 800}, {900, -0.11F, 800}, {0, -0.11F, -900}};
    floor.faces = {{0, 1, 2}};
    for (const float k1 : {-0.4F, 0.4F, -30.0F}) {
      Scene scene = lens_scene(floor, {k1, 0, 0, 0, 0});
      scene.camera.zfar = 2000;
      CHECK(subdivide_for_lens(scene).meshes[0].face_of.size() < 40000);
      scene.camera.distortion = Distortion{k1, -30, 1, -1, 20};
      CHECK(subdivide_for_lens(scene).meshes[0].face_of.size() < 200000);
      scene.camera.distortion = Distortion{k1, -1e6F, 100, -100, 1e20F};  // nothing that a lens does
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, subdivide_for_lens(scene, {.most_new_faces = 100000}),
                            "a larger one, more new faces allowed, or a camera of less distortion");
      scene.camera.distortion = fisheye(0.1F * k1, 0, 0, 0);
      CHECK(subdivide_for_lens(scene).meshes[0].face_of.size() < 200000);
    }
    Mesh odd = wall();  // faces between equal corners
    odd.faces.insert(odd.faces.end(), {{0, 0, 2}, {1, 1, 1}});
    CHECK(subdivide_for_lens(lens_scene(odd)).meshes[0].is_cut());
  }

  TEST_CASE("subdivision for a lens: instances and views count") {
    Scene scene = lens_scene(wall());
    scene.meshes[0].transform[3] = {0, 0, 8, 1};
    scene.meshes.push_back({{}, glm::mat4(1), 0});
    const SubdividedScene cut = subdivide_for_lens(scene);
    CHECK(cut.meshes[0].is_cut());
    CHECK_FALSE(cut.meshes[1].is_cut());
    validate(cut.scene);

    AuxiliaryOutputs outputs;
    const std::size_t pieces = cut.meshes[0].face_of.size();
    outputs.face_id = {-1, 0, static_cast<std::int32_t>(2 * pieces - 1)};
    outputs.barycentrics = {glm::vec3(0), {1, 0, 0}, {0.25F, 0.25F, 0.5F}};
    name_old_faces(scene, cut, outputs);
    CHECK(outputs.face_id == std::vector<std::int32_t>{-1, 0, 3});
    CHECK(outputs.barycentrics[0] == glm::vec3(0));
    CHECK(outputs.barycentrics[1] == cut.meshes[0].barycentrics[0][0]);
    const glm::vec3& last = outputs.barycentrics[2];
    CHECK(last.x + last.y + last.z == doctest::Approx(1));
  }

  TEST_CASE("subdivision for a lens: errors name what is wrong") {
    const Scene scene = lens_scene(wall());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, subdivide_for_lens(scene, {.tolerance = 0}), "tolerance");
    const float nan = std::numeric_limits<float>::quiet_NaN();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, subdivide_for_lens(scene, {.tolerance = nan}), "tolerance");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, subdivide_for_lens(scene, {.most_new_faces = 10}),
                          "more than 12 faces");
    const View view{scene.camera, {}};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, subdivide_for_lens(scene, {}, std::span(&view, 1)),
                          "transforms (views[0])");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, subdivide_for_lens({}), "meshes (scene)");
    const SubdividedScene cut = subdivide_for_lens(scene);
    Mesh less = scene.meshes[0].mesh;
    less.positions.pop_back();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, subdivide(less, cut.meshes[0]),
                          "positions (subdivided mesh): got 3, expected 4");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, subdivide(make_cube(), cut.meshes[0]),
                          "faces (subdivided mesh): got 12, expected 2");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, pull_back(cut.scene.meshes[0].mesh, cut.meshes[0], {}),
                          "faces (subdivided mesh): got");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, cut.meshes[0].vertices.combine({}, 1), "values (subdivided mesh)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, cut.meshes[0].vertices.pull_back({}, 4, 1), "gradient");
    Combinations without_weights;
    without_weights.of = {glm::uvec3(0)};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, without_weights.combine(std::vector<float>(1), 1),
                          "weights (subdivided mesh): got 0");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, without_weights.pull_back(std::vector<float>(1), 1, 1),
                          "weights (subdivided mesh): got 0");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, pull_back({}, cut, {}), "meshes (subdivided scene)");
    AuxiliaryOutputs outputs;
    outputs.face_id = {1 << 20};
    outputs.barycentrics = {glm::vec3(1, 0, 0)};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, name_old_faces(scene, cut, outputs), "face_id (subdivided scene)");
    SceneGradient of_shapes;
    of_shapes.shapes.positions.resize(4);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, pull_back(scene, cut, of_shapes), "shapes");
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("subdivision for a lens: gradients go back to the faces that were cut") {
    CHECK(pull_back_error(lens_scene(with_everything(room()))) < 1e-3);
    Mesh by_face = room();
    by_face.vertex_colors.clear();
    by_face.face_colors.assign(by_face.faces.size(), glm::vec3(0.5F));
    CHECK(pull_back_error(lens_scene(by_face)) < 1e-3);
    Scene lit = lens_scene(wall());  // by way of the normals that are made
    lit.lights = check::two_lights(Shading::phong);
    CHECK(pull_back_error(lit) < 1e-3);
    lit.meshes[0].mesh.positions[2].z -= 1;
    lit.meshes[0].transform = glm::mat4(-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1);
    CHECK(pull_back_error(lit) < 1e-3);
  }
}

}  // namespace subdivide_for_lens_test
