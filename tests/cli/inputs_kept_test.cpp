// No command writes over a file that it reads, also where only another file names it.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>

#include "base/input_file.hpp"
#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace inputs_kept_test {

namespace {

namespace fs = std::filesystem;
using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::Outcome;
using dpr::test::run_line;
using dpr::test::TempDir;

const char* const k_camera =
    R"("camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-5],[0,0,0,1]], "fov_y_degrees": 50})";

/// A textured mesh, a scene and a views file that name it, and their images.
void write_inputs(const TempDir& folder) {
  dpr::Mesh mesh = dpr::make_cube();
  mesh.face_colors.clear();
  mesh.texcoords = {{0, 0}, {1, 0}, {0, 1}};
  mesh.face_texcoords.assign(mesh.faces.size(), {0, 1, 2});
  mesh.textures.resize(1);
  mesh.textures[0].width = mesh.textures[0].height = 1;
  mesh.textures[0].texels = {{1, 0.5F, 0}};
  dpr::write_mesh(folder / "cube.obj", mesh);
  dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
  dpr::write_image(folder / "target.exr", dpr::Image(16, 16, glm::vec4(0.5F)));
  dpr::write_image(folder / "v0.png", dpr::Image(16, 16, glm::vec4(0.5F)));
  const std::string size = R"({"width": 16, "height": 16, )", camera = k_camera;
  folder.write("scene.json", size + camera + R"(, "meshes": [{"file": "cube.obj"}]})");
  folder.write("views.json",
               size + R"("initial": "cube.ply", "views": [{"image": "v0.png", )" + camera + "}]}");
}

std::map<std::string, std::string> contents(const TempDir& folder) {
  std::map<std::string, std::string> contents;
  for (const auto& entry : fs::recursive_directory_iterator(folder.path())) {
    if (entry.is_regular_file())
      contents[entry.path().string()] = folder.read(fs::relative(entry.path(), folder.path()).string());
  }
  return contents;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr: files that a scene, a views file, a mesh or its materials name are not written over") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    fs::create_symlink("v0.png", folder / "link.png");
    const auto before = contents(folder);
    const auto refuses = [&](const std::string& line, const std::string& output, const std::string& input) {
      CAPTURE(line);
      const Outcome outcome = run_line(folder, line);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 1);
      CHECK(contains(outcome.err, output));
      CHECK(contains(outcome.err, input));
      CHECK(contents(folder) == before);
    };
    const std::string gradient = "gradient --scene scene.json --target target.exr -o ";
    refuses(gradient + "./cube.obj", "./cube.obj: cannot be written", "read as cube.obj");
    refuses(gradient + "cube.mtl", "cube.mtl: cannot be written", "read as cube.mtl");
    refuses("render cube.obj -o cube.png", "cube.png: cannot be written", "read as cube.png");
    refuses("render cube.obj -o a.png --save-scene cube.mtl", "cube.mtl: cannot be written",
            "read as cube.mtl");
    refuses("pose --scene scene.json --target target.exr -o cube.png", "cube.png: cannot be written",
            "cube.png");
    refuses("pose --scene scene.json --views views.json -o v0.png", "v0.png: cannot be written",
            "read as v0.png");
    refuses("track --scene scene.json --sequence v#.png -o t.json --csv v0.png", "v0.png: cannot be written",
            "read as v0.png");
    const std::string fit = "fit --views views.json --levels 1 --iterations 1 -o ";
    refuses(fit + "cube.ply", "cube.ply: cannot be written", "read as cube.ply");
    refuses(fit + "cube.ply --initial cube.obj", "cube.ply: cannot be written", "read as cube.ply");
    refuses(fit + "v0.obj --texture 200", "v0.png: cannot be written", "read as v0.png");
    refuses(fit + "link.obj --texture 200", "link.png: cannot be written", "read as v0.png");
    refuses(fit + "a.obj --checkpoint cube.ply", "cube.ply: cannot be written", "read as cube.ply");
    refuses(fit + "a.obj --texture 200 --checkpoint ./a.mtl", "\"a.mtl\" and \"./a.mtl\"", "different files");
    refuses(fit + "a.obj --report .", "--report (command line): got \".\"", "where cube.ply is read");
    refuses("pose --scene scene.json --target target.exr -o a.json --report ./", "--report (command line)",
            "is read");
    refuses("track --scene scene.json --sequence v#.png -o t.json --report .", "--report (command line)",
            "is read");
  }

  TEST_CASE("dpr fit: a checkpoint is read and written again") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const std::string fit =
        "fit --views views.json --levels 1 --iterations 2 -o a.obj --texture 200 --checkpoint state";
    for (int i = 0; i < 2; ++i) {
      const Outcome outcome = run_line(folder, fit + " --report report --save-views saved.json");
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
    }
  }

  TEST_CASE("inputs are guarded where a program asks for it alone") {
    const TempDir folder;
    folder.write("a", "a");
    CHECK(dpr::read_file(folder / "a") == "a");
    CHECK_FALSE(dpr::guarded_input(folder / "a"));
  }
}

}  // namespace inputs_kept_test
