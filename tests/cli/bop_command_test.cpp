// dpr pose --bop: a data set in BOP's form, made of a picture by dpr, is read back and solved.
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <glm/glm.hpp>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "dpr/pose.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace bop_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::Outcome;
using dpr::test::run_line;
using dpr::test::TempDir;
using nlohmann::json;

/// From object to camera in OpenCV's axes: x right, y down, z forward; millimetres.
const dpr::Pose k_truth{dpr::rotation_from_vector({0.6, -1.1, 0.4}), {60, -45, 620}};

json rows(const glm::dmat3& matrix) {
  json list;
  for (int i = 0; i < 9; ++i) list.push_back(matrix[i % 3][i / 3]);
  return list;
}

json object(int number, const dpr::Pose& pose) {
  const glm::dvec3& t = pose.translation;
  return json{{"cam_R_m2c", rows(pose.rotation)}, {"cam_t_m2c", {t.x, t.y, t.z}}, {"obj_id", number}};
}

/// data/models/obj_000005.ply, and of the scene data/test/000002 the image 3 with the objects 1 and 5.
void write_data(const TempDir& folder) {
  std::filesystem::create_directories(folder / "data/models");
  std::filesystem::create_directories(folder / "data/test/000002/rgb");
  dpr::Mesh cube = dpr::make_cube();
  for (glm::vec3& p : cube.positions) p = 70.0F * p + glm::vec3(12, -8, 20);
  dpr::write_mesh(folder / "data/models/obj_000005.ply", cube);
  // dpr's own scene of it: OpenGL's axes, the camera at the world's origin, pixels from the first one's corner.
  const glm::dmat3 flip(1, 0, 0, 0, -1, 0, 0, 0, -1), turn = flip * k_truth.rotation;
  const glm::dvec3 place = flip * k_truth.translation;
  json transform;
  for (int row = 0; row < 3; ++row)
    transform.push_back({turn[0][row], turn[1][row], turn[2][row], place[row]});
  transform.push_back({0, 0, 0, 1});
  const json scene{
      {"width", 160},
      {"height", 120},
      {"camera", {{"intrinsics", {{"fx", 210}, {"fy", 205}, {"cx", 76.5}, {"cy", 64.5}}}, {"zfar", 2000}}},
      {"meshes", {{{"file", "data/models/obj_000005.ply"}, {"transform", transform}}}}};
  folder.write("own.json", scene.dump());
  REQUIRE(
      run_line(folder, "render --scene own.json --preset rigid -o data/test/000002/rgb/000003.png --quiet")
          .status == 0);
  // Pixels from the first one's centre.
  const json camera{{"3", {{"cam_K", {210, 0, 76, 0, 205, 64, 0, 0, 1}}, {"depth_scale", 0.1}}}};
  folder.write("data/test/000002/scene_camera.json", camera.dump());
  folder.write("data/test/000002/scene_gt.json", json{{"3", {object(1, {}), object(5, k_truth)}}}.dump());
}

const std::string k_image = "pose --bop data/test/000002 --image 3 --object 5 --quiet ";

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr pose --bop: the pose of a data set in BOP's form is found again, and written as BOP's row") {
    if (is_skipped()) return;
    const TempDir folder;
    write_data(folder);
    const glm::dvec3 start =
        dpr::vector_from_rotation(dpr::rotation_from_vector({0.1, 0.15, -0.1}) * k_truth.rotation);
    std::ostringstream vector;
    vector << start.x << "," << start.y << "," << start.z;
    REQUIRE(run_line(folder, k_image + "--rotations 0 --initial-rotation " + vector.str() + " -o pose.json")
                .status == 0);
    const json pose = json::parse(folder.read("pose.json"));
    CHECK(pose["explained"] == true);
    CHECK(pose["angle_error_degrees"]["start"].get<double>() > 8);
    CHECK(pose["angle_error_degrees"]["end"].get<double>() < 0.1);
    for (int i = 0; i < 3; ++i) {
      const double found = pose["translation"][static_cast<std::size_t>(i)].get<double>();
      CHECK(std::abs(found - k_truth.translation[i]) < 2e-3 * k_truth.translation.z);
    }

    // Without the reference, from a detector's box.
    std::filesystem::remove(folder / "data/test/000002/scene_gt.json");
    REQUIRE(run_line(folder, k_image + "--search --box 55,10,90,90 -o result.csv").status == 0);
    std::istringstream lines(folder.read("result.csv"));
    std::string head, field;
    std::getline(lines, head);
    CHECK(head == "scene_id,im_id,obj_id,score,R,t,time");
    std::vector<std::string> fields;
    while (std::getline(lines, field, ',')) fields.push_back(field);
    REQUIRE(fields.size() == 7);
    CHECK(fields[0] + "," + fields[1] + "," + fields[2] + "," + fields[3] == "2,3,5,1");
    std::istringstream numbers(fields[4] + " " + fields[5]);
    glm::dmat3 rotation;
    glm::dvec3 translation;
    for (int i = 0; i < 9; ++i) numbers >> rotation[i % 3][i / 3];
    for (int i = 0; i < 3; ++i) numbers >> translation[i];
    CHECK(dpr::angle_degrees(rotation, k_truth.rotation) < 0.1);
    CHECK(glm::length(translation - k_truth.translation) < 2e-3 * k_truth.translation.z);
  }

  TEST_CASE("dpr pose --bop: the start is the first instance, the error that from the nearest") {
    if (is_skipped()) return;
    const TempDir folder;
    write_data(folder);
    const dpr::Pose first{dpr::rotation_from_vector({0.1, 0.15, -0.1}) * k_truth.rotation,
                          k_truth.translation + glm::dvec3(15, 0, 0)};
    folder.write("data/test/000002/scene_gt.json",
                 json{{"3", {object(1, {}), object(5, first), object(5, k_truth)}}}.dump());
    const Outcome outcome = run_line(
        folder,
        "pose --bop data/test/000002/ --image 3 --object 5 --rotations 0 -o pose.json --report report");
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    CHECK(contains(outcome.out, "scene_gt.json, the nearest of 2 instances (gt_id 2): 0.0"));
    const json pose = json::parse(folder.read("pose.json"));
    CHECK(pose["gt_id"] == 2);
    CHECK(pose["angle_error_degrees"]["start"].get<double>() > 8);
    CHECK(pose["angle_error_degrees"]["end"].get<double>() < 0.1);
    CHECK(contains(folder.read("report/index.html"), "<h1>The pose of 000002</h1>"));
  }

  TEST_CASE(
      "dpr pose --bop: other pictures in place of the data set's, and advice where one is not explained") {
    if (is_skipped()) return;
    const TempDir folder;
    write_data(folder);
    std::filesystem::rename(folder / "data/test/000002/rgb/000003.png", folder / "seen.png");
    CHECK(run_line(folder, k_image + "--silhouette seen.png --rotations 0 -o pose.json").status == 0);
    dpr::write_image(folder / "grey.png", dpr::Image(160, 120, glm::vec4(0.3F, 0.3F, 0.3F, 1)));
    const Outcome outcome = run_line(
        folder, "pose --bop data/test/000002 --image 3 --object 5 --target grey.png --rotations 0 -o p.json");
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    CHECK(contains(outcome.out, "The target is not explained"));
    CHECK_FALSE(contains(outcome.out, "--translation"));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("dpr pose --bop: what the files do not have is an error that names the place") {
    if (is_skipped()) return;
    const TempDir folder;
    write_data(folder);
    const auto check = [&](const std::string& options, const char* says) {
      CAPTURE(options);
      const Outcome outcome = run_line(folder, "pose --quiet " + options);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 1);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK(contains(outcome.err, says));
    };
    check("-o p.json --target t.png", "--scene (command line): got none");
    check("--scene s.json --target t.png --object 5 -o p.json", "--object (command line): got no --bop");
    check("--bop data/test/000002 --image 3 -o p.json", "--object (command line): got none");
    check("--bop data/test/000002 --image 4 --object 5 -o p.json", "scene_camera.json): got no key \"4\"");
    check("--bop data/test/000002 --image 3 --object 2 -o p.json", "got no object 2, expected one of 1, 5");
    check("--bop data/test --image 3 --object 5 -o p.csv", "the folder name \"test\"");
    check("--scene own.json --target t.png -o p.csv", "a .csv without --bop");
    check("--bop data/test/000002 --image 3 --object 5 --models data -o p.json", "obj_000005.ply");
    for (const char* const number : {"-1", "1.5", "18446744073709551616"}) {
      const std::string says =
          "(command line): got " + std::string(number) + ", expected a whole number from 0";
      check(std::string("--bop data/test/000002 --object 5 -o p.json --image ") + number,
            ("--image " + says).c_str());
      check(std::string("--bop data/test/000002 --image 3 -o p.json --object ") + number,
            ("--object " + says).c_str());
    }
    std::filesystem::create_directory(folder / "small");
    dpr::Mesh point = dpr::make_cube();
    for (glm::vec3& p : point.positions) p = glm::vec3(0);
    dpr::write_mesh(folder / "small/obj_000005.ply", point);
    check("--bop data/test/000002 --image 3 --object 5 --models small -o p.json",
          "size of the model (small/obj_000005.ply): got 0, expected a size > 0");
    folder.write("data/test/000002/scene_camera.json",
                 R"({"3": {"cam_K": [1, 0, 3, 0, 1, 0, 0, 0, 1], "depth_scale": 0}})");
    check("--bop data/test/000002 --image 3 --object 5 -o p.json",
          "3.depth_scale (data/test/000002/scene_camera.json): got 0, expected a finite number > 0");
    folder.write("data/test/000002/scene_camera.json", R"({"3": {"cam_K": [1, 2, 3, 0, 1, 0, 0, 0, 1]}})");
    check("--bop data/test/000002 --image 3 --object 5 -o p.json",
          "3.cam_K (data/test/000002/scene_camera.json)");
  }
}

}  // namespace bop_command_test
