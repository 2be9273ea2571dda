// Chunks of long runs: which slot has which elements, and gradients of a face of more pairs than one
// work-item adds.
#include <doctest/doctest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/probe.hpp"
#include "support/reduced.hpp"

namespace runs_test {

using namespace dpr;
using dpr::test::reduced;

TEST_SUITE("unit") {
  TEST_CASE("runs: chunks share every long run out, none is longer than one work-item adds") {
    const std::vector<cl_uint> lengths{1, 513,  0,   512, 1024, 511,  1025, 3,   3,
                                       0, 5000, 700, 513, 513,  1536, 1537, 100, 600};
    const cl_uint keys = static_cast<cl_uint>(lengths.size()) - 1;  // the last does not count
    std::vector<cl_uint> starts{0}, list_keys;
    for (cl_uint key = 0; key < lengths.size(); ++key) {
      starts.push_back(starts.back() + lengths[key]);
      list_keys.insert(list_keys.end(), lengths[key], key);
    }
    const cl_uint count = starts.back(), slots = DPR_RUN_SLOTS(count);
    std::vector<std::pair<cl_uint, cl_uint>> expected(slots), found;
    for (cl_uint key = 0; key < keys; ++key) {
      for (cl_uint k = starts[key]; lengths[key] > DPR_RUN_CHUNK && k < starts[key + 1]; k += DPR_RUN_CHUNK) {
        auto& chunk = expected[2 * (k / DPR_RUN_CHUNK) + (k == starts[key] ? 1 : 0)];
        CHECK(chunk.second == 0);  // the only one there
        chunk = {k, std::min(k + DPR_RUN_CHUNK, starts[key + 1])};
      }
    }
    dpr::test::Probe probe(
        {"runs.h"},
        "kernel void probe(const uint count, global const uint* list_keys, const uint keys,\n"
        "                  global const uint* starts, global uint2* chunks) {\n"
        "  const uint i = (uint)get_global_id(0);\n"
        "  chunks[i] = chunk_of_slot(i, count, list_keys, keys, starts);\n"
        "}\n");
    const Buffer<cl_uint> in(dpr::test::device_impl(), std::span(std::as_const(list_keys)));
    const Buffer<cl_uint> runs(dpr::test::device_impl(), std::span(std::as_const(starts)));
    Buffer<cl_uint2> out;
    dpr::test::poison(out, slots, cl_uint2{{7, 7}});
    probe(slots, count, in, keys, runs, out);
    for (const cl_uint2& chunk : out.download()) found.emplace_back(chunk.s[0], chunk.s[1]);
    CHECK(found == expected);
  }

  TEST_CASE("runs: a face that fills the image, to the rounding of short sums") {
    const int size = reduced(256, 24);
    Mesh mesh;
    mesh.positions = {{-30, -30, -5}, {30, -30, -5}, {0, 60, -5}};
    mesh.faces = {{0, 1, 2}};
    const glm::vec3 color(0.5F, 0.25F, 1.0F);
    mesh.vertex_colors = std::vector<glm::vec3>(3, color);
    Scene scene = test::pipeline::scene_of(mesh, size, size);
    scene.meshes[0].transform = glm::mat4(1.0F);
    scene.camera = Camera{};
    scene.gradients.colors = true;
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const Image image = renderer.image();
    const float weight = 0.1F;
    const Image grad(size, size, glm::vec4(weight));
    const SceneGradient gradient = renderer.backward(std::span(&grad, 1));
    glm::dvec3 expected(0.0), colors(0.0);
    for (const glm::vec4& pixel : image.pixels) expected += glm::dvec3(pixel) * static_cast<double>(weight);
    for (const glm::vec3& grad_color : gradient.meshes[0].colors) colors += glm::dvec3(grad_color);
    for (int k = 0; k < 3; ++k)
      CHECK(colors[k] * static_cast<double>(color[k]) == doctest::Approx(expected[k]).epsilon(3e-5));
  }
}

}  // namespace runs_test
