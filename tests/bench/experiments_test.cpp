// The experiments in small: each runs, leaves its figure, and its numbers are what theory says where theory
// says it.
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>

#include "base/json_node.hpp"
#include "cli/json.hpp"
#include "support/command.hpp"

namespace experiments_test {

using dpr::cli::Json;
using dpr::test::TempDir;

namespace {

/// Runs one; its numbers, or null where it cannot be run.
Json run_without_picture(const TempDir& folder, const std::string& name) {
  constexpr const char* k_program = "DPR_EXPERIMENTS";
  if (dpr::test::is_skipped(k_program)) return {};
  const auto outcome =
      dpr::test::run_program(dpr::test::program_path(k_program), folder, {name, "--smoke", "-o", "out"});
  CAPTURE(outcome.err);
  REQUIRE(outcome.status == 0);
  CHECK(std::filesystem::directory_iterator(folder / "out") != std::filesystem::directory_iterator());
  return Json(dpr::read_json(folder / ("out/" + name + ".json")));
}

Json run(const TempDir& folder, const std::string& name) {
  Json numbers = run_without_picture(folder, name);
  if (!numbers.is_null()) CHECK(std::filesystem::file_size(folder / ("out/" + name + ".png")) > 1000);
  return numbers;
}

double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }
double normal_density(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * std::acos(-1.0)); }

}  // namespace

TEST_SUITE("bench-smoke") {
  TEST_CASE(
      "operators: the Heaviside curves are the priors' distribution functions, and weights are softmax") {
    const TempDir folder;
    const Json data = run(folder, "operators");
    if (data.is_null()) return;
    CHECK(data["heaviside"].size() == 5);
    CHECK(data["arg_max"].size() >= 4);
    for (std::size_t i = 0; i < data["x"].size(); ++i) {
      const auto x = data["x"][i].get<double>();
      const auto figure = [&](const char* op, const char* prior, const char* kind) {
        return data[op][prior][kind][i].get<double>();
      };
      CAPTURE(x);
      CHECK(figure("heaviside", "gaussian", "value") == doctest::Approx(normal_cdf(x)).epsilon(1e-4));
      CHECK(std::fabs(figure("heaviside", "gaussian", "derivative") - normal_density(x)) < 1e-4);
      const double logistic = 1 / (1 + std::exp(-x));
      CHECK(figure("heaviside", "logistic", "value") == doctest::Approx(logistic).epsilon(1e-4));
      CHECK(std::fabs(figure("heaviside", "logistic", "derivative") - logistic * (1 - logistic)) < 1e-4);
      const double softmax = std::exp(x) / (std::exp(x) + 1 + std::exp(-2.0));
      CHECK(figure("arg_max", "gumbel", "value") == doctest::Approx(softmax).epsilon(1e-3));
      CHECK(std::fabs(figure("arg_max", "gumbel", "derivative") - softmax * (1 - softmax)) < 1e-3);
    }
  }

  TEST_CASE("photograph: a few steps bring the template nearer to the features that were marked") {
    const TempDir folder;
    const Json data = run(folder, "photograph");
    if (data.is_null()) return;
    CHECK(data["landmarks"] == 10);
    CHECK(data["landmark_error_pixels"].get<double>() < data["start_landmark_error_pixels"].get<double>());
    CHECK(data["psnr"].get<double>() > data["start_psnr"].get<double>());
  }

  TEST_CASE("derivative: the image's difference by a turn is what the backward pass gives") {
    const TempDir folder;
    const Json data = run(folder, "derivative");
    if (data.is_null()) return;
    const auto by_differences = data["along_derivative_by_differences"].get<double>();
    CHECK(by_differences > 0);
    constexpr double k_of_few_pixels = 0.2;  // 1% at the size of the README's picture
    CHECK(data["along_derivative_by_backward"].get<double>() ==
          doctest::Approx(by_differences).epsilon(k_of_few_pixels));
  }

  TEST_CASE("lights: every kind has its errors") {
    const TempDir folder;
    const Json data = run(folder, "lights");
    if (data.is_null()) return;
    CHECK(data["rows"].size() == 4);
    for (const Json& row : data["rows"]) {
      CHECK_FALSE(row["errors"].empty());
      for (const Json& error : row["errors"]) {
        CHECK(std::isfinite(error["median"].get<double>()));
        CHECK(error["largest"].get<double>() < 2 * error["start_median"].get<double>());
      }
    }
  }

  TEST_CASE("textures: views that were not used come nearer to the truth") {
    const TempDir folder;
    const Json data = run(folder, "textures");
    if (data.is_null()) return;
    CHECK(data["held_out_psnr"].get<double>() > data["start_held_out_psnr"].get<double>() + 5);
  }

  TEST_CASE("gradient-noise: means agree with the exact derivative, and more samples spread less") {
    const TempDir folder;
    const Json data = run(folder, "gradient-noise");
    if (data.is_null()) return;
    const double repeats = data["repeats"].get<double>();
    for (const Json& op : data["operators"]) {
      CHECK(op["estimates"].size() >= 2);
      for (const auto& [name, rows] : op["estimates"].items()) {
        CAPTURE(name);
        const double few = rows["deviation"].front().get<double>(),
                     many = rows["deviation"].back().get<double>();
        CHECK(many < few);
        const double error = std::fabs(rows["mean"].back().get<double>() - op["exact"].get<double>());
        CHECK(error < 4 * many / std::sqrt(repeats));
      }
    }
  }

  TEST_CASE("gallery: every composition is drawn, and none is black") {
    const TempDir folder;
    const Json data = run(folder, "gallery");
    if (data.is_null()) return;
    CHECK(data["mean_color_of_sheet"].size() == 3);
    for (const auto& [name, mean] : data["mean_color_of_sheet"].items()) {
      CAPTURE(name);
      CHECK(mean[0].get<double>() > 0.15);
    }
  }

  TEST_CASE("estimators: every row has its figures, errors fall with M, and there is a winner") {
    const TempDir folder;
    const Json data = run(folder, "estimators");
    if (data.is_null()) return;
    CHECK(data["rows"].size() >= 8);
    for (std::size_t i = 0; i + 1 < data["rows"].size(); ++i) {
      const Json &row = data["rows"][i], &next = data["rows"][i + 1];
      CHECK(row["gradient_cost"].get<double>() ==
            doctest::Approx(std::pow(row["gradient_error"].get<double>(), 2) *
                            row["milliseconds"].get<double>()));
      if (row["estimate"] == next["estimate"] && row["scene"] == next["scene"] &&
          row["member"] == next["member"]) {
        CHECK(next["image_error"].get<double>() < row["image_error"].get<double>());
      }
    }
    CHECK(data["ranking"].front()["estimate"] == data["winner"]);
    CHECK(data["ranking"].front()["gradient_cost_relative"].get<double>() <= 1);
  }

  TEST_CASE("devices: a row for every number of parts, and one is the measure of all") {
    const TempDir folder;
    const Json data = run(folder, "devices");
    if (data.is_null()) return;
    REQUIRE(data["rows"].size() >= 1);
    CHECK(data["rows"][0]["speedup"] == 1.0);
    for (std::size_t i = 0; i < data["rows"].size(); ++i) {
      CHECK(data["rows"][i]["devices"] == i + 1);
      CHECK(data["rows"][i]["views_per_second"].get<double>() > 0);
    }
  }

  TEST_CASE("batches: a row for every way to render unlike scenes") {
    const TempDir folder;
    const Json data = run_without_picture(folder, "batches");
    if (data.is_null()) return;
    REQUIRE(data["rows"].size() == 3);
    for (const Json& row : data["rows"]) {
      CHECK(row["images_per_second"].get<double>() > 0);
      CHECK(row["device_bytes"].get<double>() > 64 * 64 * 16 * 3);
    }
  }

  TEST_CASE("shapes: methods come nearer to the truth than the hull they begin with") {
    const TempDir folder;
    const Json data = run(folder, "shapes");
    if (data.is_null()) return;
    CHECK(data["rows"].size() >= 4);
    for (const Json& row : data["rows"]) {
      CAPTURE(row["method"].get<std::string>());
      if (row["method"] !=
          "reach 16")  // its steps are too smooth for so few pixels: it loses what the hull has
        CHECK(row["iou"].get<double>() > row["start_iou"].get<double>());
      CHECK(row["held_out_psnr"].get<double>() > row["start_held_out_psnr"].get<double>());
    }
    CHECK(data["rows"][0]["iou"].get<double>() > 0.85);
  }

  TEST_CASE("cameras: what wrong ones cost, refining them brings back in part") {
    const TempDir folder;
    const Json data = run_without_picture(folder, "cameras");
    if (data.is_null()) return;
    REQUIRE(data["rows"].size() == 4);
    for (const char* const quality : {"iou", "held_out_psnr"}) {
      CAPTURE(quality);
      const auto of = [&](std::size_t row) { return data["rows"][row][quality].get<double>(); };
      const double right = of(0), off = of(2), refined = of(3);
      CHECK(off < right);
      CHECK(refined > off);
    }
  }
}

}  // namespace experiments_test
