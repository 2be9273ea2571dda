#include "measure.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <span>

#include "costs.hpp"
#include "device/context.hpp"
#include "dpr/image_loss.hpp"
#include "resident_memory.hpp"
#include "stages.hpp"

namespace dpr::bench {
namespace {

constexpr double k_milli = 1e-3;

using Clock = std::chrono::steady_clock;

/// To six digits: a file of results is read by people, and no timing has more.
double rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return std::strtod(text, nullptr);
}

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// Parameters that change from frame to frame.
struct Pose {
  std::vector<glm::vec3> positions, colors;  // of the first mesh; empty: unchanged
  std::vector<View> views;
};

/// Poses that frames take in turn. Vertices move by up to two thousandths of the shape's size, each in a direction of its
/// own, or the camera moves as far.
std::vector<Pose> poses_of(const Workload& workload, Moves moves) {
  constexpr unsigned k_poses = 4;
  constexpr float k_way = 2e-3F, k_waves = 9;
  const Mesh& mesh = workload.scene.meshes[0].mesh;
  std::vector<Pose> poses(k_poses);
  for (unsigned i = 0; i < k_poses; ++i) {
    const auto phase = static_cast<float>(i);
    Pose& pose = poses[i];
    if (moves == Moves::camera) {
      pose.views = workload.views;
      for (View& view : pose.views) view.camera.view[3].x += k_way * std::sin(phase);
      continue;
    }
    for (const glm::vec3& p : mesh.positions)
      pose.positions.push_back(p + k_way * glm::sin(k_waves * glm::vec3(p.y, p.z, p.x) + phase));
    for (const glm::vec3& color : mesh.vertex_colors)
      pose.colors.push_back(color * (1 - k_way * (1 + std::sin(phase))));
  }
  return poses;
}

/// A renderer of a row, and the loss whose gradient goes backward.
struct Row {
  Row(const Device& device, const Workload& workload, const Variant& variant)
      : renderer(device),
        loss(device, LossWeights::only(LossKind::mse), targets(workload)),
        poses(poses_of(workload, variant.moves)) {
    Scene scene = workload.scene;
    scene.smoothing = variant.smoothing;
    renderer.set_scene(scene);
    renderer.set_views(workload.views);
  }

  void move() {
    const Pose& pose = poses[next++ % poses.size()];
    if (!pose.positions.empty()) renderer.set_positions(0, pose.positions);
    if (!pose.colors.empty()) renderer.set_colors(0, pose.colors);
    if (!pose.views.empty()) renderer.set_views(pose.views);
  }

  /// From new parameters until the images are on the host.
  void forward() {
    move();
    renderer.forward();
    for (std::size_t view = 0; view < renderer.views().size(); ++view) renderer.image(view);
  }

  /// The loss, and every gradient of the scene, on the host.
  void backward() {
    loss.evaluate(renderer);
    renderer.backward(loss);
  }

  /// The images' tangents on the host, along so many of six directions: the turns and shifts of the first mesh.
  void tangents(std::size_t count) {
    std::vector<SceneTangent> directions(count);
    for (std::size_t d = 0; d < count; ++d) {
      directions[d].views.resize(renderer.views().size());
      for (ViewGradient& view : directions[d].views) {
        view.transforms.resize(renderer.scene().meshes.size());
        PoseGradient& pose = view.transforms[0];
        (d < 3 ? pose.rotation : pose.translation)[static_cast<int>(d % 3)] = 1;
      }
    }
    renderer.tangent(directions);
  }

  static std::vector<Image> targets(const Workload& workload) {
    const Image grey(workload.scene.width, workload.scene.height, glm::vec4(0.3F));
    return std::vector<Image>(workload.views.size(), grey);
  }

  Renderer renderer;
  ImageLoss loss;
  std::vector<Pose> poses;
  std::size_t next = 0;
};

/// Stops repeating after a number of runs or a time.
class Budget {
 public:
  Budget(unsigned runs, double seconds) : runs_(runs), seconds_(seconds) {}
  bool next() {
    if (done_ == runs_ || (done_ > 0 && k_milli * milliseconds_since(start_) > seconds_)) return false;
    ++done_;
    return true;
  }

 private:
  unsigned runs_, done_ = 0;
  double seconds_;
  Clock::time_point start_ = Clock::now();
};

constexpr std::size_t k_one = 1, k_six = 6;  // directions of forward mode

/// Quartiles of the runs, and every run in order.
Json timing_of(const std::vector<double>& milliseconds) {
  Json timing = quartiles(milliseconds);
  for (const double run : milliseconds) timing["runs"].push_back(rounded(run));
  return timing;
}

void measure_passes(Row& row, const MeasureOptions& options, Json& result) {
  std::vector<double> forward, backward;
  Budget budget(options.repetitions, options.max_seconds);
  while (budget.next()) {
    const auto start = Clock::now();
    row.forward();
    forward.push_back(milliseconds_since(start));
    const auto middle = Clock::now();
    row.backward();
    backward.push_back(milliseconds_since(middle));
  }
  result["forward_ms"] = timing_of(forward);
  result["backward_ms"] = timing_of(backward);
}

bool is_exact(const Smoothing& s) {
  return s.occupancy_estimator == Estimator::exact && s.aggregation_estimator == Estimator::exact;
}

/// Times along one direction and along six in turn, each after its own forward pass.
void measure_tangents(Row& row, const MeasureOptions& options, Json& result) {
  std::map<std::size_t, std::vector<double>> times;
  for (const std::size_t count : {k_one, k_six}) row.tangents(count);  // kernels are compiled, buffers grow
  Budget budget(options.repetitions, options.max_seconds);
  while (budget.next()) {
    for (const std::size_t count : {k_one, k_six}) {
      row.forward();
      const auto start = Clock::now();
      row.tangents(count);
      times[count].push_back(milliseconds_since(start));
    }
  }
  for (const auto& [count, milliseconds] : times)
    result["tangents_ms"][std::to_string(count)] = timing_of(milliseconds);
}

Json to_json(const TransferCounts& before, const TransferCounts& after) {
  return {{"bytes_to_device", after.bytes_to_device - before.bytes_to_device},
          {"bytes_from_device", after.bytes_from_device - before.bytes_from_device},
          {"host_waits", after.host_waits - before.host_waits}};
}

/// Counts the transfers of a frame of which no image goes to the host.
void count_transfers(Row& row, Json& result) {
  const Device::Impl& device = impl_of(row.renderer.device());
  const TransferCounts before = device.transfers();
  row.move();
  row.renderer.forward();
  row.backward();
  result["transfers"] = to_json(before, device.transfers());
}

using StageRuns = std::map<std::string, std::vector<double>>;

void append(const std::map<std::string, double>& run, std::size_t index, StageRuns& all) {
  for (const auto& [stage, milliseconds] : run) {
    all[stage].resize(index + 1);
    all[stage][index] = milliseconds;
  }
}

double median(std::vector<double> values) {
  return values.empty() ? 0.0 : quartiles(std::move(values))["median"].get<double>();
}

void add_rates(const StageCost& cost, double milliseconds, const Peaks& peaks, Json& stage) {
  if (milliseconds <= 0) return;
  const Cost total = cost.forward + cost.backward;
  const double gflops = total.flops / (k_milli * milliseconds) / k_giga;
  const double gbytes_per_s = total.bytes / (k_milli * milliseconds) / k_giga;
  stage["gflops"] = rounded(gflops);
  stage["gbytes_per_s"] = rounded(gbytes_per_s);
  stage["fraction_of_peak"] = rounded(gflops / peaks.gflops);
  stage["fraction_of_bandwidth"] = rounded(gbytes_per_s / peaks.gbytes_per_s);
}

void measure_stages(Row& row, const Device& device, const Peaks& peaks, const MeasureOptions& options,
                    Json& result) {
  StageRuns forward, backward, tangents;
  const bool has_tangents = result.contains("tangents_ms");
  {
    Profile profile(device);
    Budget budget(options.repetitions, options.max_seconds / 2);
    for (std::size_t run = 0; budget.next(); ++run) {
      row.forward();
      append(milliseconds_by_stage(profile.take()), run, forward);
      row.backward();
      append(milliseconds_by_stage(profile.take()), run, backward);
      if (!has_tangents) continue;
      row.forward();
      profile.take();
      row.tangents(k_six);
      append(milliseconds_by_stage(profile.take()), run, tangents);
    }
  }
  // In several bands a backward pass renders them again, and only the last one's fragments are there to
  // count.
  const bool has_rates = row.renderer.statistics().bands == 1;
  const FrameWork work = has_rates ? count_work(row.renderer) : FrameWork{};
  Json& stages = result["stages"] = Json::object();
  for (const std::string_view name : k_stages) {
    const std::string stage(name);
    if (!forward.contains(stage) && !backward.contains(stage)) continue;
    const double forward_ms = median(forward[stage]), backward_ms = median(backward[stage]);
    stages[stage] = {{"forward_ms", forward_ms}, {"backward_ms", backward_ms}};
    if (has_tangents) stages[stage]["tangents_ms"] = median(tangents[stage]);
    const auto cost = stage_cost(stage, work, row.renderer.scene().smoothing);
    if (has_rates && cost) add_rates(*cost, forward_ms + backward_ms, peaks, stages[stage]);
  }
}

Json describe_row(const Workload& workload, const Variant& variant) {
  const Smoothing& s = variant.smoothing;
  const bool exact = is_exact(s);
  return {{"workload", workload.name},
          {"preset", variant.preset},
          {"composition", to_string(s.composition)},
          {"estimator", to_string(exact ? Estimator::exact : Estimator::monte_carlo)},
          {"samples", exact ? 0 : s.samples},
          {"sigma", rounded(static_cast<double>(s.sigma))},
          {"seed", s.seed},
          {"moves", variant.moves == Moves::shape ? "shape" : "camera"},
          {"triangles", workload.scene.meshes[0].mesh.faces.size()},
          {"width", workload.scene.width},
          {"height", workload.scene.height},
          {"views", workload.views.size()}};
}

void measure_into(Json& result, const Device& device, const Peaks& peaks, const Workload& workload,
                  const Variant& variant, const MeasureOptions& options) {
  Device::Impl& impl = impl_of(device);
  impl.peak_allocated_bytes = impl.allocated_bytes.load();
  reset_peak_resident_bytes();
  Row row(device, workload, variant);
  row.forward();  // kernels are compiled, buffers grow
  row.backward();
  measure_passes(row, options, result);
  if (options.tangents && is_exact(variant.smoothing)) measure_tangents(row, options, result);
  count_transfers(row, result);
  const std::size_t device_bytes = device.peak_allocated_bytes(), resident_bytes = peak_resident_bytes();
  measure_stages(row, device, peaks, options, result);
  const RenderStatistics statistics = row.renderer.statistics();
  result["fragments"] = statistics.fragments;
  result["bands"] = statistics.bands;
  result["peak_device_bytes"] = device_bytes;
  result["peak_rss_bytes"] = resident_bytes;
}

}  // namespace

Json quartiles(std::vector<double> values) {
  std::ranges::sort(values);
  const std::size_t n = values.size();
  return {{"median", rounded(values[n / 2])},
          {"q1", rounded(values[n / 4])},
          {"q3", rounded(values[3 * n / 4])},
          {"min", rounded(values.front())},
          {"p95", rounded(values[std::min(n - 1, 95 * n / 100)])},
          {"n", n}};
}

double first_image_ms(const Device& device) {
  const Workload workload = make_workloads("cube128").front();
  const auto start = Clock::now();
  Row row(device, workload, workload.variants.front());
  row.forward();
  return rounded(milliseconds_since(start));
}

Json measure(const Device& device, const Peaks& peaks, const Workload& workload, const Variant& variant,
             const MeasureOptions& options) {
  const Json row = describe_row(workload, variant);
  Json result = row;
  std::string reason;
  try {
    measure_into(result, device, peaks, workload, variant, options);
  } catch (const Error& error) {
    reason = error.what();
  } catch (const std::bad_alloc&) {
    reason = "the host's memory is full";
  }
  if (!reason.empty()) result = row;
  result["status"] = reason.empty() ? "ok" : "failed";
  result["reason"] = reason;
  return result;
}

}  // namespace dpr::bench
