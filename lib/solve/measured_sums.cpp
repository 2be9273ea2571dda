#include "solve/measured_sums.hpp"

namespace dpr {
namespace {

float inverse_square(float scale) { return scale > 0 ? 1 / (scale * scale) : 0; }

}  // namespace

MeasuredSums::MeasuredSums(const Device& device, const std::vector<cl_float4>& target,
                           const std::string& options)
    : device_(device),
      sums_(impl_of(device_), target.size()),
      launch_(impl_of(device_), options),
      target_(impl_of(device_), target) {}

std::vector<double> MeasuredSums::losses(const Buffer<cl_float4>& colors, const Buffer<cl_float4>& depths,
                                         std::size_t views, const MeasuredWeights& weights) {
  measured_.resize(impl_of(device_), 2 * k_kinds * views * sums_.pixels());
  const auto& [coverage, depth] = weights;
  const cl_float4 fit{
      {coverage.weight, inverse_square(coverage.scale), depth.weight, inverse_square(depth.scale)}};
  const ViewSums sums = sums_.sum(1, 1, views, [&](std::size_t items, Buffer<float>& into) {
    launch_(items, kernel::normal_measured_loss{.pixels = to_uint(sums_.pixels()),
                                                .views = to_uint(views),
                                                .slots = to_uint(sums_.slots()),
                                                .fit = fit,
                                                .colors = colors,
                                                .depths = depths,
                                                .target = target_,
                                                .measured = measured_,
                                                .sums = into});
  });
  std::vector<double> result;
  for (std::size_t view = 0; view < views; ++view) result.push_back(sums.at(0, view));
  return result;
}

void MeasuredSums::move(const Buffer<cl_float4>& tangents, const Buffer<cl_float4>& depth_tangents,
                        std::size_t directions, std::size_t views) {
  moved_.resize(impl_of(device_), directions * k_kinds * views * sums_.pixels());
  launch_(sums_.vectors(directions * views), kernel::normal_measured_moved{.pixels = to_uint(sums_.pixels()),
                                                                           .views = to_uint(views),
                                                                           .target = target_,
                                                                           .measured = measured_,
                                                                           .tangents = tangents,
                                                                           .depth_tangents = depth_tangents,
                                                                           .moved = moved_});
}

std::vector<std::optional<float>> MeasuredSums::medians(std::size_t views) {
  return sums_.quantiles(0.5, views, k_kinds,
                         [&](std::size_t items, Buffer<float>& into, const Buffer<float>& thresholds) {
                           launch_(items, kernel::normal_measured_counts{.pixels = to_uint(sums_.pixels()),
                                                                         .views = to_uint(views),
                                                                         .slots = to_uint(sums_.slots()),
                                                                         .thresholds = thresholds,
                                                                         .measured = measured_,
                                                                         .sums = into});
                         });
}

}  // namespace dpr
