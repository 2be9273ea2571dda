// Going on with a training: whether it is the same one, on every rank.
#pragma once

#include <filesystem>
#include <string>

#include "learn/checkpoint.hpp"
#include "learn/rank_group.hpp"

namespace dpr::learn {

/// Settings that determine a step, without its number and the learning rate, which may change on the way.
std::string settings_of(const TrainingOptions& options, const Dataset& training);

/// Throws InvalidArgument on every rank that is to train otherwise than rank 0.
void require_same_options(const RankGroup& ranks, const TrainingOptions& options,
                          const std::string& settings);

/// The checkpoint to go on from, or a fresh start. Throws InvalidArgument if it belongs to another training.
LoadedCheckpoint resume(const std::filesystem::path& file, const TrainingOptions& options,
                        const std::string& settings, const RankGroup& ranks);

}  // namespace dpr::learn
