// The losses of a mesh's shape against the reference in double precision, their gradients against its finite
// differences; on manifold meshes, on soup, and together with a loss of images.
#include "dpr/mesh_loss.hpp"

#include <doctest/doctest.h>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "check/comparison.hpp"
#include "dpr/error.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/renderer.hpp"
#include "loss/mesh_loss_impl.hpp"
#include "mesh/adjacency.hpp"
#include "reference/finite_difference.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace mesh_loss_test {

namespace {

using dpr::Mesh;
using dpr::MeshLoss;
using dpr::MeshLossWeights;

/// A sphere with every vertex moved at random.
Mesh rough_sphere(unsigned subdivisions) {
  std::mt19937 generator(5);
  const auto uniform = [&] { return std::ldexp(static_cast<float>(generator() >> 8), -24) - 0.5F; };
  Mesh mesh = dpr::make_icosphere(subdivisions);
  for (glm::vec3& p : mesh.positions) p += 0.2F * glm::vec3(uniform(), uniform(), uniform());
  return mesh;
}

/// Three faces at an edge, one of them turned round; a border; a vertex of no face; a face of equal corners.
Mesh soup() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0},       {1, 0, 0.1F}, {0.3F, 1, 0}, {0.4F, -0.9F, 0.5F},
                    {0.6F, 0.2F, 1}, {9, 9, 9},    {2, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 1, 3}, {1, 0, 4}, {1, 6, 2}, {2, 2, 6}};
  return mesh;
}

struct Evaluation {
  double loss = 0;
  std::vector<double> gradient;  // [vertex][3]
};

constexpr std::size_t k_before = 3;  // vertices of other meshes in the joined buffer

/// On the device, on top of a gradient of 1 that is there already.
Evaluation evaluate(const Mesh& mesh, const MeshLossWeights& weights) {
  dpr::Device::Impl& device = dpr::test::device_impl();
  std::vector<cl_float4> values(k_before + mesh.positions.size(), cl_float4{{7, 7, 7, 7}});
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const glm::vec3& p = mesh.positions[i];
    values[k_before + i] = {{p.x, p.y, p.z, 0}};
  }
  dpr::Buffer<cl_float4> positions(device, std::span<const cl_float4>(values));
  dpr::Buffer<cl_float4> grad(
      device, std::span<const cl_float4>(std::vector<cl_float4>(values.size(), {{1, 1, 1, 1}})));
  MeshLoss loss(dpr::test::test_device(), weights, mesh);
  Evaluation result;
  result.loss = impl_of(loss).evaluate(positions, k_before);
  impl_of(loss).add_gradient(positions, grad);
  const std::vector<cl_float4> sums = grad.download();
  for (std::size_t i = 0; i < k_before; ++i) CHECK(sums[i].s[0] == 1.0F);
  for (std::size_t i = k_before; i < sums.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) result.gradient.push_back(static_cast<double>(sums[i].s[k]) - 1);
  }
  return result;
}

std::vector<double> flat(const Mesh& mesh) {
  std::vector<double> values;
  for (const glm::vec3& p : mesh.positions) {
    for (int i = 0; i < 3; ++i) values.push_back(p[i]);
  }
  return values;
}

const std::array<MeshLossWeights, 5> k_each{
    MeshLossWeights{.laplacian = 0.7F}, MeshLossWeights{.edge_length = 20, .edge_target = 0.3F},
    MeshLossWeights{.normal_consistency = 30}, MeshLossWeights{.flatness = 30},
    MeshLossWeights{.laplacian = 0.1F, .edge_length = 3, .normal_consistency = 5, .flatness = 7}};

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("mesh losses and their gradients are the reference's, on spheres and on soup") {
    for (const Mesh& mesh : {rough_sphere(dpr::test::is_reduced() ? 0 : 1), soup(), dpr::make_cube()}) {
      for (const MeshLossWeights& weights : k_each) {
        const auto f = [&](const std::vector<double>& at) {
          return dpr::check::reference_loss(mesh, weights, at);
        };
        const Evaluation found = evaluate(mesh, weights);
        CHECK(found.loss == doctest::Approx(f(flat(mesh))).epsilon(2e-6));
        const auto check = dpr::reference::check_gradient(f, flat(mesh), found.gradient, 1e-5, 2e-5, 3e-7);
        CAPTURE(check.error);
        CAPTURE(check.worst);
        CHECK(check.passed);
      }
    }
  }

  TEST_CASE("a wrong gradient of a mesh loss is noticed") {
    const Mesh mesh = rough_sphere(0);
    Evaluation found = evaluate(mesh, k_each[4]);
    found.gradient[5] *= 1.001;
    const auto f = [&](const std::vector<double>& at) {
      return dpr::check::reference_loss(mesh, k_each[4], at);
    };
    CHECK_FALSE(dpr::reference::check_gradient(f, flat(mesh), found.gradient, 1e-5, 2e-5, 3e-7).passed);
  }

  TEST_CASE("backward of images and a mesh loss is the sum of both, the same bits each time") {
    dpr::Scene scene;
    scene.smoothing = dpr::smoothing_preset("gaussian");
    scene.width = scene.height = dpr::test::reduced(24, 8);
    scene.camera = dpr::orbit_camera(3, 10, 20);
    scene.meshes.push_back({dpr::make_cube()});
    scene.meshes.push_back({rough_sphere(0)});
    dpr::Renderer renderer(dpr::test::test_device());
    renderer.set_scene(scene);
    renderer.forward();
    const dpr::Image target(scene.width, scene.height, glm::vec4(0.2F));
    dpr::ImageLoss image_loss(renderer.device(), {.mse = 1}, {&target, 1});
    image_loss.evaluate(renderer);
    MeshLoss mesh_loss(renderer.device(), k_each[4], scene.meshes[1].mesh);
    CHECK_THROWS_AS(renderer.backward(image_loss, mesh_loss), dpr::InvalidArgument);  // not evaluated
    CHECK_THROWS_AS(mesh_loss.evaluate(renderer, 0), dpr::InvalidArgument);           // another mesh
    CHECK_THROWS_AS(mesh_loss.evaluate(renderer, 2), dpr::InvalidArgument);
    mesh_loss.evaluate(renderer, 1);
    const auto alone = renderer.backward(image_loss).meshes[1].positions;
    const auto both = renderer.backward(image_loss, mesh_loss).meshes[1].positions;
    CHECK(both == renderer.backward(image_loss, mesh_loss).meshes[1].positions);
    const Evaluation own = evaluate(scene.meshes[1].mesh, k_each[4]);
    for (std::size_t v = 0; v < both.size(); ++v) {
      for (int i = 0; i < 3; ++i) {
        CHECK(static_cast<double>(both[v][i] - alone[v][i]) ==
              doctest::Approx(own.gradient[3 * v + static_cast<std::size_t>(i)]).epsilon(1e-4));
      }
    }
    std::vector<glm::vec3> shapes = scene.meshes[0].mesh.positions;
    shapes.insert(shapes.end(), scene.meshes[1].mesh.positions.begin(), scene.meshes[1].mesh.positions.end());
    renderer.set_shapes(shapes, {});
    renderer.forward();
    CHECK_THROWS_AS(mesh_loss.evaluate(renderer, 1), dpr::InvalidArgument);  // whose shape?
  }
}

TEST_SUITE("unit") {
  TEST_CASE("one-rings of a manifold mesh are OpenMesh's") {
    const Mesh mesh = dpr::make_torus(1, 0.4F, 7, 5);
    OpenMesh::TriMesh_ArrayKernelT<> openmesh;
    for (const glm::vec3& p : mesh.positions) openmesh.add_vertex({p.x, p.y, p.z});
    for (const glm::uvec3& f : mesh.faces)
      openmesh.add_face(openmesh.vertex_handle(f.x), openmesh.vertex_handle(f.y),
                        openmesh.vertex_handle(f.z));
    const dpr::Adjacency adjacency = dpr::make_adjacency(mesh);
    CHECK(adjacency.edges() == openmesh.n_edges());
    CHECK(adjacency.hinges.size() == openmesh.n_edges());
    for (const auto v : openmesh.vertices()) {
      std::set<unsigned> expected;
      for (const auto other : openmesh.vv_range(v)) expected.insert(static_cast<unsigned>(other.idx()));
      const auto begin = adjacency.ring.begin() + adjacency.ring_starts[static_cast<std::size_t>(v.idx())];
      const auto end = adjacency.ring.begin() + adjacency.ring_starts[static_cast<std::size_t>(v.idx()) + 1];
      CHECK(std::vector<unsigned>(begin, end) == std::vector<unsigned>(expected.begin(), expected.end()));
    }
  }

  TEST_CASE("an edge with three faces has three hinges, a border none, and turning a face changes nothing") {
    const dpr::Adjacency adjacency = dpr::make_adjacency(soup());
    CHECK(adjacency.hinges.size() == 6);  // 3 faces at 0-1, 2 at 1-2, and 2 at 2-6, one with two sides there
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("mesh losses refuse wrong weights and meshes") {
    const dpr::Device& device = dpr::test::test_device();
    const float nan = std::numeric_limits<float>::quiet_NaN();
    CHECK_THROWS_AS(MeshLoss(device, {.laplacian = -1}, dpr::make_cube()), dpr::InvalidArgument);
    CHECK_THROWS_AS(MeshLoss(device, {.flatness = nan}, dpr::make_cube()), dpr::InvalidArgument);
    CHECK_THROWS_AS(MeshLoss(device, {.edge_target = -1}, dpr::make_cube()), dpr::InvalidArgument);
    CHECK_THROWS_AS(MeshLoss(device, {}, Mesh{}), dpr::InvalidArgument);
  }

  TEST_CASE("faces without area, edges of no length and soup without edges leave finite gradients") {
    Mesh flat_mesh;
    flat_mesh.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {1, 0, 0}, {5, 5, 5}};
    flat_mesh.faces = {{0, 1, 2}, {1, 3, 2}, {4, 4, 4}};
    for (const Mesh& mesh : {flat_mesh, Mesh{{{0, 0, 0}}, {{0, 0, 0}}, {}, {}, {}, {}, {}, {}}}) {
      for (const MeshLossWeights& weights : k_each) {
        const Evaluation found = evaluate(mesh, weights);
        CHECK(std::isfinite(found.loss));
        for (const double g : found.gradient) CHECK(std::isfinite(g));
      }
    }
  }
}

}  // namespace mesh_loss_test
