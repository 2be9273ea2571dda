// Triangles given directly in NDC and view depth, through setup, binning and rasterization; and what the
// reference finds by brute force.
#pragma once

#include <array>
#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include "reference/rasterize.hpp"
#include "reference/transform.hpp"
#include "stages/bin.hpp"
#include "stages/rasterize.hpp"
#include "stages/setup.hpp"
#include "support/aggregate_errors.hpp"
#include "support/probe.hpp"

namespace dpr::test {

using NdcTriangle = std::array<glm::vec3, 3>;  // x, y in NDC, z the view depth

struct NdcFrame {
  int width = 16, height = 16;
  float blur_radius = 0;  // in the unit of the metric
  bool euclidean = false, perspective_correct = true;
  float znear = 1, zfar = 100;
  std::size_t views = 1;  // each view has its own triangles
};

inline reference::RasterizeParameters reference_parameters(const NdcFrame& frame) {
  reference::RasterizeParameters p;
  p.blur_radius = static_cast<double>(frame.blur_radius);
  p.metric = frame.euclidean ? reference::DistanceMetric::euclidean : reference::DistanceMetric::squared;
  p.perspective_correct = frame.perspective_correct;
  p.znear = static_cast<double>(frame.znear);
  p.zfar = static_cast<double>(frame.zfar);
  return p;
}

inline reference::NdcTriangle to_reference(const NdcTriangle& t) {
  reference::NdcTriangle r;
  for (std::size_t k = 0; k < 3; ++k) {
    r[k] = {static_cast<double>(t[k].x), static_cast<double>(t[k].y), static_cast<double>(t[k].z)};
  }
  return r;
}

/// The three stages on triangles of [view][face]. Every vertex belongs to one face.
class NdcStages {
 public:
  NdcStages(const NdcFrame& frame, const std::vector<NdcTriangle>& all, Device::Impl& device = device_impl())
      : setup(device), bin(device), rasterize(device), geometry_(device, scene_of(frame, all)) {
    std::vector<cl_float4> ndc;
    for (const NdcTriangle& t : all) {
      for (const glm::vec3& v : t) ndc.push_back({{v.x, v.y, v.z, 0.0F}});
    }
    ndc_.upload(device, ndc);
    shared::ViewParams view{};
    view.znear = frame.znear;
    view.zfar = frame.zfar;
    view.inverse_range = 1.0F / (frame.zfar - frame.znear);
    const std::vector<shared::ViewParams> cameras(frame.views, view);
    views_.cameras.upload(device, cameras);
    hidden_.upload(device, std::vector<float>(frame.views));
    params.views = static_cast<cl_uint>(frame.views);
    params.meshes = 1;
    params.vertices = static_cast<cl_uint>(geometry_.vertices);
    params.normals = params.vertices;
    params.faces = static_cast<cl_uint>(geometry_.faces);
    params.width = static_cast<cl_uint>(frame.width);
    params.height = static_cast<cl_uint>(frame.height);
    params.tiles_x = (params.width + DPR_TILE - 1) / DPR_TILE;
    params.tiles_y = (params.height + DPR_TILE - 1) / DPR_TILE;
    params.pixel_size = 2.0F / static_cast<float>(std::min(frame.width, frame.height));
    params.blur_distance = frame.euclidean ? frame.blur_radius : std::sqrt(frame.blur_radius);
    params.euclidean = frame.euclidean ? 1 : 0;
    params.perspective_correct = frame.perspective_correct ? 1 : 0;
  }

  /// Leaves out samples that lie that much behind another triangle, normalised depth, from now on.
  void hide(float reach) { rasterize.hiding.emplace(reach, views_.cameras); }
  void set_up() { setup.forward(params, views_, geometry_, ndc_, hidden_, bin.pair_starts); }
  void list_pairs() {
    set_up();
    bin.start();
    bin.forward(params, setup);
  }
  /// Outputs are poisoned before, as far as their sizes are known beforehand.
  void forward() {
    list_pairs();
    rasterize.forward(params, setup.triangles, bin);
    set_planes(rasterize.values, params.fragments, {});
    poison(rasterize.list, rasterize.fragments, 0xdeadbeefU);
    poison(rasterize.fragment_pair, rasterize.fragments, 0xdeadbeefU);
    rasterize.forward(params, setup.triangles, bin);
  }

  shared::FrameParams params{};
  Setup setup;
  Bin bin;
  Rasterize rasterize;

 private:
  static Scene scene_of(const NdcFrame& frame, const std::vector<NdcTriangle>& all) {
    Scene scene;
    scene.smoothing = smoothing_preset("gaussian");
    Mesh mesh;
    const auto faces = static_cast<unsigned>(all.size() / frame.views);
    for (unsigned f = 0; f < faces; ++f) {
      mesh.faces.emplace_back(3 * f, 3 * f + 1, 3 * f + 2);
      for (int k = 0; k < 3; ++k) mesh.positions.emplace_back(0.0F);
    }
    scene.meshes.push_back({mesh, glm::mat4(1.0F)});
    return scene;
  }

  Geometry geometry_;
  DeviceViews views_;
  Buffer<cl_float4> ndc_;
  Buffer<float> hidden_;
};

/// A pixel of a view, row and column, and a face.
struct FragmentKey {
  std::size_t view;
  int row, column;
  std::size_t face;
  auto operator<=>(const FragmentKey&) const = default;
};

struct FoundFragment {
  std::size_t index, pair;  // in the fragment and pair buffers
  double distance, depth, bary1, bary2;
};

/// The fragments of every pixel's list. A fragment listed twice, or under another pixel than it says, is
/// counted.
struct FoundFragments {
  std::map<FragmentKey, FoundFragment> all;
  std::size_t misplaced = 0, unordered = 0;
};

inline FoundFragments read_fragments(const NdcStages& s) {
  const Rasterize& r = s.rasterize;
  const std::vector<cl_uint> starts = r.pixel_starts.download(), list = r.list.download(),
                             pair = r.fragment_pair.download(), place = r.fragment_pixel.download(),
                             faces = s.bin.pair_face.download();
  const auto plane = [&](cl_uint number) { return r.plane(s.params, number); };
  const std::vector<float> distance = plane(DPR_PLANE_DISTANCE), depth = plane(DPR_PLANE_DEPTH),
                           bary1 = plane(DPR_PLANE_BARY), bary2 = plane(DPR_PLANE_BARY + 1);
  FoundFragments found;
  const std::size_t pixels = std::size_t{s.params.width} * s.params.height;
  for (std::size_t pixel = 0; pixel < pixels * s.params.views; ++pixel) {
    const std::size_t view = pixel / pixels, row = pixel % pixels / s.params.width,
                      column = pixel % s.params.width;
    cl_uint last_face = 0;
    for (cl_uint at = starts[pixel]; at < starts[pixel + 1]; ++at) {
      const cl_uint fragment = list.at(at);
      const cl_uint view_face = faces.at(pair.at(fragment));
      const FragmentKey key{view, static_cast<int>(row), static_cast<int>(column),
                            view_face % s.params.faces};
      const bool is_new = found.all
                              .emplace(key, FoundFragment{fragment, pair[fragment],
                                                          number(distance[fragment]), number(depth[fragment]),
                                                          number(bary1[fragment]), number(bary2[fragment])})
                              .second;
      if (!is_new || place[fragment] != (column | row << 16U) || view_face / s.params.faces != view) {
        ++found.misplaced;
      }
      if (at > starts[pixel] && view_face <= last_face) ++found.unordered;
      last_face = view_face;
    }
  }
  return found;
}

/// How far a pixel is from changing sides: of being inside, or within the blur radius. In the unit of the
/// metric.
inline double criterion_margin(const reference::NdcTriangle& t, const reference::Vec2d& point,
                               const reference::RasterizeParameters& p) {
  const double squared = reference::nearest_edge(t, point).squared_distance;
  const double magnitude = p.metric == reference::DistanceMetric::squared ? squared : std::sqrt(squared);
  return std::min(magnitude, std::abs(magnitude - p.blur_radius));
}

/// Triangles of all sizes about the image, a few of them reaching far outside.
inline std::vector<NdcTriangle> random_triangles(std::size_t count, float size, unsigned seed) {
  RandomFloat random(seed);
  std::vector<NdcTriangle> all;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec2 center(random(-1.6F, 1.6F), random(-1.6F, 1.6F));
    const float extent = size * (i % 7 == 0 ? 4.0F : random(0.1F, 1.0F));
    NdcTriangle t{};
    for (glm::vec3& v : t) {
      v = glm::vec3(center.x + extent * random(-1, 1), center.y + extent * random(-1, 1), random(2, 9));
    }
    all.push_back(t);
  }
  return all;
}

}  // namespace dpr::test
