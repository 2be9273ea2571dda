// dpr bench, the measuring part.
#pragma once

#include <string>
#include <vector>

#include "cli/common_options.hpp"
#include "measure.hpp"

namespace dpr::cli {

struct BenchMeasureOptions {
  std::vector<std::string> workloads;  ///< by name; none: all that are no sweeps
  bool sweeps = false;                 ///< the sweeps too
  std::vector<std::string> presets;    ///< of the rows to measure; none: all
  std::vector<std::string> stages;     ///< whose figures to keep and print; none: all are kept
  std::string devices;                 ///< "all": every device is ranked; empty: the one that is chosen
  std::string output, csv;             ///< files of results, empty: none
  bench::MeasureOptions each;
};

/// Measures, prints a line a row, and writes the files anew after every workload, so that what was measured
/// stays if a later one takes the process down. Throws InvalidArgument for unknown names and IoError for an
/// output that cannot be written, both before anything is measured.
void run_bench(BenchMeasureOptions options, const CommonOptions& common);

}  // namespace dpr::cli
