// dpr pose --views: several pictures, of one pose or of a moving object. Runs where DPR_CLI names the command.
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace pose_views_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::Outcome;
using dpr::test::run_line;
using dpr::test::TempDir;
using nlohmann::json;

const json k_front = {{1, 0, 0, 0}, {0, 0.8, -0.6, 0}, {0, 0.6, 0.8, -3.6}, {0, 0, 0, 1}};
const json k_side = {{0.6, 0, 0.8, 0}, {0.48, 0.8, -0.36, 0}, {-0.64, 0.6, 0.48, -3.6}, {0, 0, 0, 1}};
const json k_turned = {{0.921061, 0, 0.389418, 0}, {0, 1, 0, 0}, {-0.389418, 0, 0.921061, 0}, {0, 0, 0, 1}};

/// 60 degrees, or another field of view.
json camera_from(const json& view, double fov_y_degrees = 60) {
  return {{"view", view}, {"fov_y_degrees", fov_y_degrees}, {"znear", 1}, {"zfar", 12}};
}

json scene_of(const json& camera, const json& transform) {
  json scene{{"width", 72}, {"height", 64}, {"camera", camera}};
  scene["meshes"] = json::array({{{"file", "cube.ply"}, {"transform", transform}}});
  return scene;
}

/// front.png and side.png of a cube turned by 0.4 radians about y, scene.json with the cube not turned, views.json with
/// both cameras, and moving.json with cameras whose focal length is another.
void write_inputs(const TempDir& folder) {
  dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
  const json straight = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  folder.write("scene.json", scene_of(camera_from(k_front), straight).dump());
  json known{{"width", 72}, {"height", 64}}, near = known;
  for (const auto& [name, view] : {std::pair("front", k_front), std::pair("side", k_side)}) {
    folder.write("truth.json", scene_of(camera_from(view), k_turned).dump());
    const std::string image = std::string(name) + ".png";
    REQUIRE(run_line(folder, "render --scene truth.json --preset rigid -o " + image + " --quiet").status ==
            0);
    known["views"].push_back({{"image", image}, {"camera", camera_from(view)}});
    near["views"].push_back({{"image", image}, {"initial_camera", camera_from(view, 56)}});
  }
  folder.write("views.json", known.dump());
  folder.write("moving.json", near.dump());
}

/// R[0][0] and R[0][2] of the truth are cos 0.4 and sin 0.4.
void check_is_turned(const json& pose) {
  CHECK(pose["rotation_matrix"][0][0].get<double>() == doctest::Approx(0.921061).epsilon(0.01));
  CHECK(pose["rotation_matrix"][0][2].get<double>() == doctest::Approx(0.389418).epsilon(0.03));
  CHECK(pose["explained"].get<bool>());
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr pose --views: one pose from two pictures, with a report of each") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const Outcome outcome = run_line(
        folder,
        "pose --scene scene.json --views views.json --translation --rotations 0 -o pose.json --report page");
    REQUIRE_MESSAGE(outcome.status == 0, outcome.err);
    CHECK(contains(outcome.out, "pose.json: loss"));
    const json pose = json::parse(folder.read("pose.json"));
    check_is_turned(pose);
    CHECK(std::abs(pose["translation"][2].get<double>()) < 0.02);
    REQUIRE(pose["views"].size() == 2);
    for (const json& view : pose["views"]) CHECK(view["part_of_blank"].get<double>() < 0.05);
    CHECK(pose["views"][1]["camera"]["view"][0][2].get<double>() == doctest::Approx(0.8));
    for (const char* const page : {"page/0/index.html", "page/1/index.html"})
      CHECK(std::filesystem::exists(folder / page));
    CHECK(contains(folder.read("page/1/index.html"), "The pose in view 1 of views.json"));
  }

  TEST_CASE("dpr pose --views: the background is the views file's, and the views' errors are told") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    json views = json::parse(folder.read("views.json"));
    views["background"] = {0.5, 0.5, 0.5};
    folder.write("views.json", views.dump());
    const Outcome outcome = run_line(
        folder, "pose --scene scene.json --views views.json --translation --rotations 0 -o pose.json");
    REQUIRE_MESSAGE(outcome.status == 0, outcome.err);
    CHECK(contains(outcome.out, "The views are not explained"));  // whose pictures are black there
    CHECK(contains(outcome.out, "Errors of the views, in parts of a picture without the object: "));
    CHECK_FALSE(json::parse(folder.read("pose.json"))["explained"].get<bool>());
  }

  TEST_CASE("dpr pose --views --moving --focal: a pose in each picture, and one focal length") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const Outcome outcome =
        run_line(folder,
                 "pose --scene scene.json --views moving.json --moving --focal --translation "
                 "--rotations 0 -o pose.json");
    REQUIRE_MESSAGE(outcome.status == 0, outcome.err);
    CHECK(contains(outcome.out, "pose.json: 2 of 2 views are explained."));
    const json found = json::parse(folder.read("pose.json"));
    const double truth = std::tan(56 * M_PI / 360) / std::tan(60 * M_PI / 360);
    CHECK(found["focal_scale"].get<double>() == doctest::Approx(truth).epsilon(0.01));
    REQUIRE(found["views"].size() == 2);
    for (const json& view : found["views"]) {
      check_is_turned(view);
      CHECK(view["covariance"].size() == 7);
    }
  }

  TEST_CASE("dpr pose --views: what does not go together is an error of one line") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const auto check_refused = [&](const std::string& options, const std::string& part) {
      CAPTURE(options);
      const Outcome outcome = run_line(folder, "pose --scene scene.json -o pose.json " + options);
      CHECK(outcome.status != 0);
      CHECK(contains(outcome.err, part));
      CHECK_FALSE(std::filesystem::exists(folder / "pose.json"));
    };
    check_refused("--views views.json --target front.png", "--target");
    check_refused("--views views.json --box 1,1,5,5", "--box");
    check_refused("--views views.json --method descent", "least squares");
    check_refused("--target front.png --moving", "--views");
    folder.write("views.json", R"({"width": 72, "height": 64, "views": [{"image": "front.png"}]})");
    check_refused("--views views.json", "views[0]");
    folder.write("views.json", R"({"width": 48, "height": 40, "views": []})");
    check_refused("--views views.json", "views.json");
  }
}

}  // namespace pose_views_command_test
