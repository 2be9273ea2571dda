// Checkpoint of a training: the network, the optimizer, and the losses so far.
#pragma once

#include <torch/torch.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "learn/learning.hpp"
#include "learn/network.hpp"

namespace dpr::learn {

/// Losses of a step, and of a validation.
struct StepRecord {
  double loss, silhouette, color, laplacian;
};
struct ValidationRecord {
  double step, iou;
};

struct Checkpoint {
  NetworkOptions architecture;
  std::string method;
  std::uint64_t seed = 1;
  std::string settings;  ///< whatever else a step depends on, as text
  std::vector<StepRecord> steps;
  std::vector<ValidationRecord> validations;
};

/// The file appears whole or not at all. Throws IoError.
void save_checkpoint(const std::filesystem::path& file, const Checkpoint& checkpoint, const Network& network,
                     const torch::optim::Adam& optimizer);

/// A checkpoint that was read; the network has its weights.
struct LoadedCheckpoint {
  Checkpoint checkpoint;
  Network network = nullptr;
  std::unique_ptr<torch::optim::Adam> optimizer;
};

/// A new network with the weights that `seed` draws, and its optimizer.
LoadedCheckpoint start(const NetworkOptions& architecture, const std::string& method, std::uint64_t seed,
                       double learning_rate);

/// Throws IoError for a file that is missing, no checkpoint, or of another architecture.
LoadedCheckpoint load_checkpoint(const std::filesystem::path& file, double learning_rate);
/// The same of a file's bytes, where this process need not have it. The name is for errors.
LoadedCheckpoint load_checkpoint(const std::filesystem::path& file, const std::string& bytes,
                                 double learning_rate);

}  // namespace dpr::learn
