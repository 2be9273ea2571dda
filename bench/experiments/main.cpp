// dpr_experiments: the paper's figures and tables, each one command.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "base/output_file.hpp"
#include "cli/process.hpp"
#include "dpr/error.hpp"
#include "experiment.hpp"

namespace {

struct Options {
  std::string device, folder;
  bool smoke = false, quiet = false;
};

void add_command(CLI::App& application, const dpr::experiments::Experiment& experiment, Options& options) {
  CLI::App* command = application.add_subcommand(experiment.name, experiment.description);
  command->add_option("-o,--output", options.folder, "Folder for the figures and numbers")
      ->required()
      ->type_name("DIR");
  command->add_flag("--smoke", options.smoke, "In seconds: few points, small images");
  command->add_flag("--quiet", options.quiet, "Print errors only");
  command->add_option("--device", options.device, "cpu, gpu, an index or a part of the name");
  command->callback([&experiment, &options] {
    dpr::make_folder(options.folder);
    experiment.run({dpr::open_device(options.device), options.folder, options.smoke, options.quiet});
  });
}

}  // namespace

int main(int argc, char** argv) {
  dpr::cli::prepare_process();
  CLI::App application("The paper's figures and tables, each one command.", "dpr_experiments");
  application.require_subcommand(1);
  application.footer("Example: dpr_experiments operators -o figures");
  Options options;
  for (const auto& experiment : dpr::experiments::experiments())
    add_command(application, experiment, options);
  try {
    application.parse(argc, argv);
    dpr::cli::require_printed();
    return 0;
  } catch (const CLI::ParseError& error) {
    return application.exit(error) == 0 ? 0 : 1;
  } catch (const dpr::DeviceError& error) {
    std::fprintf(stderr, "dpr_experiments: error: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "dpr_experiments: error: %s\n", error.what());
    return 1;
  }
}
