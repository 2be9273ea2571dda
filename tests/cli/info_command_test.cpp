// dpr info: what it says of meshes, scenes, and files that are neither.
#include <doctest/doctest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace info_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::run_command;
using dpr::test::TempDir;
using nlohmann::json;

json info(const TempDir& folder, const std::string& file) {
  const auto outcome = run_command(folder, {"info", file, "--json"});
  CAPTURE(outcome.err);
  REQUIRE(outcome.status == 0);
  return json::parse(outcome.out);
}

bool notes(const json& mesh, const std::string& part) {
  return std::ranges::any_of(mesh["notes"],
                             [&](const json& note) { return contains(note.get<std::string>(), part); });
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr info: a closed mesh with colours has nothing to note") {
    if (is_skipped()) return;
    const TempDir folder;
    dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
    const json cube = info(folder, "cube.ply");
    CHECK(cube["kind"] == "mesh");
    CHECK(cube["vertices"] == 24);
    CHECK(cube["distinct_positions"] == 8);
    CHECK(cube["faces"] == 12);
    CHECK(cube["components"] == 1);
    CHECK(cube["closed"] == true);
    CHECK(cube["manifold"] == true);
    CHECK(cube["colors"] == "face");
    CHECK(cube["bounds"]["low"] == json({-1, -1, -1}));
    CHECK(cube["bounds"]["high"] == json({1, 1, 1}));
    CHECK(cube["notes"].empty());
    const auto text = run_command(folder, {"info", "cube.ply"});
    CHECK(text.status == 0);
    CHECK(contains(text.out, "closed, manifold, wound in one sense"));
    CHECK(!contains(text.out, "normals"));
    folder.write("n.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n");
    CHECK(contains(run_command(folder, {"info", "n.obj"}).out, "  normals              1\n"));
  }

  TEST_CASE("dpr info, render and pose: a glTF mesh that blends") {
    if (is_skipped()) return;
    const TempDir folder;
    const std::string text =
        R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
      "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri":
      "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
      "materials": [{"alphaMode": ")";
    const std::string factor = R"(", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 0.5]}}]})";
    folder.write("opaque.gltf", text + "OPAQUE" + factor);
    folder.write("blend.gltf", text + "BLEND" + factor);
    CHECK(!notes(info(folder, "opaque.gltf"), "opacities below 1"));
    CHECK(notes(info(folder, "blend.gltf"), "opacities below 1"));
    CHECK(run_command(folder, {"render", "opaque.gltf", "-o", "a.png"}).status == 0);
    CHECK(run_command(folder, {"render", "blend.gltf", "-o", "b.exr"}).status == 0);
    const dpr::Image image = dpr::read_image(folder / "b.exr");
    const auto alpha = std::ranges::max(image.pixels, {}, [](const glm::vec4& p) { return p.w; }).w;
    CHECK(alpha == doctest::Approx(0.5).epsilon(0.01));
    const auto pose = [&](const std::string& file) {
      folder.write("scene.json", R"({"width": 24, "height": 24,
        "camera": {"view": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -4], [0, 0, 0, 1]], "znear": 1, "zfar": 9},
        "meshes": [{"file": ")" + file +
                                     R"("}]})");
      return run_command(
          folder, {"pose", "--scene", "scene.json", "--target", "a.png", "--rotations", "0", "-o", "p.json"});
    };
    CHECK(pose("opaque.gltf").status == 0);
    CHECK(contains(pose("blend.gltf").err, "an opaque mesh"));
    CHECK(run_command(folder, {"render", "--scene", "scene.json", "-o", "b.png"}).status == 0);
  }

  TEST_CASE("dpr info: holes, faces without area, missing material libraries, textures") {
    if (is_skipped()) return;
    const TempDir folder;
    folder.write("scrap.mtl", "newmtl red\nKd 1 0 0\nmap_Kd paint.png\n");
    folder.write(
        "scrap.obj",
        "mtllib scrap.mtl\nmtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nvt 0 0\nvt 1 0\nvt 0 1\n"
        "usemtl red\nf 1/1 2/2 3/3\nf 1/1 2/2 2/2\n");
    const json scrap = info(folder, "scrap.obj");
    CHECK(scrap["faces_without_area"] == 1);
    CHECK(scrap["boundary_edges"] == 3);
    CHECK(scrap["texture_coordinates"] == 3);
    CHECK(scrap["textures"].empty());
    CHECK(scrap["materials"] == json::parse(R"([{"name": "red", "texture": "paint.png"}])"));
    for (const char* part :
         {"1 triangle without area", "vertices without a face: 1", "gone.mtl", "paint.png", "not closed"})
      CHECK(notes(scrap, part));
  }

  TEST_CASE("dpr info: a scene and the meshes in it") {
    if (is_skipped()) return;
    const TempDir folder;
    dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
    folder.write("scene.json",
                 R"({"width": 20, "height": 10, "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-3],[0,0,0,1]],
                 "znear": 2.5}, "smoothing": {"sigma": 0.25}, "meshes": [{"file": "cube.ply"},
                 {"positions": [[0,0,0],[1,0,0],[0,1,0]], "faces": [[0,1,2]]}], "gradients": ["camera"]})");
    const json scene = info(folder, "scene.json");
    CHECK(scene["kind"] == "scene");
    CHECK(scene["width"] == 20);
    CHECK(scene["smoothing"]["sigma"] == 0.25);
    CHECK(scene["smoothing"]["noise"] == "triangle");  // of a smoothing that says anything but that
    CHECK(scene["lights"].is_null());
    CHECK(scene["gradients"] == json({"camera"}));
    REQUIRE(scene["meshes"].size() == 2);
    CHECK(scene["meshes"][0]["file"] == "cube.ply");
    CHECK(notes(scene["meshes"][0], "2 triangles nearer than znear"));         // the front
    CHECK(notes(scene["meshes"][0], "8 triangles clipped at znear or zfar"));  // all but the back
    CHECK(scene["meshes"][1]["file"].is_null());
    CHECK(notes(scene["meshes"][1], "no colours: white"));
    const auto text = run_command(folder, {"info", "scene.json"});
    CHECK(text.status == 0);
    CHECK(contains(text.out, "cube.ply: mesh"));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("dpr info: what cannot be read is one line") {
    if (is_skipped()) return;
    const TempDir folder;
    folder.write("broken.obj", "v 0 0 0\nf 1 2 3\n");
    folder.write("broken.json", "{\"width\": ");
    folder.write("mesh.txt", "v 0 0 0\n");
    folder.write("empty.ply", "");
    folder.write("lost.json",
                 R"({"width": 2, "height": 2, "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-3],[0,0,0,1]]},
                 "meshes": [{"file": "lost.obj"}]})");
    for (const char* file :
         {"broken.obj", "broken.json", "mesh.txt", "empty.ply", "none.obj", "lost.json", "."}) {
      const auto outcome = run_command(folder, {"info", file, "--json"});
      CAPTURE(outcome.err);
      CHECK(outcome.status == 1);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK(outcome.out.empty());
    }
  }
}

}  // namespace info_command_test
