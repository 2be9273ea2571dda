// Fragments: every (pixel, triangle) pair within the blur distance, by triangle, and each pixel's list of its
// own.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <vector>

#include "kernels/rasterize.hpp"
#include "kernels/rasterize_hide.hpp"
#include "stages/bin.hpp"
#include "stages/clip.hpp"
#include "stages/scan.hpp"
#include "stages/window.hpp"

namespace dpr {

/// Pairs and fragments that a frame holds, or its buffers can hold; and, with noise on the pixel, pairs
/// of tiles and contours.
struct FrameCounts {
  std::size_t pairs = 0, fragments = 0, contours = 0;

  bool fit(const FrameCounts& capacity) const {
    return pairs <= capacity.pairs && fragments <= capacity.fragments && contours <= capacity.contours;
  }
};

inline FrameCounts larger(const FrameCounts& a, const FrameCounts& b) {
  return {std::max(a.pairs, b.pairs), std::max(a.fragments, b.fragments), std::max(a.contours, b.contours)};
}

/// What the device noted of frames that the host does not wait for.
struct FrameNote {
  FrameCounts counts;       ///< the most of any; of fragments only where the pairs fitted
  std::size_t emptied = 0;  ///< frames up to the last of them that are in no note before
};

/// Contours' pairs of a frame, as far as they have to fit: starts[last] is how many there are.
struct ContourCount {
  std::size_t last;
  Buffer<cl_uint>& starts;
};

/// Samples without fragments, where all triangles are opaque: those that lie further than `reach`,
/// normalised depth, behind another.
struct Hiding {
  float reach;
  const Buffer<shared::ViewParams>& cameras;
};

/// Rows of as many pixels of the window.
struct PixelBlock {
  Range row(std::size_t r) const { return {first + r * stride, columns}; }

  std::size_t first, columns, rows = 1, stride = 0;
};

/// A stretch of tiles whose fragments are on the device at the same time: whole rows of tiles, all views' one
/// after the other, as a single row of pixels; or a part of a row that is too large.
struct Band {
  Range tiles, pairs;
  PixelBlock pixels;
  Range fragments;  ///< of the frame's, by pair; as many by pixel
};

/// The launch of a kernel that handles pairs in groups (kernels/tile_lanes.h).
struct PairGroups {
  /// For as many pairs as Bin::launched says.
  PairGroups(const Device::Impl& device, const Range& of, std::size_t launched);

  cl_uint2 pairs;     ///< the first, and the one behind the last
  std::size_t count;  ///< work-items
};

class Rasterize {
 public:
  explicit Rasterize(Device::Impl& device) : device_(device), launch_(device), scan_(device) {}

  /// Finds what every pair covers and counts the fragments. Blocks to read where each row of tiles begins.
  /// Counts those of pixels, if the frame is not in bands of samples.
  void cover(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, Bin& bin,
             bool counts_pixels = true);
  /// Counts the fragments of the window's pixels; after cover().
  void count_pixels(const shared::FrameParams& p, const Bin& bin);
  /// The same and forward() of the whole frame without waiting to learn how many fragments there are. If
  /// anything exceeds the capacity the frame is emptied, with the lists of faces' and contours' pairs;
  /// read_counts() returns the true counts, so that the caller can retry. `reads`: they are on their way to
  /// the host at once; else only history() takes part.
  /// Kernels are launched for `likely_fragments`.
  void forward_within(const FrameCounts& capacity, std::size_t likely_fragments, shared::FrameParams& p,
                      const Buffer<shared::Triangle>& triangles, Bin& bin,
                      const std::optional<ContourCount>& contours, bool reads);
  /// Counts of forward_within(). Blocks until the device has counted and, where it did not read, rendered.
  FrameCounts read_counts();
  /// [2] of the frames that forward_within() did not read: the most pairs, fragments and contours' pairs of
  /// any, and those of the last; and, of both, how many frames were emptied. All 0 at first, and after
  /// forget_history().
  Buffer<cl_uint4>& history();
  void forget_history();
  /// The history after those frames, as far as it has arrived. Does not block.
  FrameNote poll_notes();
  /// The counts of the notes that are on the way are those of another scene.
  void disown_notes() { disowned_notes_ = notes_under_way_; }
  /// Says what the counts are, after a forward_within() whose capacity was enough. Returns the whole frame as
  /// the band whose fragments these are.
  Band settle(shared::FrameParams& p, const FrameCounts& counts);
  /// Counts of a frame that cover() counted.
  FrameCounts counted() const;
  /// Reads where each row of tiles begins, of a frame that forward_within() rendered. Blocks.
  void read_rows(const shared::FrameParams& p);
  /// Cuts rows of tiles of the window into bands whose fragments, of so many bytes each, fit the budget; after
  /// cover() or read_rows(). Blocks where a row of tiles has to be cut. A band is no less than a tile, even if that
  /// does not fit.
  std::vector<Band> cut(const shared::FrameParams& p, const Bin& bin, const Range& rows, std::size_t budget,
                        std::size_t fragment_bytes) const;
  /// Throws InvalidArgument if a band does not fit.
  static void require_fits(std::span<const Band> bands, std::size_t budget, std::size_t fragment_bytes);
  /// The fragments of a band; their numbers count from the band's first. `p` gets what it says of them, and of
  /// the pairs.
  void forward(shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin,
               const Band& band);
  /// All of it: cover() and forward() of the whole frame.
  void forward(shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, Bin& bin);
  /// Makes room for `grads`.
  void start_gradients(const shared::FrameParams& p);
  /// From the gradients of distance, depth and barycentrics to `grad_corners` of the band's pairs.
  void backward(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, const Bin& bin);
  /// Makes room for the tangents of the band's fragments, and fills those of depths, barycentrics and distances,
  /// by those of the vertices.
  void tangent(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles,
               const Geometry& geometry, const Bin& bin, Tangents& tangents);
  /// The band's fragments' DPR_PLANE_..., or the gradients.
  std::vector<float> plane(const shared::FrameParams& p, cl_uint number) const;
  std::vector<float> grad_plane(const shared::FrameParams& p, cl_uint number) const;

  /// Pairs that the stages behind this one work on: the band's, or all where none was cut.
  Range pairs(const Bin& bin) const { return band ? band->pairs : Range(bin.pairs); }
  std::vector<Range> pixels(const shared::FrameParams& p) const;
  Range tiles(const shared::FrameParams& p) const;

  PairGroups pair_groups(const Bin& bin) const { return PairGroups(device_, pairs(bin), bin.launched); }

  /// Fragments to launch for, by kernels that take more where there are more.
  std::size_t launched_fragments() const { return std::min(fragments, likely_fragments_); }

  /// Vectors of fragments to launch for (kernels/tile_lanes.h).
  std::size_t vectors() const;

  /// Length of the buffers that later stages hold of every fragment.
  Length fragment_length() const { return length(fragments); }

  /// Bytes a fragment of the buffers below, and of base colours.
  static constexpr std::size_t k_fragment_bytes =
      3 * sizeof(cl_uint) + (DPR_PLANE_BASE + DPR_GRAD_PLANE_BASE) * sizeof(float);
  static constexpr std::size_t k_base_bytes = 6 * sizeof(float);
  /// Of the largest of all buffers of fragments, at the most.
  static constexpr std::size_t k_largest_bytes = (DPR_PLANE_BASE + 3) * sizeof(float);
  /// Fragments of a band whose planes kernels index by 32 bits.
  static constexpr std::size_t k_most_fragments =
      std::numeric_limits<cl_uint>::max() / (DPR_PLANE_BASE + 3) - k_widest_vector;

  Clip* clip = nullptr;             ///< of frames with faces that cross a plane
  std::optional<Hiding> hiding;     ///< none: everything may be seen
  std::optional<Band> band;         ///< whose fragments these are
  std::size_t fragments = 0;        ///< of the band; or the capacity
  std::size_t frame_fragments = 0;  ///< of all bands
  Buffer<cl_uint2> masks;           ///< [pair] pixels of its tile that a pair covers
  Buffer<cl_uint> fragment_starts;  ///< [pair + 1]
  Buffer<cl_uint> pixel_starts;     ///< [pixels_of(p) + 1] runs of `list`
  Buffer<cl_uint> list;             ///< [fragment] fragments by pixel
  Buffer<cl_uint> fragment_pair;    ///< [fragment]
  Buffer<cl_uint> fragment_pixel;   ///< [fragment] x | y << 16
  Buffer<float> values;             ///< [DPR_PLANE_...][p.fragments]
  Buffer<float> grads;              ///< [DPR_PLANE_...][p.grad_fragments]
  Buffer<float> grad_corners;       ///< [pair][9] x, y (NDC) and view depth of the corners

  std::size_t bytes() const;

 private:
  /// Pairs and fragments before a tile.
  struct TileStart {
    std::size_t tile, pair, fragment;
  };

  /// The oldest of those under way, which it no longer is.
  PendingRead<cl_uint4>& next_note();
  /// The tiles of a row.
  std::vector<TileStart> tile_starts(const shared::FrameParams& p, const Bin& bin, std::size_t row) const;
  void rebase(const Band& next);
  Length length(std::size_t count) const {
    return counted_ ? Length::varying(count) : Length::at_most(count);
  }
  void count(const shared::FrameParams& p, const Buffer<shared::Triangle>& triangles, Bin& bin,
             const ContourCount& contours, bool counts_pixels);

  Device::Impl& device_;
  Launcher<kernel::rasterize_cover, kernel::rasterize_hide, kernel::rasterize_count, kernel::rasterize_rows,
           kernel::rasterize_fit, kernel::rasterize_note, kernel::rasterize_rebase, kernel::rasterize_list,
           kernel::rasterize_forward, kernel::rasterize_backward, kernel::rasterize_tangent>
      launch_;
  Scan scan_;
  Buffer<cl_uint4> device_rows_, history_;
  PendingRead<cl_uint4> last_row_;
  std::array<PendingRead<cl_uint4>, 8> notes_;  // a ring; frames beyond are in the next note
  std::size_t oldest_note_ = 0, notes_under_way_ = 0, disowned_notes_ = 0;
  cl_uint noted_emptied_ = 0;  // frames, in the notes so far
  std::size_t likely_fragments_ = std::numeric_limits<std::size_t>::max();
  std::vector<TileStart> row_starts_;  // [view * tiles_y + 1]
  bool counted_ = true;                // the counts are the frame's, not the capacity
  bool in_bands_ = false;  // the starts above are a band's, those below the frame's, or the window's
  Buffer<cl_uint> frame_fragment_starts_, frame_pixel_starts_;
};

}  // namespace dpr
