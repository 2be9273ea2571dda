#include "solve/slot_sums.hpp"

namespace dpr {
namespace {

/// Few enough pixels a slot for plain sums, in whole vectors.
std::size_t slots_of(std::size_t pixels) {
  constexpr std::size_t k_pixels_of_slot = 64;
  const std::size_t slots = (pixels + k_pixels_of_slot - 1) / k_pixels_of_slot;
  return (slots + k_widest_vector - 1) / k_widest_vector * k_widest_vector;
}

}  // namespace

SlotSums::SlotSums(Device::Impl& device, std::size_t pixels)
    : device_(device),
      pixels_(pixels),
      slots_(slots_of(pixels)),
      width_(std::min<std::size_t>(device.info.lanes, DPR_TILE)),
      reduce_(device) {}

void SlotSums::prepare(std::size_t count, std::size_t views) {
  values_.resize(device_, count * views * slots_);
  if (starts_.length().count >= views + 1) return;
  std::vector<cl_uint> starts;
  for (std::size_t view = 0; view <= views; ++view) starts.push_back(to_uint(view * slots_));
  starts_.upload(device_, starts);
}

}  // namespace dpr
