// dpr track: which files make a sequence, what the track's files hold, and what is an error. Runs where the environment
// variable DPR_CLI names the command.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "cli/sequence.hpp"
#include "cli/track_report.hpp"
#include "dpr/aov.hpp"
#include "dpr/error.hpp"
#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"

namespace track_command_test {

namespace {

using dpr::test::contains;
using dpr::test::is_skipped;
using dpr::test::Outcome;
using dpr::test::run_line;
using dpr::test::TempDir;
using nlohmann::json;

/// Runs `dpr track --scene scene.json ARGUMENTS` in the folder; spaces part the arguments.
Outcome track(const TempDir& folder, const std::string& arguments) {
  return run_line(folder, "track --scene scene.json " + arguments);
}

constexpr int k_first = 8, k_frames = 5;

double angle(int frame) { return 0.05 * (frame - k_first); }

std::string frame_name(int frame) { return "frames/f" + std::to_string(frame) + ".png"; }

/// scene.json, and the cube that turns about y: frames/f8.png to f12.png, masks/, and depths/ of .exr files.
void write_inputs(const TempDir& folder) {
  dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
  folder.write(
      "scene.json",
      R"({"width": 64, "height": 48, "camera": {"view": [[1,0,0,0],[0,0.8,-0.6,0],[0,0.6,0.8,-6],[0,0,0,1]]},
                   "meshes": [{"file": "cube.ply"}]})");
  for (const char* const name : {"frames", "masks", "depths"})
    std::filesystem::create_directory(folder / name);
  dpr::Scene scene = dpr::read_scene(folder / "scene.json");
  scene.smoothing = dpr::rigid_smoothing();
  dpr::Renderer renderer(dpr::open_device());
  renderer.set_scene(scene);
  for (int frame = k_first; frame < k_first + k_frames; ++frame) {
    const dpr::View view{scene.camera,
                         {glm::mat4(glm::mat3(dpr::rotation_from_vector({0, angle(frame), 0})))}};
    renderer.set_views({&view, 1});
    renderer.forward();
    const dpr::Image image = renderer.image();
    dpr::write_image(folder / frame_name(frame), dpr::opaque(image));
    dpr::Image mask = image, depth = image;
    const std::vector<float> depths = dpr::auxiliary_outputs(renderer).depth;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      mask.pixels[i] = glm::vec4(glm::vec3(image.pixels[i].w), 1);
      depth.pixels[i] = glm::vec4(glm::vec3(depths[i]), 1);
    }
    const std::string name = "/f" + std::to_string(frame);
    dpr::write_image(folder / ("masks" + name + ".png"), mask);
    dpr::write_image(folder / ("depths" + name + ".exr"), depth);
  }
}

std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> result;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) result.push_back(line);
  return result;
}

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> result;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) result.push_back(cell);
  return result;
}

/// Least significant byte first.
std::string number(std::uint32_t value, int bytes = 4) {
  std::string result;
  for (int i = 0; i < bytes; ++i) result.push_back(static_cast<char>(value >> (8 * i) & 0xff));
  return result;
}

std::string chunk(const std::string& name, const std::string& content) {
  const auto size = static_cast<std::uint32_t>(content.size());
  return name + number(size) + content + std::string(size % 2, '\0');
}

/// An AVI file of JPEG files, ten a second.
std::string video_of(const std::vector<std::string>& jpegs, std::uint32_t width, std::uint32_t height) {
  const auto count = static_cast<std::uint32_t>(jpegs.size());
  std::string head = number(100000) + number(1 << 20) + number(0) + number(0) + number(count) + number(0) +
                     number(1) + number(1 << 20) + number(width) + number(height) + std::string(16, '\0');
  const std::string stream = "vidsMJPG" + number(0) + number(0) + number(0) + number(1) + number(10) +
                             number(0) + number(count) + number(1 << 20) + number(0xffffffff) + number(0) +
                             std::string(8, '\0');
  const std::string format = number(40) + number(width) + number(height) + number(1, 2) + number(24, 2) +
                             "MJPG" + number(3 * width * height) + std::string(16, '\0');
  std::string frames = "movi";
  for (const std::string& jpeg : jpegs) frames += chunk("00dc", jpeg);
  return chunk("RIFF",
               "AVI " +
                   chunk("LIST", "hdrl" + chunk("avih", head) +
                                     chunk("LIST", "strl" + chunk("strh", stream) + chunk("strf", format))) +
                   chunk("LIST", frames));
}

/// A row is of that frame, and has its angle.
void check_row(const std::string& line, int frame) {
  const std::vector<std::string> row = cells(line);
  CAPTURE(line);
  REQUIRE(row.size() == 12);
  CHECK(row[0] == std::to_string(frame - k_first));
  CHECK(row[1] == frame_name(frame));
  CHECK(row[2] == (frame == k_first ? "found" : "tracked"));
  CHECK(std::abs(std::stod(row[4]) - angle(frame)) < 0.01);
  CHECK(row[6] == "0");
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("sequence: numbers in names count as such") {
    using dpr::cli::is_naturally_less;
    const std::vector<std::string> names{"a", "a2", "a10", "a10b", "a11", "b1", "b01", "b1c"};
    CHECK(is_naturally_less("a2", "a10"));
    CHECK_FALSE(is_naturally_less("a10", "a2"));
    CHECK(is_naturally_less("a", "a2"));
    CHECK(is_naturally_less("a10", "a10b"));
    CHECK(is_naturally_less("b01", "b1"));
    CHECK_FALSE(is_naturally_less("b1", "b01"));
    CHECK(is_naturally_less("b1", "b02"));
    for (const std::string& name : names) CHECK_FALSE(is_naturally_less(name, name));
  }

  TEST_CASE("sequence: files, folders and patterns, each in its order") {
    const TempDir folder;
    dpr::Scene scene;
    scene.width = 2, scene.height = 1;
    const auto write = [&](const char* name) {
      dpr::write_image(folder / name, dpr::Image(2, 1, glm::vec4(1)));
    };
    for (const char* name :
         {"f9.png", "f9.depth.exr", "f10.png", "f11.png", "g010.exr", "g009.exr", "g009.uv.exr"})
      write(name);
    folder.write("notes.txt", "");
    const auto read = [&](const std::vector<std::string>& names) {
      std::vector<std::string> paths, files;
      for (const std::string& name : names) paths.push_back((folder / name).string());
      dpr::cli::Sequence sequence(paths, dpr::Encoding::srgb, scene);
      const auto size = sequence.size();
      while (const auto frame = sequence.next())
        files.push_back(std::filesystem::path(frame->file).filename().string());
      CHECK(size == files.size());
      return files;
    };
    using Files = std::vector<std::string>;
    CHECK(read({""}) == Files{"f9.png", "f10.png", "f11.png", "g009.exr", "g010.exr"});
    CHECK(read({"f%d.png"}) == Files{"f9.png", "f10.png", "f11.png"});
    CHECK(read({"g%03d.exr"}) == Files{"g009.exr", "g010.exr"});
    CHECK(read({"f9.depth.exr"}) == Files{"f9.depth.exr"});
    CHECK(read({"g###.exr", "f9.png"}) == Files{"g009.exr", "g010.exr", "f9.png"});
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, read({"f%03d.png"}), "got no file that matches");
    DPR_CHECK_MESSAGE_HAS(dpr::IoError, read({std::string(5000, 'a')}), "aa: the file does not exist");
    std::filesystem::remove(folder / "f10.png");
    DPR_CHECK_MESSAGE_HAS(dpr::IoError, read({"f#.png"}), "f10.png: the file does not exist");
  }

  TEST_CASE("sequence: names with points are frames, unless --aov gives them") {
    const TempDir folder;
    dpr::Scene scene;
    scene.width = 2, scene.height = 1;
    for (const char* name : {"12.25.exr", "12.50.exr", "12.exr", "12.depth.exr", "12.25.standard_error.exr"})
      dpr::write_image(folder / name, dpr::Image(2, 1, glm::vec4(1)));
    dpr::cli::Sequence sequence({folder.path().string()}, dpr::Encoding::srgb, scene);
    for (const char* name : {"12.exr", "12.25.exr", "12.50.exr"}) {
      const auto frame = sequence.next();
      REQUIRE(frame);
      CHECK(std::filesystem::path(frame->file).filename() == name);
    }
    CHECK_FALSE(sequence.next());
  }

  TEST_CASE("sequence: images of a folder beside the frames of another are named as these") {
    const TempDir folder;
    dpr::Scene scene;
    scene.width = 2, scene.height = 1;
    const auto sequence = [&](const char* option, const std::string& name,
                              const std::vector<const char*>& files) {
      std::filesystem::create_directory(folder / name);
      for (const char* const file : files)
        dpr::write_image(folder / (name + "/" + file), dpr::Image(2, 1, glm::vec4(1)));
      const auto read = [](const std::string& file) { return dpr::read_image(file); };
      return dpr::cli::Sequence(option, {(folder / name).string()}, scene, read);
    };
    const auto frames = sequence("--sequence", "frames", {"0.png", "1.png", "10.png"});
    sequence("--depth", "same", {"0.exr", "1.exr", "10.exr"}).require_names_of(frames);
    sequence("--depth", "suffix", {"0.depth.exr", "1.depth.exr", "10.depth.exr"}).require_names_of(frames);
    const auto check = [&](const std::string& name, const std::vector<const char*>& files, const char* says) {
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, sequence("--depth", name, files).require_names_of(frames),
                            says);
    };
    check("gap", {"0.exr", "1.exr", "11.exr"},
          "images of --depth (command line): got 11.exr for 10.png, expected the numbers or names of");
    check("shift", {"1.exr", "10.exr", "11.exr"}, "got 1.exr for 0.png");
    check("digit", {"00.exr", "10.exr", "100.exr"}, "got 10.exr for 1.png");
    check("text", {"a.exr", "b.exr", "c.exr"}, "got a.exr for 0.png");
    sequence("--depth", "prefix", {"d2_000.exr", "d2_001.exr", "d2_010.exr"}).require_names_of(frames);
    const auto words = sequence("--sequence", "words", {"left.png", "right.png"});
    sequence("--depth", "same words", {"left.depth.exr", "right.depth.exr"}).require_names_of(words);
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument,
                          sequence("--depth", "others", {"left.exr", "up.exr"}).require_names_of(words),
                          "got up.exr for right.png");
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("dpr track: the cube is followed; its files and its report hold what they promise") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const Outcome outcome =
        track(folder, "--sequence frames/f#.png -o track.json --csv track.csv --report report --covariance");
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    CHECK(contains(outcome.out, "5 frames: 1 searched for and found, 4 followed, 0 lost"));
    const std::vector<std::string> rows = lines(folder.read("track.csv"));
    REQUIRE(rows.size() == 1 + k_frames);
    CHECK(rows[0] == "frame,file,status,rx,ry,rz,tx,ty,tz,loss,explained_below,seconds");
    for (int i = 0; i < k_frames; ++i) check_row(rows[static_cast<std::size_t>(1 + i)], k_first + i);
    const json file = json::parse(folder.read("track.json"));
    CHECK(file["frames"] == k_frames);
    CHECK(file["lost"] == 0);
    CHECK_FALSE(file.contains("error"));
    REQUIRE(file["poses"].size() == k_frames);
    const json& last = file["poses"][k_frames - 1];
    CHECK(last["file"] == frame_name(k_first + k_frames - 1));
    CHECK(last["transform"][0][0].get<double>() == doctest::Approx(std::cos(0.2)).epsilon(0.01));
    CHECK(last["covariance"].size() == 3);
    const std::string page = folder.read("report/index.html");
    for (const char* part : {"frames.png", "frame 0, found", "frame 4, tracked", "rotation vector"})
      CHECK(contains(page, part));
    CHECK(dpr::read_image(folder / "report/frames.png").width == k_frames * 256 + (k_frames - 1) * 2);
  }

  TEST_CASE("dpr track: silhouettes and depths beside the frames") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const auto found_by = [&](const std::string& options) {
      const Outcome outcome =
          track(folder, "--sequence frames --translation -o track.json --csv track.csv " + options);
      CAPTURE(outcome.err);
      REQUIRE(outcome.status == 0);
      const json file = json::parse(folder.read("track.json"));
      CHECK(file["lost"] == 0);
      return std::stod(cells(lines(folder.read("track.csv")).back())[8]);
    };
    CHECK(std::abs(found_by("--silhouette masks --depth depths/f%d.exr")) < 0.01);
    // Depths of a longer unit move the cube away.
    CHECK(found_by("--depth depths --depth-scale 1.005 --depth-weight 100") < -0.01);
  }

  TEST_CASE("dpr track: the frames of a video, where OpenImageIO reads any") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    std::vector<std::string> jpegs;
    for (int frame = k_first; frame < k_first + k_frames; ++frame) {
      dpr::write_image(folder / "frame.jpg", dpr::read_image(folder / frame_name(frame)));
      jpegs.push_back(folder.read("frame.jpg"));
    }
    folder.write("film.avi", video_of(jpegs, 64, 48));
    const Outcome outcome = track(folder, "--sequence film.avi -o track.json");
    if (outcome.status == 1 && contains(outcome.err, "film.avi: cannot be read")) {
      MESSAGE("skipped: OpenImageIO reads no videos");
      return;
    }
    CAPTURE(outcome.err);
    REQUIRE(outcome.status == 0);
    const json poses = json::parse(folder.read("track.json"))["poses"];
    REQUIRE(poses.size() == k_frames);
    for (int i = 0; i < k_frames; ++i) {
      const json& pose = poses[static_cast<std::size_t>(i)];
      CHECK(pose["file"] == "film.avi:" + std::to_string(i));
      // What JPEG makes of few pixels may be more than a pose explains.
      if (i > 0 && pose["status"] == "lost") continue;
      REQUIRE(pose.contains("rotation"));
      CHECK(std::abs(pose["rotation"][1].get<double>() - angle(k_first + i)) < 0.03);
    }
  }

  TEST_CASE("dpr track: a frame that is not explained is lost, without a pose") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    dpr::write_image(folder / frame_name(k_first + 2), dpr::Image(64, 48, glm::vec4(0.3F, 0.3F, 0.3F, 1)));
    const auto outcome = track(folder, "--sequence frames --rotations 64 -o track.json --csv track.csv");
    REQUIRE(outcome.status == 0);
    CHECK(contains(outcome.out, "1 lost\nNo pose explains a lost frame. --robust"));
    CHECK(contains(outcome.out, "--explained 0.2, twice as much"));
    const std::vector<std::string> rows = lines(folder.read("track.csv"));
    REQUIRE(rows.size() == 1 + k_frames);
    check_row(rows[2], k_first + 1);
    CHECK(contains(rows[3], "f10.png,lost,,,,,,,"));
    CHECK(contains(rows[4], "f11.png,found,"));
    CHECK(contains(rows[5], "f12.png,tracked,"));
    const json file = json::parse(folder.read("track.json"));
    CHECK(file["poses"][2]["status"] == "lost");
    CHECK_FALSE(file["poses"][2].contains("transform"));
  }

  TEST_CASE("dpr track: no --explained is advised that is out of range") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    dpr::write_image(folder / "grey.png", dpr::Image(64, 48, glm::vec4(0.3F, 0.3F, 0.3F, 1)));
    const auto outcome =
        track(folder, "--sequence grey.png --explained 0.6 --search-interval 0 --rotations 0 -o track.json");
    REQUIRE(outcome.status == 0);
    CHECK(contains(outcome.out, "1 frame: 0 searched for and found, 0 followed, 1 lost"));
    CHECK_FALSE(contains(outcome.out, "--explained"));
  }

  TEST_CASE("track report: unknown losses are gaps, and a single frame is told as one") {
    const TempDir folder;
    dpr::Scene scene;
    scene.width = scene.height = 8;
    scene.camera.view[3].z = -6;
    scene.meshes.push_back({dpr::make_cube()});
    const dpr::Device device = dpr::open_device();
    const dpr::Image image(8, 8, glm::vec4(0, 0, 0, 1));
    const auto page_of = [&](const std::string& name, const std::vector<dpr::cli::TrackRow>& rows) {
      dpr::cli::TrackReport report(folder / name);
      for (const dpr::cli::TrackRow& row : rows) report.add(row, image);
      report.write({"title", "command", "device"}, device, scene, rows, true);
      return folder.read(name + "/index.html");
    };
    using dpr::TrackStatus;
    const auto row = [](std::size_t frame, TrackStatus status, double loss, double below) {
      dpr::cli::TrackRow result{frame, "frame.png", {}, 0};
      result.found.status = status;
      result.found.loss = loss;
      result.found.explained_below = below;
      return result;
    };
    const dpr::cli::TrackRow unseen = row(0, TrackStatus::lost, 0, 0);
    const std::string single = page_of("single", {unseen});
    CHECK(contains(single, "1 of 1 frame, with"));
    CHECK(contains(single, "<td>frame 0</td>"));
    CHECK_FALSE(contains(single, "plot.png"));
    const std::string page =
        page_of("three", {unseen, row(1, TrackStatus::found, 0.5, 2), row(2, TrackStatus::lost, 4, 0)});
    CHECK(contains(page, "<td>frames 0, 2</td>"));
    const std::string begin = "<script type=\"application/json\">";
    if (!contains(page, begin)) {
      MESSAGE("skipped: gnuplot is not installed");
      return;
    }
    const std::size_t first = page.find(begin) + begin.size();
    const json data = json::parse(page.substr(first, page.find("</script>", first) - first));
    CHECK(data["curves"][0]["y"] == json{nullptr, 0.5, 4});
    CHECK(data["curves"][1]["y"] == json{nullptr, 2, nullptr});
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("dpr track: a frame that cannot be read is one error, and the poses before it are in the files") {
    if (is_skipped()) return;
    const auto check = [](auto spoil, const char* says) {
      const TempDir folder;
      write_inputs(folder);
      spoil(folder);
      const Outcome outcome =
          track(folder, "--sequence frames/f%d.png -o track.json --csv track.csv --quiet");
      CAPTURE(outcome.err);
      CHECK(outcome.status == 1);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK(contains(outcome.err, says));
      const std::vector<std::string> rows = lines(folder.read("track.csv"));
      REQUIRE(rows.size() == 3);
      check_row(rows[2], k_first + 1);
      const json file = json::parse(folder.read("track.json"));
      CHECK(file["poses"].size() == 2);
      CHECK(contains(file["error"].get<std::string>(), says));
    };
    const std::string third = frame_name(k_first + 2);
    check([&](const TempDir& f) { std::filesystem::remove(f / third); }, "f10.png: the file does not exist");
    check([&](const TempDir& f) { dpr::write_image(f / third, dpr::Image(32, 48)); },
          "size of --sequence frames/f10.png (command line): got 32x48, expected 64x48");
    check([&](const TempDir& f) { f.write(third, f.read(third).substr(0, 100)); }, "f10.png: cannot be read");
  }

  TEST_CASE("dpr track: what cannot be a sequence, or does not go together, is an error of one line") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    std::filesystem::create_directory(folder / "empty");
    folder.write("film.mp4", "no film");
    const auto check = [&](const std::string& options, const char* says) {
      CAPTURE(options);
      const Outcome outcome = track(folder, "-o track.json --csv track.csv " + options);
      CAPTURE(outcome.err);
      CHECK(outcome.status == 1);
      CHECK(dpr::test::is_error_line(outcome.err));
      CHECK(contains(outcome.err, says));
      CHECK_FALSE(std::filesystem::exists(folder / "track.json"));
      CHECK_FALSE(std::filesystem::exists(folder / "track.csv"));
    };
    check("", "no --sequence");
    check("--sequence frames/%04d.png",
          "--sequence frames/%04d.png (command line): got no file that matches");
    check("--sequence empty", "--sequence empty (command line): got a folder without images");
    check("--sequence missing.png", "missing.png: the file does not exist");
    check("--sequence film.mp4", "film.mp4: cannot be read");
    check("--sequence frames --damping 2", "--damping (command line): got 2");
    check("--sequence frames --search --rotations 0", "--rotations (command line): got 0");
    check("--sequence frames --search --initial-rotation 0,0,0", "both --");
    check("--sequence frames --size 32x32", "got 64x48, expected 32x32");
    check("--sequence frames --sigma 1", "unknown option \"--sigma\"");
    check("--sequence frames --depth-scale 1", "got no --depth");
    for (const char* const scale : {"0", "-1", "nan", "inf"}) {
      check(std::string("--sequence frames --depth depths --depth-scale ") + scale,
            ("--depth-scale (command line): got " + std::string(scale) + ", expected a finite number > 0")
                .c_str());
    }
    check("--sequence frames --depth frames", "got whole numbers, expected --depth-scale");
    check("--sequence frames --depth film.mp4 --depth-scale 1",
          "--depth film.mp4 (command line): got a video");
    check("--sequence frames --silhouette masks/f8.png",
          "images of --silhouette (command line): got 1, expected 5");
    check("--sequence frames --depth nowhere", "nowhere: the file does not exist");
    check("--sequence frames --silhouette missing%d.png",
          "--silhouette missing%d.png (command line): got no file that matches");
  }
}

}  // namespace track_command_test
