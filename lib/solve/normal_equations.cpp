#include "solve/normal_equations.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

namespace dpr {
namespace {

constexpr std::size_t k_channels = 3;
constexpr std::size_t k_cell_sums = 6;  // as the kernel has them

// Weighing and solving in turn: until the loss falls by no more than a part, but no more often than that. The
// loss of a hypothesis must be at its least for its derivatives to hold.
constexpr int k_most_reweightings = 30;
constexpr double k_least_fall = 1e-5;

// Scale of the robust loss, in standard deviations of the residuals, and its lower bound: the colour
// difference that blur and rounding leave anywhere.
constexpr float k_scale = 4, k_least_scale = 0.02F;
constexpr int k_scale_iterations = 3;  // the light of the robust fit leaves other residuals

std::size_t terms_of(PoseLight light) {
  if (light == PoseLight::fixed) return 0;
  return (light == PoseLight::gain ? 1 : k_harmonics) + 1;
}

// A normal distribution's standard deviation over the median of the sizes.
constexpr float k_normal = 1.4826F;
constexpr double k_half = 0.5;
// Colours are compared by squares, to which large residuals matter: most are below so many standard deviations.
constexpr double k_most = 0.9;
constexpr float k_most_deviations = 1.645F;

constexpr std::size_t triangle(std::size_t n) { return n * (n + 1) / 2; }

}  // namespace

NormalSums::NormalSums(const Device& device, const WeighedTarget& target, PoseLight light,
                       std::size_t directions)
    : pixels_(target.colors.size()),
      terms_(terms_of(light)),
      directions_(directions),
      background_{{target.background.x, target.background.y, target.background.z,
                   target.has_unknown_background ? 1.0F : 0.0F}},
      device_(device),
      launch_(impl_of(device), options(!target.measured.empty())),
      sums_(impl_of(device_), pixels_),
      target_(impl_of(device), target.colors),
      weights_(impl_of(device), target.weights) {
  if (terms_ > 0) launch_light_.emplace(impl_of(device), options(false));
  if (!target.measured.empty()) measured_.emplace(device, target.measured, options(true));
  double colors = 0, coverages = 0, depths = 0;
  for (const float w : target.weights) colors += static_cast<double>(w);
  for (const cl_float4& m : target.measured) {
    coverages += static_cast<double>(m.s[1]);
    depths += static_cast<double>(m.s[3]);
  }
  counts_colors_ = colors > 0;
  total_ = counts_colors_ ? static_cast<double>(k_channels) * colors : coverages > 0 ? coverages : depths;
}

std::size_t NormalSums::light_sums() const { return terms_ > 0 ? triangle(terms_) + 2 * terms_ : 0; }

std::string NormalSums::options(bool has_measured) const {
  return " -DDPR_TERMS=" + std::to_string(terms_) + " -DDPR_DIRECTIONS=" + std::to_string(directions_) +
         (has_measured ? " -DDPR_MEASURED=1" : "");
}

ViewSums NormalSums::weigh(const HypothesisImages& images, std::span<const float> scales,
                           const std::vector<cl_uint>& active) {
  Device::Impl& d = impl_of(device_);
  std::vector<float> fits;
  for (std::size_t view = 0; view < images.views; ++view) {
    fits.push_back(scales[view] > 0 ? 1 / (scales[view] * scales[view]) : 0);
    for (const ChannelLight& channel : lights_[view]) {
      for (const double l : channel.light) fits.push_back(static_cast<float>(l));
    }
  }
  fits_.upload(d, fits);
  if (active != uploaded_active_) {
    uploaded_active_.clear();
    active_.upload(d, active);
    uploaded_active_ = active;
  }
  residuals_.resize(d, 4 * images.views * pixels_);
  const std::size_t count = 1 + k_channels * light_sums();
  return sums_.sum(count, 1, active.size(), [&](std::size_t items, Buffer<float>& into) {
    launch_(items, kernel::normal_loss{.pixels = to_uint(pixels_),
                                       .views = to_uint(active.size()),
                                       .slots = to_uint(sums_.slots()),
                                       .background = background_,
                                       .active = active_,
                                       .fits = fits_,
                                       .colors = images.colors,
                                       .normals = images.normals,
                                       .target = target_,
                                       .weights = weights_,
                                       .residuals = residuals_,
                                       .sums = into});
    if (terms_ == 0) return;
    (*launch_light_)((sums_.is_gpu() ? 2 * k_channels : 1) * items,
                     kernel::normal_light{.pixels = to_uint(pixels_),
                                          .views = to_uint(active.size()),
                                          .slots = to_uint(sums_.slots()),
                                          .background = background_,
                                          .active = active_,
                                          .colors = images.colors,
                                          .normals = images.normals,
                                          .target = target_,
                                          .residuals = residuals_,
                                          .sums = into});
  });
}

void NormalSums::solve(const ViewSums& sums, std::size_t place, Lights& lights) const {
  const auto terms = static_cast<Eigen::Index>(terms_);
  std::size_t number = 1;  // behind the loss
  for (ChannelLight& channel : lights) {
    LightSums light{Eigen::MatrixXd(terms, terms), Eigen::VectorXd(terms), Eigen::VectorXd(terms)};
    for (Eigen::Index k = 0; k < terms; ++k) {
      for (Eigen::Index l = 0; l <= k; ++l)
        light.normal(k, l) = light.normal(l, k) = sums.at(number++, place);
    }
    for (double& s : light.sum) s = sums.at(number++, place);
    for (double& r : light.right) r = sums.at(number++, place);
    channel = solve_light(light);
  }
}

std::vector<double> NormalSums::fit(const HypothesisImages& images, std::span<const float> scales) {
  std::vector<cl_uint> active(images.views);
  std::iota(active.begin(), active.end(), 0U);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(terms_));
  lights_.assign(images.views, {});
  for (Lights& lights : lights_) {
    for (ChannelLight& channel : lights) channel.light = none;
  }
  const std::vector<float> squares(images.views);  // have the first light
  std::vector<double> losses(images.views, std::numeric_limits<double>::infinity());
  for (int step = terms_ > 0 ? 0 : 1; !active.empty(); ++step) {
    const ViewSums sums = weigh(images, step == 0 ? squares : scales, active);
    std::vector<cl_uint> falling;
    for (std::size_t i = 0; i < active.size(); ++i) {
      const cl_uint view = active[i];
      bool falls = true;
      if (step > 0) {
        const double before = std::exchange(losses[view], sums.at(0, i));
        for (const ChannelLight& channel : lights_[view]) losses[view] += channel.prior_loss;
        falls = losses[view] <= (1 - k_least_fall) * before && scales[view] > 0;
      }
      if (!falls || terms_ == 0 || step > k_most_reweightings) continue;
      solve(sums, i, lights_[view]);
      falling.push_back(view);
    }
    active = std::move(falling);
  }
  return losses;
}

std::vector<double> NormalSums::losses(const HypothesisImages& images, const LossScales& scales) {
  std::vector<double> losses = fit(images, std::vector<float>(images.views, scales.color));
  if (measured_) {
    const std::vector<double> others =
        measured_->losses(images.colors, images.depths, images.views, scales.measured);
    for (std::size_t view = 0; view < images.views; ++view) losses[view] += others[view];
  }
  for (double& loss : losses) loss /= total_;
  return losses;
}

double NormalSums::measured_loss(const HypothesisImages& images, const MeasuredWeights& weights) {
  return measured_->losses(images.colors, images.depths, images.views, weights).front() / total_;
}

void NormalSums::project(const HypothesisImages& images) {
  Device::Impl& d = impl_of(device_);
  const std::size_t size = k_channels * terms_;
  const ViewSums sums =
      sums_.sum(directions_ * size, directions_, images.views, [&](std::size_t items, Buffer<float>& into) {
        (*launch_light_)(items, kernel::normal_cross{.pixels = to_uint(pixels_),
                                                     .views = to_uint(images.views),
                                                     .slots = to_uint(sums_.slots()),
                                                     .colors = images.colors,
                                                     .normals = images.normals,
                                                     .residuals = residuals_,
                                                     .lit = lit_,
                                                     .sums = into});
      });
  std::vector<float> taken;  // [direction][view][channel][term]
  Eigen::VectorXd right(static_cast<Eigen::Index>(terms_));
  for (std::size_t direction = 0; direction < directions_; ++direction) {
    for (std::size_t view = 0; view < images.views; ++view) {
      std::size_t number = direction * size;
      for (const ChannelLight& channel : lights_[view]) {
        for (double& r : right) r = sums.at(number++, view);
        for (const double t : Eigen::VectorXd(channel.inverse * right))
          taken.push_back(static_cast<float>(t));
      }
    }
  }
  taken_.upload(d, taken);
  left_.resize(d, directions_ * images.views * k_channels * pixels_);
  (*launch_light_)(sums_.vectors(directions_ * images.views),
                   kernel::normal_left{.pixels = to_uint(pixels_),
                                       .views = to_uint(images.views),
                                       .taken = taken_,
                                       .colors = images.colors,
                                       .normals = images.normals,
                                       .lit = lit_,
                                       .left = left_});
}

std::vector<NormalEquations> NormalSums::linearize(const HypothesisImages& images,
                                                   const HypothesisTangents& tangents,
                                                   const LossScales& scales) {
  const std::vector<double> losses = this->losses(images, scales);
  lit_.resize(impl_of(device_), directions_ * images.views * k_channels * pixels_);
  launch_(sums_.vectors(directions_ * images.views), kernel::normal_lit{.pixels = to_uint(pixels_),
                                                                        .views = to_uint(images.views),
                                                                        .background = background_,
                                                                        .fits = fits_,
                                                                        .colors = images.colors,
                                                                        .normals = images.normals,
                                                                        .target = target_,
                                                                        .tangents = tangents.colors,
                                                                        .normal_tangents = tangents.normals,
                                                                        .lit = lit_});
  if (terms_ > 0) project(images);
  if (measured_) measured_->move(tangents.colors, tangents.depths, directions_, images.views);
  const std::size_t n = directions_, products = triangle(n);
  const std::size_t parts = sums_.is_gpu() ? products : 1;
  const ViewSums sums =
      sums_.sum(n + 2 * products, parts, images.views, [&](std::size_t items, Buffer<float>& into) {
        launch_(items, kernel::normal_equations{.pixels = to_uint(pixels_),
                                                .views = to_uint(images.views),
                                                .slots = to_uint(sums_.slots()),
                                                .residuals = residuals_,
                                                .measured = measured_ ? measured_->residuals() : residuals_,
                                                .lit = lit_,
                                                .left = terms_ > 0 ? left_ : lit_,
                                                .moved = measured_ ? measured_->derivatives() : lit_,
                                                .sums = into});
      });
  const double part = 1 / total_;
  std::vector<NormalEquations> result(images.views);
  for (std::size_t view = 0; view < images.views; ++view) {
    NormalEquations& e = result[view];
    e.loss = losses[view];
    std::size_t number = n;
    for (std::size_t k = 0; k < n; ++k) {
      e.gradient[k] = part * sums.at(k, view);
      for (std::size_t l = 0; l <= k; ++l, ++number) {
        e.hessian[k * n + l] = e.hessian[l * n + k] = part * sums.at(number, view);
        e.scatter[k * n + l] = e.scatter[l * n + k] = part * part * sums.at(number + products, view);
      }
    }
  }
  return result;
}

ScoreCells NormalSums::score_cells(const HypothesisImages& images, const HypothesisTangents& tangents,
                                   const LossScales& scales, std::size_t width) {
  constexpr std::size_t k_least_side = 4, k_most_cells = 64;  // pixels; along an axis
  Device::Impl& d = impl_of(device_);
  const std::size_t height = pixels_ / width, n = directions_;
  ScoreCells result;
  result.equations = linearize(images, tangents, scales).front();
  result.weight = 1 / total_;
  result.side = std::max(k_least_side, (std::max(width, height) + k_most_cells - 1) / k_most_cells);
  result.columns = (width + result.side - 1) / result.side;
  const std::size_t cells = result.columns * ((height + result.side - 1) / result.side);
  std::vector<float> units;
  for (std::size_t k = 0; k < n; ++k) {
    const double h = result.equations.hessian[k * (n + 1)];
    units.push_back(h > 0 ? static_cast<float>(result.weight / h) : 0.0F);
  }
  units_.upload(d, units);
  cells_.resize(d, (n + k_cell_sums) * cells);
  if (!launch_cells_) launch_cells_.emplace(d);
  (*launch_cells_)(cells_.size(),
                   kernel::normal_cells{.directions = to_uint(n),
                                        .pixels = to_uint(pixels_),
                                        .width = to_uint(width),
                                        .side = to_uint(result.side),
                                        .cells = to_uint(cells),
                                        .kinds = to_uint(measured_ ? MeasuredSums::k_kinds : 0),
                                        .units = units_,
                                        .weights = weights_,
                                        .residuals = residuals_,
                                        .measured = measured_ ? measured_->residuals() : residuals_,
                                        .left = terms_ > 0 ? left_ : lit_,
                                        .moved = measured_ ? measured_->derivatives() : lit_,
                                        .sums = cells_});
  const std::vector<float> sums = cells_.download();
  const auto of = [&](std::size_t number) {
    return sums.begin() + static_cast<std::ptrdiff_t>(number * cells);
  };
  for (auto sum = of(0); sum != of(n); ++sum)
    result.scores.push_back(result.weight * static_cast<double>(*sum));
  const double whole = std::accumulate(of(n + 1), of(n + 2), 0.0);
  if (whole > 0) result.kept = std::accumulate(of(n), of(n + 1), 0.0) / whole;
  result.residuals.assign(of(n + 2), of(n + 5));
  result.squares = std::accumulate(of(n + 5), of(n + 6), 0.0);
  if (counts_colors_) {
    result.median = quantiles(k_half, images).front().value_or(0.0F);
  } else {
    const std::vector<std::optional<float>> of_kinds = measured_->medians(1);
    result.median = of_kinds[0] ? *of_kinds[0] : of_kinds[1].value_or(0.0F);
  }
  return result;
}

std::vector<std::optional<float>> NormalSums::quantiles(double part, const HypothesisImages& images) {
  return sums_.quantiles(part, images.views, 1,
                         [&](std::size_t items, Buffer<float>& into, const Buffer<float>& thresholds) {
                           launch_(items, kernel::normal_counts{.pixels = to_uint(pixels_),
                                                                .views = to_uint(images.views),
                                                                .slots = to_uint(sums_.slots()),
                                                                .thresholds = thresholds,
                                                                .colors = images.colors,
                                                                .residuals = residuals_,
                                                                .sums = into});
                         });
}

std::vector<float> NormalSums::scales(const HypothesisImages& images) {
  std::vector<float> scales(images.views);
  for (int i = 0; i < k_scale_iterations; ++i) {
    fit(images, scales);
    const std::vector<std::optional<float>> medians = quantiles(k_half, images);
    for (std::size_t view = 0; view < images.views; ++view)
      scales[view] = medians[view] ? std::max(k_scale * k_normal * *medians[view], k_least_scale) : 0;
  }
  return scales;
}

std::vector<Deviations> NormalSums::deviations(const HypothesisImages& images) {
  std::vector<Deviations> result(images.views);
  if (counts_colors_) {
    fit(images, std::vector<float>(images.views));
    const std::vector<std::optional<float>> most = quantiles(k_most, images);
    for (std::size_t view = 0; view < images.views; ++view) {
      if (most[view]) result[view][0] = std::max(*most[view] / k_most_deviations, k_least_scale / k_scale);
    }
  }
  measured_->losses(images.colors, images.depths, images.views, {});
  const std::vector<std::optional<float>> medians = measured_->medians(images.views);
  for (std::size_t i = 0; i < medians.size(); ++i) {
    if (medians[i]) result[i / MeasuredSums::k_kinds][1 + i % MeasuredSums::k_kinds] = k_normal * *medians[i];
  }
  return result;
}

void NormalSums::average(const Buffer<cl_float4>& images, std::size_t width, std::size_t samples,
                         Buffer<cl_float4>& means) {
  means.resize(impl_of(device_), images.size() / (samples * samples));
  launch_(means.size(), kernel::normal_means{.width = to_uint(width),
                                             .samples = to_uint(samples),
                                             .pixels = to_uint(means.size()),
                                             .image = images,
                                             .means = means});
}

}  // namespace dpr
