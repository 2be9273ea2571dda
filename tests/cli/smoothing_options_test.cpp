// A smoothing is the same whoever describes it: the library's options, a scene file, the command line over a
// file, and what frames of named arrays are told. Every preset with every kind of override.
#include "dpr/smoothing_options.hpp"

#include <doctest/doctest.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "cli/common_options.hpp"
#include "dpr/scene.hpp"
#include "smoothing/option_fields.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace smoothing_options_test {

using namespace dpr;
using dpr::test::TempDir;
using nlohmann::json;

namespace {

constexpr int k_width = 300, k_height = 200;

/// Values that the tests put beside a preset: each is the "smoothing" of a scene file.
const std::vector<json> k_overrides{
    json::object(),
    {{"sigma", 1e-4}},
    {{"sigma", 0.037}, {"blur_radius", 0.25}},
    {{"blur_radius", 0.125}},
    {{"occupancy_threshold", 1e-2}},
    {{"occupancy_threshold", 1e-2}, {"sigma", 3e-4}},
    {{"occupancy_threshold", 1e-2}, {"blur_radius", 0.5}},
    {{"gamma", 0.07}, {"alpha", 2.5}, {"background_depth", 0.25}},
    {{"occupancy_prior", "cauchy"}, {"sigma", 2e-3}, {"occupancy_width", "fixed"}},
    {{"depth_prior", "logistic"}, {"seed", 18446744073709551615U}},
    {{"estimator", "exact"}, {"samples", 12}},
    {{"occupancy_prior", "logistic"},
     {"occupancy_width", "fixed"},
     {"composition", "barrier"},
     {"estimator", "monte_carlo"},
     {"occupancy_estimator", "exact"},
     {"variance_reduction", "rigid"},
     {"draws", "antithetic"}},
    {{"occupancy_width", "fixed"}, {"distance", "squared"}, {"sigma", 5e-5}},
    {{"noise", "triangle"}, {"occupancy_width", "fixed"}},
    {{"noise", "pixel"}, {"estimator", "exact"}, {"occupancy_width", "fixed"}},
    {{"noise", "pixel"}, {"estimator", "exact"}, {"supersampling", 2}}};

std::vector<std::string> presets() {
  std::vector<std::string> names{""};  // none
  for (const std::string_view name : smoothing_preset_names()) names.emplace_back(name);
  return names;
}

json with_preset(json smoothing, const std::string& preset) {
  if (!preset.empty()) smoothing["preset"] = preset;
  return smoothing;
}

std::filesystem::path write_scene(const TempDir& folder, const json& smoothing) {
  const json scene{{"width", k_width},
                   {"height", k_height},
                   {"meshes", {{{"positions", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}, {"faces", {{0, 1, 2}}}}}},
                   {"smoothing", smoothing}};
  return folder.write("S.json", scene.dump());
}

Smoothing by_file(const TempDir& folder, const json& smoothing) {
  return read_scene(write_scene(folder, smoothing)).smoothing;
}

/// `flags` on the command line of a command that reads the scene file with `in_file`.
Smoothing by_command_line(const TempDir& folder, const json& in_file, const json& flags) {
  CLI::App application;
  cli::CommonOptions options;
  cli::add_common_options(application, options);
  std::vector<std::string> arguments;  // CLI11 takes them from the back
  for (const auto& [key, value] : flags.items()) {
    std::string flag = "--" + key;
    std::ranges::replace(flag, '_', '-');
    arguments.insert(arguments.begin(), value.is_string() ? value.get<std::string>() : value.dump());
    arguments.insert(arguments.begin() + 1, flag);
  }
  application.parse(arguments);
  return cli::read_scene(write_scene(folder, in_file).string(), options).smoothing;
}

OptionValue option_value(const json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_integer()) return value.get<std::int64_t>();
  return value.get<double>();
}

/// The operator's way: value by value, in the order of the keys or against it.
Smoothing by_values(const json& smoothing, bool is_reversed) {
  SmoothingOptions options;
  std::vector<std::string> keys;
  for (const auto& item : smoothing.items()) keys.push_back(item.key());
  if (is_reversed) std::ranges::reverse(keys);
  for (const std::string& key : keys) REQUIRE(set_option(options, key, option_value(smoothing[key]), key));
  return resolve_smoothing(options, k_width, k_height);
}

/// The smoothing as the renderer sees it, or the reason of its refusal without its place, which differs.
template <typename Resolve>
std::string outcome(Resolve resolve, Smoothing& smoothing) {
  try {
    smoothing = resolve();
    return "";
  } catch (const InvalidArgument& error) {
    return error.got() + ", expected " + error.expected();
  }
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("every preset with every override: file, command line and operator agree to the last bit") {
    const TempDir folder;
    std::size_t valid = 0;
    for (const std::string& preset : presets()) {
      for (const json& override : k_overrides) {
        const json all = with_preset(override, preset);
        CAPTURE(all.dump());
        Smoothing expected;
        const std::string refused = outcome([&] { return by_file(folder, all); }, expected);
        valid += refused.empty() ? 1U : 0U;
        const auto check = [&](auto resolve) {
          Smoothing found;
          CHECK(outcome(resolve, found) == refused);
          CHECK(found == expected);
        };
        check([&] { return by_command_line(folder, json::object(), all); });
        check([&] { return by_command_line(folder, with_preset(json::object(), preset), override); });
        check([&] { return by_command_line(folder, all, json::object()); });
        json operators = all;  // its integers are signed
        if (operators.contains("seed")) operators["seed"] = 7;
        if (all.contains("seed")) expected.seed = 7;
        check([&] { return by_values(operators, false); });
        check([&] { return by_values(operators, true); });
      }
    }
    CHECK(valid > presets().size() * k_overrides.size() / 2);
  }

  TEST_CASE("a preset's blur radius follows sigma, a given one does not") {
    const auto radius = [](const SmoothingOptions& given) { return blur_radius(resolve_smoothing(given)); };
    CHECK(radius({.preset = "softras", .sigma = 1e-4F}) == doctest::Approx(9.21e-4).epsilon(1e-4));
    CHECK(radius({.preset = "paper_cauchy", .sigma = 2e-3F}) == doctest::Approx(1.842e-2).epsilon(1e-4));
    CHECK(radius({.preset = "softras", .sigma = 1e-4F, .blur_radius = 0.25F}) == 0.25F);
    CHECK(radius({.preset = "rigid", .sigma = 1e-4F}) == 0);
    CHECK(radius({.preset = "pixel", .sigma = 1e-4F}) == 0);
    CHECK(radius({.preset = "softras", .noise = Noise::pixel}) == 0);
    CHECK(radius({.preset = "nmr", .sigma = 1e-2F}) == 0.5F);
    CHECK(radius({.preset = "nmr", .occupancy_threshold = 1e-2F}) == 0.5F);  // its width needs one
    CHECK(radius({.sigma = 1e-4F}) == doctest::Approx(3.719e-4).epsilon(1e-4));
    // A threshold that is given says how far; logistic noise falls to 1% at 4.595 sigma.
    CHECK(radius({.preset = "softras", .occupancy_threshold = 1e-2F}) ==
          doctest::Approx(4.595e-3).epsilon(1e-4));
    CHECK(radius({.preset = "softras", .occupancy_threshold = 1e-2F, .blur_radius = 0.25F}) == 0.25F);
    // A smoothing that a program starts from is as a preset.
    Smoothing own = smoothing_preset("paper_gaussian");
    own.seed = 5;
    const Smoothing narrow = resolve_smoothing({.sigma = 1e-4F}, 128, 128, own);
    CHECK(*narrow.blur_radius == doctest::Approx(9.21e-4).epsilon(1e-4));
    CHECK(narrow.samples == own.samples);
    CHECK(resolve_smoothing({.preset = "rigid"}, 128, 128, own).seed == 5);
  }

  TEST_CASE("nothing said is noise of the pixel, anything else said is noise of the triangles") {
    const TempDir folder;
    CHECK(Smoothing{} == smoothing_preset("pixel"));
    CHECK(by_file(folder, json::object()) == Smoothing{});
    CHECK(by_command_line(folder, json::object(), json::object()) == Smoothing{});
    Smoothing seeded;
    seeded.seed = 7;
    seeded.supersampling = 2;
    CHECK(by_file(folder, {{"seed", 7}, {"supersampling", 2}}) == seeded);
    Smoothing narrow = smoothing_preset("gaussian");
    narrow.sigma = 1e-4F;
    CHECK(by_file(folder, {{"sigma", 1e-4}}) == narrow);
    CHECK(by_command_line(folder, json::object(), {{"sigma", 1e-4}}) == narrow);
    narrow = {};
    narrow.sigma = 1e-4F;
    CHECK(by_file(folder, {{"noise", "pixel"}, {"sigma", 1e-4}}) == narrow);
  }

  TEST_CASE("the command line over a file") {
    const TempDir folder;
    const auto resolve = [&](const json& file, const json& flags) {
      return by_command_line(folder, file, flags);
    };
    // A preset replaces the file's values, but for the seed.
    Smoothing rigid = rigid_smoothing();
    rigid.seed = 3;
    CHECK(resolve({{"sigma", 0.1}, {"composition", "barrier"}, {"seed", 3}}, {{"preset", "rigid"}}) == rigid);
    // An estimator is that of both stages.
    const Smoothing exact = resolve({{"occupancy_estimator", "monte_carlo"}}, {{"estimator", "exact"}});
    CHECK(exact == smoothing_preset("gaussian"));
    CHECK(resolve({{"estimator", "monte_carlo"}}, {{"occupancy_estimator", "exact"}}).aggregation_estimator ==
          Estimator::monte_carlo);
    // A file may say only together with the flags what can be rendered.
    CHECK(resolve({{"variance_reduction", "leave_one_out"}, {"estimator", "monte_carlo"}, {"samples", 1}},
                  {{"samples", 4}})
              .samples == 4);
    // A pixel is one of the image that is rendered.
    CLI::App application;
    cli::CommonOptions options;
    cli::add_common_options(application, options);
    application.parse("--size 50x80");
    const auto file = write_scene(folder, {{"preset", "opendr"}}).string();
    CHECK(cli::read_scene(file, options).smoothing.sigma == 2.0F / 50);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("unknown words are named, with their place and all that there are") {
    const TempDir folder;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, by_file(folder, {{"preset", "SoftRas"}}), "smoothing.preset (");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, by_file(folder, {{"preset", "SoftRas"}}),
                          "got \"SoftRas\", expected softras, opendr, nmr, paper_gaussian, paper_cauchy, "
                          "gaussian, joint_gaussian, pixel or rigid");
    DPR_CHECK_MESSAGE_HAS(
        InvalidArgument, by_command_line(folder, json::object(), {{"depth_prior", "normal"}}),
        "--depth-prior: got \"normal\", expected gaussian, cauchy, logistic, gumbel or uniform");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, by_command_line(folder, json::object(), {{"preset", "soft"}}),
                          "--preset: got \"soft\"");
    CLI::App application;
    cli::CommonOptions options;
    cli::add_common_options(application, options);
    const std::string help = application.help();
    for (const std::string_view key : option_keys()) {
      std::string flag = "--" + std::string(key);
      std::ranges::replace(flag, '_', '-');
      CHECK_MESSAGE(help.find(flag + " ") != std::string::npos, flag);
    }
    CHECK(help.find("gaussian|cauchy|logistic|gumbel|uniform") != std::string::npos);
    CHECK(help.find("nmr|paper_gaussian") != std::string::npos);
  }

  TEST_CASE("values of the wrong kind, one by one") {
    SmoothingOptions options;
    const auto set = [&](std::string_view key, const OptionValue& value) {
      return set_option(options, key, value, key);
    };
    CHECK_FALSE(set("nothing", 1.0));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set("sigma", std::string("wide")),
                          "sigma: got \"wide\", expected a number");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set("depth_prior", 1.0), "depth_prior: got 1");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set("preset", std::string("hard")), "preset: got \"hard\"");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set("samples", 2.5),
                          "expected a whole number from 0 to 4294967295");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set("samples", std::int64_t{1} << 32), "samples: got 4294967296");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set("seed", std::int64_t{-1}), "seed: got -1");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set("seed", 1e300), "seed: got 1");
    CHECK(set("seed", 0x1p53));
    CHECK(*options.seed == std::uint64_t{1} << 53U);
  }
}

}  // namespace smoothing_options_test
