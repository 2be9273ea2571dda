// dpr-bench: the benchmark, as `dpr bench` runs it.
#include "bench_command.hpp"
#include "cli/commands.hpp"

int main(int argc, char** argv) {
  dpr::cli::CommonOptions common;
  CLI::App application("Measures forward and backward passes, compares results, draws them.", "dpr bench");
  dpr::cli::add_bench_options(application, common);
  return dpr::cli::run_application(application, common, argc, argv);
}
