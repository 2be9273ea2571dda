// The command when something is wrong: its exit status, one line on stderr, and no output left behind. Runs
// where the environment variable DPR_CLI names the command.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace cli_test {

using dpr::test::is_error_line;
using dpr::test::is_skipped;
using dpr::test::Outcome;
using dpr::test::run_command;
using dpr::test::TempDir;

namespace {

namespace fs = std::filesystem;

/// A mesh, a scene that shows it, and an image of another size than the scene's.
void write_inputs(const TempDir& folder) {
  dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
  folder.write("scene.json",
               R"({"width": 16, "height": 12, "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-6.7],
      [0,0,0,1]]}, "meshes": [{"file": "cube.ply"}]})");
  dpr::write_image(folder / "target.exr", dpr::Image(16, 12, glm::vec4(0.5F)));
  dpr::write_image(folder / "other.exr", dpr::Image(16, 16, glm::vec4(0.5F)));
}

std::vector<std::string> files(const TempDir& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder.path()))
    names.push_back(entry.path().string());
  std::ranges::sort(names);
  return names;
}

/// The command fails with that status, says one line that names the part, and leaves the folder as it was.
void check_fails(const TempDir& folder, int status, const std::string& part,
                 const std::vector<std::string>& arguments, const std::string& environment = "") {
  std::string line;
  for (const std::string& argument : arguments) line += " " + argument;
  CAPTURE(line);
  const std::vector<std::string> before = files(folder);
  const Outcome outcome = run_command(folder, arguments, environment);
  CAPTURE(outcome.err);
  CHECK(outcome.status == status);
  CHECK(is_error_line(outcome.err));
  CHECK(dpr::test::contains(outcome.err, part));
  CHECK(files(folder) == before);
}

/// A good command, and more arguments.
std::vector<std::string> render(std::vector<std::string> more) {
  more.insert(more.begin(), {"render", "cube.ply", "-o", "a.png"});
  return more;
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("cli: right input gives status 0, the output, and nothing on stderr") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const std::size_t before = files(folder).size();
    const std::vector<std::vector<std::string>> commands{
        {"render", "cube.ply", "-o", "a.png", "--size", "16x16"},
        {"render", "--scene", "scene.json", "-o", "b.exr"},
        {"gradient", "--scene", "scene.json", "--target", "target.exr", "-o", "c.json"},
        {"render", "--scene", "scene.json", "-o", "d.exr", "--device", "cpu", "--sigma", "1e-4", "--quiet"}};
    for (const std::vector<std::string>& command : commands) {
      const Outcome outcome = run_command(folder, command);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 0);
      CHECK(outcome.err.empty());
    }
    CHECK(files(folder).size() == before + commands.size());
    CHECK(dpr::read_image(folder / "a.png").width == 16);
    CHECK(dpr::read_image(folder / "b.exr").height == 12);
    CHECK(run_command(folder, {"--help"}).status == 0);
    folder.write("behind.json",
                 R"({"width": 16, "height": 12, "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,6.7],
      [0,0,0,1]]}, "meshes": [{"file": "cube.ply"}]})");
    const Outcome empty = run_command(folder, {"render", "--scene", "behind.json", "-o", "empty.png"});
    CHECK(empty.status == 0);
    CHECK(empty.err.find("the picture is empty") != std::string::npos);
    CHECK(run_command(folder, {"render", "--help"}).status == 0);
    CHECK(run_command(folder, {"devices"}).status == 0);
    // An existing output is replaced.
    CHECK(run_command(folder, {"render", "cube.ply", "-o", "a.png", "--size", "20x10"}).status == 0);
    CHECK(dpr::read_image(folder / "a.png").width == 20);
  }

  TEST_CASE("cli: it finds its parts where it is itself found in the PATH") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const std::string own = fs::path(dpr::test::program_path("DPR_CLI")).parent_path().string();
    const Outcome outcome = dpr::test::run_program(
        "dpr", folder, {"render", "cube.ply", "-o", "a.exr", "--size", "8x8"}, "PATH=" + own);
    CHECK(outcome.err.empty());
    CHECK(outcome.status == 0);
  }

  TEST_CASE("cli: what is mistyped is named, with what is nearest to it") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    check_fails(folder, 1, "unknown command \"rendr\", expected render, or a command that \"dpr --help\"",
                {"rendr"});
    check_fails(folder, 1, "unknown command \"draw\", expected a command", {"draw"});
    check_fails(
        folder, 1,
        "unknown option \"--elevaton\", expected --elevation, or an option that \"dpr render --help\"",
        {"render", "cube.ply", "--elevaton", "3"});
    check_fails(folder, 1, "unknown option \"--colour\", expected an option",
                {"render", "cube.ply", "-o", "a.png", "--colour", "red"});
    check_fails(folder, 1, "(dpr): got the unknown option \"-x\"", {"-x"});
    check_fails(folder, 1, "got no --output, expected --output OUT.png, as \"dpr render --help\"",
                {"render", "cube.ply"});
    check_fails(folder, 1, "got no FILE, expected FILE, as", {"info"});
    check_fails(folder, 1, "got the extension \"\"", {"render", "cube.ply", "-o", ""});
  }

  TEST_CASE("cli: messages of the options' library are in our words") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    check_fails(folder, 1, "dpr: error: --sigma (command line): got \"x\", expected a number\n",
                render({"--sigma", "x"}));
    check_fails(folder, 1, "--samples (command line): got \"1.5\", expected a whole number\n",
                render({"--samples", "1.5"}));
    check_fails(folder, 1, "got \"-1\", expected a whole number that is not negative",
                render({"--samples", "-1"}));
    check_fails(folder, 1, "got \"99999999999\", expected a smaller number",
                render({"--samples", "99999999999"}));
    check_fails(folder, 1,
                "--memory-budget (command line): got \"0\", expected a number from 1 to 1073741824",
                render({"--memory-budget", "0"}));
    check_fails(folder, 1, "--size (command line): got no value, expected WxH", render({"--size"}));
    check_fails(folder, 1, "--size (command line): got 2 values, expected one value",
                render({"--size", "8x8", "--size", "8x8"}));
    check_fails(folder, 1, "--quiet (command line): got \"maybe\", expected no value",
                render({"--quiet=maybe"}));
    check_fails(folder, 1, "(dpr render): got both --quiet and --verbose, expected one of the two",
                render({"--quiet", "--verbose"}));
    check_fails(folder, 1, "got both MESH (cube.ply) and --scene, expected one of the two",
                render({"--scene", "scene.json"}));
    check_fails(folder, 1, "got neither MESH nor --scene, expected one of the two",
                {"render", "-o", "a.png"});
  }

  TEST_CASE("cli: an output without -o is told how it is given") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    check_fails(folder, 1, "got \"a.png\", which belongs to no option, expected -o a.png for a file to write",
                {"render", "cube.ply", "a.png"});
    check_fails(folder, 1, "got both MESH (a.png) and --scene, expected -o a.png for a file to write",
                {"render", "--scene", "scene.json", "a.png"});
    check_fails(folder, 1, "got \"c.png\", which belongs to no option, expected what \"dpr render --help\"",
                {"render", "cube.ply", "-o", "a.png", "c.png"});
  }

  TEST_CASE("cli: a file that another option names is not written over") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    fs::create_symlink("scene.json", folder / "link.json");
    const std::string mesh = folder.read("cube.ply"), scene = folder.read("scene.json");
    check_fails(folder, 1,
                "--save-scene (command line): got \"cube.ply\", the file of MESH, expected another",
                {"render", "cube.ply", "-o", "a.png", "--save-scene", "cube.ply"});
    check_fails(folder, 1, "--output (command line): got \"a.png\", the file of --save-scene",
                {"render", "cube.ply", "-o", "a.png", "--save-scene", "./a.png"});
    check_fails(folder, 1, "got \"target.exr\", the file of --target",
                {"pose", "--scene", "scene.json", "--target", "target.exr", "-o", "target.exr"});
    check_fails(folder, 1, "got \"link.json\", the file of --scene",
                {"gradient", "--scene", "scene.json", "--target", "target.exr", "-o", "link.json"});
    CHECK(folder.read("cube.ply") == mesh);
    CHECK(folder.read("scene.json") == scene);
    CHECK(run_command(folder,
                      {"gradient", "--scene", "scene.json", "--target", "target.exr", "-o", "/dev/null"})
              .status == 0);
  }

  TEST_CASE("cli: without arguments it prints its help") {
    if (is_skipped()) return;
    const TempDir folder;
    const Outcome bare = run_command(folder, {});
    CHECK(bare.status == 0);
    CHECK(bare.err.empty());
    CHECK(bare.out == run_command(folder, {"--help"}).out);
  }

  TEST_CASE("cli: the help of a command that was not built says how to get it") {
    if (is_skipped()) return;
    const TempDir folder;
    fs::copy_file(dpr::test::program_path("DPR_CLI"), folder / "dpr");
    const std::string program = (folder / "dpr").string();
    for (const char* const command : {"learn", "bench"}) {
      const Outcome help = dpr::test::run_program(program, folder, {command, "--help"});
      CHECK(help.status == 0);
      CHECK(help.err.empty());
      CHECK(dpr::test::contains(help.out, std::string("This build has no dpr-") + command));
      CHECK(dpr::test::contains(help.out, "cmake --preset release"));
      const Outcome use = dpr::test::run_program(program, folder, {command});
      CHECK(use.status == 1);
      CHECK(is_error_line(use.err));
    }
  }

  TEST_CASE("cli: ranges name the option, or the file and its key") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    check_fails(folder, 1, "error: --sigma (command line): got -1, expected a finite number > 0",
                render({"--sigma", "-1"}));
    check_fails(folder, 1, "error: --azimuth (command line): got nan", render({"--azimuth", "nan"}));
    check_fails(folder, 1, "error: --elevation (command line): got 90, expected an angle",
                render({"--elevation", "90"}));
    check_fails(folder, 1, "error: --estimator (command line): got monte_carlo with the uniform prior",
                render({"--estimator", "monte_carlo", "--depth-prior", "uniform", "--noise", "triangle"}));
    folder.write("wrong.json", R"({"meshes": [{"file": "cube.ply"}], "smoothing": {"sigma": -1}})");
    folder.write("samples.json", R"({"meshes": [{"file": "cube.ply"}], "smoothing": {"samples": 4}})");
    folder.write("near.json", R"({"meshes": [{"file": "cube.ply"}], "camera": {"znear": -1}})");
    const auto scene = [](const std::string& file, std::vector<std::string> more) {
      more.insert(more.begin(), {"render", "--scene", file, "-o", "a.png"});
      return more;
    };
    check_fails(folder, 1, "error: smoothing.sigma (wrong.json): got -1", scene("wrong.json", {}));
    check_fails(folder, 1, "error: smoothing.sigma (wrong.json): got -1",
                scene("wrong.json", {"--gamma", "1"}));
    check_fails(folder, 1, "error: --samples (command line): got 0",
                scene("samples.json", {"--samples", "0"}));
    check_fails(folder, 1, "error: camera.znear (near.json): got -1", scene("near.json", {}));
  }

  TEST_CASE("cli: a memory budget makes bands, and the same image") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const std::vector<std::string> render{"render", "cube.ply", "--size", "256x256", "-o"};
    const auto with = [&](std::vector<std::string> more) {
      more.insert(more.begin(), render.begin(), render.end());
      return run_command(folder, more);
    };
    CHECK(dpr::test::contains(with({"whole.exr", "--verbose"}).out, "in 1 bands"));
    const Outcome banded = with({"banded.exr", "--verbose", "--memory-budget", "1"});
    CHECK(dpr::test::contains(banded.out, " bands, "));
    CHECK_FALSE(dpr::test::contains(banded.out, "in 1 bands"));
    CHECK(dpr::read_image(folder / "whole.exr").pixels == dpr::read_image(folder / "banded.exr").pixels);
  }

  TEST_CASE("cli: auxiliary outputs lie beside the image") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    folder.write(
        "square.obj",
        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n");
    const std::size_t before = files(folder).size();
    const Outcome all =
        run_command(folder, {"render", "square.obj", "-o", "a.png", "--size", "16x12", "--aov",
                             "depth,normal,face_id,barycentrics,uv,effective_faces"});
    CAPTURE(all.err);
    CHECK(all.status == 0);
    CHECK(files(folder).size() == before + 7);
    for (const char* name : {"depth", "normal", "face_id", "barycentrics", "uv", "effective_faces"}) {
      CHECK(dpr::read_image(folder / (std::string("a.") + name + ".exr")).height == 12);
    }
    CHECK(dpr::read_image(folder / "a.face_id.exr").at(8, 6).a == 1);
    CHECK(run_command(folder, {"render", "--aov", "depth", "square.obj", "-o", "a.png", "--size", "16x12"})
              .status == 0);
    const Outcome sampled =
        run_command(folder, {"render", "--scene", "scene.json", "-o", "b.exr", "--preset", "paper_gaussian",
                             "--verbose", "--aov", "standard_error,gradient_standard_error"});
    CHECK(sampled.status == 0);
    CHECK(dpr::test::contains(sampled.out, "standard error of the colours: "));
    CHECK(dpr::read_image(folder / "b.standard_error.exr").width == 16);
    CHECK(dpr::read_image(folder / "b.gradient_standard_error.exr").width == 16);

    check_fails(folder, 1, "nonsense", {"render", "square.obj", "-o", "c.png", "--aov", "depth,nonsense"});
    check_fails(folder, 1, "no texture coordinates", {"render", "cube.ply", "-o", "c.png", "--aov", "uv"});
  }

  TEST_CASE("cli: presets of the size of the image") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const auto render = [&](const std::string& output, const std::vector<std::string>& more) {
      std::vector<std::string> words{"render", "--scene", "scene.json", "--size", "40x20", "-o", output};
      words.insert(words.end(), more.begin(), more.end());
      CHECK(run_command(folder, words).status == 0);
      return dpr::read_image(folder / output).pixels;
    };
    const auto preset = render("a.exr", {"--preset", "opendr"});
    CHECK(preset == render("b.exr", {"--preset", "opendr", "--sigma", "0.1"}));  // 2 / 20
    CHECK(preset != render("c.exr", {"--preset", "opendr", "--sigma", "0.2"}));
    render("d.exr", {"--preset", "nmr", "--occupancy-width", "variable"});
    check_fails(folder, 1, "--occupancy-width (command line)",
                {"render", "--scene", "scene.json", "-o", "e.exr", "--occupancy-width", "variable"});
  }

  TEST_CASE("cli: wrong files") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    std::string mesh = folder.read("cube.ply");
    folder.write("truncated.ply", mesh.substr(0, mesh.size() * 2 / 3));
    folder.write("truncated.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n");
    folder.write("empty.obj", "");
    folder.write("unknown_key.json", R"({"meshes": [{"file": "cube.ply"}], "smoothing": {"sigmma": 1e-3}})");
    folder.write("broken.json", "{\"width\": 16,\n \"height\": ]}");
    folder.write("lost_mesh.json", R"({"meshes": [{"file": "lost.ply"}]})");
    folder.write("wrong_value.json", R"({"meshes": [{"file": "cube.ply"}], "smoothing": {"sigma": -1}})");
    folder.write("not_an_image.exr", "nothing");

    check_fails(folder, 1, "missing.obj", {"render", "missing.obj", "-o", "o.png"});
    check_fails(folder, 1, "truncated.ply", {"render", "truncated.ply", "-o", "o.png"});
    check_fails(folder, 1, "truncated.off", {"render", "truncated.off", "-o", "o.png"});
    check_fails(folder, 1, "empty.obj", {"render", "empty.obj", "-o", "o.png"});
    check_fails(folder, 1, "missing.json", {"render", "--scene", "missing.json", "-o", "o.png"});
    check_fails(folder, 1, "sigmma", {"render", "--scene", "unknown_key.json", "-o", "o.png"});
    check_fails(folder, 1, "broken.json", {"render", "--scene", "broken.json", "-o", "o.png"});
    check_fails(folder, 1, "lost.ply", {"render", "--scene", "lost_mesh.json", "-o", "o.png"});
    check_fails(folder, 1, "sigma", {"render", "--scene", "wrong_value.json", "-o", "o.png"});
    const auto gradient = [](const std::string& target, const std::string& output) {
      return std::vector<std::string>{"gradient", "--scene", "scene.json", "--target", target, "-o", output};
    };
    check_fails(folder, 1, "16x16", gradient("other.exr", "g.json"));
    check_fails(folder, 1, "not_an_image.exr", gradient("not_an_image.exr", "g.json"));
    check_fails(folder, 1, "missing.exr", gradient("missing.exr", "g.json"));
    check_fails(folder, 1, "no_folder", gradient("target.exr", "no_folder/g.json"));
  }

  TEST_CASE("cli: outputs that cannot be written") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    fs::create_directories(folder / "folder.png");
    check_fails(folder, 1, "no_folder", {"render", "cube.ply", "-o", "no_folder/o.png"});
    check_fails(folder, 1, "folder.png", {"render", "cube.ply", "-o", "folder.png"});
    check_fails(folder, 1, "o.nonsense", {"render", "cube.ply", "-o", "o.nonsense"});
    fs::create_directories(folder / "a.depth.exr");
    // Without a device nothing can have been rendered: these are found out before.
    const TempDir no_vendors;
    const std::string environment = "OCL_ICD_VENDORS=" + no_vendors.path().string();
    check_fails(folder, 1, "o.nonsense", {"render", "cube.ply", "-o", "o.nonsense"}, environment);
    check_fails(folder, 1, "a.depth.exr", {"render", "cube.ply", "-o", "a.png", "--aov", "depth"},
                environment);
    const auto compare = [](const std::string& command, const std::string& target,
                            const std::string& output) {
      return std::vector<std::string>{command, "--scene", "scene.json", "--target", target, "-o", output};
    };
    for (const char* const command : {"gradient", "pose"}) {
      check_fails(folder, 1, "no_folder", compare(command, "target.exr", "no_folder/g.json"), environment);
      check_fails(folder, 1, "size of --target other.exr (command line): got 16x16, expected 16x12",
                  compare(command, "other.exr", "g.json"), environment);
    }
  }

  TEST_CASE("cli: wrong arguments") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const auto render = [](std::vector<std::string> more) {
      std::vector<std::string> words{"render", "--scene", "scene.json", "-o", "o.png"};
      words.insert(words.end(), more.begin(), more.end());
      return words;
    };
    check_fails(folder, 1, "no such device", render({"--device", "no such device"}));
    check_fails(folder, 1, "no such device", render({}), "DPR_DEVICE=no such device");
    check_fails(folder, 1, "a scene is given by --scene", {"render", "scene.json", "-o", "o.png"});
    check_fails(folder, 1, "--samples", render({"--samples", "0"}));
    check_fails(folder, 1, "--draws", render({"--draws", "mirrored"}));
    check_fails(folder, 1, "even number",
                render({"--estimator", "monte_carlo", "--draws", "antithetic", "--samples", "3"}));
    check_fails(
        folder, 1, "at least 2",
        render({"--estimator", "monte_carlo", "--variance-reduction", "leave_one_out", "--samples", "1"}));
    check_fails(folder, 1, "sigma", render({"--sigma", "nan"}));
    check_fails(folder, 1, "--size", render({"--size", "0x16"}));
    check_fails(folder, 1, "--memory-budget", render({"--memory-budget", "0"}));
    check_fails(folder, 1, "nonsense", render({"--depth-prior", "nonsense"}));
    check_fails(folder, 1, "--nonsense", render({"--nonsense"}));
    check_fails(folder, 1, "nonsense", {"nonsense"});
    check_fails(folder, 1, "--output", {"render", "cube.ply"});
    check_fails(folder, 1, "nonsense",
                {"gradient", "--scene", "scene.json", "--target", "target.exr", "--loss", "nonsense", "-o",
                 "g.json"});
  }

  TEST_CASE("cli: without an OpenCL device the status is 2") {
    if (is_skipped()) return;
    const TempDir folder, no_vendors;
    write_inputs(folder);
    const std::string environment = "OCL_ICD_VENDORS=" + no_vendors.path().string();
    check_fails(folder, 2, "OpenCL device", {"render", "cube.ply", "-o", "o.png"}, environment);
    check_fails(folder, 2, "OpenCL device",
                {"gradient", "--scene", "scene.json", "--target", "target.exr", "-o", "g.json"}, environment);
    // Wrong input is found out before the device is looked for.
    check_fails(folder, 1, "missing.obj", {"render", "missing.obj", "-o", "o.png"}, environment);
    CHECK(run_command(folder, {"devices"}, environment).status == 0);
  }

  TEST_CASE("cli: what is no error line is told apart") {
    CHECK(is_error_line("dpr: error: mesh (x.obj): got nothing, expected a mesh\n"));
    CHECK_FALSE(is_error_line(""));
    CHECK_FALSE(is_error_line("dpr: error: \n"));
    CHECK_FALSE(is_error_line("dpr: error: no end"));
    CHECK_FALSE(is_error_line("error: mesh\n"));
    CHECK_FALSE(is_error_line("dpr: error: mesh\nand a second line\n"));
  }
}

}  // namespace cli_test
