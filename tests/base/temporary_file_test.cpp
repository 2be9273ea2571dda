// Files that appear whole or not at all.
#include "base/temporary_file.hpp"

#include <doctest/doctest.h>

#include <ostream>
#include <stdexcept>

#include "support/messages.hpp"
#include "support/temp_dir.hpp"

using namespace dpr;
using dpr::test::TempDir;

TEST_SUITE("robustness") {
  TEST_CASE("whole files: bytes as they were written, in place of what was there") {
    const TempDir folder;
    folder.write("a.txt", "something longer than what comes");
    write_whole_file(folder / "a.txt", [](std::ostream& out) { out << "one\ntwo\r\n"; });
    CHECK(folder.read("a.txt") == "one\ntwo\r\n");
    CHECK(folder.entries() == 1);
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
    DPR_CHECK_MESSAGE_HAS(IoError, write_whole_file(folder / "no" / "a.txt", [](std::ostream&) {}),
                          "does not exist");
  }
}
