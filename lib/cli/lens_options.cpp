#include "cli/lens_options.hpp"

#include "cli/option_names.hpp"

namespace dpr::cli {

void add_lens_options(CLI::App& command, LensSubdivisionOptions& options) {
  command
      .add_option("--lens-tolerance", options.tolerance,
                  "Most pixels between a point of an edge as it is drawn and as the scene's lens shows it: "
                  "faces are cut until none is further; 0.25 by default, inf leaves faces whole")
      ->type_name("FLOAT");
}

SubdividedScene subdivide(const CLI::App& command, const Scene& scene,
                          const LensSubdivisionOptions& options) {
  return with_option_names(command, {{"tolerance", "--lens-tolerance"}},
                           [&] { return subdivide_for_lens(scene, options); });
}

}  // namespace dpr::cli
