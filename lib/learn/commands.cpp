// dpr learn data, train, eval, show: from the command line to the library and back.
#include "learn/commands.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "base/name_list.hpp"
#include "base/output_file.hpp"
#include "cli/completion.hpp"
#include "cli/json.hpp"
#include "cli/plot.hpp"
#include "cli/progress.hpp"
#include "cli/provenance.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"
#include "image/codec.hpp"
#include "learn/generate.hpp"
#include "learn/learning.hpp"
#include "learn/ranks.hpp"

namespace dpr::cli {
namespace {

using learn::Dataset;
using learn::Split;

/// Folder and classes of the data.
struct DataOptions {
  std::string folder;
  std::vector<std::string> classes;
};

void add_classes(CLI::App& command, std::vector<std::string>& classes) {
  CLI::Option* const option =
      command
          .add_option("--classes", classes,
                      "Classes by name or synset, separated by commas (default: all thirteen)")
          ->delimiter(',')
          ->type_name("NAME,...");
  std::vector<std::string_view> names;
  for (const learn::ObjectClass& object_class : learn::object_classes()) names.push_back(object_class.name);
  cli::complete_with(*option, names);
}

void add_data(CLI::App& command, DataOptions& options) {
  command.add_option("--data", options.folder, "Folder of the data")->required()->type_name("DIR");
  add_classes(command, options.classes);
}

void add_checkpoint(CLI::App& command, std::string& file) {
  command.add_option("--checkpoint", file, "The trained network")->required()->type_name("FILE.pt");
}

void add_split(CLI::App& command, std::string& split) {
  command.add_option("--split", split, "Split of the data")
      ->capture_default_str()
      ->type_name("train|val|test");
}

std::vector<std::size_t> class_indices(const std::vector<std::string>& words) {
  std::vector<std::size_t> indices;
  for (const std::string& word : words) {
    const std::size_t c = learn::find_class(word);
    if (std::ranges::find(indices, c) == indices.end()) indices.push_back(c);
  }
  if (words.empty()) {
    for (std::size_t i = 0; i < learn::object_classes().size(); ++i) indices.push_back(i);
  }
  return indices;
}

Dataset read(const DataOptions& options, Split split) {
  return {options.folder, split, class_indices(options.classes)};
}

// data

struct DataCommand {
  std::string output;
  std::vector<std::string> classes;
  learn::GenerateOptions generate;
};

void run_data(DataCommand& command, const CommonOptions& common) {
  command.generate.classes = class_indices(command.classes);
  make_folder(command.output);
  {
    std::unique_ptr<Progress> bar;
    learn::generate(open_device(common), command.generate, command.output,
                    [&](std::size_t done, std::size_t all, const std::string& what) {
                      if (!bar)
                        bar = std::make_unique<Progress>(static_cast<unsigned>(all), common.quiet, "object");
                      bar->update(static_cast<unsigned>(done), what);
                    });
  }
  const std::filesystem::path sheet = std::filesystem::path(command.output) / "contact_sheet.png";
  write_image(sheet, learn::contact_sheet(Dataset(command.output, Split::train, command.generate.classes)));
  if (!common.quiet) std::printf("%s: see %s\n", command.output.c_str(), sheet.c_str());
}

void add_data_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand("data", "Makes a data set of parametric shapes");
  const auto options = std::make_shared<DataCommand>();
  command->add_option("-o,--output", options->output, "Folder to write")->required()->type_name("DIR");
  add_classes(*command, options->classes);
  const auto count = [&](const char* name, Split split, const char* what) {
    command->add_option(name, options->generate.objects[static_cast<std::size_t>(split)], what)
        ->check(CLI::Range(1, 100000))
        ->capture_default_str()
        ->type_name("N");
  };
  count("--train", Split::train, "Objects of a class to train with");
  count("--val", Split::val, "Objects of a class to validate with");
  count("--test", Split::test, "Objects of a class to test with");
  std::uint64_t& seed = options->generate.seed;
  add_seed_option(
      *command, [&seed](std::uint64_t given) { seed = given; }, "Seed of the shapes")
      ->default_str(std::to_string(seed));
  add_output_options(*command, common);
  add_device_options(*command, common);
  command->footer("Example: dpr learn data -o data");
  command->callback([options, &common] { run_data(*options, common); });
}

// train

struct TrainCommand {
  DataOptions data;
  std::string output;
  std::optional<int> ranks;
  unsigned timeout = static_cast<unsigned>(learn::Ranks().timeout.count());
  learn::TrainingOptions training;
};

/// Means of consecutive values, so that a plot of many is not a smear.
void plot_losses(const std::filesystem::path& file, const std::vector<double>& losses) {
  constexpr std::size_t k_points = 300;
  const std::size_t window = std::max<std::size_t>(1, losses.size() / k_points);
  std::vector<double> steps, means;
  for (std::size_t first = 0; first + window <= losses.size(); first += window) {
    double sum = 0;
    for (std::size_t i = first; i < first + window; ++i) sum += losses[i];
    steps.push_back(static_cast<double>(first + window));
    means.push_back(sum / static_cast<double>(window));
  }
  if (steps.size() > 1)
    plot(file,
         {"step", steps, {{"Training loss, means of consecutive steps", "loss", true, {{"mean", means}}}}});
}

std::string validation_text(const learn::TrainingProgress& progress) {
  return progress.validation_iou ? format(", validation IoU %.3f", *progress.validation_iou) : "";
}

void print_result(const std::string& folder, const learn::TrainingResult& result) {
  std::printf("%s: %zu steps%s; ", folder.c_str(), result.losses.size(),
              validation_text(result.last).c_str());
  if (result.last.step == 0) {
    std::printf("nothing was left to do\n");
  } else {
    std::printf("%.0f s in this run, %.0f%% of them in the renderer\n", result.last.seconds,
                100 * result.last.render_share);
  }
}

/// The ranks of a machine take the devices of the list in turn.
Device device_of(const CommonOptions& common, const learn::Ranks& ranks) {
  if (ranks.count == 1) return open_device(common);
  const std::vector<Device> devices = open_devices(common);
  return devices[static_cast<std::size_t>(ranks.local_rank) % devices.size()];
}

/// Trains as one rank, or alone.
void train(const TrainCommand& command, const CommonOptions& common) {
  const Dataset training = read(command.data, Split::train), validation = read(command.data, Split::val);
  const learn::TrainingOptions& o = command.training;
  learn::training_smoothing(o);  // a wrong method or device leaves no folder behind
  const Device device = device_of(common, o.ranks);
  if (o.ranks.rank == 0) make_folder(command.output);
  learn::TrainingResult result;
  {
    Progress bar(static_cast<unsigned>(o.steps), common.quiet);
    result =
        learn::train(device, training, validation, o, command.output, [&](const learn::TrainingProgress& p) {
          const double steps = static_cast<double>(p.step) / static_cast<double>(o.steps);
          const double time = o.minutes > 0 ? p.seconds / (60 * o.minutes) : 0;
          bar.update(static_cast<unsigned>(p.step), std::max(steps, time),
                     format("loss %.4f", p.loss) + validation_text(p));
        });
  }
  if (o.ranks.rank != 0) return;
  const std::filesystem::path folder(command.output);
  plot_losses(folder / "losses.png", result.losses);
  if (result.validation_steps.size() > 1) {
    plot(folder / "validation.png",
         {"step",
          result.validation_steps,
          {{"Validation on unseen shapes", "mean IoU", false, {{"validation", result.validation_iou}}}}});
  }
  if (!common.quiet) print_result(command.output, result);
}

void run_train(TrainCommand command, CommonOptions common) {
  learn::Ranks& ranks = command.training.ranks;
  ranks = learn::ranks_of([](const char* variable) { return std::getenv(variable); });
  ranks.timeout = std::chrono::seconds(command.timeout);
  if (ranks.count == 1 && command.ranks.value_or(1) > 1) {
    if (const int status = learn::run_ranks(*command.ranks); status != 0) std::exit(status);
    return;
  }
  if (command.ranks.value_or(ranks.count) != ranks.count) {
    throw InvalidArgument("ranks (dpr learn)", std::to_string(*command.ranks),
                          std::to_string(ranks.count) + ", as WORLD_SIZE says, or no --ranks");
  }
  common.quiet = common.quiet || ranks.rank != 0;
  train(command, common);
}

void add_train_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand("train", "Trains a network, or goes on with it");
  const auto options = std::make_shared<TrainCommand>();
  learn::TrainingOptions& o = options->training;
  add_data(*command, options->data);
  command
      ->add_option("-o,--output", options->output,
                   "Folder of the run; where it holds a checkpoint, that goes on")
      ->required()
      ->type_name("DIR");
  command->add_option("--method", o.method, "Preset of the smoothing to render with")
      ->capture_default_str()
      ->type_name(joined(learn::training_methods()));
  command->add_option("--minutes", o.minutes, "Time for this run, 0 for as long as it takes")
      ->capture_default_str()
      ->type_name("FLOAT");
  command->add_option("--steps", o.steps, "Steps in all, with those of earlier runs")
      ->check(CLI::PositiveNumber)
      ->capture_default_str()
      ->type_name("N");
  add_seed_option(
      *command, [&o](std::uint64_t seed) { o.seed = seed; }, "Seed of the weights, the batches and the noise")
      ->default_str(std::to_string(o.seed));
  command->add_option("--batch", o.batch, "Images a step, of all ranks")
      ->capture_default_str()
      ->type_name("N");
  command->add_option("--learning-rate", o.learning_rate, "Learning rate of Adam")
      ->capture_default_str()
      ->type_name("FLOAT");
  command
      ->add_option(
          "--sigma", o.sigma,
          "Scale of the distance noise, NDC^2 (default: as wide as SoftRas' noise at 1e-4; of opendr and "
          "nmr the preset's)")
      ->type_name("FLOAT");
  command->add_option("--gamma", o.gamma, "Scale of the depth noise (default: the same)")->type_name("FLOAT");
  command->add_option("--palette", o.palette, "Colours of a palette")->capture_default_str()->type_name("N");
  command->add_option("--silhouette-weight", o.weights.silhouette, "Weight of the silhouette's IoU")
      ->capture_default_str()
      ->type_name("FLOAT");
  command->add_option("--color-weight", o.weights.color, "Weight of the colours' L1")
      ->capture_default_str()
      ->type_name("FLOAT");
  command->add_option("--laplacian-weight", o.weights.laplacian, "Weight of the Laplacian")
      ->capture_default_str()
      ->type_name("FLOAT");
  command
      ->add_option("--checkpoint-every", o.checkpoint_every, "Steps between checkpoints, which are validated")
      ->check(CLI::PositiveNumber)
      ->capture_default_str()
      ->type_name("N");
  command->add_option("--ranks", options->ranks, "Processes on this machine that train together (default: 1)")
      ->check(CLI::Range(1, 1024))
      ->type_name("N");
  command->add_option("--timeout", options->timeout, "Seconds for another rank to answer")
      ->check(CLI::Range(1, 86400))
      ->capture_default_str()
      ->type_name("N");
  add_output_options(*command, common);
  add_device_options(*command, common);
  command->get_option("--device")
      ->type_name("cpu|gpu|INDEX|SUBSTRING|LIST")
      ->description(
          "OpenCL device; the ranks of a machine take one each of a list (default: DPR_DEVICE, else a "
          "GPU, else "
          "an accelerator, else a CPU)");
  command->footer("Example: dpr learn train --data data -o run --minutes 30");
  command->callback([options, &common] { run_train(*options, common); });
}

// eval

struct EvalCommand {
  DataOptions data;
  std::string checkpoint, split = "test", output;
  std::size_t views = learn::k_views;
};

Json evaluation_to_json(const learn::Evaluation& evaluation, const EvalCommand& command) {
  Json classes = Json::array();
  for (const learn::ClassIou& row : evaluation.classes) {
    const learn::ObjectClass& c = learn::object_classes()[row.object_class];
    classes.push_back({{"class", c.name},
                       {"synset", c.synset},
                       {"images", row.images},
                       {"iou", row.iou},
                       {"sphere", row.sphere}});
  }
  return {{"commit", commit()},         {"method", evaluation.method},
          {"seed", evaluation.seed},    {"steps", evaluation.steps},
          {"split", command.split},     {"views", command.views},
          {"mean_iou", evaluation.iou}, {"sphere_mean_iou", evaluation.sphere},
          {"classes", classes}};
}

void run_eval(const EvalCommand& command, const CommonOptions& common) {
  if (!command.output.empty()) require_writable(command.output);  // before the work, not after it
  const Dataset dataset = read(command.data, learn::parse_split(command.split));
  learn::Evaluation evaluation;
  {
    std::unique_ptr<Progress> bar;
    evaluation =
        learn::evaluate(command.checkpoint, dataset, command.views, [&](std::size_t done, std::size_t all) {
          if (!bar) bar = std::make_unique<Progress>(static_cast<unsigned>(all), common.quiet, "image");
          bar->update(static_cast<unsigned>(done), "");
        });
  }
  if (!command.output.empty()) write_json(command.output, evaluation_to_json(evaluation, command));
  if (common.quiet) return;
  const auto print = [](std::string_view name, double iou, double sphere) {
    std::printf("%-10s %5.1f%%  (the sphere %4.1f%%)\n", std::string(name).c_str(), 100 * iou, 100 * sphere);
  };
  for (const learn::ClassIou& row : evaluation.classes) {
    print(learn::object_classes()[row.object_class].name, row.iou, row.sphere);
  }
  print("mean", evaluation.iou, evaluation.sphere);
}

void add_eval_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand("eval", "3D IoU at 32^3, by class");
  const auto options = std::make_shared<EvalCommand>();
  add_checkpoint(*command, options->checkpoint);
  add_data(*command, options->data);
  add_split(*command, options->split);
  command->add_option("--views", options->views, "Views of each object")
      ->check(CLI::Range(std::size_t{1}, learn::k_views))
      ->capture_default_str()
      ->type_name("N");
  command->add_option("-o,--output", options->output, "Table to write")->type_name("R.json");
  add_output_options(*command, common);
  command->footer("Example: dpr learn eval --checkpoint run/checkpoint.pt --data data -o iou.json");
  command->callback([options, &common] { run_eval(*options, common); });
}

// show

struct ShowCommand {
  DataOptions data;
  std::string checkpoint, split = "test", output;
  std::size_t object = 0;
};

void add_show_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command = application.add_subcommand("show", "A picture of inputs and their reconstructions");
  const auto options = std::make_shared<ShowCommand>();
  add_checkpoint(*command, options->checkpoint);
  add_data(*command, options->data);
  add_split(*command, options->split);
  command->add_option("--object", options->object, "Number of the object of every class")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str()
      ->type_name("N");
  command->add_option("-o,--output", options->output, "Picture to write")->required()->type_name("OUT.png");
  add_output_options(*command, common);
  add_device_options(*command, common);
  command->footer("Example: dpr learn show --checkpoint run/checkpoint.pt --data data -o figure.png");
  command->callback([options, &common] {
    require_image_format(options->output);
    require_writable(options->output);
    const Dataset dataset = read(options->data, learn::parse_split(options->split));
    write_image(options->output,
                learn::show(open_device(common), options->checkpoint, dataset, options->object));
    if (!common.quiet) std::printf("%s\n", options->output.c_str());
  });
}

}  // namespace

void add_learn_commands(CLI::App& application, CommonOptions& common) {
  add_data_command(application, common);
  add_train_command(application, common);
  add_eval_command(application, common);
  add_show_command(application, common);
}

}  // namespace dpr::cli
