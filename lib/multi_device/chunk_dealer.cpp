#include "multi_device/chunk_dealer.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace dpr {

std::vector<Chunk> make_chunks(std::size_t views, std::size_t size) {
  std::vector<Chunk> chunks;
  for (std::size_t first = 0; first < views; first += size)
    chunks.push_back({first, std::min(first + size, views)});
  return chunks;
}

void Pace::record(double seconds, std::size_t views) {
  const double now = seconds / static_cast<double>(views);
  if (!is_warm) {
    is_warm = true;
  } else if (seconds_per_view > 0) {
    seconds_per_view = (seconds_per_view + std::min(now, 3 * seconds_per_view)) / 2;
  } else {
    seconds_per_view = now;
  }
}

ChunkDealer::ChunkDealer(std::vector<Chunk> chunks, std::vector<Pace>& paces, std::vector<bool> lost)
    : chunks_(std::move(chunks)),
      paces_(paces),
      lost_(std::move(lost)),
      has_rendered_(lost_.size(), false),
      states_(chunks_.size(), State::waiting),
      in_work_(lost_.size(), 0),
      left_(chunks_.size()) {}

std::optional<std::size_t> ChunkDealer::take(std::size_t device) {
  std::unique_lock lock(mutex_);
  while (left_ > 0 && !lost_[device]) {
    const auto waiting = std::ranges::find(states_, State::waiting);
    const auto chunk = static_cast<std::size_t>(waiting - states_.begin());
    if (waiting != states_.end() && pays(device, chunks_[chunk])) {
      *waiting = State::taken;
      in_work_[device] = chunks_[chunk].size();
      return chunk;
    }
    changed_.wait(lock);
  }
  return std::nullopt;
}

/// Among the devices that are left the fastest is always paid: no other is done with a chunk before it is.
bool ChunkDealer::pays(std::size_t device, const Chunk& chunk) const {
  constexpr double k_patience = 20;
  const Pace& pace = paces_[device];
  const double own_seconds = pace.seconds_per_view * static_cast<double>(chunk.size());
  if (own_seconds == 0 || pace.idle_seconds > k_patience * own_seconds) return true;
  double views_per_second = 0, fastest = std::numeric_limits<double>::infinity();
  std::size_t views = 0;
  for (std::size_t other = 0; other < paces_.size(); ++other) {
    if (other == device || lost_[other]) continue;
    views += in_work_[other];
    if (paces_[other].seconds_per_view == 0) continue;
    views_per_second += 1 / paces_[other].seconds_per_view;
    fastest = std::min(fastest, paces_[other].seconds_per_view);
  }
  if (views_per_second == 0) return true;
  for (std::size_t c = 0; c < chunks_.size(); ++c) {
    if (states_[c] == State::waiting) views += chunks_[c].size();
  }
  const double others_seconds =
      std::max(static_cast<double>(views) / views_per_second, static_cast<double>(chunk.size()) * fastest);
  return own_seconds <= others_seconds;
}

void ChunkDealer::end(std::size_t device, std::size_t chunk, State state) {
  states_[chunk] = state;
  in_work_[device] = 0;
  if (state == State::done) --left_;
  changed_.notify_all();
}

void ChunkDealer::finish(std::size_t device, std::size_t chunk, double seconds) {
  const std::scoped_lock lock(mutex_);
  paces_[device].record(seconds, chunks_[chunk].size());
  paces_[device].idle_seconds = 0;
  has_rendered_[device] = true;
  end(device, chunk, State::done);
}

void ChunkDealer::give_up(std::size_t device, std::size_t chunk) {
  const std::scoped_lock lock(mutex_);
  end(device, chunk, State::done);
}

void ChunkDealer::lose(std::size_t device, std::size_t chunk) {
  const std::scoped_lock lock(mutex_);
  lost_[device] = true;
  end(device, chunk, State::waiting);
}

void ChunkDealer::withdraw(std::size_t device) {
  const std::scoped_lock lock(mutex_);
  lost_[device] = true;
  changed_.notify_all();
}

void ChunkDealer::finish_all(double seconds) {
  for (std::size_t d = 0; d < paces_.size(); ++d) {
    if (!has_rendered_[d]) paces_[d].idle_seconds += seconds;
  }
}

}  // namespace dpr
