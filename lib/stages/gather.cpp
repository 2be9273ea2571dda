#include "stages/gather.hpp"

namespace dpr {
namespace {

constexpr cl_uint k_corner_channels = 9;

}  // namespace

Gather::Gather(Device::Impl& device)
    : device_(device),
      chunk_sums_(device, "gather.cl", "gather_chunks"),
      corners_(device, "gather.cl", "gather_corners"),
      faces_(device, "gather.cl", "gather_faces") {}

void Gather::per_view(const shared::FrameParams& p, std::size_t targets, const Bin& bin,
                      const Incidence& incidence, const Buffer<float>& partial, Buffer<cl_float4>& grad) {
  grad.resize(device_, p.views * targets);
  sum_chunks(p, bin, k_corner_channels, partial);
  corners_(p.views * targets, p, static_cast<cl_uint>(targets), 0, bin.pair_starts, bin.face_pairs,
           incidence.starts, incidence.corners, partial, chunks_, grad);
}

void Gather::over_views(const shared::FrameParams& p, std::size_t targets, const Bin& bin,
                        const Incidence& incidence, const Buffer<float>& partial, Buffer<cl_float4>& grad) {
  grad.resize(device_, targets);
  sum_chunks(p, bin, k_corner_channels, partial);
  corners_(targets, p, static_cast<cl_uint>(targets), 1, bin.pair_starts, bin.face_pairs, incidence.starts,
           incidence.corners, partial, chunks_, grad);
}

void Gather::over_views(const shared::FrameParams& p, const Bin& bin, const SurfaceMaterials& materials,
                        const Buffer<float>& partial, Buffer<float>& channels) {
  channels.resize(device_, std::size_t{DPR_MATERIAL_CHANNELS} * p.faces);
  sum_chunks(p, bin, DPR_MATERIAL_CHANNELS, partial);
  faces_(p.faces, p, bin.pair_starts, bin.face_pairs, materials.faces, partial, chunks_, channels);
}

void Gather::sum_chunks(const shared::FrameParams& p, const Bin& bin, cl_uint channels,
                        const Buffer<float>& partial) {
  // A face has a pair a tile at most.
  if (std::size_t{p.tiles_x} * p.tiles_y <= DPR_RUN_CHUNK) return;
  const std::size_t slots = DPR_RUN_SLOTS(bin.pairs);
  chunks_.resize(device_, Length::varying(slots * channels));
  chunk_sums_(slots * channels, to_uint(slots), channels, p.views * p.faces, bin.pair_count, bin.place_face,
              bin.pair_starts, bin.face_pairs, partial, chunks_);
}

}  // namespace dpr
