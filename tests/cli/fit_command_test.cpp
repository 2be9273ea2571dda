// dpr fit as a user runs it: mesh, report and checkpoint; and one line for whatever is wrong.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "dpr/device.hpp"
#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"
#include "support/page.hpp"
#include "support/several_devices.hpp"

namespace fit_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::run_command;
using dpr::test::TempDir;
using nlohmann::json;

json camera(const char* view) {
  return {{"view", json::parse(view)}, {"fov_y_degrees", 50}, {"znear", 1}, {"zfar", 8}};
}

/// views.json and its images: the cube from three sides.
json write_inputs(const TempDir& folder, const std::string& extension = ".exr") {
  const char* const sides[] = {"[[1,0,0,0],[0,0.8,-0.6,0],[0,0.6,0.8,-5],[0,0,0,1]]",
                               "[[0,0,1,0],[0,1,0,0],[-1,0,0,-5],[0,0,0,1]]",
                               "[[-0.8,0,-0.6,0],[0,1,0,0],[0.6,0,-0.8,-5],[0,0,0,1]]"};
  dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
  json views = {{"width", 24}, {"height", 24}, {"views", json::array()}};
  for (int i = 0; i < 3; ++i) {
    const std::string image = "view" + std::to_string(i) + extension;
    const json scene = {
        {"width", 24}, {"height", 24}, {"camera", camera(sides[i])}, {"meshes", {{{"file", "cube.ply"}}}}};
    folder.write("scene.json", scene.dump());
    REQUIRE(
        run_command(folder, {"render", "--scene", "scene.json", "--preset", "rigid", "-o", image}).status ==
        0);
    views["views"].push_back({{"image", image}, {"camera", camera(sides[i])}});
  }
  folder.write("views.json", views.dump());
  return views;
}

const std::vector<std::string> k_short{"fit",      "--views", "views.json",   "-o", "mesh.obj",
                                       "--levels", "1",       "--iterations", "6"};

std::vector<std::string> with(std::vector<std::string> arguments, const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("dpr fit: a report that cannot be written does not cost the mesh") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    std::filesystem::create_directories(folder / "report/iterations/00002.png");
    const auto outcome = run_command(folder, with(k_short, {"--report", "report"}));
    CAPTURE(outcome.err);
    CHECK(outcome.status == 1);
    CHECK(contains(outcome.err, "00002.png"));
    CHECK_FALSE(dpr::read_mesh(folder / "mesh.obj").faces.empty());
  }

  TEST_CASE("dpr fit: depths and normals beside the images") {
    if (is_skipped()) return;
    const TempDir folder;
    json views = write_inputs(folder);
    for (int i = 0; i < 3; ++i) {
      const std::string name = "view" + std::to_string(i);
      const json scene = {{"width", 24},
                          {"height", 24},
                          {"camera", views["views"][i]["camera"]},
                          {"meshes", {{{"file", "cube.ply"}}}}};
      folder.write("scene.json", scene.dump());
      REQUIRE(run_command(folder, {"render", "--scene", "scene.json", "--preset", "rigid", "--aov",
                                   "depth,normal", "-o", name + ".exr"})
                  .status == 0);
      views["views"][i]["depth"] = name + ".depth.exr";
      views["views"][i]["normal"] = name + ".normal.exr";
    }
    const auto loss = [&](const std::vector<std::string>& options) {
      folder.write("views.json", views.dump());
      const auto outcome = run_command(folder, with(k_short, options));
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
      const std::size_t at = outcome.out.rfind(", loss ");
      return std::stod(outcome.out.substr(at + 7));
    };
    CHECK(loss({}) > loss({"--depth", "0", "--normal", "0"}));
    CHECK(loss({"--size", "12x12"}) > 0);
    REQUIRE(loss({"--report", "report", "--initial", "cube.ply", "--learning-rate", "1e-6"}) > 0);
    const json report = json::parse(folder.read("report/fit.json"));
    CHECK(report["depth_difference"].get<double>() < 1e-3);  // of the cube itself
    CHECK(report["normal_difference"].get<double>() < 1e-3);
    CHECK(contains(folder.read("report/index.html"), "depths off by"));
    const auto refuse = [&](const json& wrong, const std::vector<std::string>& options, const char* part) {
      folder.write("views.json", wrong.dump());
      const auto outcome = run_command(folder, with(k_short, options));
      CHECK(outcome.status == 1);
      CAPTURE(outcome.err);
      CHECK(contains(outcome.err, part));
    };
    json without = views;
    without["views"][0].erase("normal");  // the view that lacks one is named, be it the first
    refuse(without, {},
           "normal of views[0] (shape): got none, expected one, because there is a normal of views[1]");
    for (json& view : without["views"]) view.erase("normal");
    refuse(without, {"--normal", "2"}, "--normal (command line)");
    for (json& view : without["views"]) view.erase("depth");
    refuse(without, {"--depth", "2"}, "--depth (command line)");
  }

  TEST_CASE("dpr fit tells of depths that cannot be meant") {
    if (is_skipped()) return;
    const TempDir folder;
    json views = write_inputs(folder);
    const auto fit = [&](const char* file, const dpr::Image& depth) {
      dpr::write_image(folder / file, depth);
      for (json& view : views["views"]) view["depth"] = file;
      folder.write("views.json", views.dump());
      return run_command(folder, k_short);
    };
    const auto bytes = fit("depth.png", dpr::Image(24, 24, glm::vec4(1)));
    CHECK(bytes.status == 0);
    CHECK(contains(bytes.err, "depth.png (and others, 3 in all): whole numbers"));
    const auto parts = fit("depth.png", dpr::Image(24, 24, glm::vec4(0.5F, 0.5F, 0.5F, 1)));
    CHECK(parts.status == 1);
    CHECK(contains(parts.err, "all outside its camera's range, expected some from znear to zfar, 1 to 8"));
    views["depth_scale"] = 5;  // 0.5 is 0.74 in sRGB: before the cube
    CHECK(fit("depth.png", dpr::Image(24, 24, glm::vec4(0.5F, 0.5F, 0.5F, 1))).err.empty());
    views["depth_scale"] = 0;
    CHECK(contains(fit("depth.png", dpr::Image(24, 24, glm::vec4(1))).err, "depth_scale"));
    views.erase("depth_scale");
    dpr::Image depth(24, 24, glm::vec4(4, 4, 4, 1));
    CHECK(fit("depth.exr", depth).err.empty());
    depth.pixels[7] = glm::vec4(65504, 0, 0, 1);
    const auto far = fit("depth.exr", depth);
    CHECK(far.status == 0);
    CHECK(contains(far.err, "1 pixels of the depth of views[0], up to 65504, are not between"));
    depth.pixels[7] = glm::vec4(-4, 0, 0, 1);
    CHECK(contains(fit("depth.exr", depth).err, "depth ("));
    CHECK(contains(fit("depth.exr", depth).err, "got -4, expected the distance"));
    const auto nothing = fit("depth.exr", dpr::Image(24, 24, glm::vec4(0, 5, 5, 1)));
    CHECK(nothing.status == 1);
    CHECK(contains(nothing.err, "depth of views[0] (shape): got no pixel that counts"));
  }

  TEST_CASE("dpr fit says that opaque images do not tell where the object is") {
    if (is_skipped()) return;
    const TempDir folder;
    for (const char* const extension : {".png", ".exr"}) {
      write_inputs(folder, extension);
      const auto outcome = run_command(folder, k_short);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
      CHECK(contains(outcome.err, "colours alone") == (extension == std::string(".png")));
    }
  }

  TEST_CASE("dpr fit leaves a coloured mesh, a report that opens without a network, and a checkpoint") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const auto outcome = run_command(
        folder, with(k_short, {"--report", "report", "--checkpoint", "state", "--laplacian", "3e-3"}));
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    const dpr::Mesh mesh = dpr::read_mesh(folder / "mesh.obj");
    CHECK(mesh.vertex_colors.size() == mesh.positions.size());
    const std::string page = folder.read("report/index.html");
    for (const char* picture : {"targets.png", "results.png", "differences.png", "turntable.png",
                                "target.png", "start.png", "iterations/00000.png", "iterations/00005.png"}) {
      CHECK(std::filesystem::is_regular_file(folder / ("report/" + std::string(picture))));
      CHECK(contains(page, "src=\"" + std::string(picture) + "\""));
    }
    CHECK_FALSE(contains(dpr::test::own_text(page), "http"));
    const json data = json::parse(folder.read("report/fit.json"));
    CHECK(data["history"].size() == 6);
    CHECK(data["history"][0]["mesh_loss"].get<double>() > 0);
    CHECK(data["vertices"] == mesh.positions.size());
    CHECK(contains(page, "image 2"));
    CHECK(contains(page, "iteration 5, level 1"));
    // Nothing is left to do, so the same mesh comes out.
    const std::string before = folder.read("mesh.obj");
    REQUIRE(run_command(folder, with(k_short, {"--checkpoint", "state", "--laplacian", "3e-3"})).status == 0);
    CHECK(folder.read("mesh.obj") == before);
  }

  TEST_CASE("dpr fit --texture gives the mesh a texture, with room for its triangles") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const auto outcome = run_command(folder, with(k_short, {"--texture", "160", "--report", "report"}));
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    CHECK(contains(folder.read("report/index.html"), "160x160 texels, mean squared difference"));
    const dpr::Mesh mesh = dpr::read_mesh(folder / "mesh.obj");
    REQUIRE(mesh.textures.size() == 1);
    CHECK(mesh.textures[0].width == 160);
    CHECK(mesh.vertex_colors.empty());
    const auto small = run_command(folder, with(k_short, {"--texture", "4"}));
    CHECK(small.status == 0);
    CHECK(contains(small.err, "texels a side, the least for"));
    const dpr::Mesh least = dpr::read_mesh(folder / "mesh.obj");
    REQUIRE(least.textures.size() == 1);
    CHECK((least.textures[0].width > 4 && least.textures[0].width < 160));
    for (const char* const side : {"0", "16385", ""}) {
      const auto refused = run_command(folder, with(k_short, {"--texture", side}));
      CHECK(refused.status == 1);
      CHECK(contains(refused.err, "from 1 to 16384"));
    }
    const auto ply =
        run_command(folder, {"fit", "--views", "views.json", "-o", "mesh.ply", "--texture", "64"});
    CHECK(ply.status == 1);
    CHECK(contains(ply.err, ".obj or .glb"));
  }

  TEST_CASE("dpr fit tells which images are not explained, in one line, a file and a page") {
    if (is_skipped()) return;
    const TempDir folder;
    json views = write_inputs(folder);
    const std::vector<std::string> still =
        with(k_short, {"--initial", "cube.ply", "--learning-rate", "1e-6", "--color-learning-rate", "0",
                       "--report", "report"});
    const auto right = run_command(folder, still);
    CHECK(!contains(right.out, "not explained"));
    CHECK(json::parse(folder.read("report/fit.json"))["explained"] == true);
    views["views"][1]["camera"] = camera("[[0.34,0,0.94,0],[0,1,0,0],[-0.94,0,0.34,-5],[0,0,0,1]]");
    folder.write("views.json", views.dump());
    const auto wrong = run_command(folder, still);
    CAPTURE(wrong.out);
    CHECK(wrong.status == 0);
    CHECK(wrong.err.empty());
    CHECK(contains(wrong.out, "\n1 of 3 images is not explained: image 1 (view1.exr, IoU 0."));
    CHECK(contains(wrong.out, "--refine-cameras is for cameras a few pixels off.\n"));
    const json numbers = json::parse(folder.read("report/fit.json"));
    CHECK(numbers["explained"] == false);
    for (std::size_t i = 0; i < 3; ++i) {
      const json& view = numbers["views"][i];
      CHECK(view["image"] == "view" + std::to_string(i) + ".exr");
      CHECK(view["explained"] == (i != 1));
      CHECK((view["iou"] > 0.9) == (i != 1));
      CHECK(view["unexplained_part"] > 0);
    }
    const std::string page = folder.read("report/index.html");
    CHECK(contains(page, "src=\"worst_differences.png\""));
    CHECK(contains(page, "<td>view1.exr</td>"));
    if (contains(page, "class=\"model\"")) {
      CHECK(contains(page,
                     "{\"label\":\"1\",\"name\":\"image 1, view1.exr, not explained\",\"standsOut\":true"));
      CHECK(contains(page, "{\"label\":\"2\",\"name\":\"image 2, view2.exr\",\"standsOut\":false"));
    }
    CHECK(run_command(folder, with(still, {"--quiet"})).out.empty());
  }

  TEST_CASE("dpr fit names the images that are explained worst, and counts the others") {
    if (is_skipped()) return;
    const TempDir folder;
    json views = write_inputs(folder);
    for (int i = 0; i < 3; ++i) views["views"].push_back(views["views"][i]);
    for (json& view : views["views"]) view["camera"]["view"][2][3] = -3;
    folder.write("views.json", views.dump());
    const auto outcome =
        run_command(folder, with(k_short, {"--initial", "cube.ply", "--learning-rate", "1e-6"}));
    CAPTURE(outcome.out);
    CHECK(contains(outcome.out, "6 of 6 images are not explained: image "));
    CHECK(contains(outcome.out, "); and 3 others. The image"));
  }

  TEST_CASE("dpr fit tells of silhouettes that bound no shape") {
    if (is_skipped()) return;
    const TempDir folder;
    json views = write_inputs(folder);
    const auto notes_of_fit = [&] {
      const auto outcome = run_command(folder, k_short);
      CHECK(outcome.status == 0);
      return outcome.err;
    };
    CHECK(!contains(notes_of_fit(), "bound no shape"));
    views["views"][0]["image"] = "empty.exr";
    dpr::write_image(folder / "empty.exr", dpr::Image(24, 24));
    folder.write("views.json", views.dump());
    CHECK(contains(notes_of_fit(), "silhouettes and depths bound no shape"));
  }

  TEST_CASE("dpr fit: an initial mesh, images without alpha, a smoothing, another size, PLY") {
    if (is_skipped()) return;
    const TempDir folder;
    json views = write_inputs(folder);
    dpr::write_image(folder / "view1.ppm", dpr::read_image(folder / "view1.exr"));
    dpr::write_mesh(folder / "start.obj", dpr::make_icosphere(1));
    views["views"][1]["image"] = "view1.ppm";
    views["initial"] = "start.obj";
    views["background"] = {0, 0, 0};
    views["smoothing"] = {{"preset", "softras"}, {"sigma", 1e-4}, {"gamma", 1e-3}};
    folder.write("views.json", views.dump());
    const auto outcome =
        run_command(folder, {"fit",      "--views", "views.json",   "-o",       "mesh.ply",
                             "--levels", "1",       "--iterations", "3",        "--remesh-interval",
                             "0",        "--steps", "direct",       "--size",   "16x16",
                             "--sigma",  "3e-4",    "--schedule",   "adaptive", "--report",
                             "report"});
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    CHECK(dpr::read_mesh(folder / "mesh.ply").faces == dpr::make_icosphere(1).faces);
    const json history = json::parse(folder.read("report/fit.json"))["history"];
    CHECK(history[0]["width"] == 16);
    CHECK(history[0]["height"] == 16);
    CHECK(history[0]["sigma"].get<double>() == doctest::Approx(25 * 3e-4));  // --blur is 5 times --blur-end
    CHECK(history[0]["gamma"].get<double>() == doctest::Approx(5 * 1e-3));   // the file's
    // An image without alpha has no silhouette: something must compare its colours.
    const auto with_losses = [&](const std::vector<std::string>& losses) {
      return run_command(folder, with({"fit", "--views", "views.json", "-o", "mesh.ply", "--levels", "1",
                                       "--iterations", "1", "--l1", "0"},
                                      losses));
    };
    const auto refused = with_losses({});
    CHECK(refused.status == 1);
    CHECK(contains(refused.err, "silhouettes alone"));
    CHECK(with_losses({"--ssim", "1"}).status == 0);
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("dpr fit --refine-cameras moves cameras, and writes a views file that has them") {
    if (is_skipped()) return;
    const TempDir folder;
    json views = write_inputs(folder);
    views["background"] = {0, 0, 0};
    views["views"][1].erase("camera");
    views["views"][1]["camera"] = camera("[[0.01,0,1,0],[0,1,0,0.05],[-1,0,0.01,-5],[0,0,0,1]]");
    folder.write("views.json", views.dump());
    std::filesystem::create_directories(folder / "found");
    const auto fit = [&](const std::string& file, const std::vector<std::string>& more) {
      const auto outcome = run_command(
          folder,
          with({"fit", "--views", file, "-o", "mesh.obj", "--levels", "1", "--iterations", "6"}, more));
      CAPTURE(outcome.err);
      REQUIRE(outcome.status == 0);
    };
    fit("views.json", {"--refine-cameras", "--size", "12x12", "--save-views", "found/views.json"});
    json found = json::parse(folder.read("found/views.json"));
    CHECK(found["views"][0]["image"] == "../view0.exr");
    for (std::size_t i = 0; i < 3; ++i) {
      json &now = found["views"][i]["camera"]["view"], &before = views["views"][i]["camera"]["view"];
      double most = 0;
      for (std::size_t row = 0; row < 4; ++row) {
        for (std::size_t column = 0; column < 4; ++column) {
          const double difference = now[row][column].get<double>() - before[row][column].get<double>();
          most = std::max(most, std::abs(difference));
        }
      }
      CHECK(most > 1e-3);
      CHECK(most < 0.5);
      now = before;
      found["views"][i]["image"] = views["views"][i]["image"];
    }
    CHECK(found == views);  // nothing else has changed
    fit("found/views.json", {"--save-views", "again.json"});
    const json again = json::parse(folder.read("again.json"));
    CHECK(again["views"][2]["camera"] ==
          json::parse(folder.read("found/views.json"))["views"][2]["camera"]);  // they stay
    CHECK(again["views"][2]["image"] == "view2.exr");
  }

  TEST_CASE(
      "dpr fit on parts of the CPU is that on the whole with chunks as large; a checkpoint goes on there") {
    if (is_skipped() || !dpr::test::is_divisible(dpr::open_device("cpu"))) return;
    const TempDir folder;
    write_inputs(folder);
    const auto fit = [&](const std::vector<std::string>& more) {
      const auto outcome = run_command(folder, with(k_short, more));
      CAPTURE(outcome.err);
      REQUIRE(outcome.status == 0);
      CHECK(outcome.err.empty());
      return folder.read("mesh.obj");
    };
    const std::string parts = fit({"--device", "cpu/2"});
    CHECK(parts == fit({"--device", "0/2"}));
    CHECK(parts == fit({"--device", "cpu", "--chunk", "1"}));
    fit({"--device", "cpu/2", "--checkpoint", "state"});
    CHECK(fit({"--device", "cpu", "--checkpoint", "state"}) == parts);  // nothing is left to do
    CHECK(run_command(folder, with(k_short, {"--device", "cpu,cpu"})).status == 1);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("dpr fit: what is wrong is one line, and nothing is left behind") {
    if (is_skipped()) return;
    const TempDir folder;
    const json good = write_inputs(folder);
    dpr::write_image(folder / "small.exr", dpr::Image(8, 8, glm::vec4(1)));
    folder.write("garbage", "no checkpoint");
    const std::size_t entries = folder.entries();
    const auto fails = [&](const json& views, const std::vector<std::string>& arguments, const char* word) {
      folder.write("views.json", views.dump());
      const auto outcome = run_command(folder, arguments);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 1);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK(contains(outcome.err, word));
      CHECK(folder.entries() == entries);
    };
    const auto changed = [&](auto change) {
      json views = good;
      change(views);
      return views;
    };
    fails(changed([](json& v) { v["views"][1]["image"] = "missing.exr"; }), k_short, "missing.exr");
    fails(changed([](json& v) { v["views"][1]["image"] = "small.exr"; }), k_short, "8x8");
    fails(changed([](json& v) { v["views"] = json::array(); }), k_short, "views");
    fails(changed([](json& v) { v["focus"] = 1; }), k_short, "focus");
    fails(changed([](json& v) { v["views"][0]["images"] = 1; }), k_short, "images");
    fails(changed([](json& v) { v["initial"] = "missing.obj"; }), k_short, "missing.obj");
    fails(changed([](json& v) { v.erase("width"); }), k_short, "width");
    fails(good, with(k_short, {"--checkpoint", "garbage"}), "garbage");
    fails(good, with(k_short, {"--checkpoint", "/dev/zero"}),
          "/dev/zero: is no regular file and does not end");
    fails(good, with(k_short, {"--steps", "small"}), "small");
    fails(good, with(k_short, {"--schedule", "sometimes"}), "sometimes");
    fails(good, with(k_short, {"--blur", "0"}), "--blur (command line)");
    fails(good, with(k_short, {"--edge", "-1"}), "--edge (command line)");
    fails(good, with(k_short, {"--laplacian", ""}),
          "--laplacian (command line): got \"\", expected a number");
    fails(good, with(k_short, {"--sigma", ""}), "--sigma (command line): got \"\", expected a number");
    fails(good, with(k_short, {"--blur-end", "0"}), "--blur-end (command line)");
    fails(good, with(k_short, {"--camera-learning-rate", "0"}), "--camera-learning-rate (command line)");
    fails(good, with(k_short, {"--camera-learning-rate", "0.1"}),
          "--camera-learning-rate (command line): got one without --refine-cameras");
    fails(good, with(k_short, {"--robust-scale", "0.1"}),
          "--robust-scale (command line): got one without --robust");
    fails(good, with(k_short, {"--checkpoint-interval", "9"}), "got one without --checkpoint");
    fails(changed([](json& v) { v["initial"] = "none.ply"; }), k_short, "none.ply");
    fails(good, with(k_short, {"--save-views", "nowhere/views.json"}), "nowhere");
    fails(changed([](json& v) { v["views"] = json::array({v["views"][0]}); }),
          with(k_short, {"--refine-cameras"}), "at least two");
    fails(good, with(k_short, {"--laplacian", "-1"}), "weight");
    fails(good, {"fit", "--views", "views.json", "-o", "mesh.stl"}, "mesh.stl");
    fails(good, {"fit", "--views", "views.json", "-o", "nowhere/mesh.obj"}, "nowhere");
    fails(good, {"fit", "--views", "none.json", "-o", "mesh.obj", "--report", "report"}, "none.json");
    fails(good, {"fit", "--views", "views.json", "-o", "/proc/mesh.obj"}, "cannot be written");
    fails(good, with(k_short, {"--size", "100000x100000"}), "16384");
    fails(good, with(k_short, {"--size", "32x16"}), "proportions");
    fails(good, with(k_short, {"--edge", "1e-6"}), "edge length");
    CHECK(folder.read("garbage") == "no checkpoint");
  }

  TEST_CASE("dpr fit --initial takes the place of the views file's mesh, which is not read") {
    if (is_skipped()) return;
    const TempDir folder;
    json views = write_inputs(folder);
    views["initial"] = "none.ply";
    folder.write("views.json", views.dump());
    const auto outcome = run_command(folder, with(k_short, {"--initial", "cube.ply"}));
    CAPTURE(outcome.err);
    CHECK(outcome.status == 0);
  }

  TEST_CASE("dpr fit: an output that finds no room is an error that names it") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    std::filesystem::create_directories(folder / "report");
    for (const std::string name : {"mesh.ply", "mesh.obj", "report/targets.png", "report/plot.png",
                                   "report/fit.json", "report/index.html"}) {
      std::filesystem::create_symlink("/dev/full", folder / name);
      const bool is_mesh = name.starts_with("mesh");
      const auto outcome =
          run_command(folder, {"fit", "--views", "views.json", "-o", is_mesh ? name : "good.obj", "--levels",
                               "1", "--iterations", "2", "--report", "report"});
      CAPTURE(outcome.err);
      CHECK(outcome.status == 1);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK(contains(outcome.err, name + ": cannot be written: No space left on device"));
      std::filesystem::remove(folder / name);
    }
  }

  TEST_CASE("dpr fit finds the cameras and the light of photographs, and keeps the template's faces") {
    if (is_skipped()) return;
    const TempDir folder;
    json views = write_inputs(folder);
    const json known = views["views"][0]["camera"];
    views["views"] = json::array({{{"image", "view0.exr"}, {"initial_camera", known}}});
    folder.write("views.json", views.dump());
    const auto arguments = with(k_short, {"--initial", "cube.ply", "--ssim", "0", "--report", "report",
                                          "--save-views", "found.json"});
    const auto outcome = run_command(folder, arguments);
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    CHECK(contains(outcome.out, "image 0: looking for its camera"));
    CHECK(dpr::read_mesh(folder / "mesh.obj").faces == dpr::make_cube().faces);
    const json data = json::parse(folder.read("report/fit.json"));
    CHECK(data["harmonics"].size() == 9);
    CHECK(data["lights"]["harmonics"] == data["harmonics"]);
    REQUIRE(data["cameras"].size() == 1);
    CHECK(std::abs(data["cameras"][0]["fov_y_degrees"].get<double>() - 50) < 5);
    const json found = json::parse(folder.read("found.json"))["views"][0];
    CHECK_FALSE(found.contains("initial_camera"));
    CHECK(found["camera"]["fov_y_degrees"] == data["cameras"][0]["fov_y_degrees"]);
    const auto refused = run_command(folder, with(arguments, {"--light", "gain"}));
    CHECK(refused.status == 1);
    CHECK(contains(refused.err, "--light"));
    const auto templateless = run_command(folder, k_short);
    CHECK(templateless.status == 1);
    CHECK(contains(templateless.err, "initial"));
  }
}

}  // namespace fit_command_test
