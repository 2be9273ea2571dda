// The self-test's parts, and the log that collects their comparisons.
#pragma once

#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>

#include "check/self_test.hpp"

namespace dpr::check {

/// The largest of many differences. What is not a number is infinitely wrong.
class Largest {
 public:
  void add(double difference) {
    if (std::isnan(difference)) difference = std::numeric_limits<double>::infinity();
    if (difference > value_) value_ = difference;
  }
  void add(double found, double expected) { add(std::fabs(found - expected)); }
  double value() const { return value_; }

 private:
  double value_ = 0;
};

/// Rows with the time since the one before.
class CheckLog {
 public:
  explicit CheckLog(std::function<void(const CheckRow&)> on_row) : on_row_(std::move(on_row)) {}

  void add(const std::string& stage, const std::string& compared, double worst, double bound) {
    add({stage, compared, worst, bound, 0, {}});
  }
  void add_failure(const std::string& stage, const std::string& error) {
    add({stage, "", std::numeric_limits<double>::infinity(), 0, 0, error});
  }

 private:
  using Clock = std::chrono::steady_clock;

  void add(CheckRow row) {
    const Clock::time_point now = Clock::now();
    row.seconds = std::chrono::duration<double>(now - std::exchange(last_, now)).count();
    on_row_(row);
  }

  std::function<void(const CheckRow&)> on_row_;
  Clock::time_point last_ = Clock::now();
};

/// Scan, sort and reduce.
void check_lists(const Device& device, CheckLog& log);
/// Vertices, fragments, colours and occupancies of a frame, stage by stage, its image, and all gradients.
void check_frame(const Device& device, CheckLog& log);
/// Rough surfaces in lights of every kind.
void check_microfacets(const Device& device, CheckLog& log);
/// Triangles that the near plane cuts.
void check_clipping(const Device& device, CheckLog& log);
/// The exact aggregation of every prior in both compositions.
void check_aggregation(const Device& device, CheckLog& log);
/// The sampled stages, of many samples, against the exact expectations.
void check_sampling(const Device& device, CheckLog& log);
/// Noise on the pixel.
void check_pixel_noise(const Device& device, CheckLog& log);
/// Losses of images and of meshes.
void check_losses(const Device& device, CheckLog& log);
/// Forward mode.
void check_tangents(const Device& device, CheckLog& log);

}  // namespace dpr::check
