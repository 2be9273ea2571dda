// The commands on a scene in which a mesh stands in two places.
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace instances_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::run_command;
using dpr::test::succeed;
using dpr::test::TempDir;
using nlohmann::json;

/// A cube on the left and, of `second`, on the right.
std::string scene_text(const std::string& second) {
  return R"({"width": 16, "height": 12, "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-9],[0,0,0,1]]},
             "meshes": [{"file": "cube.ply", "transform": [[1,0,0,-2],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},
                        {)" +
         second + R"(, "transform": [[1,0,0,2],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})";
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr render, gradient, info and pose on a scene with instances") {
    if (is_skipped()) return;
    const TempDir folder;
    dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
    folder.write("two.json", scene_text(R"("instance_of": 0)"));
    folder.write("copies.json", scene_text(R"("file": "cube.ply")"));
    succeed(folder, {"render", "--scene", "two.json", "-o", "two.exr"});
    succeed(folder, {"render", "--scene", "copies.json", "-o", "copies.exr"});
    const dpr::Image two = dpr::read_image(folder / "two.exr"),
                     copies = dpr::read_image(folder / "copies.exr");
    CHECK(two.pixels == copies.pixels);

    const dpr::Image black(16, 12, glm::vec4(0, 0, 0, 1));
    dpr::write_image(folder / "target.exr", black);
    for (const std::string name : {"two", "copies"}) {
      succeed(folder,
              {"gradient", "--scene", name + ".json", "--target", "target.exr", "-o", name + ".grad.json"});
    }
    const json of_two = json::parse(folder.read("two.grad.json"));
    const json of_copies = json::parse(folder.read("copies.grad.json"));
    CHECK(of_two["meshes"][1]["translation"] == of_copies["meshes"][1]["translation"]);
    for (const auto& [key, value] : of_two["meshes"][1].items()) {
      CAPTURE(key);
      CHECK(value.empty() == (key != "rotation" && key != "translation"));  // the rest is the mesh's
    }
    const auto x = [](const json& gradient, int mesh) {
      return gradient["meshes"][mesh]["positions"][0][0].get<double>();
    };
    CHECK(x(of_two, 0) == doctest::Approx(x(of_copies, 0) + x(of_copies, 1)).epsilon(1e-3));

    const json info = json::parse(succeed(folder, {"info", "two.json", "--json"}).out);
    CHECK(info["meshes"][1]["instance_of"] == 0);
    CHECK(info["meshes"][1]["faces"] == 12);
    CHECK_FALSE(info["meshes"][0].contains("instance_of"));
    CHECK(contains(succeed(folder, {"info", "two.json"}).out, "cube.ply: another place of mesh 0"));

    const auto pose =
        run_command(folder, {"pose", "--scene", "two.json", "--target", "two.exr", "-o", "p.json"});
    CHECK(pose.status == 1);
    CHECK(contains(pose.err, "--mesh (command line): got none, expected numbers of the scene's meshes"));
  }
}

}  // namespace instances_command_test
