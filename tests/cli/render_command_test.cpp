// dpr render: what it says and refuses before it renders.
#include <doctest/doctest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace render_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::run_command;
using dpr::test::TempDir;

const char* const k_scene = R"({"width": 16, "height": 16, "meshes": [{"file": "cube.ply"}],
    "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-5],[0,0,0,1]]}%})";

std::string scene(const std::string& further) {
  std::string text = k_scene;
  return text.replace(text.find('%'), 1, further);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr render: a smoothing that takes the default's noise away is told") {
    if (is_skipped()) return;
    const TempDir folder;
    dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
    folder.write("plain.json", scene(""));
    folder.write("said.json", scene(R"(, "smoothing": {"sigma": 1e-3})"));
    const auto is_told = [&](std::vector<std::string> arguments) {
      arguments.insert(arguments.begin(), "render");
      arguments.insert(arguments.end(), {"-o", "cube.png", "--size", "16x16"});
      const auto outcome = run_command(folder, arguments);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
      return contains(outcome.err, "--noise pixel keeps");
    };
    CHECK(is_told({"cube.ply", "--sigma", "1e-3"}));
    CHECK(is_told({"--scene", "plain.json", "--sigma", "1e-3"}));
    CHECK_FALSE(is_told({"cube.ply"}));
    CHECK_FALSE(is_told({"cube.ply", "--sigma", "1e-3", "--noise", "pixel"}));
    CHECK_FALSE(is_told({"cube.ply", "--preset", "softras"}));
    CHECK_FALSE(is_told({"--scene", "said.json", "--sigma", "1e-3"}));
  }

  TEST_CASE("dpr render: faces without area are no more than invisible") {
    if (is_skipped()) return;
    const TempDir folder;
    folder.write("point.obj", "v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n");
    folder.write("repeated.obj", "v 0 0 0\nv 1 0 0\nf 1 1 1\nf 1 2 2\nf 1 2 1\n");
    for (const std::string name : {"point", "repeated"}) {
      for (const std::string noise : {"triangle", "pixel"}) {
        CAPTURE(name);
        const auto outcome = run_command(
            folder, {"render", name + ".obj", "-o", name + ".png", "--size", "16x16", "--noise", noise});
        CAPTURE(outcome.err);
        CHECK(outcome.status == 0);
        CHECK(contains(outcome.out, "; not shown: "));
        CHECK(contains(outcome.out, " without area"));
      }
    }
  }

  TEST_CASE("dpr render: it says which triangles the camera does not show, and not that a mesh has a back") {
    if (is_skipped()) return;
    const TempDir folder;
    dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
    folder.write("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const auto printed = [&](std::vector<std::string> arguments) {
      arguments.insert(arguments.begin(), "render");
      arguments.insert(arguments.end(), {"-o", "a.png"});
      return dpr::test::succeed(folder, arguments).out;
    };
    CHECK(printed({"cube.ply"}) == "a.png: 256x256, 12 triangles\n");
    CHECK(printed({"one.obj"}) == "a.png: 256x256, 1 triangle\n");
    // One triangle in view, one that crosses an edge of the image, and one for each reason.
    const auto triangles = [](const std::string& camera) {
      return R"({"width": 20, "height": 10, "camera": {"znear": 1, "zfar": 9)" + camera + R"(}, "meshes": [
          {"positions": [[0,0,-5],[1,0,-5],[0,1,-5]], "faces": [[0,1,2]]},
          {"positions": [[0,0,-5],[99,0,-5],[0,1,-5]], "faces": [[0,1,2]]},
          {"positions": [[0,0,-0.5],[1,0,-0.5],[0,1,0.5]], "faces": [[0,1,2]]},
          {"positions": [[0,0,-10],[1,0,-10],[0,1,-10]], "faces": [[0,1,2]]},
          {"positions": [[30,0,-5],[31,0,-5],[30,1,-5]], "faces": [[0,1,2]]},
          {"positions": [[0,-30,-0.5],[1,-31,-5],[0,-30,-5]], "faces": [[0,1,2]]},
          {"positions": [[0,0,-5],[1,0,-5],[2,0,-5]], "faces": [[0,1,2]]}]})";
    };
    const std::string shown =
        "7 triangles; not shown: 1 nearer than znear, 1 beyond zfar, 2 outside the image, 1 without area\n";
    folder.write("perspective.json", triangles(""));
    CHECK(printed({"--scene", "perspective.json"}) == "a.png: 20x10, " + shown);
    folder.write("parallel.json", triangles(R"(, "projection": "orthographic", "orthographic_height": 4)"));
    CHECK(printed({"--scene", "parallel.json"}) == "a.png: 20x10, " + shown);
    CHECK(contains(dpr::test::succeed(folder, {"info", "perspective.json"}).out,
                   "1 triangle outside the image"));
  }

  TEST_CASE("dpr render --rigid leaves no smoothing to set") {
    if (is_skipped()) return;
    const TempDir folder;
    dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
    const auto outcome =
        run_command(folder, {"render", "cube.ply", "-o", "a.png", "--rigid", "--sigma", "1e-2"});
    CHECK(outcome.status == 1);
    CHECK(contains(outcome.err, "got both --rigid and --sigma, expected one of the two"));
    dpr::test::succeed(folder, {"render", "cube.ply", "-o", "a.png", "--rigid", "--seed", "2"});
  }

  TEST_CASE("dpr render: meshes of any size fill the picture, or the message says why not") {
    if (is_skipped()) return;
    const TempDir folder;
    const auto render = [&](const std::string& s, const std::vector<std::string>& input) {
      folder.write("one.obj",
                   "v -" + s + " -" + s + " 0\nv " + s + " -" + s + " 0\nv 0 " + s + " 0\nf 1 2 3\n");
      std::vector<std::string> arguments{"render", "-o", "a.png", "--size", "16x16"};
      arguments.insert(arguments.end(), input.begin(), input.end());
      return run_command(folder, arguments);
    };
    for (const std::string unit : {"1e-3", "1e-8"}) {
      const auto outcome = render(unit, {"one.obj"});
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
      CHECK(outcome.err.empty());
    }
    CHECK(contains(render("1e-12", {"one.obj"}).err, "another unit of length"));
    folder.write("scene.json", R"({"meshes": [{"file": "one.obj"}], "width": 16, "height": 16,
        "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-5],[0,0,0,1]]}})");
    for (const std::string unit : {"1e-9", "1e20"})
      CHECK(contains(render(unit, {"--scene", "scene.json"}).err,
                     "empty: 1 triangle in view, too small to be seen or too large for single precision"));
  }

  TEST_CASE("dpr render --save-scene: the scene file shows the same image to the bit") {
    if (is_skipped()) return;
    const TempDir folder;
    std::filesystem::create_directories(folder / "meshes");
    std::filesystem::create_directories(folder / "scenes");
    dpr::write_mesh(folder / "meshes/cube.ply", dpr::make_cube());
    const std::vector<std::vector<std::string>> cases{
        {},
        {"--rigid"},
        {"--azimuth", "200", "--elevation", "-10", "--shading", "flat", "--cull", "back"},
        {"--sigma", "1e-3", "--composition", "barrier"},
        {"--preset", "nmr"},
        {"--preset", "softras", "--blur-radius", "0.02"},
        {"--preset", "paper_gaussian", "--seed", "7", "--samples", "4"},
        {"--noise", "pixel", "--supersampling", "2", "--occupancy-prior", "logistic"}};
    for (const std::vector<std::string>& options : cases) {
      std::vector<std::string> words{"render",       "meshes/cube.ply",  "-o",
                                     "mesh.exr",     "--size",           "24x16",
                                     "--save-scene", "scenes/cube.json", "--quiet"};
      words.insert(words.end(), options.begin(), options.end());
      CAPTURE(options.empty() ? "" : options.back());
      dpr::test::succeed(folder, words);
      dpr::test::succeed(folder, {"render", "--scene", "scenes/cube.json", "-o", "scene.exr"});
      CHECK(dpr::read_image(folder / "mesh.exr").pixels == dpr::read_image(folder / "scene.exr").pixels);
    }
    CHECK(contains(folder.read("scenes/cube.json"), "\"file\": \"../meshes/cube.ply\""));
    dpr::test::succeed(folder,
                       {"gradient", "--scene", "scenes/cube.json", "--target", "mesh.exr", "-o", "g.json"});
    const auto refused = run_command(
        folder, {"render", "--scene", "scenes/cube.json", "-o", "a.png", "--save-scene", "b.json"});
    CHECK(refused.status == 1);
    CHECK(contains(refused.err, "got both --scene and --save-scene"));
    const auto lost =
        run_command(folder, {"render", "meshes/cube.ply", "-o", "a.png", "--save-scene", "no_folder/b.json"});
    CHECK(lost.status == 1);
    CHECK_FALSE(std::filesystem::exists(folder / "a.png"));
  }

  TEST_CASE("dpr render: --shading replaces the scene's") {
    if (is_skipped()) return;
    const TempDir folder;
    dpr::write_mesh(folder / "ball.ply", dpr::make_icosphere(1, 1.0F));
    const auto render = [&](const std::string& shading) {
      const auto outcome = run_command(
          folder, {"render", "ball.ply", "-o", shading + ".png", "--size", "24x24", "--shading", shading});
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
      return folder.read(shading + ".png");
    };
    const std::string flat = render("flat"), phong = render("phong");
    CHECK(flat != phong);
    CHECK(phong != render("gouraud"));
    CHECK(phong != render("microfacet"));
    folder.write("dark.json", scene(""));
    dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
    const auto dark =
        run_command(folder, {"render", "--scene", "dark.json", "-o", "dark.png", "--shading", "flat"});
    CHECK(dark.status == 1);
    CHECK(contains(dark.err, "without lights"));
    const auto mistyped = run_command(folder, {"render", "ball.ply", "-o", "x.png", "--shading", "fong"});
    CHECK(mistyped.status == 1);
    CHECK(contains(mistyped.err, "--shading"));
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("dpr render: every file that was written is told") {
    if (is_skipped()) return;
    const TempDir folder;
    dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
    const std::vector<std::string> render{"render", "cube.ply", "-o",    "cube.png",
                                          "--size", "16x16",    "--aov", "depth,face_id"};
    const auto outcome = run_command(folder, render);
    CHECK(outcome.status == 0);
    CHECK(contains(outcome.out, "cube.png: 16x16"));
    CHECK(contains(outcome.out, "\ncube.depth.exr\ncube.face_id.exr\n"));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("dpr render: an output that cannot be written is an error before there is a device") {
    if (is_skipped()) return;
    const TempDir folder;
    dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
    const auto outcome =
        run_command(folder, {"render", "cube.ply", "-o", "none/cube.png", "--device", "no such device"});
    CHECK(outcome.status == 1);
    CHECK(contains(outcome.err, "none/cube.png"));
  }
}

}  // namespace render_command_test
