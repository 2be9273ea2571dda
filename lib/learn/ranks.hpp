// The processes that train together: what their launcher tells each of them, and a launcher for one machine.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace dpr::learn {

/// One of the processes that train together, a rank, and where it meets the others.
struct Ranks {
  int rank = 0;            ///< this process, below `count`; rank 0 reports and writes
  int count = 1;           ///< of all machines; 1: this process is alone
  int local_rank = 0;      ///< of those on this machine
  std::string address;     ///< of rank 0's machine
  std::uint16_t port = 0;  ///< there
  /// True if the launcher itself listens at that port, as torchrun may; its number of restarts, which
  /// then keeps the attempts apart.
  bool launcher_listens = false;
  std::string restarts = "0";
  std::chrono::seconds timeout{120};  ///< for the others to answer

  /// This rank's share of `total` ordered items: first() to last() - 1. No two ranks share an item.
  std::size_t first(std::size_t total) const { return total * static_cast<std::size_t>(rank) / whole(); }
  std::size_t last(std::size_t total) const { return total * (static_cast<std::size_t>(rank) + 1) / whole(); }

 private:
  std::size_t whole() const { return static_cast<std::size_t>(count); }
};

/// The value of an environment variable, or null.
using Environment = std::function<const char*(const char* variable)>;

/// Reads RANK, WORLD_SIZE, LOCAL_RANK, MASTER_ADDR and MASTER_PORT, as torchrun sets them; a single rank where
/// none of them is set. With MASTER_ADDR and MASTER_PORT from the user, the others are also taken from srun's
/// SLURM_PROCID, SLURM_NTASKS and SLURM_LOCALID. Throws InvalidArgument where they are not complete, or no
/// numbers in range.
Ranks ranks_of(const Environment& environment);

/// Prefix of errors that are only the consequence of another rank's end.
inline constexpr std::string_view k_lost_contact = "contact (dpr learn)";

/// Runs this program with its own arguments again, `count` times on this machine, with the variables above,
/// which stay set in this process, and each with its share of the cores unless OMP_NUM_THREADS,
/// OPENBLAS_NUM_THREADS and POCL_MAX_PTHREAD_COUNT say otherwise. Returns the exit status once all have
/// ended: 0, or that of the first that failed, whose error it prints; the others are ended then. What the
/// ranks print on stderr is kept until they have ended. If this process ends, they do. Throws Error if they
/// cannot be started.
int run_ranks(int count);

}  // namespace dpr::learn
