// Positions in clip space, from named arrays, in the C interface.
#include "dpr/clip_space.hpp"

#include <algorithm>
#include <span>
#include <vector>

#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"

using namespace dpr::c;
using dpr::batch::k_any;
using dpr::batch::NamedArray;

struct dpr_clip_space {
  static constexpr const char* k_handle = "dpr_clip_space";
  dpr::ClipSpace space;
  std::vector<glm::vec4> positions;

  std::size_t shapes() const { return space.scales().size(); }
  std::size_t vertices() const { return positions.size() / shapes(); }
  std::size_t intrinsics() const { return space.is_perspective() ? 4 : 1; }
};

namespace {

dpr_clip_space make(int width, int height, dpr::batch::NamedArrays arrays) {
  const NamedArray& positions = dpr::batch::require(arrays, "positions");
  dpr::batch::require_form(positions, dpr::batch::Element::float32, {{k_any, 4}, {k_any, k_any, 4}},
                           "[V, 4] or [N, V, 4]");
  std::vector<glm::uvec3> faces;
  for (const NamedArray& array : arrays) {
    if (array.name != "positions" && array.name != "faces")
      throw dpr::InvalidArgument("name (clip space)", "\"" + array.name + "\"", "positions or faces");
    if (array.name == "faces") faces = dpr::batch::read_triples(array);
  }
  const auto rows = positions.rows<const glm::vec4>();
  const std::size_t shapes = positions.shape.size() == 3 ? positions.shape[0] : 1;
  return {dpr::ClipSpace(rows, shapes, faces, width, height), {rows.begin(), rows.end()}};
}

/// Fills an array by its name.
void read(const dpr_clip_space& clip, const NamedArray& array) {
  const dpr::Camera& camera = clip.space.camera();
  const std::size_t shapes = clip.shapes();
  std::vector<float> numbers;
  const auto add = [&](std::initializer_list<float> more) { numbers.insert(numbers.end(), more); };
  if (array.name == "vertices") {
    dpr::batch::require_floats(array, {shapes, clip.vertices(), 3}, "[N, V, 3]");
    for (const glm::vec3& v : clip.space.vertices(clip.positions)) add({v.x, v.y, v.z});
  } else if (array.name == "views") {
    dpr::batch::require_floats(array, {shapes, 4, 4}, "[N, 4, 4]");
    for (std::size_t shape = 0; shape < shapes; ++shape)
      add({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  } else if (array.name == "intrinsics") {
    dpr::batch::require_floats(array, {shapes, clip.intrinsics()},
                               "[N, " + std::to_string(clip.intrinsics()) + "]");
    for (std::size_t shape = 0; shape < shapes; ++shape) {
      if (const auto& lens = camera.intrinsics) {
        add({lens->fx, lens->fy, lens->cx, lens->cy});
      } else {
        add({*camera.orthographic_height});
      }
    }
  } else if (array.name == "scales") {
    dpr::batch::require_floats(array, {shapes}, "[N]");
    numbers.assign(clip.space.scales().begin(), clip.space.scales().end());
  } else if (array.name == "planes") {
    dpr::batch::require_floats(array, {2}, "[2]");
    add({camera.znear, camera.zfar});
  } else {
    throw dpr::InvalidArgument("name (clip space)", "\"" + array.name + "\"",
                               "vertices, views, intrinsics, planes or scales");
  }
  std::ranges::copy(numbers, array.rows<float>().begin());
}

}  // namespace

dpr_status dpr_clip_space_create(int width, int height, const dpr_array* arrays, std::size_t count,
                                 dpr_clip_space** clip_space) {
  return guarded([&] {
    deref(clip_space, "clip_space");
    give(clip_space, make(width, height, dpr::batch::to_arrays(arrays, count, "arrays")));
  });
}

dpr_status dpr_clip_space_size(const dpr_clip_space* clip_space, std::size_t* shapes,
                               std::size_t* intrinsics) {
  return guarded([&] {
    deref(shapes, "shapes") = deref(clip_space, "clip_space").shapes();
    deref(intrinsics, "intrinsics") = clip_space->intrinsics();
  });
}

dpr_status dpr_clip_space_read(const dpr_clip_space* clip_space, const dpr_array* arrays, std::size_t count) {
  return guarded([&] {
    for (const NamedArray& array : dpr::batch::to_arrays(arrays, count, "arrays"))
      read(deref(clip_space, "clip_space"), array);
  });
}

dpr_status dpr_clip_space_backward(const dpr_clip_space* clip_space, const dpr_array* grad_vertices,
                                   const dpr_array* grad_positions) {
  return guarded([&] {
    const dpr_clip_space& clip = deref(clip_space, "clip_space");
    const NamedArray from = dpr::batch::to_arrays(grad_vertices, 1, "grad_vertices")[0],
                     to = dpr::batch::to_arrays(grad_positions, 1, "grad_positions")[0];
    if (from.name != "vertices" || to.name != "positions")
      throw dpr::InvalidArgument("name (clip space)", "\"" + from.name + "\" and \"" + to.name + "\"",
                                 "the gradient of vertices, and that of positions");
    dpr::batch::require_floats(from, {clip.shapes(), clip.vertices(), 3}, "[N, V, 3]");
    dpr::batch::require_floats(to, {clip.shapes(), clip.vertices(), 4}, "[N, V, 4]");
    std::ranges::copy(clip.space.gradient(clip.positions, from.rows<const glm::vec3>()),
                      to.rows<glm::vec4>().begin());
  });
}

void dpr_clip_space_destroy(dpr_clip_space* clip_space) { destroy(clip_space); }
