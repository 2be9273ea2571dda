// Signals and streams of a program's process.
#pragma once

namespace dpr::cli {

/// To be called before anything else. A signal that ends the program removes its temporary files first; a
/// file that grows beyond the user's limit is an error, not a signal; a standard stream that is closed is no
/// number for the next file to take.
void prepare_process();

/// Writes out what was printed; to be called at the end, because a full disk or a closed stream may show only
/// then. Throws IoError.
void require_printed();

}  // namespace dpr::cli
