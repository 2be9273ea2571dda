#include "stages/scan.hpp"

#include <string>

namespace dpr {

std::size_t scanned_at_once(const Device::Impl& device) {
  constexpr std::size_t k_by_a_work_item = 32768;  // 17 microseconds; a launch takes 5 to 10
  return device.info.lanes == 1 ? DPR_SCAN_CHUNK : k_by_a_work_item;
}

Scan::Scan(Device::Impl& device) : device_(device), launch_(device) {
  const cl_uint zero = 0, all = std::numeric_limits<cl_uint>::max();
  zero_.upload(device, std::span(&zero, 1));
  all_.upload(device, std::span(&all, 1));
  bases_.resize(4);  // 1024^4 > 2^32 counts
}

void Scan::scan_level(std::size_t count, const Buffer<cl_uint>& present, Buffer<cl_uint>& values,
                      std::size_t level) {
  const auto n = static_cast<cl_uint>(count);
  if (count <= scanned_at_once(device_)) {
    launch_.in_groups(
        1, kernel::scan_apply{.count = n, .size = n, .present = present, .bases = zero_, .values = values});
    return;
  }
  const std::size_t chunks = (count + DPR_SCAN_CHUNK - 1) / DPR_SCAN_CHUNK;
  Buffer<cl_uint>& bases = bases_[level];
  bases.resize(device_, chunks + 1);
  launch_.in_groups(chunks,
                    kernel::scan_sum{.count = n, .present = present, .values = values, .sums = bases});
  scan_level(chunks, all_, bases, level + 1);
  launch_.in_groups(
      chunks,
      kernel::scan_apply{
          .count = n, .size = cl_uint{DPR_SCAN_CHUNK}, .present = present, .bases = bases, .values = values});
}

std::size_t Scan::bytes() const {
  std::size_t bytes = zero_.capacity_bytes() + all_.capacity_bytes();
  for (const Buffer<cl_uint>& bases : bases_) bytes += bases.capacity_bytes();
  return bytes;
}

void check_total(std::size_t total, const char* what, std::size_t most) {
  if (total > most)
    throw InvalidArgument(what, "more than " + std::to_string(most), "a smaller image, blur radius or mesh");
}

std::size_t read_total(const Buffer<cl_uint>& offsets, std::size_t count, const char* what,
                       std::size_t most) {
  cl_uint total = 0;
  offsets.download(std::span(&total, 1), count);
  check_total(total, what, most);
  return total;
}

}  // namespace dpr
