// Assignment of a batch's chunks to devices.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <optional>
#include <vector>

namespace dpr {

/// Consecutive views [first, last).
struct Chunk {
  std::size_t first, last;
  std::size_t size() const { return last - first; }
};

/// Views [0, views) in chunks of `size`, the last of what remains.
std::vector<Chunk> make_chunks(std::size_t views, std::size_t size);

/// Speed of a device, as far as it is known from the chunks that the device has rendered.
struct Pace {
  bool is_warm = false;         ///< has rendered a chunk; in the first kernels are built, so it is not timed
  double seconds_per_view = 0;  ///< 0: not known
  double idle_seconds = 0;      ///< how long calls have taken since it last rendered

  /// One chunk that took long by chance counts no more than double.
  void record(double seconds, std::size_t views);
};

/// Deals the chunks of one call, each to the device that is free first, unless it is so slow that the others
/// would be done with all that is left before it is with this one. So a slow device gets the work that it is
/// worth, or none. One that gets none is tried again when the calls since have taken 20 times as long as its
/// chunk would, so that no more than a twentieth of the time is lost on it. May be used from several threads.
class ChunkDealer {
 public:
  /// `paces` of all devices, of which those that are lost get no chunk; it must outlive the dealer.
  ChunkDealer(std::vector<Chunk> chunks, std::vector<Pace>& paces, std::vector<bool> lost);

  /// The number of the chunk that a device is to render. None: there is nothing more to do for it. Blocks
  /// while others work on what is left, since they may be lost.
  std::optional<std::size_t> take(std::size_t device);
  /// The device is done with the chunk, in that time.
  void finish(std::size_t device, std::size_t chunk, double seconds);
  /// The device is done with the chunk, which failed and need not be tried again.
  void give_up(std::size_t device, std::size_t chunk);
  /// The device is lost, and its chunk is to be dealt again.
  void lose(std::size_t device, std::size_t chunk);
  /// The device takes no chunk any more; one that it has it may still end.
  void withdraw(std::size_t device);
  /// To be called at the end, with the time that everything took.
  void finish_all(double seconds);

  bool is_done() const { return left_ == 0; }

 private:
  enum class State { waiting, taken, done };

  bool pays(std::size_t device, const Chunk& chunk) const;
  void end(std::size_t device, std::size_t chunk, State state);

  const std::vector<Chunk> chunks_;
  std::vector<Pace>& paces_;
  std::vector<bool> lost_, has_rendered_;  // [device]
  std::vector<State> states_;              // [chunk]
  std::vector<std::size_t> in_work_;       // [device] views
  std::size_t left_;                       // chunks that are not done
  std::mutex mutex_;
  std::condition_variable changed_;
};

}  // namespace dpr
