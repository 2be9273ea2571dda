// Contours of every view: the edges where its rigid image may jump, by tile.
#pragma once

#include <optional>

#include "dpr/light.hpp"
#include "kernels/bin.hpp"
#include "kernels/contour.hpp"
#include "stages/edges.hpp"
#include "stages/geometry.hpp"
#include "stages/scan.hpp"
#include "stages/sort.hpp"
#include "stages/transform.hpp"

namespace dpr {

/// Everything of a frame that contours are found by.
struct ContourInputs {
  const shared::FrameParams& p;
  const DeviceViews& views;
  const Geometry& geometry;
  const Edges& edges;  ///< joined where vertices lie
  const Transform& transform;
  const Buffer<cl_uchar>& facing;              ///< [view][face] Setup::facing
  const Buffer<shared::ClippedFace>& clipped;  ///< [view][face] where p.clips is set
  const Buffer<cl_uint4>& normal_faces;        ///< [face] of frames that show normals beside colours
  const Buffer<cl_float4>& normals;            ///< [normal]
};

/// Tells a frame of its contours, once it is known whether faces are clipped. `shading` of a lit scene.
void set_edges(shared::FrameParams& p, const Edges& edges, const std::optional<Shading>& shading,
               float depth_reach);

class Contour {
 public:
  explicit Contour(Device::Impl& device) : device_(device), launch_(device), scan_(device), sort_(device) {}

  /// Blocks to read the number of pairs.
  void forward(const ContourInputs& in);
  /// Does not wait to learn how many pairs there are. If they exceed the capacity, all are left out.
  /// Kernels are launched for as many as are likely.
  void forward_within(const ContourInputs& in, std::size_t capacity, std::size_t likely);
  /// Says how many pairs there are, after a forward_within() whose capacity was enough.
  void settle(std::size_t known_pairs);
  /// Adds the gradients of the pairs' ends to those of the vertices; where faces are clipped, those of ends
  /// on the planes to `grad_clip`, as Transform::backward() has it, and fills `grad_cuts`.
  void gather(const ContourInputs& in, const Buffer<cl_float4>& grad_ends, Buffer<cl_float4>& grad_ndc,
              Buffer<cl_float4>& grad_clip);

  std::size_t pairs = 0;         ///< or the capacity, until the number is known
  std::size_t launched = 0;      ///< work-items for all of them, which take several each where there are more
  Buffer<cl_uint> pair_count;    ///< [1] how many there are, 0 where they do not fit
  Buffer<cl_uint> pair_starts;   ///< [view * edge + 1] runs of the edges' pairs
  Buffer<cl_uint> pair_contour;  ///< [pair] see DPR_CONTOUR_FLAGS
  Buffer<cl_uint> pair_tile;     ///< [pair] view * tiles + tile
  Buffer<cl_uint> tile_starts;   ///< [view * tile + 1] runs of pairs
  Buffer<float> grad_cuts;       ///< [DPR_CUT_CHANNELS][view][vertex] where a lens distorts cuts

  std::size_t bytes() const;

 private:
  void count(const ContourInputs& in);
  void list(const ContourInputs& in, std::size_t capacity, std::size_t likely);

  Device::Impl& device_;
  Launcher<kernel::contour_count, kernel::contour_fill, kernel::bin_link, kernel::contour_gather,
           kernel::contour_drop_near, kernel::contour_gather_cuts>
      launch_;
  Scan scan_;
  Sort sort_;
  Buffer<cl_uchar> kinds_;                  // [view][edge] of contours: see contour_count
  Buffer<cl_uint> edge_pairs_;              // the pairs of every edge
  Buffer<cl_uint> place_contour_, places_;  // [pair] before sorting
};

}  // namespace dpr
