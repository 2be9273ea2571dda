#include "stages/gather.hpp"

namespace dpr {
namespace {

constexpr cl_uint k_corner_channels = 9;

/// The frame as if the faces that views have of their own were those of one view: as incidences number them.
shared::FrameParams by_rows(shared::FrameParams p) {
  if (p.own_faces == 0) return p;
  p.faces *= p.views;
  p.views = 1;
  return p;
}

}  // namespace

void Gather::per_view(const shared::FrameParams& p, std::size_t targets, const Bin& bin,
                      const Incidence& incidence, const PairSums& partial, Buffer<cl_float4>& grad) {
  corners(p, p.views / by_rows(p).views * targets, p.views * targets, bin, incidence, partial, grad);
}

void Gather::over_views(const shared::FrameParams& p, std::size_t targets, const Bin& bin,
                        const Incidence& incidence, const PairSums& partial, Buffer<cl_float4>& grad) {
  corners(p, targets, targets, bin, incidence, partial, grad);
}

void Gather::corners(const shared::FrameParams& p, std::size_t targets, std::size_t sums, const Bin& bin,
                     const Incidence& incidence, const PairSums& partial, Buffer<cl_float4>& grad) {
  const std::size_t parts = incidence.part_count, gathered = parts > 0 ? parts : targets;
  Buffer<cl_float4>& out = parts > 0 ? parts_ : grad;
  grad.resize(device_, sums);
  out.resize(device_, sums / targets * gathered);
  sum_chunks(p, bin, k_corner_channels, partial);
  launch_(out.size(),
          kernel::gather_corners{.p = by_rows(p),
                                 .targets = to_uint(gathered),
                                 .sum_views = cl_uint{sums == targets},
                                 .pair_starts = bin.pair_starts,
                                 .face_pairs = bin.face_pairs,
                                 .corner_starts = parts > 0 ? incidence.part_starts : incidence.starts,
                                 .corners = incidence.corners,
                                 .partial = partial.values,
                                 .first = partial.first,
                                 .chunks = chunks_,
                                 .grad = out});
  if (parts == 0) return;
  launch_(sums, kernel::gather_parts{.sums = to_uint(sums),
                                     .targets = to_uint(targets),
                                     .parts = to_uint(parts),
                                     .part_starts = incidence.parts,
                                     .partial = parts_,
                                     .grad = grad});
}

void Gather::over_views(const shared::FrameParams& p, const Bin& bin, const SurfaceMaterials& materials,
                        const PairSums& partial, Buffer<float>& channels) {
  const shared::FrameParams rows = by_rows(p);
  channels.resize(device_, std::size_t{DPR_MATERIAL_CHANNELS} * rows.faces);
  sum_chunks(p, bin, DPR_MATERIAL_CHANNELS, partial);
  launch_(rows.faces, kernel::gather_faces{.p = rows,
                                           .pair_starts = bin.pair_starts,
                                           .face_pairs = bin.face_pairs,
                                           .ordered = materials.faces,
                                           .partial = partial.values,
                                           .first = partial.first,
                                           .chunks = chunks_,
                                           .channels = channels});
}

void Gather::sum_chunks(const shared::FrameParams& p, const Bin& bin, cl_uint channels,
                        const PairSums& partial) {
  // A face has a pair a tile at most.
  if (std::size_t{p.tiles_x} * p.tiles_y <= DPR_RUN_CHUNK) return;
  const std::size_t slots = DPR_RUN_SLOTS(bin.pairs);
  chunks_.resize(device_, Length::varying(slots * channels));
  launch_(slots * channels, kernel::gather_chunks{.slots = to_uint(slots),
                                                  .channels = channels,
                                                  .faces = p.views * p.faces,
                                                  .pairs = bin.pair_count,
                                                  .place_face = bin.place_face,
                                                  .pair_starts = bin.pair_starts,
                                                  .face_pairs = bin.face_pairs,
                                                  .partial = partial.values,
                                                  .first = partial.first,
                                                  .chunks = chunks_});
}

}  // namespace dpr
