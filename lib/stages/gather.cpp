#include "stages/gather.hpp"

namespace dpr {

Gather::Gather(Device::Impl& device)
    : device_(device),
      corners_(device, "gather.cl", "gather_corners"),
      faces_(device, "gather.cl", "gather_faces") {}

void Gather::per_view(const shared::FrameParams& p, std::size_t targets, const Bin& bin,
                      const Incidence& incidence, const Buffer<float>& partial, Buffer<cl_float4>& grad) {
  grad.resize(device_, p.views * targets);
  corners_(p.views * targets, p, static_cast<cl_uint>(targets), 0, bin.pair_starts, bin.face_pairs,
           incidence.starts, incidence.corners, partial, grad);
}

void Gather::over_views(const shared::FrameParams& p, std::size_t targets, const Bin& bin,
                        const Incidence& incidence, const Buffer<float>& partial, Buffer<cl_float4>& grad) {
  grad.resize(device_, targets);
  corners_(targets, p, static_cast<cl_uint>(targets), 1, bin.pair_starts, bin.face_pairs, incidence.starts,
           incidence.corners, partial, grad);
}

void Gather::over_views(const shared::FrameParams& p, const Bin& bin, const SurfaceMaterials& materials,
                        const Buffer<float>& partial, Buffer<float>& channels) {
  channels.resize(device_, std::size_t{DPR_MATERIAL_CHANNELS} * p.faces);
  faces_(p.faces, p, bin.pair_starts, bin.face_pairs, materials.faces, partial, channels);
}

}  // namespace dpr
