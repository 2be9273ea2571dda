// Temporary files go with their owner, by whatever it ends; those of others stay.
#include "base/temporary_file.hpp"

#include <doctest/doctest.h>
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <system_error>
#include <vector>

#include "support/temp_dir.hpp"

namespace temporary_file_test {

using dpr::TemporaryFile;
using dpr::test::TempDir;

namespace {

namespace fs = std::filesystem;

constexpr const char* k_name = ".dpr-0123456789abcdef.tmp";

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("temporary files: hidden while they live, gone with their owner, or renamed") {
    const TempDir folder;
    {
      const TemporaryFile file(folder.path());
      CHECK(file.descriptor() >= 0);
      CHECK(folder.entries() == 1);
      CHECK(fs::directory_iterator(folder.path())->path().filename().string().starts_with(".dpr-"));
    }
    CHECK(folder.entries() == 0);
    {
      TemporaryFile file(folder.path());
      REQUIRE(write(file.descriptor(), "x", 1) == 1);
      file.rename_to(folder / "a");
    }
    CHECK(folder.read("a") == "x");
    CHECK(folder.entries() == 1);
    CHECK_THROWS_AS(TemporaryFile(folder / "no"), std::system_error);
  }

  TEST_CASE("temporary files: what a signal handler calls removes them all, and nothing else") {
    const TempDir folder;
    folder.write(k_name, "another process'");
    const TempDir other;
    {
      const TemporaryFile a(other.path()), b(other.path()), c(other.path());
      TemporaryFile renamed(other.path());
      renamed.rename_to(other / "kept");
      CHECK(other.entries() == 4);
      dpr::remove_temporary_files();
      CHECK(other.entries() == 1);
    }
    CHECK(fs::exists(other / "kept"));
    CHECK(folder.entries() == 1);
    // More of them than the handler's list has room for are files all the same.
    {
      std::vector<std::unique_ptr<TemporaryFile>> many;
      for (int i = 0; i < 100; ++i) many.push_back(std::make_unique<TemporaryFile>(other.path()));
      CHECK(other.entries() == 101);
    }
    CHECK(other.entries() == 1);
  }

  TEST_CASE("temporary files: the first one in a folder removes stale ones; living and foreign ones stay") {
    const TempDir folder;
    folder.write(k_name, "left by a process that was killed");
    const fs::path living = folder.write(".dpr-fedcba9876543210.tmp", "of a process that is at work");
    const int descriptor = open(living.c_str(), O_WRONLY | O_CLOEXEC);
    REQUIRE(flock(descriptor, LOCK_EX) == 0);  // by another opening of the file, as another process has it
    const char* const foreign[] = {".dpr-0123456789abcde.tmp",   ".dpr-0123456789abcdeg.tmp",
                                   "dpr-0123456789abcdef.tmp",   ".dpr-0123456789abcdef.png",
                                   ".dpr-0123456789abcdef.tmp~", "checkpoint.pt"};
    for (const char* const name : foreign) folder.write(name, "somebody's");
    fs::create_directory(folder / ".dpr-00000000000000aa.tmp");
    fs::create_symlink("checkpoint.pt", folder / ".dpr-00000000000000bb.tmp");
    { const TemporaryFile first(folder.path()); }
    CHECK_FALSE(fs::exists(folder / k_name));
    CHECK(fs::exists(living));
    for (const char* const name : foreign) CHECK_MESSAGE(fs::exists(folder / name), name);
    CHECK(folder.entries() == 3 + std::size(foreign));
    close(descriptor);
  }
}

}  // namespace temporary_file_test
