#include "learn/resume.hpp"

#include <algorithm>
#include <sstream>
#include <utility>
#include <vector>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "base/name_list.hpp"
#include "dpr/error.hpp"

namespace dpr::learn {
namespace {

/// Those parts of two settings that are not the same.
std::pair<std::string, std::string> differences(const std::string& first, const std::string& second) {
  const std::vector<std::string> there = split_list(first), here = split_list(second);
  std::pair<std::string, std::string> result;
  for (std::size_t i = 0; i < std::max(there.size(), here.size()); ++i) {
    const std::string a = i < there.size() ? there[i] : "", b = i < here.size() ? here[i] : "";
    if (a == b) continue;
    result.first += (result.first.empty() ? "" : ", ") + a;
    result.second += (result.second.empty() ? "" : ", ") + b;
  }
  return result;
}

/// Throws InvalidArgument unless the settings are the same, with those parts that are not.
void require_same(const std::filesystem::path& file, const std::string& found, const std::string& asked) {
  if (found == asked) return;
  const auto [got, expected] = differences(found, asked);
  throw InvalidArgument("checkpoint (" + file.string() + ")", got,
                        expected + " as asked for, or another folder");
}

/// Checkpoint in rank 0's folder, if there is one, sent to every rank.
LoadedCheckpoint load_of_rank_0(const std::filesystem::path& file, double learning_rate,
                                const RankGroup& ranks) {
  if (ranks.ranks().rank != 0) {
    const std::string bytes = ranks.share({});
    return bytes.empty() ? LoadedCheckpoint{} : load_checkpoint(file, bytes, learning_rate);
  }
  LoadedCheckpoint loaded;
  if (std::filesystem::exists(file)) loaded = load_checkpoint(file, learning_rate);
  if (!ranks.is_alone()) ranks.share(loaded.network ? read_file(file) : "");
  release_input(file);
  return loaded;
}

}  // namespace

std::string settings_of(const TrainingOptions& options, const Dataset& training) {
  const Smoothing smoothing = training_smoothing(options);
  const LearningWeights& w = options.weights;
  std::ostringstream text;
  text << options.method << " with seed " << options.seed << ", batch " << options.batch << ", sigma "
       << checks::text(smoothing.sigma) << ", gamma " << checks::text(smoothing.gamma) << ", weights "
       << checks::text(w.silhouette) << " " << checks::text(w.color) << " " << checks::text(w.laplacian)
       << ", " << training.size() << " objects of";
  for (const std::size_t c : training.classes()) text << " " << object_classes()[c].name;
  return text.str();
}

void require_same_options(const RankGroup& ranks, const TrainingOptions& options,
                          const std::string& settings) {
  std::ostringstream text;
  text << settings << ", palette " << options.palette << ", learning rate "
       << checks::text(options.learning_rate) << ", " << options.steps << " steps, "
       << checks::text(options.minutes) << " minutes, a checkpoint every " << options.checkpoint_every;
  const std::string expected = ranks.share(text.str());
  if (text.str() == expected) return;
  const auto [got, wanted] = differences(text.str(), expected);
  throw InvalidArgument("rank " + std::to_string(ranks.ranks().rank) + " (dpr learn)", got,
                        wanted + " as rank 0");
}

LoadedCheckpoint resume(const std::filesystem::path& file, const TrainingOptions& options,
                        const std::string& settings, const RankGroup& ranks) {
  const NetworkOptions wanted{options.palette};
  LoadedCheckpoint loaded = load_of_rank_0(file, options.learning_rate, ranks);
  if (!loaded.network) {
    loaded = start(wanted, options.method, options.seed, options.learning_rate);
    loaded.checkpoint.settings = settings;
    return loaded;
  }
  const Checkpoint& c = loaded.checkpoint;
  if (!(c.architecture == wanted)) {
    throw InvalidArgument("checkpoint (" + file.string() + ")",
                          "a network of " + std::to_string(c.architecture.palette) + " palette colours",
                          std::to_string(wanted.palette) + ", as asked for");
  }
  require_same(file, c.settings, settings);
  return loaded;
}

}  // namespace dpr::learn
