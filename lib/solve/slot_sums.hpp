// Sums of kernels over images' pixels, by slots that reduce.cl adds up, and quantiles found from counts.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "stages/reduce.hpp"

namespace dpr {

/// Numbers that a kernel sums, of every view.
struct ViewSums {
  double at(std::size_t number, std::size_t view) const {
    return static_cast<double>(values[number * views + view]);
  }

  std::vector<float> values;  // [number][view]
  std::size_t views;
};

class SlotSums {
 public:
  /// Of images of so many pixels.
  SlotSums(Device::Impl& device, std::size_t pixels);

  std::size_t slots() const { return slots_; }
  std::size_t pixels() const { return pixels_; }
  std::size_t width() const { return width_; }
  bool is_gpu() const { return width_ == 1; }
  /// Work-items of kernels that have one for each vector of pixels of so many images.
  std::size_t vectors(std::size_t images) const { return images * ((pixels_ + width_ - 1) / width_); }

  /// Adds up what a kernel sums into [number][view][slot]: so many numbers of every view, by so many parts.
  /// `launch` is called with the number of work-items and that buffer.
  template <typename Launch>
  ViewSums sum(std::size_t count, std::size_t parts, std::size_t views, const Launch& launch) {
    prepare(count, views);
    launch(parts * views * slots_ / width_, values_);
    return {reduce_.read({{views * slots_, count, views, 1, starts_, values_}}).front(), views};
  }

  /// Sizes that so large a part of all are below, [view][kind]; none where there are none. `launch` is that of a
  /// kernel which counts, in [kind][threshold], sizes below thresholds[view][kind][threshold], its third argument.
  template <typename Launch>
  std::vector<std::optional<float>> quantiles(double part, std::size_t views, std::size_t kinds,
                                              const Launch& launch) {
    // Bits of numbers that are not negative are in the numbers' order: they are found from the first on, four a
    // pass. Those that are left are below 1e-4 of the number.
    constexpr unsigned k_bits = 4, k_first_shift = 27, k_last_shift = 7;
    static_assert(1U << k_bits == k_thresholds);
    constexpr auto k_infinity = std::bit_cast<cl_uint>(std::numeric_limits<float>::infinity());
    std::vector<cl_uint> bits(views * kinds);
    std::vector<double> middle(bits.size());  // number of sizes below the quantile
    std::vector<std::optional<float>> result(bits.size());
    for (unsigned shift = k_first_shift; shift >= k_last_shift; shift -= k_bits) {
      std::vector<float> thresholds;
      for (const cl_uint first : bits) {
        for (cl_uint k = 1; k <= k_thresholds; ++k)
          thresholds.push_back(std::bit_cast<float>(std::min(first + (k << shift), k_infinity)));
      }
      thresholds_.upload(device_, thresholds);
      const ViewSums sums = sum(kinds * k_thresholds, 1, views,
                                [&](std::size_t items, auto& into) { launch(items, into, thresholds_); });
      for (std::size_t i = 0; i < bits.size(); ++i) {
        const auto below = [&](cl_uint k) { return sums.at(i % kinds * k_thresholds + k, i / kinds); };
        if (shift == k_first_shift) middle[i] = std::floor(part * below(k_thresholds - 1));
        cl_uint k = 0;
        while (k + 1 < k_thresholds && below(k) <= middle[i]) ++k;
        bits[i] += k << shift;
        if (below(k_thresholds - 1) > 0) result[i] = std::bit_cast<float>(bits[i]);
      }
    }
    return result;
  }

 private:
  static constexpr cl_uint k_thresholds = 16;  // as the kernels have them

  void prepare(std::size_t count, std::size_t views);

  Device::Impl& device_;
  std::size_t pixels_, slots_, width_;
  Reduce reduce_;
  Buffer<float> values_, thresholds_;
  Buffer<cl_uint> starts_;
};

}  // namespace dpr
