// dpr-learn: the commands that need libtorch, as `dpr learn` runs them.
#include "cli/commands.hpp"
#include "learn/commands.hpp"

int main(int argc, char** argv) {
  dpr::cli::CommonOptions common;
  CLI::App application("Single-image reconstruction: data, training, evaluation.", "dpr learn");
  application.require_subcommand(1);
  application.footer("Example: dpr learn data -o data && dpr learn train --data data -o run --minutes 30");
  dpr::cli::add_learn_commands(application, common);
  return dpr::cli::run_application(application, common, argc, argv);
}
