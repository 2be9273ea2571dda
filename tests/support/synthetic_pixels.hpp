// Pixels made by hand for the aggregation stage: the buffers of the stages before it, filled with any
// fragments, and what the reference says of them.
#pragma once

#include <cmath>
#include <vector>

#include "reference/aggregate.hpp"
#include "stages/aggregate.hpp"
#include "support/made_bin.hpp"
#include "support/probe.hpp"

namespace dpr::test {

struct SyntheticFragment {
  float depth = 1, occupancy = 0;
  glm::vec3 color{0.0F};
  float distance = 0;  ///< what the sampled joint composition reads instead of the occupancy
};

using SyntheticPixel = std::vector<SyntheticFragment>;

/// The normalised depth range of the synthetic camera.
inline constexpr float k_znear = 1, k_zfar = 100;

inline float log_of(float occupancy) { return occupancy > 0 ? std::log(occupancy) : DPR_LOG_ZERO; }

/// Inputs of the kernel as the reference takes them: the same floats.
inline std::vector<reference::FragmentInput> reference_fragments(const SyntheticPixel& pixel) {
  std::vector<reference::FragmentInput> inputs;
  for (const SyntheticFragment& f : pixel) {
    reference::FragmentInput input;
    input.depth = static_cast<double>(f.depth);
    input.occupancy = static_cast<double>(f.occupancy);
    if (f.occupancy > 0) input.log_occupancy = static_cast<double>(log_of(f.occupancy));
    input.color = {static_cast<double>(f.color.x), static_cast<double>(f.color.y),
                   static_cast<double>(f.color.z)};
    inputs.push_back(input);
  }
  return inputs;
}

inline reference::AggregateParameters reference_parameters(const Smoothing& s, const glm::vec3& background) {
  reference::AggregateParameters p;
  p.composition =
      s.composition == Composition::joint ? reference::Composition::joint : reference::Composition::barrier;
  p.prior = static_cast<reference::Prior>(s.depth_prior);
  p.gamma = static_cast<double>(s.gamma);
  p.alpha = static_cast<double>(s.alpha);
  p.znear = static_cast<double>(k_znear);
  p.zfar = static_cast<double>(k_zfar);
  p.background_depth = static_cast<double>(s.background_depth);
  p.background = {static_cast<double>(background.x), static_cast<double>(background.y),
                  static_cast<double>(background.z)};
  return p;
}

/// One view, one row of pixels; the fragments of a pixel are the faces 0, 1, 2 ... Fragments are stored in
/// another order than they are listed, and the buffers hold one that no pixel lists.
class SyntheticFrame {
 public:
  explicit SyntheticFrame(const std::vector<SyntheticPixel>& pixels)
      : bin_(device_impl()), rasterize_(device_impl()), aggregate_(device_impl()) {
    std::vector<cl_uint> starts{0}, list, pair, faces;
    std::size_t count = 0, most = 0;
    for (const SyntheticPixel& pixel : pixels) {
      for (std::size_t k = 0; k < pixel.size(); ++k) list.push_back(static_cast<cl_uint>(count + k));
      count += pixel.size();
      most = std::max(most, pixel.size());
      starts.push_back(static_cast<cl_uint>(count));
    }
    for (cl_uint& fragment : list)
      fragment = static_cast<cl_uint>(count) - fragment;  // count ... 1; 0 is unlisted
    fragments_ = count + 1;
    first_ = starts;
    std::vector<float> depth(fragments_, k_poison), log_p(fragments_, k_poison), p(fragments_, k_poison),
        red(fragments_, k_poison), green(fragments_, k_poison), blue(fragments_, k_poison),
        distance(fragments_, k_poison);
    pair.assign(fragments_, 0);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      for (std::size_t k = 0; k < pixels[i].size(); ++k) {
        const std::size_t at = list[first_[i] + k];
        const SyntheticFragment& f = pixels[i][k];
        depth[at] = f.depth;
        distance[at] = f.distance;
        p[at] = f.occupancy;
        log_p[at] = log_of(f.occupancy);
        red[at] = f.color.x;
        green[at] = f.color.y;
        blue[at] = f.color.z;
        pair[at] = static_cast<cl_uint>(k);
      }
    }
    for (std::size_t k = 0; k < std::max<std::size_t>(most, 1); ++k) faces.push_back(static_cast<cl_uint>(k));
    place_ = list;
    frame_.views = frame_.meshes = 1;
    frame_.width = static_cast<cl_uint>(pixels.size());
    frame_.height = 1;
    frame_.faces = static_cast<cl_uint>(faces.size());
    frame_.fragments = frame_.grad_fragments = static_cast<cl_uint>(fragments_);
    make_pairs(bin_, faces);
    rasterize_.fragments = fragments_;
    rasterize_.pixel_starts.upload(device_impl(), starts);
    rasterize_.list.resize(device_impl(), std::max<std::size_t>(count, 1));
    rasterize_.list.upload(device_impl(), list);
    rasterize_.fragment_pair.upload(device_impl(), pair);
    set_planes(rasterize_.values, fragments_,
               {{DPR_PLANE_DEPTH, depth},
                {DPR_PLANE_DISTANCE, distance},
                {DPR_PLANE_LOG_OCCUPANCY, log_p},
                {DPR_PLANE_OCCUPANCY, p},
                {DPR_PLANE_COLOR, red},
                {DPR_PLANE_COLOR + 1, green},
                {DPR_PLANE_COLOR + 2, blue}});
    shared::ViewParams view{};
    view.znear = k_znear;
    view.zfar = k_zfar;
    view.inverse_range = 1.0F / (k_zfar - k_znear);
    views_.cameras.upload(device_impl(), std::span(&view, 1));
  }

  /// The image of every pixel. The buffer is poisoned before.
  std::vector<cl_float4> forward(const Smoothing& smoothing, const glm::vec3& background) {
    aggregate_.set_smoothing(smoothing);
    poison(aggregate_.image, frame_.width, cl_float4{{k_poison, k_poison, k_poison, k_poison}});
    aggregate_.forward(inputs(), background);
    return aggregate_.image.download();
  }

  /// Gradients of every fragment, as they were given, and of every pixel. After forward(). Buffers are
  /// poisoned before.
  struct Gradients {
    std::vector<std::vector<float>> depth, log_occupancy, red, green, blue;  // [pixel][fragment]
    // Inputs of the sampled joint composition alone: [pixel][fragment] and [pixel].
    std::vector<std::vector<float>> distance;
    std::vector<float> sigma;
    std::vector<float> gamma, alpha;    // [pixel]
    std::vector<glm::vec3> background;  // [pixel]
  };
  Gradients backward(const glm::vec3& background, const std::vector<cl_float4>& grad_image) {
    const Buffer<cl_float4> grad(device_impl(), std::span<const cl_float4>(grad_image));
    set_planes(rasterize_.grads, fragments_, {});
    const std::size_t pixels = frame_.width;
    poison(aggregate_.channels, aggregate_.channel_count() * pixels);
    poison(aggregate_.grad_sigma, pixels);
    aggregate_.backward(inputs(), background, grad);
    Gradients g;
    g.depth = by_pixel(DPR_PLANE_DEPTH);
    g.log_occupancy = by_pixel(DPR_PLANE_LOG_OCCUPANCY);
    g.red = by_pixel(DPR_PLANE_COLOR);
    g.green = by_pixel(DPR_PLANE_COLOR + 1);
    g.blue = by_pixel(DPR_PLANE_COLOR + 2);
    if (aggregate_.perturbs_distances()) {
      g.distance = by_pixel(DPR_PLANE_DISTANCE);
      g.sigma = aggregate_.grad_sigma.download();
    }
    const std::vector<float> channels = aggregate_.channels.download();
    const auto channel = [&](std::size_t c, std::size_t i) { return channels[c * pixels + i]; };
    for (std::size_t i = 0; i < pixels; ++i) {
      g.gamma.push_back(channel(DPR_CHANNEL_GAMMA, i));
      g.alpha.push_back(aggregate_.channel_count() > DPR_CHANNEL_ALPHA ? channel(DPR_CHANNEL_ALPHA, i)
                                                                       : 0.0F);
      g.background.emplace_back(channel(DPR_CHANNEL_BACKGROUND, i), channel(DPR_CHANNEL_BACKGROUND + 1, i),
                                channel(DPR_CHANNEL_BACKGROUND + 2, i));
    }
    return g;
  }

  /// The fragments as the pixels list them now: the joint composition sorts.
  std::vector<cl_uint> list() const { return rasterize_.list.download(); }
  std::vector<float> depths() const { return rasterize_.plane(frame_, DPR_PLANE_DEPTH); }

 private:
  AggregateInputs inputs() { return {frame_, views_, bin_, rasterize_}; }

  std::vector<std::vector<float>> by_pixel(cl_uint plane) const {
    const std::vector<float> all = rasterize_.grad_plane(frame_, plane);
    std::vector<std::vector<float>> values(frame_.width);
    for (std::size_t i = 0; i < values.size(); ++i) {
      for (std::size_t at = first_[i]; at < first_[i + 1]; ++at) values[i].push_back(all[place_[at]]);
    }
    return values;
  }

  shared::FrameParams frame_{};
  DeviceViews views_;
  Bin bin_;
  Rasterize rasterize_;
  Aggregate aggregate_;
  std::size_t fragments_ = 0;
  std::vector<cl_uint> first_, place_;
};

}  // namespace dpr::test
