// dpr pose: what its flags do, what its files hold, and which flags do not go together. Runs where the
// environment variable DPR_CLI names the command.
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"
#include "support/page.hpp"

namespace pose_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::Outcome;
using dpr::test::run_line;
using dpr::test::TempDir;
using nlohmann::json;

/// scene.json, and target.exr: the cube turned by 0.8 radians about y.
void write_inputs(const TempDir& folder) {
  dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
  const auto scene = [](const char* transform) {
    return std::string(
               R"({"width": 64, "height": 48, "camera": {"view": [[1,0,0,0],[0,0.8,-0.6,0],[0,0.6,0.8,-6],
      [0,0,0,1]]}, "meshes": [{"file": "cube.ply", "transform": )") +
           transform + "}]}";
  };
  folder.write("scene.json", scene("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"));
  folder.write("truth.json", scene("[[0.696707,0,0.717356,0],[0,1,0,0],[-0.717356,0,0.696707,0],[0,0,0,1]]"));
  REQUIRE(run_line(folder, "render --scene truth.json --preset rigid -o target.exr --quiet").status == 0);
}

/// Mean difference of colours between the end and the target that a report shows.
double difference_on_page(const TempDir& folder) {
  const dpr::Image end = dpr::read_image(folder / "page/end.png");
  const dpr::Image target = dpr::read_image(folder / "page/target.png");
  double sum = 0;
  for (std::size_t i = 0; i < target.pixels.size(); ++i)
    sum += static_cast<double>(glm::length(glm::vec3(end.pixels[i] - target.pixels[i])));
  return sum / static_cast<double>(target.pixels.size());
}

/// R[0][0] and R[0][2] of the truth are cos 0.8 and sin 0.8.
void check_is_truth(const json& pose) {
  CHECK(pose["rotation_matrix"][0][0].get<double>() == doctest::Approx(0.696707).epsilon(0.02));
  CHECK(pose["rotation_matrix"][0][2].get<double>() == doctest::Approx(0.717356).epsilon(0.02));
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr pose --mesh: a mesh turns behind another, which stands still") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const json block{{"file", "cube.ply"},
                     {"transform", {{0.4, 0, 0, 0.9}, {0, 0.4, 0, 0.6}, {0, 0, 0.4, 2.2}, {0, 0, 0, 1}}}};
    for (const char* file : {"scene.json", "truth.json"}) {
      json scene = json::parse(folder.read(file));
      scene["meshes"].insert(scene["meshes"].begin(), block);
      folder.write(file, scene.dump());
    }
    REQUIRE(run_line(folder, "render --scene truth.json --preset rigid -o target.exr --quiet").status == 0);
    const std::string line = "pose --scene scene.json --target target.exr -o pose.json --quiet ";
    const Outcome solved = run_line(folder, line + "--mesh 1 --rotations 0 --initial-rotation 0,0.5,0");
    CAPTURE(solved.err);
    REQUIRE(solved.status == 0);
    const json pose = json::parse(folder.read("pose.json"));
    check_is_truth(pose);
    CHECK(pose["explained"] == true);
    CHECK(pose["meshes"] == json{1});
    REQUIRE(pose["transforms"].size() == 1);
    CHECK(pose["transforms"][0] == pose["transform"]);
    for (const char* wrong :
         {"--mesh 2", "--mesh 1,1", "--mesh -1", "--mesh cube", "--mesh ,", "--mesh 0,1 --mesh 1",
          "--mesh 0 --mesh 2", "--mesh 0 --mesh ,", "--mesh 0 --mesh 1 --initial-rotation 0,1,0"}) {
      CAPTURE(wrong);
      const Outcome outcome = run_line(folder, line + wrong);
      CHECK(outcome.status != 0);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK(contains(outcome.err, "--mesh"));
    }
  }

  TEST_CASE("dpr pose --mesh --mesh: two objects that hide each other have poses of their own") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const auto write_scene = [&](const char* file, const json& block) {
      json scene = json::parse(folder.read(file));
      scene["meshes"].push_back({{"file", "cube.ply"}, {"transform", block}});
      folder.write(file, scene.dump());
    };
    write_scene("truth.json", {{0.4, 0, 0, 0.9}, {0, 0.6, 0, 0.6}, {0, 0, 0.4, 2.2}, {0, 0, 0, 1}});
    write_scene("scene.json",
                {{0.392, 0, 0.0795, 0.85}, {0, 0.6, 0, 0.7}, {-0.0795, 0, 0.392, 2.1}, {0, 0, 0, 1}});
    json turned = json::parse(folder.read("scene.json"));
    turned["meshes"][0]["transform"] = {
        {0.825, 0, 0.565, 0.1}, {0, 1, 0, 0}, {-0.565, 0, 0.825, 0}, {0, 0, 0, 1}};
    folder.write("scene.json", turned.dump());
    REQUIRE(run_line(folder, "render --scene truth.json --preset rigid -o target.exr --quiet").status == 0);
    const std::string line =
        "pose --scene scene.json --target target.exr --translation --rotations 0 -o pose.json ";
    const Outcome solved = run_line(folder, line + "--mesh 1 --mesh 0 --report report");
    CAPTURE(solved.err);
    REQUIRE(solved.status == 0);
    CHECK(contains(solved.out, "pose.json, mesh 1: loss"));
    const json pose = json::parse(folder.read("pose.json"));
    CHECK(pose["explained"] == true);
    CHECK(pose["light"] == "fixed");
    CHECK(pose["width"] == 64);
    CHECK(pose.contains("camera"));
    REQUIRE(pose["bodies"].size() == 2);
    const json &block = pose["bodies"][0], &cube = pose["bodies"][1];
    check_is_truth(cube);
    CHECK(block["meshes"] == json{1});
    CHECK(block["transforms"][0] == block["transform"]);
    CHECK(std::abs(block["transform"][0][3].get<double>() - 0.9) < 0.03);
    CHECK(std::abs(block["transform"][1][3].get<double>() - 0.6) < 0.03);
    for (const char* key :
         {"explained", "unexplained_part", "loss", "iterations", "seconds", "history", "hypotheses"})
      CHECK(cube.contains(key));
    CHECK(cube["covariance"].size() == 6);
    CHECK_FALSE(cube.contains("camera"));
    const std::string page = folder.read("report/index.html");
    for (const char* picture :
         {"target.png", "start.png", "end.png", "difference.png", "iterations_0.png", "iterations_1.png"})
      CHECK(contains(page, "src=\"" + std::string(picture) + "\""));
    CHECK(contains(page, "Result, mesh 0"));
    const dpr::Image end = dpr::read_image(folder / "report/end.png");
    const dpr::Image start = dpr::read_image(folder / "report/start.png");
    const dpr::Image target = dpr::read_image(folder / "report/target.png");
    double from_end = 0, from_start = 0;
    for (std::size_t i = 0; i < target.pixels.size(); ++i) {
      from_end += static_cast<double>(glm::length(glm::vec3(end.pixels[i] - target.pixels[i])));
      from_start += static_cast<double>(glm::length(glm::vec3(start.pixels[i] - target.pixels[i])));
    }
    CHECK(from_end < 0.2 * from_start);
    for (const char* wrong :
         {"--focal", "--distortion", "--box 1,1,20,20", "--silhouette target.exr", "--method descent"}) {
      CAPTURE(wrong);
      const Outcome outcome = run_line(folder, line + "--mesh 0 --mesh 1 --quiet " + wrong);
      CHECK(outcome.status == 1);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK(contains(outcome.err, std::string(wrong).substr(0, std::string(wrong).find(' '))));
    }
  }

  TEST_CASE("dpr pose --search finds the pose; its file and its report hold what they promise") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const Outcome search = run_line(
        folder,
        "pose --scene scene.json --target target.exr --search --translation -o pose.json --report report");
    REQUIRE(search.status == 0);
    CHECK(search.out.starts_with("step "));  // the search ends long before the most that it may take
    CHECK(contains(search.out, " of at most "));
    const json pose = json::parse(folder.read("pose.json"));
    check_is_truth(pose);
    CHECK(pose["translation"].size() == 3);
    CHECK(pose["rotation"].size() == 3);
    REQUIRE(pose["transform"].size() == 4);
    CHECK(pose["transform"][0][3].get<double>() == doctest::Approx(pose["translation"][0].get<double>()));
    CHECK(pose["loss"].get<double>() < 1e-3);
    CHECK(pose["explained"] == true);
    CHECK_FALSE(pose.contains("doubt"));
    CHECK(pose["unexplained_part"].get<double>() < 0.1);
    CHECK(pose["light"] == "fixed");
    CHECK(pose["focal_scale"] == 1.0);
    CHECK(pose["covariance"].size() == 6);
    CHECK(pose["covariance"][5].size() == 6);
    REQUIRE(pose["hypotheses"].size() >= 1);
    CHECK(pose["hypotheses"][0]["rotation_matrix"] == pose["rotation_matrix"]);
    REQUIRE(pose["history"].size() == pose["iterations"].get<std::size_t>());
    for (const char* key :
         {"iteration", "loss", "sigma", "gamma", "samples", "width", "height", "hypotheses"}) {
      CHECK(pose["history"][0].contains(key));
    }
    const std::string page = folder.read("report/index.html");
    for (const char* picture : {"target.png", "start.png", "end.png", "difference.png", "iterations.png"}) {
      CHECK(std::filesystem::is_regular_file(folder / ("report/" + std::string(picture))));
      CHECK(contains(page, "src=\"" + std::string(picture) + "\""));
    }
    CHECK_FALSE(contains(dpr::test::own_text(page), "http"));  // opens without a network
  }

  TEST_CASE("dpr pose: says what leaves little more than a target that is not explained") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    json empty = json::parse(folder.read("truth.json"));
    empty["meshes"][0]["transform"] = {
        {1, 0, 0, 0}, {0, 1, 0, 100}, {0, 0, 1, 0}, {0, 0, 0, 1}};  // out of sight
    folder.write("empty.json", empty.dump());
    REQUIRE(run_line(folder, "render --scene empty.json --preset rigid -o empty.exr --quiet").status == 0);
    const Outcome solved = run_line(
        folder, "pose --scene scene.json --target empty.exr --rotations 0 -o pose.json --report report");
    CAPTURE(solved.err);
    REQUIRE(solved.status == 0);
    const json pose = json::parse(folder.read("pose.json"));
    CHECK(pose["explained"] == false);
    CHECK(pose["doubt"] == "empty_picture");
    CHECK(pose["unexplained_part"].get<double>() > 0.1);
    CHECK(contains(solved.out, " times that of a picture without the object"));
    CHECK(contains(folder.read("report/index.html"), " times that of a picture without the object"));
  }

  TEST_CASE("dpr pose: the light that it found explains the target") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    json truth = json::parse(folder.read("truth.json"));
    truth["lights"] = {{"ambient", {0, 0, 0}}, {"harmonics", json::array()}};
    for (int k = 0; k < 9; ++k)
      truth["lights"]["harmonics"].push_back(
          {k == 0 ? 2.0 : 0.5 / k, k == 0 ? 1.5 : 0.2, k == 0 ? 1.0 : -0.1});
    folder.write("lit.json", truth.dump());
    REQUIRE(run_line(folder, "render --scene lit.json --preset rigid -o target.exr --quiet").status == 0);
    REQUIRE(
        run_line(folder,
                 "pose --scene scene.json --target target.exr --search -o pose.json --report page --quiet")
            .status == 0);
    CHECK(difference_on_page(folder) < 0.01);
    const json pose = json::parse(folder.read("pose.json"));
    REQUIRE(pose["light"] == "harmonics");
    REQUIRE(pose["harmonics"].size() == 9);
    json found = json::parse(folder.read("scene.json"));
    found["meshes"][0]["transform"] = pose["transform"];
    CHECK(pose["lights"]["harmonics"] == pose["harmonics"]);
    found["lights"] = pose["lights"];
    folder.write("found.json", found.dump());
    REQUIRE(run_line(folder, "render --scene found.json --preset rigid -o found.exr --quiet").status == 0);
    REQUIRE(run_line(folder, "render --scene truth.json --preset rigid -o dark.exr --quiet").status == 0);
    const dpr::Image target = dpr::read_image(folder / "target.exr");
    const auto difference = [&](const char* file) {
      const dpr::Image image = dpr::read_image(folder / file);
      double sum = 0;
      for (std::size_t i = 0; i < target.pixels.size(); ++i)
        sum += static_cast<double>(glm::length(glm::vec3(image.pixels[i] - target.pixels[i])));
      return sum;
    };
    CHECK(difference("found.exr") < 0.2 * difference("dark.exr"));
  }

  TEST_CASE("dpr pose --light gain: the gain and the offset that it found are in the file") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const glm::dvec3 gain(0.3, 0.5, 1.4), offset(0.2, 0, 0.1);
    dpr::Image target = dpr::read_image(folder / "target.exr");
    for (glm::vec4& pixel : target.pixels)
      pixel = glm::vec4(glm::vec3(gain) * glm::vec3(pixel) + glm::vec3(offset) * pixel.w, pixel.w);
    dpr::write_image(folder / "target.exr", target);
    REQUIRE(run_line(folder,
                     "pose --scene scene.json --target target.exr --initial-rotation 0,0.6,0 --light gain "
                     "-o pose.json --report page --quiet")
                .status == 0);
    CHECK(difference_on_page(folder) < 0.01);
    const json pose = json::parse(folder.read("pose.json"));
    check_is_truth(pose);
    REQUIRE(pose["light"] == "gain");
    CHECK_FALSE(pose.contains("harmonics"));
    const auto found = [&](const char* key, int c) {
      return pose[key][static_cast<std::size_t>(c)].get<double>();
    };
    for (int c = 1; c < 3; ++c) {
      CHECK(found("gain", c) == doctest::Approx(gain[c]).epsilon(0.03));
      CHECK(std::abs(found("offset", c) - offset[c]) < 0.02);
    }
    // All sides in sight have the same red, which leaves open how much of it is reflected by the offset.
    constexpr double k_red = 0.1;
    CHECK(k_red * found("gain", 0) + found("offset", 0) ==
          doctest::Approx(k_red * gain[0] + offset[0]).epsilon(0.03));
  }

  TEST_CASE("dpr pose: mask, robust loss, focal length and the grid's size") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    dpr::write_image(folder / "mask.png", dpr::Image(64, 48, glm::vec4(1)));
    REQUIRE(run_line(folder,
                     "pose --scene scene.json --target target.exr --initial-rotation 0,0.6,0 --mask mask.png "
                     "--robust 0.2 --focal --rotations 0 --coarsest 24 --level-iterations 12 --blur 0.3 "
                     "--blur-end 0.15 -o pose.json --quiet")
                .status == 0);
    const json pose = json::parse(folder.read("pose.json"));
    check_is_truth(pose);
    CHECK(pose["focal_scale"].get<double>() == doctest::Approx(1).epsilon(0.03));
    CHECK(pose["covariance"].size() == 4);
    CHECK(pose["history"][0]["hypotheses"] == 1);
    CHECK(pose["history"][0]["height"] == 24);
    CHECK_FALSE(pose.contains("distortion"));
    REQUIRE(run_line(folder,
                     "pose --scene scene.json --target target.exr --initial-rotation 0,0.6,0 --distortion "
                     "--rotations 0 --coarsest 24 -o lens.json --quiet")
                .status == 0);
    const json lens = json::parse(folder.read("lens.json"));
    check_is_truth(lens);
    REQUIRE(lens["distortion"].size() == 5);
    CHECK(lens["distortion"][0] != 0);
    CHECK(lens["covariance"].size() == 5);
  }

  TEST_CASE("dpr pose: a silhouette, depths in floats or whole numbers, or both will do without a target") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    REQUIRE(
        run_line(folder, "render --scene truth.json --preset rigid -o seen.exr --aov depth --quiet").status ==
        0);
    const dpr::Image depth = dpr::read_image(folder / "seen.depth.exr");
    std::string whole = "P5 64 48 65535\n";  // millimetres, most significant byte first
    for (const glm::vec4& pixel : depth.pixels) {
      const auto length = static_cast<unsigned>(std::lround(1000 * pixel.x));
      whole.push_back(static_cast<char>(length / 256));
      whole.push_back(static_cast<char>(length % 256));
    }
    folder.write("depth.pgm", whole);
    for (const char* options :
         {"--silhouette target.exr", "--depth seen.depth.exr", "--depth depth.pgm --depth-scale 0.001",
          "--silhouette target.exr --silhouette-weight 2 --depth depth.pgm --depth-scale 0.001 "
          "--depth-weight 0.5",
          "--target target.exr --silhouette target.exr --depth seen.depth.exr"}) {
      CAPTURE(options);
      REQUIRE(
          run_line(
              folder,
              std::string(
                  "pose --scene scene.json --initial-rotation 0,0.7,0 --rotations 0 -o pose.json --quiet ") +
                  options)
              .status == 0);
      check_is_truth(json::parse(folder.read("pose.json")));
    }
  }

  TEST_CASE("dpr pose: an option of the descent's, or of the smoothing's, implies it") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    for (const char* option : {"--method descent", "--schedule anneal", "--sigma 1e-3"}) {
      REQUIRE(run_line(folder, std::string("pose --scene scene.json --target target.exr --composition joint "
                                           "--iterations 4 --restarts 0 -o pose.json --quiet ") +
                                   option)
                  .status == 0);
      const json pose = json::parse(folder.read("pose.json"));
      CHECK(pose["iterations"] == 4);
      CHECK(pose["history"][0]["width"] == 64);
      CHECK(pose["covariance"].empty());
    }
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("dpr pose: what does not go together is an error of one line") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    for (const char* options :
         {"--method least_squares --iterations 4", "--method least_squares --sigma 1e-3", "--method newton",
          "--search --schedule anneal", "--mask target.exr --iterations 4", "--mask missing.png", "--blur 0",
          "--search --rotations 0", "--robust -1", "--device cpu/2"}) {
      CAPTURE(options);
      const Outcome outcome = run_line(
          folder, std::string("pose --scene scene.json --target target.exr -o pose.json ") + options);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 1);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK_FALSE(std::filesystem::exists(folder / "pose.json"));
    }
  }

  TEST_CASE("dpr pose: silhouettes and depths that cannot be compared are errors of one line that say why") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    dpr::write_image(folder / "small.png", dpr::Image(3, 2, glm::vec4(1)));
    dpr::write_image(folder / "black.png", dpr::Image(64, 48, glm::vec4(0, 0, 0, 1)));
    dpr::write_image(folder / "black.exr", dpr::Image(64, 48, glm::vec4(0, 0, 0, 1)));
    dpr::write_image(folder / "far.exr", dpr::Image(64, 48, glm::vec4(1e6F)));
    const auto check = [&](const std::string& options, const char* says) {
      CAPTURE(options);
      const Outcome outcome = run_line(folder, "pose --scene scene.json -o pose.json " + options);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 1);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK(contains(outcome.err, says));
      CHECK_FALSE(std::filesystem::exists(folder / "pose.json"));
    };
    check("", "--target (command line): got none");
    check("--silhouette missing.png", "missing.png: the file does not exist");
    check("--silhouette small.png", "size of --silhouette small.png (command line): got 3x2, expected 64x48");
    check("--silhouette black.png", "sum of the silhouette (pose): got 0");
    check("--depth-weight 2", "--depth-weight (command line): got no --depth");
    check("--depth small.png --depth-scale 1", "size of --depth small.png (command line): got 3x2");
    check("--depth black.png", "--depth black.png (command line): got whole numbers, expected --depth-scale");
    check("--depth black.exr", "--depth (command line): got no pixel that has one");
    check("--depth far.exr", "expected some from znear to zfar");
    check("--target target.exr --depth-scale 1", "--depth-scale (command line): got no --depth");
    check("--silhouette black.png --unknown-background",
          "--unknown-background (command line): got no --target");
    check("--silhouette target.exr --report report", "--report (command line): got no --target");
    check("--silhouette target.exr --iterations 4", "options of least squares beside those of the descent");
  }
}

}  // namespace pose_command_test
