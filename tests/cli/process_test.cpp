// Manners of the program: it says when its words are lost, ends as its signals ask, leaves no
// temporary files, and writes where it is told.
#include "cli/process.hpp"

#include <doctest/doctest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include "base/temporary_file.hpp"
#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "support/command.hpp"
#include "support/messages.hpp"
#include "support/process.hpp"

namespace process_test {

namespace {

namespace fs = std::filesystem;
using dpr::test::contains;
using dpr::test::is_error_line;
using dpr::test::is_skipped;
using dpr::test::Outcome;
using dpr::test::program_path;
using dpr::test::run_command;
using dpr::test::TempDir;

void write_inputs(const TempDir& folder) {
  dpr::write_mesh(folder / "cube.ply", dpr::make_cube());
  folder.write("scene.json", R"({"width": 16, "height": 12, "meshes": [{"file": "cube.ply"}]})");
  dpr::write_image(folder / "target.exr", dpr::Image(16, 12, glm::vec4(0.5F)));
}

std::vector<std::string> gradient(const std::string& output) {
  return {"gradient", "--scene", "scene.json", "--target", "target.exr", "-o", output};
}

/// Runs `dpr ARGUMENTS` by a line of the shell, which has it as "$0" "$@".
Outcome run_by_shell(const TempDir& folder, const std::string& line, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {"-c", line, program_path("DPR_CLI")});
  return dpr::test::run_program("/bin/sh", folder, arguments);
}

/// How a process ends that has a temporary file in the folder and sends itself the signal: 7 where it goes
/// on.
int end_by(int signal, const TempDir& folder, bool is_ignored) {
  const pid_t child = fork();
  if (child == 0) {
    std::signal(signal, is_ignored ? SIG_IGN : SIG_DFL);
    dpr::cli::prepare_process();
    const dpr::TemporaryFile file(folder.path());
    raise(signal);
    _exit(7);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("signals: a program that is ended removes its temporary files, and its status names the signal") {
    const TempDir folder;
    for (const int signal : {SIGHUP, SIGINT, SIGTERM, SIGPIPE, SIGXCPU}) {
      CAPTURE(signal);
      CHECK(end_by(signal, folder, false) == -signal);
      CHECK(folder.entries() == 0);
    }
    CHECK(end_by(SIGHUP, folder, true) == 7);    // nohup
    CHECK(end_by(SIGXFSZ, folder, false) == 7);  // a limit of the user's is an error where it is met
    CHECK(end_by(SIGKILL, folder, false) == -SIGKILL);
    CHECK(folder.entries() == 1);  // its own; it has removed what _exit() left of those before
    { const dpr::TemporaryFile later(folder.path()); }
    CHECK(folder.entries() == 0);
  }

  TEST_CASE("cli: what cannot be printed is an error") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    const std::vector<std::vector<std::string>> commands{{"devices"},   {"devices", "--json"},
                                                         {"--help"},    {"render", "--help"},
                                                         {"--version"}, gradient("g.json")};
    for (const std::vector<std::string>& command : commands) {
      CAPTURE(command.front());
      for (const char* const line : {"\"$0\" \"$@\" >/dev/full", "\"$0\" \"$@\" >&-"}) {
        const Outcome outcome = run_by_shell(folder, line, command);
        CHECK(outcome.status == 1);
        CHECK(is_error_line(outcome.err));
        CHECK(contains(outcome.err, "standard output: cannot be written"));
      }
    }
    CHECK(contains(folder.read("g.json"), "\"loss\""));
    CHECK_FALSE(contains(folder.read("g.json"), "g.json"));  // nothing was printed into it
    CHECK(run_by_shell(folder, "\"$0\" \"$@\" --quiet >&-", gradient("g.json")).status == 0);
  }

  TEST_CASE("cli: a reader that went away ends the program in silence, as it ends others") {
    if (is_skipped()) return;
    const TempDir folder;
    int ends[2] = {-1, -1};
    REQUIRE(pipe(ends) == 0);
    close(ends[0]);
    dpr::test::Process process(program_path("DPR_CLI"), folder.path(), {"devices"}, folder / "err", ends[1]);
    close(ends[1]);
    CHECK(process.wait() == -SIGPIPE);
    CHECK(folder.read("err").empty());
  }

  TEST_CASE("cli: outputs to links, FIFOs and devices") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    REQUIRE(run_command(folder, gradient("a.json")).status == 0);
    const std::string expected = folder.read("a.json");
    fs::create_symlink("b.json", folder / "link");
    CHECK(run_command(folder, gradient("link")).status == 0);
    CHECK(fs::is_symlink(folder / "link"));
    CHECK(folder.read("b.json") == expected);
    REQUIRE(mkfifo((folder / "fifo").c_str(), 0600) == 0);
    const Outcome piped = run_by_shell(folder, "cat fifo & \"$0\" \"$@\" --quiet; wait", gradient("fifo"));
    CHECK(piped.out == expected);
    REQUIRE(fs::is_fifo(folder / "fifo"));  // or else what follows may replace the system's devices
    const Outcome through = run_by_shell(folder, "\"$0\" \"$@\" | cat", [] {
      std::vector<std::string> words = gradient("/dev/stdout");
      words.emplace_back("--quiet");
      return words;
    }());
    CHECK(through.out == expected);

    fs::create_symlink("/dev/full", folder / "full.png");
    fs::create_symlink("/dev/full", folder / "full.json");
    for (const std::vector<std::string>& command :
         {gradient("full.json"), {"render", "cube.ply", "-o", "full.png", "--size", "16x16"}}) {
      const Outcome outcome = run_command(folder, command);
      CHECK(outcome.status == 1);
      CHECK(is_error_line(outcome.err));
      CHECK(contains(outcome.err, "No space left on device"));
    }
    CHECK(fs::is_symlink(folder / "full.png"));
    CHECK(run_command(folder, gradient("/dev/null")).status == 0);
    CHECK(fs::is_character_file("/dev/null"));
  }

  TEST_CASE("cli: a seed is the same number on the command line as in a scene file, or the same error") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    for (const std::string seed : {"-1", "1.5", "18446744073709551616"}) {
      CAPTURE(seed);
      const Outcome by_line =
          run_command(folder, {"render", "--scene", "scene.json", "-o", "o.png", "--seed", seed});
      folder.write("seed.json", R"({"meshes": [{"file": "cube.ply"}], "smoothing": {"seed": )" + seed + "}}");
      const Outcome by_file = run_command(folder, {"render", "--scene", "seed.json", "-o", "o.png"});
      CHECK(by_line.status == 1);
      CHECK(by_file.status == 1);
      const auto end_of = [](const std::string& err) { return err.substr(err.find(", expected")); };
      CHECK(contains(by_line.err, "--seed (command line): got " + seed));
      CHECK(end_of(by_line.err) == end_of(by_file.err));
    }
    CHECK(run_command(folder,
                      {"render", "--scene", "scene.json", "-o", "o.png", "--seed", "18446744073709551615"})
              .status == 0);
  }

  TEST_CASE("cli: messages show the control characters of what they are about") {
    if (is_skipped()) return;
    const TempDir folder;
    write_inputs(folder);
    folder.write("nul.json", R"({"meshes": [{"file": "cube.ply"}], "a\u0000b": 1})");
    const Outcome outcome = run_command(folder, {"render", "--scene", "nul.json", "-o", "o.png"});
    CHECK(outcome.status == 1);
    CHECK(is_error_line(outcome.err));
    CHECK(contains(outcome.err, "the unknown key \"a\\x00b\""));
    CHECK(contains(outcome.err, "keys out of"));  // it goes on behind it
    const Outcome escape = run_command(folder, {"render", "no\n\x1b[31m.ply", "-o", "o.png"});
    CHECK(contains(escape.err, "no\\x0a\\x1b[31m.ply"));
  }
}

}  // namespace process_test
