// Files that appear whole or not at all, and what stands at the name that they take.
#include "base/output_file.hpp"

#include <doctest/doctest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <ostream>
#include <stdexcept>
#include <string>
#include <thread>

#include "support/file_size_limit.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace output_file_test {

using namespace dpr;
using dpr::test::FileSizeLimit;
using dpr::test::TempDir;

namespace {

namespace fs = std::filesystem;

unsigned mode_of(const fs::path& file) { return static_cast<unsigned>(fs::status(file).permissions()); }

/// Takes these permissions away from new files while the object lives.
class Umask {
 public:
  explicit Umask(mode_t mask) : before_(umask(mask)) {}
  ~Umask() { umask(before_); }
  Umask(const Umask&) = delete;
  Umask& operator=(const Umask&) = delete;

 private:
  mode_t before_;
};

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("whole files: bytes as they were written, in place of what was there") {
    const TempDir folder;
    folder.write("a.txt", "something longer than what comes");
    write_whole_file(folder / "a.txt", [](std::ostream& out) { out << "one\ntwo\r\n"; });
    CHECK(folder.read("a.txt") == "one\ntwo\r\n");
    CHECK(folder.entries() == 1);
    const std::string name(255, 'n');  // the longest
    write_whole_file(folder / name, "x");
    CHECK(folder.read(name) == "x");
  }

  TEST_CASE("whole files: a writer that fails leaves what was there, and nothing else") {
    const TempDir folder;
    folder.write("a.txt", "before");
    DPR_CHECK_MESSAGE_HAS(IoError,
                          write_whole_file(folder / "a.txt",
                                           [](std::ostream& out) {
                                             out << "half";
                                             out.setstate(std::ios::badbit);
                                           }),
                          "a.txt: cannot be written");
    CHECK_THROWS_AS(write_whole_file(folder / "a.txt",
                                     [](std::ostream& out) {
                                       out << "half";
                                       throw std::runtime_error("the writer's own");
                                     }),
                    std::runtime_error);
    CHECK(folder.read("a.txt") == "before");
    CHECK(folder.entries() == 1);
    DPR_CHECK_MESSAGE_HAS(IoError, write_whole_file(folder / "no" / "a.txt", "x"), "does not exist");
    DPR_CHECK_MESSAGE_HAS(IoError, write_whole_file(folder.path(), "x"), "is a folder");
  }

  TEST_CASE("whole files: no room for all of the bytes leaves what was there, and nothing else") {
    const TempDir folder;
    folder.write("a.txt", "before");
    const FileSizeLimit limit(1000);
    DPR_CHECK_MESSAGE_HAS(IoError, write_whole_file(folder / "a.txt", std::string(1001, 'x')),
                          "a.txt: cannot be written: File too large");
    CHECK(folder.read("a.txt") == "before");
    CHECK(folder.entries() == 1);
    write_whole_file(folder / "a.txt", std::string(1000, 'x'));
    CHECK(folder.read("a.txt") == std::string(1000, 'x'));
  }

  TEST_CASE("whole files: a file that is replaced keeps its mode, a new one follows the umask") {
    const TempDir folder;
    const Umask umask(0027);
    write_whole_file(folder / "new.txt", "x");
    CHECK(mode_of(folder / "new.txt") == 0640);
    for (const unsigned mode : {0600U, 0666U, 0755U}) {
      fs::permissions(folder / "new.txt", static_cast<fs::perms>(mode));
      write_whole_file(folder / "new.txt", "y");
      CHECK(mode_of(folder / "new.txt") == mode);
    }
    if (geteuid() == 0) return;  // who may write everything
    fs::permissions(folder / "new.txt", static_cast<fs::perms>(0400));
    DPR_CHECK_MESSAGE_HAS(IoError, write_whole_file(folder / "new.txt", "z"), "Permission denied");
    CHECK(folder.read("new.txt") == "y");
  }

  TEST_CASE("whole files: links stay, and the file at their end is replaced") {
    const TempDir folder;
    fs::create_directories(folder / "there");
    folder.write("there/a.txt", "before");
    fs::create_symlink("there/a.txt", folder / "near");
    fs::create_symlink(folder / "near", folder / "far");
    fs::create_symlink("there/new.txt", folder / "dangling");
    fs::create_symlink("loop", folder / "loop");
    fs::create_symlink("no/a.txt", folder / "lost");
    for (const char* name : {"near", "far"}) {
      CHECK_NOTHROW(require_writable(folder / name));
      write_whole_file(folder / name, std::string("by ") + name);
      CHECK(folder.read("there/a.txt") == std::string("by ") + name);
      CHECK(fs::is_symlink(folder / name));
    }
    write_whole_file(folder / "dangling", "new");
    CHECK(folder.read("there/new.txt") == "new");
    CHECK(fs::is_symlink(folder / "dangling"));
    DPR_CHECK_MESSAGE_HAS(IoError, write_whole_file(folder / "loop", "x"), "loop: cannot be written");
    DPR_CHECK_MESSAGE_HAS(IoError, write_whole_file(folder / "lost", "x"), "does not exist");
    CHECK(folder.entries() == 6);
    const fs::directory_iterator there(folder / "there"), end;
    CHECK(std::distance(there, end) == 2);
  }

  TEST_CASE("whole files: devices and FIFOs are written to, and stay what they are") {
    const TempDir folder;
    const fs::path fifo = folder / "fifo";
    REQUIRE(mkfifo(fifo.c_str(), 0600) == 0);
    CHECK_NOTHROW(require_writable(fifo));  // without a reader
    const std::string sent(100'000, 'x');   // more than a pipe holds
    std::string received;
    std::thread reader([&] { received = folder.read("fifo"); });
    write_whole_file(fifo, sent);
    reader.join();
    CHECK(received == sent);
    REQUIRE(fs::is_fifo(fifo));  // or else what follows may take /dev/null away from whoever may do that
    CHECK(folder.entries() == 1);

    CHECK_NOTHROW(require_writable("/dev/null"));
    write_whole_file("/dev/null", "x");
    CHECK(fs::is_character_file("/dev/null"));
    CHECK_NOTHROW(require_writable("/dev/full"));
    DPR_CHECK_MESSAGE_HAS(IoError, write_whole_file("/dev/full", "x"),
                          "/dev/full: cannot be written: No space");
    CHECK(fs::is_character_file("/dev/full"));
  }
}

}  // namespace output_file_test
