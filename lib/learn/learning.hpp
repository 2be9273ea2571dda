// Training and evaluation of single-image reconstruction. No header of torch is needed to use this.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dpr/device.hpp"
#include "dpr/smoothing.hpp"
#include "learn/dataset.hpp"
#include "learn/ranks.hpp"

namespace dpr::learn {

/// Weights of (74). The paper's Laplacian has 3e-3. All views look down at the same angle, and colours are
/// not shaded: with so little, the sides of a box cave in where no silhouette shows it.
struct LearningWeights {
  double silhouette = 1, color = 1, laplacian = 0.3;
};

struct TrainingOptions {
  std::string method = "gaussian";  ///< a preset of the smoothing, with the scales below
  /// Unless given, SoftRas' published 1e-4 each, and what makes another prior's noise as wide
  /// (Gaussian: 1.79e-4 and 1.24e-4); of opendr and nmr the preset's.
  std::optional<float> sigma, gamma;
  std::uint64_t seed = 1;     ///< of the first weights, the batches, and sampled noise
  std::int64_t palette = 16;  ///< colours of a palette
  int batch = 16;  ///< images a step, of all ranks; each mesh is compared with two views of its object
  double learning_rate = 3e-4;  ///< of Adam (0.9, 0.999); the paper's is 1e-4
  LearningWeights weights;
  std::size_t steps = 20000;           ///< in all, with those before a resumption
  double minutes = 0;                  ///< of this run; 0: no limit
  std::size_t checkpoint_every = 250;  ///< steps; validated each time
  Ranks ranks;                         ///< of which this process is one
};

/// Progress of a run, reported as it goes.
struct TrainingProgress {
  std::size_t step = 0;
  double loss = 0;
  std::optional<double> validation_iou;  ///< of the last checkpoint, once there is one
  double seconds = 0;         ///< of this run, without validation
  double render_share = 0;    ///< of these seconds, in the renderer
};

struct TrainingResult {
  TrainingProgress last;
  std::vector<double> losses;  ///< [step] from the first one on
  std::vector<double> validation_steps, validation_iou;
};

/// The presets that can be trained with: those that have gradients.
std::vector<std::string_view> training_methods();
/// The smoothing of a method, as training uses it. Throws InvalidArgument.
Smoothing training_smoothing(const TrainingOptions& options);

/// Trains, or goes on where `folder`/checkpoint.pt stands, until the steps or the minutes are over, and
/// leaves checkpoint.pt and losses.csv in that folder, which exists. Step n depends on the options, the data
/// and n only, and all but the learning rate are those of the checkpoint: interrupted
/// and resumed training gives the same losses, bit by bit on one device with the same number of threads.
///
/// Ranks divide every batch, and the validation, into equal parts, and all return the losses of the whole,
/// for their number the same bit by bit. They follow a process that is alone to rounding; sampled noise is of
/// its own on each. Rank 0 reads and writes the folder, which the others need not have, and is told the
/// progress. Throws InvalidArgument, IoError, DeviceError; and Error if a loss is not finite, or another rank
/// ended or does not answer (learn/ranks.hpp).
TrainingResult train(const Device& device, const Dataset& training, const Dataset& validation,
                     const TrainingOptions& options, const std::filesystem::path& folder,
                     const std::function<void(const TrainingProgress&)>& progress);

/// 3D IoU of a class at 32^3.
struct ClassIou {
  std::size_t object_class = 0;
  std::size_t images = 0;
  double iou = 0;     ///< mean over the images
  double sphere = 0;  ///< what the sphere that the network starts from has
};

/// Quality of a checkpoint's network.
struct Evaluation {
  std::string method;          ///< that it was trained with
  std::uint64_t seed = 1;      ///< of its training
  std::size_t steps = 0;       ///< of its training
  double iou = 0, sphere = 0;  ///< means over the classes
  std::vector<ClassIou> classes;
};

/// Evaluates a checkpoint on `views` views, 1 to 24, evenly spread, of every object. Throws InvalidArgument,
/// IoError.
Evaluation evaluate(const std::filesystem::path& checkpoint, const Dataset& dataset, std::size_t views,
                    const std::function<void(std::size_t, std::size_t)>& progress);

/// One row a class: an image of its object `number`, and the reconstruction rendered from four sides. Throws
/// InvalidArgument where a class has no such object, IoError, DeviceError.
Image show(const Device& device, const std::filesystem::path& checkpoint, const Dataset& dataset,
           std::size_t number);

}  // namespace dpr::learn
