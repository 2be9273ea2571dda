// dpr pose on people's own pictures: of any size, with the camera that took them.
#include "cli/pose_pictures.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace pose_pictures_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::Outcome;
using dpr::test::run_line;
using dpr::test::TempDir;
using nlohmann::json;

constexpr double k_angle = 0.8;  // of the truth, about y

/// A scene of the cube, turned by an angle about y, with a camera of a picture of 192x144.
json scene_of(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {
      {"camera",
       {{"view", {{1, 0, 0, 0}, {0, 0.8, -0.6, 0}, {0, 0.6, 0.8, -6}, {0, 0, 0, 1}}},
        {"intrinsics", {{"fx", 130}, {"fy", 126}, {"cx", 100}, {"cy", 66}}}}},
      {"meshes",
       {{{"file", "cube.ply"}, {"transform", {{c, 0, s, 0}, {0, 1, 0, 0}, {-s, 0, c, 0}, {0, 0, 0, 1}}}}}}};
}

/// cube.ply; target.exr and target.depth.exr of 192x144 pixels; scene.json without a size.
void write_inputs(const TempDir& folder) {
  dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
  json truth = scene_of(k_angle);
  truth["width"] = 192, truth["height"] = 144;
  folder.write("truth.json", truth.dump());
  folder.write("scene.json", scene_of(0.6).dump());
  REQUIRE(
      run_line(folder, "render --scene truth.json --preset rigid -o target.exr --aov depth --quiet").status ==
      0);
}

/// Solves from 0.6 radians without trying other rotations; checks the result, and returns the pose file.
json solve(const TempDir& folder, const std::string& options) {
  CAPTURE(options);
  const Outcome outcome = run_line(folder, "pose --rotations 0 --quiet -o pose.json " + options);
  CAPTURE(outcome.err);
  REQUIRE(outcome.status == 0);
  const json pose = json::parse(folder.read("pose.json"));
  CHECK(pose["rotation"][1].get<double>() == doctest::Approx(k_angle).epsilon(0.02));
  return pose;
}

/// The content of a JPEG file with a focal length of 35-mm film in Exif.
std::string with_focal(const std::string& jpeg, char millimetres) {
  const std::string tiff{
      "MM\0*\0\0\0\x08\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x1a\0\0\0\0"
      "\0\x01\xa4\x05\0\x03\0\0\0\x01\0",
      37};
  const std::string exif = std::string("Exif\0\0", 6) + tiff + millimetres + std::string(6, '\0');
  const std::string head{"\xff\xe1\0", 3};
  return jpeg.substr(0, 2) + head + static_cast<char>(exif.size() + 2) + exif + jpeg.substr(2);
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("masks and depths are scaled without mixing an object with what lies behind it") {
    constexpr float k_near = 2, k_far = 5;
    dpr::Scene scene;
    scene.width = 4, scene.height = 3;
    dpr::cli::ObservedPictures pictures;
    pictures.depth = dpr::Image(16, 12, glm::vec4(k_far));
    pictures.mask = pictures.silhouette = dpr::Image(16, 12, glm::vec4(0, 0, 0, 1));
    for (int row = 0; row < 12; ++row) {
      for (int column = 0; column < 7; ++column) {  // the boundary crosses the second column of the scene
        pictures.depth.at(column, row) = glm::vec4(k_near);
        pictures.mask.at(column, row) = pictures.silhouette.at(column, row) = glm::vec4(1);
      }
      for (int column = 13; column < 16; ++column) pictures.depth.at(column, row) = glm::vec4(std::nanf(""));
    }
    dpr::Notes notes;
    scale_pictures(pictures, {"", "m.png", "s.png", "d.exr", {}}, scene, notes);
    REQUIRE(pictures.depth.pixels.size() == 12);
    CHECK(notes.size() == 3);
    CHECK(contains(notes[0], "s.png is scaled from 16x12 to 4x3"));
    for (int row = 0; row < 3; ++row) {
      CHECK(pictures.depth.at(1, row).x == k_near);
      CHECK(pictures.depth.at(2, row).x == k_far);
      CHECK(pictures.depth.at(3, row).w == 0);  // one pixel in four has a depth
      CHECK(pictures.mask.at(1, row).x == 1);
      CHECK(pictures.silhouette.at(1, row).x == 0.75F);
    }
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("dpr pose: pictures of another size than the scene's") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    // A scene without a size takes the picture's, for which its intrinsics are.
    CHECK(solve(folder, "--scene scene.json --target target.exr")["width"] == 192);
    // With --size intrinsics follow, and the picture is scaled.
    const json small = solve(folder, "--scene scene.json --target target.exr --size 64x48");
    CHECK(small["history"].back()["width"] == 64);
    CHECK(small["camera"]["intrinsics"]["cy"].get<double>() == doctest::Approx(22));
    // A scene that is larger than the picture shrinks.
    json large = scene_of(0.6);
    large["width"] = 960, large["height"] = 720;
    for (json& number : large["camera"]["intrinsics"]) number = 5 * number.get<double>();
    folder.write("large.json", large.dump());
    const json shrunk = solve(folder, "--scene large.json --target target.exr");
    CHECK(shrunk["height"] == 144);
    CHECK(shrunk["camera"]["intrinsics"]["fx"].get<double>() == doctest::Approx(130));
    solve(folder, "--scene scene.json --size 64x48 --silhouette target.exr --depth target.depth.exr");
  }

  TEST_CASE("dpr pose: cameras by OpenCV and by Exif") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    json scene = scene_of(0.6);
    scene["camera"].erase("intrinsics");
    folder.write("scene.json", scene.dump());
    // For pictures twice as large; OpenCV counts from the centre of the first pixel.
    folder.write(
        "camera.yml",
        "%YAML:1.0\n---\nimage_width: 384\nimage_height: 288\ncamera_matrix: !!opencv-matrix\n   rows: 3\n"
        "   cols: 3\n   dt: d\n   data: [ 260., 0., 199.5, 0., 252.,\n       131.5, 0., 0., 1. ]\n"
        "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
        "   data: [ 0., 0., 0., 0., 0. ]\n");
    const json pose =
        solve(folder, "--scene scene.json --target target.exr --camera camera.yml --size 96x72");
    CHECK(pose["camera"]["intrinsics"]["fx"].get<double>() == doctest::Approx(65));
    CHECK(pose["camera"]["intrinsics"]["cx"].get<double>() == doctest::Approx(50));
    CHECK_FALSE(pose["camera"].contains("distortion"));

    dpr::write_image(folder / "plain.jpg", dpr::read_image(folder / "target.exr"));
    folder.write("photograph.jpg", with_focal(folder.read("plain.jpg"), 30));
    REQUIRE(
        run_line(folder,
                 "pose --scene scene.json --target photograph.jpg --exif-focal --rotations 0 --size 32x24 "
                 "-o exif.json --quiet")
            .status == 0);
    const double fov = json::parse(folder.read("exif.json"))["camera"]["fov_y_degrees"].get<double>();
    // The height is three fifths of the diagonal.
    CHECK(std::tan(fov * std::acos(-1.0) / 360) == doctest::Approx(0.6 * 43.2666 / 2 / 30).epsilon(1e-4));
    const Outcome none =
        run_line(folder, "pose --scene scene.json --target plain.jpg --exif-focal -o p.json");
    CHECK(none.status == 1);
    CHECK(dpr::test::is_error_line(none.err));
    CHECK(contains(none.err, "plain.jpg without Exif's FocalLengthIn35mmFilm"));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("dpr pose: a picture of another shape is an error that says what to do") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    json scene = scene_of(0.6);
    scene["camera"].erase("intrinsics");
    scene["width"] = scene["height"] = 64;
    folder.write("square.json", scene.dump());
    Outcome outcome = run_line(folder, "pose --scene square.json --target target.exr -o pose.json");
    CHECK(outcome.status == 1);
    CHECK(dpr::test::is_error_line(outcome.err));
    CHECK(contains(outcome.err, "size of --target target.exr (command line): got 192x144, expected 64x64"));
    CHECK(contains(outcome.err, "--size 85x64"));
    dpr::write_image(folder / "mask.png", dpr::Image(50, 50, glm::vec4(1)));
    outcome = run_line(folder, "pose --scene scene.json --target target.exr --mask mask.png -o pose.json");
    CHECK(contains(outcome.err, "size of --mask mask.png (command line): got 50x50, expected 192x144"));
    CHECK(contains(outcome.err, "the intrinsics hold for the scene's width and height"));
    CHECK_FALSE(std::filesystem::exists(folder / "pose.json"));
  }
}

}  // namespace pose_pictures_test
