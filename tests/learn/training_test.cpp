// Training learns, goes on where it stopped, and says what is wrong with what it is given.
#include <doctest/doctest.h>
#include <torch/torch.h>

#include <cmath>

#include "dpr/error.hpp"
#include "learn/checkpoint.hpp"
#include "learn/evaluation.hpp"
#include "learn/generate.hpp"
#include "learn/learning.hpp"
#include "support/file_size_limit.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace dpr::test::training_test {
namespace {

using namespace learn;

std::vector<std::size_t> two_classes() { return {find_class("table"), find_class("car")}; }

/// A data set of a few objects, made once.
const std::filesystem::path& data_folder() {
  static const TempDir folder;
  static const bool made = [] {
    generate(open_device(), {two_classes(), {8, 2, 2}, 3}, folder.path(),
             [](std::size_t, std::size_t, const std::string&) {});
    return true;
  }();
  static_cast<void>(made);
  return folder.path();
}

Dataset read(Split split) { return {data_folder(), split, two_classes()}; }

TrainingOptions small_options(const std::string& method) {
  TrainingOptions options;
  options.method = method;
  options.batch = 4;
  options.steps = 6;
  options.checkpoint_every = 100;  // beyond the last: a checkpoint is 370 MB
  options.palette = 5;
  return options;
}

TrainingResult run(const TrainingOptions& options, const TempDir& folder) {
  return train(open_device(), read(Split::train), read(Split::val), options, folder.path(),
               [](const TrainingProgress&) {});
}

std::string message(const TrainingOptions& options, const TempDir& folder) {
  return message_of<Error>([&] { run(options, folder); });
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("network: shapes, ranges, and a start at the sphere") {
    LoadedCheckpoint fresh = start({7}, "softras", 3, 1e-4);
    torch::manual_seed(1);
    const at::Tensor images = torch::rand({3, 4, 64, 64});
    const Reconstruction found = fresh.network->forward(images);
    CHECK(found.vertices.sizes() == at::IntArrayRef({3, 642, 3}));
    CHECK(found.colors.sizes() == at::IntArrayRef({3, 642, 3}));
    CHECK(found.colors.min().item<float>() >= 0);
    CHECK(found.colors.max().item<float>() <= 1);
    const at::Tensor radius = found.vertices.norm(2, {2});
    CHECK(radius.min().item<float>() > 0.15F);
    CHECK(radius.max().item<float>() < 0.35F);
    // A palette's colours are those of the object: of a red object on nothing, red.
    at::Tensor red = torch::zeros({2, 4, 64, 64});
    red.slice(2, 20, 40).select(1, 0) = 0.8;
    red.slice(2, 20, 40).select(1, 3) = 1.0;
    const at::Tensor color = fresh.network->forward(red).colors.flatten(0, 1).mean(0);
    CHECK(color[0].item<float>() == doctest::Approx(0.8).epsilon(0.02));
    CHECK(color[1].item<float>() < 0.02F);
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("training: every prior's noise is as wide as SoftRas' at 1e-4, unless scales are given") {
    const auto scales = [](const char* method) {
      TrainingOptions options;
      options.method = method;
      return training_smoothing(options);
    };
    CHECK(scales("softras").sigma == doctest::Approx(1e-4));
    CHECK(scales("softras").gamma == doctest::Approx(1e-4));
    for (const char* method : {"gaussian", "joint_gaussian", "paper_gaussian"}) {
      CHECK(scales(method).sigma == doctest::Approx(1e-4 * std::log(19.0) / 1.644854));
      CHECK(scales(method).gamma == doctest::Approx(1e-4 * (2.970195 + 1.097189) / (2 * 1.644854)));
    }
    CHECK(scales("paper_cauchy").sigma == doctest::Approx(1e-4 * std::log(19.0) / 6.313752));
    CHECK(scales("nmr").sigma == smoothing_preset("nmr").sigma);
    CHECK(blur_radius(scales("softras")) == doctest::Approx(9.21e-4).epsilon(1e-3));
    CHECK(blur_radius(scales("gaussian")) == doctest::Approx(3.719 * 1.790e-4).epsilon(1e-3));
    TrainingOptions options = small_options("softras");
    options.sigma = 2e-4F;
    options.gamma = 3e-4F;
    CHECK(training_smoothing(options).sigma == 2e-4F);
    CHECK(training_smoothing(options).gamma == 3e-4F);
  }

  TEST_CASE("training: interrupted and resumed gives the same losses, bit by bit") {
    for (const char* method : {"joint_gaussian", "paper_gaussian"}) {
      CAPTURE(std::string(method));
      TrainingOptions options = small_options(method);
      options.checkpoint_every = 4;
      const TempDir whole, parts;
      const std::vector<double> expected = run(options, whole).losses;
      REQUIRE(expected.size() == 6);
      options.steps = 3;
      CHECK(run(options, parts).losses.size() == 3);
      options.steps = 6;
      CHECK(run(options, parts).losses == expected);
      CHECK(whole.read("losses.csv") == parts.read("losses.csv"));
      CHECK(parts.entries() == 2);  // checkpoint and losses
      options.seed = 2;
      options.checkpoint_every = 100;
      const TempDir other;
      CHECK(run(options, other).losses != expected);
    }
  }

  TEST_CASE("training: in half a minute it learns shapes far better than the sphere's") {
    TrainingOptions options;
    options.batch = 8;
    options.steps = 60;
    options.checkpoint_every = 1000;
    const TempDir folder;
    const TrainingResult result = run(options, folder);
    CHECK(result.losses.back() < 0.75 * result.losses.front());
    const Evaluation found =
        evaluate(folder / "checkpoint.pt", read(Split::test), 4, [](std::size_t, std::size_t) {});
    CHECK(found.method == "gaussian");
    CHECK(found.steps == options.steps);
    REQUIRE(found.classes.size() == 2);
    for (const ClassIou& row : found.classes) CHECK(row.images == 8);
    CHECK(found.iou == doctest::Approx((found.classes[0].iou + found.classes[1].iou) / 2));
    MESSAGE("IoU " << found.iou << ", of the sphere " << found.sphere << ", loss " << result.losses.front()
                   << " to " << result.losses.back());
    CHECK(found.iou > found.sphere + 0.08);
    const Image figure = show(open_device(), folder / "checkpoint.pt", read(Split::test), 0);
    CHECK(figure.height == 2 * 128);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("training: checkpoints that do not fit, and options out of range") {
    const TempDir folder;
    const TrainingOptions options = small_options("softras");
    run(options, folder);
    TrainingOptions other = options;
    other.palette = 9;
    CHECK(contains(message(other, folder), "5 palette colours"));
    other = options;
    other.method = "joint_gaussian";
    CHECK(contains(message(other, folder), "softras with seed 1"));
    other.method = "rigid";
    CHECK(contains(message(other, TempDir()), "got rigid, expected "));
    other.method = "hard";
    CHECK(contains(message(other, TempDir()), "preset"));
    other = options;
    other.batch = 6;
    CHECK(contains(message(other, folder), "got batch 4, expected batch 6"));
    other = options;
    other.weights.laplacian = 3e-3;
    CHECK(contains(message(other, folder), "weights 1 1 0.3"));
    other = options;
    other.learning_rate = 5e-5;  // may change on the way
    CHECK_NOTHROW(run(other, folder));
    CHECK_THROWS_AS(evaluate(folder / "checkpoint.pt", read(Split::test), 0, [](std::size_t, std::size_t) {}),
                    InvalidArgument);
    CHECK_THROWS_AS(show(open_device(), folder / "checkpoint.pt", read(Split::test), 2), InvalidArgument);
    other = options;
    other.batch = 1;
    CHECK(contains(message(other, folder), "batch (dpr learn)"));
    other = options;
    other.sigma = -1.0F;
    CHECK(contains(message(other, folder), "sigma"));

    const auto read_message = [](const std::filesystem::path& file) {
      return message_of<IoError>([&] { load_checkpoint(file, 1e-4); });
    };
    CHECK(contains(read_message(folder / "missing.pt"), "does not exist"));
    CHECK(contains(read_message(folder.write("text.pt", "no checkpoint")), "no checkpoint of dpr learn"));
    const std::string good = folder.read("checkpoint.pt");
    CHECK(contains(read_message(folder.write("cut.pt", good.substr(0, good.size() / 2))), "damaged"));
    torch::serialize::OutputArchive foreign;
    foreign.write("description", c10::IValue(std::string(R"({"architecture": "another one"})")));
    foreign.save_to((folder / "foreign.pt").string());
    CHECK(contains(read_message(folder / "foreign.pt"), "another architecture: \"another one\""));
    LoadedCheckpoint bad = load_checkpoint(folder / "checkpoint.pt", 1e-4);
    {
      const torch::NoGradGuard guard;
      bad.network->parameters()[0].view(-1)[0] = NAN;
    }
    save_checkpoint(folder / "nan.pt", bad.checkpoint, bad.network, *bad.optimizer);
    CHECK(contains(read_message(folder / "nan.pt"), "damaged"));
    {
      const FileSizeLimit full_disk(1 << 20);
      CHECK_THROWS_AS(save_checkpoint(folder / "full.pt", bad.checkpoint, bad.network, *bad.optimizer),
                      IoError);
    }
    CHECK_FALSE(std::filesystem::exists(folder / "full.pt"));
    torch::save(torch::ones({2}), (folder / "tensor.pt").string());
    CHECK(contains(read_message(folder / "tensor.pt"), "no checkpoint of dpr learn"));
  }
}

}  // namespace dpr::test::training_test
