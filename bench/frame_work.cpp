#include "frame_work.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>
#include <stdexcept>
#include <string>

#include "device/kernel_sources.hpp"
#include "renderer/frame.hpp"

namespace dpr::bench {
namespace {

/// A constant of the kernels, from their source.
double kernel_constant(std::string_view file, std::string_view name) {
  const std::string_view text = kernel_file(file);
  const std::string definition = "#define " + std::string(name) + " ";
  const std::size_t at = text.find(definition);
  if (at == std::string_view::npos) throw std::logic_error(definition + "is not in " + std::string(file));
  return std::strtod(text.data() + at + definition.size(), nullptr);
}

/// Quadrature of the Gaussian integrals, as in kernels/prior_gaussian.h and quadrature.h.
struct Rule {
  static double of_prior(std::string_view name) { return kernel_constant("prior_gaussian.h", name); }
  static double of_any(std::string_view name) { return kernel_constant("quadrature.h", name); }
  static double of_joint(std::string_view name) { return kernel_constant("aggregate_joint.cl", name); }

  double reach = of_prior("DPR_BARRIER_REACH"), nodes = of_prior("DPR_BARRIER_NODES");
  double throng = of_any("DPR_THRONG");
  double joint_reach = of_prior("DPR_JOINT_BELOW") + of_prior("DPR_JOINT_ABOVE");
  double crowd = of_any("DPR_JOINT_CROWD"), crowd_reach = of_any("DPR_JOINT_CROWD_REACH");
  double step = of_prior("DPR_JOINT_STEP"), crowd_step = of_prior("DPR_JOINT_CROWD_STEP");
  double opaque = of_joint("DPR_OPAQUE"), negligible = kernel_constant("sorted_slots.h", "DPR_NEGLIGIBLE");
  double min_transparency = kernel_constant("pixel.h", "DPR_MIN_TRANSPARENCY");
  double block = 16;  // DPR_WIDTH of aggregate_joint.cl on vectors
};

const Rule& rule() {
  static const Rule gaussian;
  return gaussian;
}

/// The fragments of a frame, on the host.
struct Fragments {
  std::vector<cl_uint> starts, list;
  std::vector<float> depth, log_occupancy, occupancy;

  explicit Fragments(const FrameFragments& f)
      : starts(f.pixel_starts.download()),
        list(f.list.download()),
        depth(f.depth),
        log_occupancy(f.log_occupancy),
        occupancy(f.occupancy) {}

  std::span<const cl_uint> pixel(std::size_t i) const {
    return std::span(list).subspan(starts[i], starts[i + 1] - starts[i]);
  }
  bool is_there(cl_uint k) const { return log_occupancy[k] > DPR_LOG_ZERO; }
};

struct Evaluations {
  double forward = 0, backward = 0;
};

double present(const Fragments& f, std::span<const cl_uint> run) {
  return static_cast<double>(std::ranges::count_if(run, [&](cl_uint k) { return f.is_there(k); }));
}

/// Barrier: all slots within reach of the largest beta, at the nodes that their number asks for.
Evaluations barrier_pixel(const Fragments& f, std::span<const cl_uint> run, const Smoothing& s,
                          const Camera& camera) {
  const auto beta = [&](cl_uint k) {
    const double zeta = (static_cast<double>(camera.zfar) - f.depth[k]) / (camera.zfar - camera.znear);
    return zeta / s.gamma + static_cast<double>(f.log_occupancy[k]) / s.alpha;
  };
  double largest = static_cast<double>(s.background_depth / s.gamma);
  const double background = largest;
  for (const cl_uint k : run) largest = f.is_there(k) ? std::max(largest, beta(k)) : largest;
  std::size_t crowd = background > largest - rule().reach ? 1 : 0;
  for (const cl_uint k : run) crowd += f.is_there(k) && beta(k) > largest - rule().reach ? 1U : 0U;
  if (crowd < 2) return {};  // a slot alone needs no integral
  const auto slots = static_cast<double>(crowd);
  const double nodes = rule().nodes * (slots > rule().throng ? 2 : 1);
  return {nodes * slots, nodes * slots};
}

/// Joint: what covers, sorted by depth, front to back; clusters of two and more at nodes that span them.
Evaluations joint_pixel(const Fragments& f, std::span<const cl_uint> run, const Smoothing& s,
                        const Camera& camera) {
  const double scale = 1.0 / (static_cast<double>(camera.zfar - camera.znear) * static_cast<double>(s.gamma));
  const auto occupancy = [&](cl_uint k) { return static_cast<double>(f.occupancy[k]); };
  double largest = 0;
  for (const cl_uint k : run) largest = std::max(largest, occupancy(k));
  std::vector<cl_uint> slots;
  for (const cl_uint k : run) {
    if (occupancy(k) > rule().negligible * largest) slots.push_back(k);
  }
  std::ranges::sort(slots, {}, [&](cl_uint k) { return f.depth[k]; });
  const auto depth = [&](std::size_t i) { return static_cast<double>(f.depth[slots[i]]); };
  Evaluations sum;
  double transparency = 1;
  for (std::size_t first = 0, last = 0; first < slots.size() && transparency > rule().opaque; first = last) {
    double covering = 0;
    for (last = first; last == first ||
                       (last < slots.size() && (depth(last) - depth(last - 1)) * scale < rule().joint_reach);
         ++last) {
      covering += occupancy(slots[last]);
      transparency *= std::max(1 - occupancy(slots[last]), rule().min_transparency);
    }
    if (last - first < 2) continue;
    const bool crowded = covering > rule().crowd;
    const double span =
        (depth(last - 1) - depth(first)) * scale + (crowded ? rule().crowd_reach : 1) * rule().joint_reach;
    const double nodes =
        std::ceil(span / ((crowded ? rule().crowd_step : rule().step) * rule().block)) * rule().block;
    sum.forward += nodes * static_cast<double>(last - first);
  }
  sum.backward = sum.forward;
  return sum;
}

Evaluations count_pixel(const Fragments& f, std::span<const cl_uint> run, const Smoothing& s,
                        const Camera& camera) {
  if (s.aggregation_estimator == Estimator::monte_carlo) {
    const double draws = (present(f, run) + 1) * s.samples;
    return {draws, draws};
  }
  if (s.composition == Composition::barrier && s.depth_prior == Prior::gumbel) {
    return {static_cast<double>(run.size()) + 1, static_cast<double>(run.size()) + 1};  // softmax
  }
  if (s.depth_prior != Prior::gaussian) return {};
  return s.composition == Composition::joint ? joint_pixel(f, run, s, camera)
                                             : barrier_pixel(f, run, s, camera);
}

}  // namespace

FrameWork count_work(const Renderer& renderer) {
  const FrameFragments found = last_fragments(renderer, "count_work");
  const Scene& scene = renderer.scene();
  const Fragments f(found);
  const std::size_t pixels = f.starts.size() - 1;  // with noise of the pixel, samples around the frame too
  const std::size_t pixels_per_view = pixels / renderer.views().size();
  FrameWork work;
  work.pairs = static_cast<double>(found.pairs);
  work.fragments = static_cast<double>(found.fragments);
  work.pixels = static_cast<double>(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const std::span<const cl_uint> run = f.pixel(i);
    if (run.empty()) continue;
    const Evaluations pixel =
        count_pixel(f, run, scene.smoothing, renderer.views()[i / pixels_per_view].camera);
    work.forward_evaluations += pixel.forward;
    work.backward_evaluations += pixel.backward;
  }
  return work;
}

}  // namespace dpr::bench
