// dpr fit, killed at any moment: nothing half-written, and the same mesh in the end.
#include <doctest/doctest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "cli/fit_report.hpp"
#include "dpr/image.hpp"
#include "support/command.hpp"
#include "support/interruptions.hpp"

namespace fit_interruption_test {

namespace {

using dpr::test::TempDir;
using nlohmann::json;

/// The cube from three sides.
void write_views(const TempDir& folder) {
  std::vector<dpr::Camera> cameras;
  for (const float azimuth : {0.0F, 120.0F, 240.0F}) {
    cameras.push_back(dpr::orbit_camera(/*distance=*/5.0F, /*elevation_degrees=*/30.0F, azimuth));
    cameras.back().fov_y_degrees = 50;
    cameras.back().zfar = 10;
  }
  const auto images = dpr::cli::render_rigidly(dpr::open_device(), dpr::make_cube(), cameras, 24, 24);
  json views = {{"width", 24}, {"height", 24}, {"views", json::array()}};
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const std::string image = std::to_string(i) + ".exr";
    dpr::write_image(folder / image, images[i]);
    json rows = json::array();
    for (int row = 0; row < 4; ++row) {
      const glm::mat4& view = cameras[i].view;
      rows.push_back({view[0][row], view[1][row], view[2][row], view[3][row]});
    }
    views["views"].push_back(
        {{"image", image},
         {"camera",
          {{"view", rows}, {"fov_y_degrees", 50}, {"znear", cameras[i].znear}, {"zfar", cameras[i].zfar}}}});
  }
  folder.write("views.json", views.dump());
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("dpr fit: killed 20 times it ends with the mesh of an undisturbed run, and nothing beside it") {
    if (dpr::test::is_skipped()) return;
    const TempDir folder;
    write_views(folder);
    const std::size_t inputs = folder.entries();
    std::string expected;
    const auto check = [&](bool finished) {
      const bool is_there = std::filesystem::exists(folder / "mesh.obj");
      if (finished) REQUIRE(is_there);
      if (!is_there) return;
      if (expected.empty()) expected = folder.read("mesh.obj");
      CHECK(folder.read("mesh.obj") == expected);
    };
    const auto clear = [&] {
      for (const char* const name : {"mesh.obj", "state"}) std::filesystem::remove(folder / name);
    };
    const unsigned resumed = dpr::test::interrupt(
        {dpr::test::program_path("DPR_CLI"),
         folder.path(),
         {"fit", "--views", "views.json", "-o", "mesh.obj", "--levels", "1", "--iterations", "24",
          "--checkpoint", "state", "--checkpoint-interval", "1", "--quiet"},
         folder / "state",
         check,
         clear},
        20, 1);
    CHECK(resumed > 0);
    CHECK(folder.entries() == inputs + 2);
  }
}

}  // namespace fit_interruption_test
