#include "multi_device/gradient_sum.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "scene/gradient_table.hpp"

namespace dpr {
namespace {

/// Adds the gradients of chunks, which come in their order, in double precision.
class GradientSum {
 public:
  void add_chunk(SceneGradient&& chunk) {
    std::size_t next = 0;
    for_each_array(chunk, [&](const GradientRow& row, GradientIndex, const GradientArray& array) {
      if (is_per_view(row.of)) return;
      if (next == sums_.size()) sums_.emplace_back();
      add(sums_[next++], array);
    });
    std::ranges::move(chunk.views, std::back_inserter(views_));
    last_ = std::move(chunk);
  }

  SceneGradient finish() {
    std::size_t next = 0;
    for_each_array(last_, [&](const GradientRow& row, GradientIndex, const GradientArray& array) {
      if (is_per_view(row.of)) return;
      auto value = sums_[next++].begin();
      transform_numbers(array, [&](double) { return *value++; });
    });
    last_.views = std::move(views_);
    return std::move(last_);
  }

 private:
  static void add(std::vector<double>& sum, const GradientArray& array) {
    std::size_t i = 0;
    transform_numbers(array, [&](double value) {
      if (i == sum.size()) sum.push_back(0.0);
      sum[i++] += value;
      return value;
    });
  }

  std::vector<std::vector<double>> sums_;  // [array that is a sum over the views]
  std::vector<ViewGradient> views_;
  SceneGradient last_;
};

}  // namespace

SceneGradient sum_of(std::vector<SceneGradient>&& parts) {
  if (parts.size() == 1) return std::move(parts.front());
  GradientSum sum;
  for (SceneGradient& part : parts) sum.add_chunk(std::move(part));
  return sum.finish();
}

}  // namespace dpr
