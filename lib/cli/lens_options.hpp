// --lens-tolerance: faces cut for the scene's lens.
#pragma once

#include <CLI/CLI.hpp>

#include "dpr/subdivision.hpp"

namespace dpr::cli {

/// Names the option in the command.
void add_lens_options(CLI::App& command, LensSubdivisionOptions& options);
/// subdivide_for_lens(), whose errors name the option.
SubdividedScene subdivide(const CLI::App& command, const Scene& scene, const LensSubdivisionOptions& options);

}  // namespace dpr::cli
