// The training loop: a step is a function of the options, the data and its number.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <ostream>
#include <random>

#include "base/checks.hpp"
#include "base/clock.hpp"
#include "base/name_list.hpp"
#include "base/output_file.hpp"
#include "dpr/error.hpp"
#include "dpr/smoothing_options.hpp"
#include "learn/checkpoint.hpp"
#include "learn/evaluation.hpp"
#include "learn/mesh_renderer.hpp"
#include "learn/rank_group.hpp"
#include "learn/resume.hpp"
#include "mesh/adjacency.hpp"
#include "smoothing/priors.hpp"

namespace dpr::learn {
namespace {

constexpr std::string_view k_without_gradients = "rigid";

/// Images of a step's objects, and another view of each.
struct Batch {
  std::vector<ViewOfObject> inputs, others;
};

/// Every class is as likely as any other, whatever its number of objects; as published.
Batch draw_batch(const Dataset& dataset, std::uint64_t seed, std::size_t step, int size) {
  std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U),
                         static_cast<std::uint32_t>(step)};
  std::mt19937 engine(sequence);
  const auto below = [&](std::size_t count) {  // the same with every standard library; the bias is below 1e-5
    return static_cast<std::size_t>(std::uint64_t{engine()} * count >> 32U);
  };
  Batch batch;
  for (int i = 0; i < size; ++i) {
    const std::size_t c = below(dataset.classes().size());
    const std::size_t object =
        dataset.first_object(c) + below(dataset.first_object(c + 1) - dataset.first_object(c));
    const std::size_t view = below(k_views), other = (view + 1 + below(k_views - 1)) % k_views;
    batch.inputs.emplace_back(object, view);
    batch.others.emplace_back(object, other);
  }
  return batch;
}

/// The part of a list that is a rank's.
template <typename Value>
std::vector<Value> part_of(const std::vector<Value>& all, const Ranks& ranks) {
  const auto at = [&](std::size_t i) { return all.begin() + static_cast<std::ptrdiff_t>(i); };
  return {at(ranks.first(all.size())), at(ranks.last(all.size()))};
}

/// World to camera of every view: [24, 4, 4].
at::Tensor view_matrices() {
  at::Tensor views = torch::empty({static_cast<std::int64_t>(k_views), 4, 4});
  float* out = views.data_ptr<float>();
  for (std::size_t v = 0; v < k_views; ++v) {
    const glm::mat4 matrix = dataset_camera(v).view;
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) *out++ = matrix[column][row];
    }
  }
  return views;
}

/// fx, fy, cx, cy of the data's cameras.
at::Tensor intrinsics() {
  constexpr float k_center = 0.5F * k_image_size;
  const float focal = k_center / std::tan(glm::radians(dataset_camera(0).fov_y_degrees) / 2);
  return torch::tensor({focal, focal, k_center, k_center});
}

/// L of L v = v - mean of its one-ring, [642, 642].
at::Tensor umbrella_operator(const Mesh& mesh) {
  const Adjacency adjacency = make_adjacency(mesh);
  const auto count = static_cast<std::int64_t>(mesh.positions.size());
  at::Tensor matrix = torch::eye(count);
  auto values = matrix.accessor<float, 2>();
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    const std::uint32_t first = adjacency.ring_starts[v], last = adjacency.ring_starts[v + 1];
    for (std::uint32_t i = first; i < last; ++i)
      values[v][adjacency.ring[i]] = -1.0F / static_cast<float>(last - first);
  }
  return matrix;
}

/// The three terms of (74), unweighted, each a mean over the batch.
struct Losses {
  at::Tensor silhouette, color, laplacian;
};

class Trainer {
 public:
  Trainer(const Device& device, const Dataset& dataset, const TrainingOptions& options,
          const RankGroupPtr& ranks, Network& network)
      : dataset_(dataset),
        options_(options),
        ranks_(ranks),
        gradients_(ranks, network->parameters()),
        smoothing_(training_smoothing(options)),
        renderer_(std::make_shared<MeshRenderer>(template_mesh().faces, k_image_size, smoothing_, device)),
        views_(view_matrices()),
        intrinsics_(intrinsics().expand({2 * options.batch / ranks->ranks().count, 4})),
        laplacian_(umbrella_operator(template_mesh())) {
    network->share_batches(ranks);
  }

  double render_seconds() const { return renderer_->seconds(); }

  StepRecord step(LoadedCheckpoint& run) {
    try {
      return try_step(run);
    } catch (const RenderError& error) {
      std::rethrow_exception(error.original());
    } catch (const c10::Error& error) {
      throw Error(error.what_without_backtrace());
    }
  }

 private:
  StepRecord try_step(LoadedCheckpoint& run) {
    const std::size_t number = run.checkpoint.steps.size();
    const Losses losses = evaluate_step(run.network, number);
    const LearningWeights& w = options_.weights;
    const at::Tensor loss =
        w.silhouette * losses.silhouette + w.color * losses.color + w.laplacian * losses.laplacian;
    const StepRecord record =
        record_of(torch::stack({loss, losses.silhouette, losses.color, losses.laplacian}));
    if (!std::isfinite(record.loss)) {
      throw Error("loss (dpr learn): got " + checks::text(record.loss) + " in step " +
                  std::to_string(number) + ", expected a finite number; the last checkpoint stands");
    }
    gradients_.backward(loss);
    run.optimizer->step();
    return record;
  }

  /// Mean over all ranks, whose batches have the same size.
  StepRecord record_of(const at::Tensor& losses) const {
    const at::Tensor means = losses.detach().to(torch::kDouble);
    ranks_->sum(means);
    means.div_(ranks_->ranks().count);
    const auto value = [&](std::int64_t i) { return means[i].item<double>(); };
    return {value(0), value(1), value(2), value(3)};
  }

  Losses evaluate_step(Network& network, std::size_t number) {
    constexpr unsigned k_step_bits = 40;
    const Batch whole = draw_batch(dataset_, options_.seed, number, options_.batch);
    const Ranks& ranks = ranks_->ranks();
    const Batch batch{part_of(whole.inputs, ranks), part_of(whole.others, ranks)};
    Smoothing smoothing = smoothing_;
    // Sampled noise of its own in every step, and on every rank.
    smoothing.seed = options_.seed + number + (static_cast<std::uint64_t>(ranks.rank) << k_step_bits);
    renderer_->set_smoothing(smoothing);
    const at::Tensor inputs = load_images(dataset_, batch.inputs);
    const at::Tensor targets =
        torch::cat({inputs, load_images(dataset_, batch.others)}).permute({0, 2, 3, 1});
    const Reconstruction meshes = network->forward(inputs);
    const at::Tensor images = renderer_->render(torch::cat({meshes.vertices, meshes.vertices}),
                                                torch::cat({meshes.colors, meshes.colors}),
                                                views_.index_select(0, view_indices(batch)), intrinsics_);
    return compare(images, targets, meshes.vertices);
  }

  at::Tensor view_indices(const Batch& batch) const {
    std::vector<std::int64_t> indices;
    for (const auto& list : {batch.inputs, batch.others}) {
      for (const ViewOfObject& which : list) indices.push_back(static_cast<std::int64_t>(which.second));
    }
    return torch::tensor(indices, torch::kLong);
  }

  Losses compare(const at::Tensor& images, const at::Tensor& targets, const at::Tensor& vertices) const {
    constexpr double k_least_union = 1e-6;  // of two empty silhouettes
    const at::Tensor found = images.select(3, 3), wanted = targets.select(3, 3);
    const at::Tensor both = (found * wanted).sum({1, 2});
    const at::Tensor either = (found + wanted).sum({1, 2}) - both;
    return {(1.0 - both / either.clamp_min(k_least_union)).mean(),
            (images.slice(3, 0, 3) - targets.slice(3, 0, 3)).abs().mean(),
            laplacian_.matmul(vertices).square().sum({1, 2}).mean()};
  }

  const Dataset& dataset_;
  const TrainingOptions& options_;
  RankGroupPtr ranks_;
  GradientAverage gradients_;
  Smoothing smoothing_;
  std::shared_ptr<MeshRenderer> renderer_;
  at::Tensor views_, intrinsics_, laplacian_;
};

void write_losses(const std::filesystem::path& file, const std::vector<StepRecord>& steps) {
  write_whole_file(file, [&](std::ostream& out) {
    out << "step,loss,silhouette,color,laplacian\n";
    for (std::size_t i = 0; i < steps.size(); ++i) {
      out << i + 1;
      for (const double value : {steps[i].loss, steps[i].silhouette, steps[i].color, steps[i].laplacian}) {
        out << ',' << checks::text(value);
      }
      out << '\n';
    }
  });
}

void check(const TrainingOptions& options) {
  const auto require = [](bool good, const char* name, double got, const char* expected) {
    if (!good) throw InvalidArgument(std::string(name) + " (dpr learn)", checks::text(got), expected);
  };
  require(options.batch >= 2 && options.batch <= 1024, "batch", options.batch, "2 to 1024");
  require(options.batch % options.ranks.count == 0, "batch", options.batch,
          ("a multiple of the " + std::to_string(options.ranks.count) + " ranks").c_str());
  require(options.palette >= 1 && options.palette <= 256, "palette", static_cast<double>(options.palette),
          "1 to 256");
  require(options.learning_rate > 0 && std::isfinite(options.learning_rate), "learning rate",
          options.learning_rate, "a number > 0");
  require(options.minutes >= 0, "minutes", options.minutes, "a number >= 0");
  require(options.checkpoint_every >= 1, "checkpoint interval", static_cast<double>(options.checkpoint_every),
          "at least 1");
  for (const double weight : {options.weights.silhouette, options.weights.color, options.weights.laplacian}) {
    require(weight >= 0 && std::isfinite(weight), "weight", weight, "a number >= 0");
  }
}

/// Mean IoU of the listed images, of which every rank takes a part.
double validate(Network& network, const Dataset& dataset, const std::vector<ViewOfObject>& which,
                const RankGroup& ranks) {
  const std::vector<double> own =
      reconstruction_iou(network, dataset, part_of(which, ranks.ranks()), [](std::size_t) {});
  const auto first = static_cast<std::int64_t>(ranks.ranks().first(which.size()));
  const at::Tensor all = torch::zeros({static_cast<std::int64_t>(which.size())}, torch::kDouble);
  std::ranges::copy(own, all.data_ptr<double>() + first);
  ranks.sum(all);
  const double* const values = all.data_ptr<double>();
  return std::accumulate(values, values + which.size(), 0.0) / static_cast<double>(which.size());
}

TrainingResult result_of(const LoadedCheckpoint& run, const TrainingProgress& last) {
  TrainingResult result;
  result.last = last;
  for (const StepRecord& step : run.checkpoint.steps) result.losses.push_back(step.loss);
  for (const ValidationRecord& validation : run.checkpoint.validations) {
    result.validation_steps.push_back(validation.step);
    result.validation_iou.push_back(validation.iou);
  }
  return result;
}

/// The scale at which `prior` spreads as wide as SoftRas' prior of the same noise does at its published
/// scale. Widths are of the middle nine tenths: Cauchy noise has no variance.
float published_scale(Prior prior, Prior of_softras) {
  constexpr double k_softras_scale = 1e-4;  // of distance and depth: Liu et al. 2019, at 64x64
  const auto width = [](Prior p) { return quantile(p, 0.95) - quantile(p, 0.05); };
  return static_cast<float>(k_softras_scale * width(of_softras) / width(prior));
}

}  // namespace

std::vector<std::string_view> training_methods() {
  std::vector<std::string_view> names = smoothing_preset_names();
  std::erase(names, k_without_gradients);
  return names;
}

Smoothing training_smoothing(const TrainingOptions& options) {
  if (options.method == k_without_gradients)
    throw InvalidArgument("method (dpr learn)", options.method, one_of(training_methods()));
  SmoothingOptions given{.preset = options.method, .sigma = options.sigma, .gamma = options.gamma};
  const Smoothing preset = smoothing_preset(options.method, k_image_size, k_image_size);
  if (preset.occupancy_prior != Prior::uniform) {  // else pixels and rigid depths are the scales
    if (!given.sigma) given.sigma = published_scale(preset.occupancy_prior, Prior::logistic);
    if (!given.gamma) given.gamma = published_scale(preset.depth_prior, Prior::gumbel);
  }
  return resolve_smoothing(given, k_image_size, k_image_size);
}

TrainingResult train(const Device& device, const Dataset& training, const Dataset& validation,
                     const TrainingOptions& options, const std::filesystem::path& folder,
                     const std::function<void(const TrainingProgress&)>& progress) {
  check(options);
  const std::filesystem::path file = folder / "checkpoint.pt";
  const std::string settings = settings_of(options, training);
  const auto ranks = c10::make_intrusive<RankGroup>(options.ranks);
  const bool is_first = options.ranks.rank == 0;
  require_same_options(*ranks, options, settings);
  LoadedCheckpoint run = resume(file, options, settings, *ranks);
  Trainer trainer(device, training, options, ranks, run.network);
  constexpr std::size_t k_validation_views = 2;
  const std::vector<ViewOfObject> held_out = spread_views(validation, k_validation_views);
  TrainingProgress state;
  if (!run.checkpoint.validations.empty()) state.validation_iou = run.checkpoint.validations.back().iou;

  const auto save = [&] {
    const double iou = validate(run.network, validation, held_out, *ranks);
    state.validation_iou = iou;
    run.checkpoint.validations.push_back({static_cast<double>(run.checkpoint.steps.size()), iou});
    if (!is_first) return;
    // In this order: interrupted between the two, a training that is complete would not write its losses.
    write_losses(folder / "losses.csv", run.checkpoint.steps);
    save_checkpoint(file, run.checkpoint, run.network, *run.optimizer);
  };

  const Clock::time_point begin = Clock::now();
  bool saved = true, is_over = false;
  while (run.checkpoint.steps.size() < options.steps && !is_over) {
    const Clock::time_point start_of_step = Clock::now();
    run.checkpoint.steps.push_back(trainer.step(run));
    state.seconds += seconds_since(start_of_step);
    state.step = run.checkpoint.steps.size();
    state.loss = run.checkpoint.steps.back().loss;
    state.render_share = trainer.render_seconds() / state.seconds;
    saved = state.step % options.checkpoint_every == 0;
    if (saved) save();
    if (is_first) progress(state);
    is_over = options.minutes > 0 && ranks->any(seconds_since(begin) >= 60 * options.minutes);
  }
  if (!saved) save();
  return result_of(run, state);
}

}  // namespace dpr::learn
