// Textures from the shell: an OBJ with its material, a scene with a texture of its own, their gradients, what
// dpr info says.
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "dpr/image.hpp"
#include "dpr/texture.hpp"
#include "support/command.hpp"
#include "support/data.hpp"
#include "support/messages.hpp"

namespace texture_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::run_command;
using dpr::test::TempDir;
using nlohmann::json;

/// A square that fills most of the image: red left above, green right above, blue left below, white.
void write_square(const TempDir& folder) {
  dpr::write_texture(
      folder / "paint.exr",
      {2, 2, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}}, dpr::Wrap::clamp, dpr::Filter::nearest});
  folder.write("square.mtl", "newmtl paint\nmap_Kd paint.exr\n");
  folder.write("square.obj",
               "mtllib square.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
               "usemtl paint\nf 1/1 2/2 3/3 4/4\n");
  folder.write("scene.json",
               R"({"width": 16, "height": 16, "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-2],[0,0,0,1]]},
                   "meshes": [{"file": "square.obj", "texture": {"file": "paint.exr", "wrap": "clamp",
                   "filter": "nearest"}}], "smoothing": {"preset": "pixel", "sigma": 1e-6},
                   "gradients": ["texture", "texcoords"]})");
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr render: a texture has its first row on top, and v goes up") {
    if (is_skipped()) return;
    const TempDir folder;
    write_square(folder);
    const auto outcome =
        run_command(folder, {"render", "--scene", "scene.json", "-o", "out.exr", "--device", "cpu"});
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    const dpr::Image image = dpr::read_image(folder / "out.exr");
    CHECK(glm::distance(glm::vec3(image.at(5, 5)), glm::vec3(1, 0, 0)) < 1e-3F);
    CHECK(glm::distance(glm::vec3(image.at(10, 5)), glm::vec3(0, 1, 0)) < 1e-3F);
    CHECK(glm::distance(glm::vec3(image.at(5, 10)), glm::vec3(0, 0, 1)) < 1e-3F);
    CHECK(glm::distance(glm::vec3(image.at(10, 10)), glm::vec3(1, 1, 1)) < 1e-3F);
  }

  TEST_CASE("dpr gradient: texels and texture coordinates") {
    if (is_skipped()) return;
    const TempDir folder;
    write_square(folder);
    dpr::write_image(folder / "target.exr", dpr::Image(16, 16));
    const auto outcome = run_command(folder, {"gradient", "--scene", "scene.json", "--target", "target.exr",
                                              "-o", "g.json", "--device", "cpu"});
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    const json mesh = json::parse(folder.read("g.json"))["meshes"][0];
    CHECK(mesh["texcoords"].size() == 4);
    CHECK(mesh["texcoords"][0].size() == 2);
    REQUIRE(mesh["textures"].size() == 1);
    REQUIRE(mesh["textures"][0].size() == 4);
    CHECK(mesh["textures"][0][0][0].get<double>() > 0);
    CHECK(mesh["textures"][0][0][1] == 0);
  }

  TEST_CASE("dpr info: textures of materials") {
    if (is_skipped()) return;
    const TempDir folder;
    write_square(folder);
    const auto outcome = run_command(folder, {"info", "square.obj", "--json"});
    REQUIRE(outcome.status == 0);
    const json square = json::parse(outcome.out);
    CHECK(square["textures"] ==
          json::parse(R"([{"width": 2, "height": 2, "wrap": "repeat", "filter": "bilinear"}])"));
    CHECK(square["materials"] == json::parse(R"([{"name": "paint", "texture": "paint.exr"}])"));
    CHECK(contains(run_command(folder, {"info", "square.obj"}).out, "2x2 repeat bilinear"));
  }

  TEST_CASE("dpr info: Spot's control mesh has its texture") {
    if (is_skipped()) return;
    const TempDir folder;
    const auto file = dpr::test::data_folder() / "../../bench/data/spot_control_mesh.obj";
    const auto info = json::parse(dpr::test::succeed(folder, {"info", file.string(), "--json"}).out);
    REQUIRE(info["textures"].size() == 1);
    CHECK(info["textures"][0]["width"] == 512);
    CHECK(info["materials"][0]["texture"] == "spot_texture.png");
  }

  TEST_CASE("dpr render: a texture that is no image, or is not there") {
    if (is_skipped()) return;
    const TempDir folder;
    write_square(folder);
    folder.write("paint.exr", "not a picture");
    const auto broken = run_command(folder, {"render", "square.obj", "-o", "out.png", "--device", "cpu"});
    CHECK(broken.status == 1);
    CHECK(contains(broken.err, "paint.exr"));
    std::filesystem::remove(folder / "paint.exr");
    const auto gone = run_command(folder, {"render", "square.obj", "-o", "out.png", "--device", "cpu"});
    CHECK(gone.status == 0);
    CHECK(contains(gone.err, "the texture \"paint.exr\" of the material \"paint\" (map_Kd) is not there"));
    CHECK(run_command(folder, {"render", "--scene", "scene.json", "-o", "s.png", "--device", "cpu"}).status ==
          1);
  }
}

}  // namespace texture_command_test
