// dpr demo: the pose it finds, and that what it leaves is what the other commands take.
#include <doctest/doctest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace demo_command_test {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::run_command;
using dpr::test::TempDir;

namespace {

/// From the highest row that shows the object to the lowest, of the image's height.
double covered_height(const dpr::Image& image) {
  int first = image.height, last = -1;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      if (image.at(column, row).a < 0.5F) continue;
      first = std::min(first, row);
      last = row;
    }
  }
  return static_cast<double>(last - first + 1) / image.height;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr demo finds the cube's pose, and leaves what the other commands can be tried on") {
    if (is_skipped()) return;
    const TempDir folder;
    const auto run = [&](const std::vector<std::string>& arguments) {
      const auto outcome = run_command(folder, arguments);
      CAPTURE(outcome.err);
      REQUIRE(outcome.status == 0);
    };
    run({"demo", "-o", "demo"});
    const auto errors = nlohmann::json::parse(folder.read("demo/pose.json"))["angle_error_degrees"];
    CHECK(errors["start"].get<double>() == doctest::Approx(50));
    CHECK(errors["end"].get<double>() < 1);

    const std::string page = folder.read("demo/index.html");
    CHECK(contains(page, "dpr demo -o demo"));
    CHECK(contains(page, "start, 50.00 degrees from the truth"));
    CHECK(covered_height(dpr::read_image(folder / "demo/target.exr")) > 0.7);

    run({"render", "--scene", "demo/truth.json", "--preset", "rigid", "-o", "truth.exr"});
    CHECK(dpr::read_image(folder / "truth.exr").pixels == dpr::read_image(folder / "demo/target.exr").pixels);
    run({"gradient", "--scene", "demo/scene.json", "--target", "demo/target.exr", "-o", "gradient.json"});
    run({"pose", "--scene", "demo/scene.json", "--target", "demo/target.exr", "--rotations", "0", "-o",
         "pose.json"});
    run({"fit", "--views", "demo/views.json", "--levels", "1", "--iterations", "20", "-o", "mesh.ply"});
    CHECK_FALSE(dpr::read_mesh(folder / "mesh.ply").vertex_colors.empty());
  }
}

}  // namespace demo_command_test
