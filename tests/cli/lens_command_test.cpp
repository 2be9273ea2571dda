// The commands on a scene of two large triangles before a lens: they are drawn as small ones are, and what is
// written is of the two.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "dpr/image.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace lens_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::run_command;
using dpr::test::succeed;
using dpr::test::TempDir;
using nlohmann::json;

/// A wall before the camera.
std::string scene_text(const std::string& lens) {
  return R"({"width": 48, "height": 36, "camera": {"intrinsics": {"fx": 24, "fy": 24, "cx": 24, "cy": 18},
             "znear": 0.5, "zfar": 10)" +
         lens +
         R"(}, "meshes": [{"positions": [[-1.3,-1,-1.6],[1.4,-0.9,-1.9],[1.3,1.2,-2.1],[-1.4,1.1,-1.8]],
             "faces": [[0,1,2],[0,2,3]], "face_colors": [[1,0,0],[0,0,1]]}]})";
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr render and gradient cut the faces before a lens") {
    if (is_skipped()) return;
    const TempDir folder;
    folder.write("lens.json", scene_text(R"(, "distortion": [-0.25, 0.03, 0, 0, 0])"));
    folder.write("none.json", scene_text(""));
    const std::string said =
        succeed(folder, {"render", "--scene", "lens.json", "-o", "cut.exr", "--aov", "face_id,barycentrics"})
            .out;
    CHECK(contains(said, "2 triangles, cut into "));
    const dpr::Image faces = dpr::read_image(folder / "cut.face_id.exr");
    const auto highest = std::ranges::max_element(faces.pixels, {}, [](const glm::vec4& p) { return p.x; });
    CHECK(highest->x == 1);
    CHECK_FALSE(
        contains(succeed(folder, {"render", "--scene", "none.json", "-o", "none.exr"}).out, "cut into"));

    const auto whole =
        succeed(folder, {"render", "--scene", "lens.json", "-o", "whole.exr", "--lens-tolerance", "inf"});
    CHECK_FALSE(contains(whole.out, "cut into"));
    CHECK(dpr::read_image(folder / "whole.exr").pixels != dpr::read_image(folder / "cut.exr").pixels);

    const auto gradient_of = [&](const std::string& tolerance) {
      succeed(folder, {"gradient", "--scene", "lens.json", "--target", "none.exr", "-o", "g.json",
                       "--lens-tolerance", tolerance});
      return json::parse(folder.read("g.json"));
    };
    const json cut = gradient_of("0.25"), finer = gradient_of("0.05");
    CHECK(cut["meshes"][0]["positions"].size() == 4);
    CHECK(cut["meshes"][0]["colors"].size() == 2);
    CHECK_FALSE(cut["meshes"][0].contains("normals"));
    const auto red = [](const json& gradient) { return gradient["meshes"][0]["colors"][0][0].get<double>(); };
    CHECK(std::abs(red(cut) / red(finer) - 1) < 0.01);
    CHECK(std::abs(red(gradient_of("inf")) / red(finer) - 1) > 0.1);

    const auto wrong =
        run_command(folder, {"render", "--scene", "lens.json", "-o", "no.exr", "--lens-tolerance", "-1"});
    CHECK(wrong.status == 1);
    CHECK(contains(wrong.err, "--lens-tolerance (command line): got -1"));
  }

  TEST_CASE("the commands take a fisheye") {
    if (is_skipped()) return;
    const TempDir folder;
    std::string scene = scene_text(R"(, "fisheye": [-0.25, 0.125, 0, 0.5])");
    scene.insert(1, R"("gradients": ["distortion"], )");
    folder.write("fisheye.json", scene);
    const std::string said = succeed(folder, {"render", "--scene", "fisheye.json", "-o", "cut.exr"}).out;
    CHECK(contains(said, "2 triangles, cut into "));
    succeed(folder, {"gradient", "--scene", "fisheye.json", "--target", "cut.exr", "-o", "g.json"});
    const json of_lens = json::parse(folder.read("g.json"))["camera"]["fisheye"];
    CHECK(of_lens.size() == 4);
    CHECK(of_lens.contains("k4"));
    CHECK(contains(succeed(folder, {"info", "fisheye.json"}).out, "fisheye -0.25 0.125 0.0 0.5"));
  }
}

}  // namespace lens_command_test
