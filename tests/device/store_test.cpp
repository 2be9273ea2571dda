// Store between starts: whole or not at all, bounded, and never in the way.
#include "device/store.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "dpr/error.hpp"
#include "kernels/scan.hpp"
#include "support/probe.hpp"
#include "support/temp_dir.hpp"
#include "support/variable.hpp"

namespace store_test {

using dpr::Store;
using dpr::test::TempDir;
using dpr::test::Variable;

namespace {

std::vector<std::filesystem::path> files_of(const TempDir& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) files.push_back(entry.path());
  return files;
}

std::string read(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("store: a value is found by its key, and replaced") {
    const TempDir folder;
    const Store store(folder.path());
    CHECK_FALSE(store.load("key"));
    store.save("key", std::string_view("a\0b", 3));
    store.save("other", "");
    CHECK(store.load("key") == std::string("a\0b", 3));
    CHECK(store.load("other") == "");
    store.save("key", "new");
    CHECK(store.load("key") == "new");
    CHECK(files_of(folder).size() == 2);
  }

  TEST_CASE("store: a file that is cut short, or of which any byte differs, is not there") {
    const TempDir folder;
    const Store store(folder.path());
    store.save("key", "value");
    const std::filesystem::path file = files_of(folder).at(0);
    const std::string whole = read(file);
    for (std::size_t i = 0; i < whole.size(); ++i) {
      std::string changed = whole;
      changed[i] = static_cast<char>(changed[i] ^ 1);
      folder.write(file.filename().string(), changed);
      CHECK_FALSE(store.load("key"));
      folder.write(file.filename().string(), whole.substr(0, i));
      CHECK_FALSE(store.load("key"));
    }
    folder.write(file.filename().string(), whole + "more");
    CHECK_FALSE(store.load("key"));
    store.save("key", "again");
    CHECK(store.load("key") == "again");
  }

  TEST_CASE("store: beyond its bound the oldest go, and what is too large is not kept") {
    const TempDir folder;
    const Store store(folder.path(), 1000);
    const std::string value(300, 'v');
    const auto pause = [] { std::this_thread::sleep_for(std::chrono::milliseconds(20)); };
    for (const char* const key : {"first", "second"}) {
      store.save(key, value);
      pause();
    }
    CHECK(store.load("first"));  // is used, and so the newest
    pause();
    store.save("third", value);
    CHECK(store.load("first"));
    CHECK_FALSE(store.load("second"));
    CHECK(store.load("third"));
    store.save("large", std::string(1001, 'v'));
    CHECK_FALSE(store.load("large"));
  }

  TEST_CASE("store: a folder that cannot be made is as if nothing were remembered") {
    for (const char* const folder : {"/dev/null/store", "/proc/store"}) {
      const Store store{std::filesystem::path(folder)};
      store.save("key", "value");
      CHECK_FALSE(store.load("key"));
    }
  }

  TEST_CASE("store: the environment names its folder, or switches it off") {
    const TempDir folder;
    const auto is_kept_in = [&](const char* place) {
      Store().save("key", "value");
      return std::filesystem::exists(folder / place) && Store().load("key") == "value";
    };
    {
      const Variable own("DPR_CACHE_DIR", (folder / "own").c_str());
      CHECK(is_kept_in("own"));
    }
    {
      const Variable own("DPR_CACHE_DIR", nullptr), caches("XDG_CACHE_HOME", (folder / "caches").c_str());
      CHECK(is_kept_in("caches/dpr"));
    }
    {
      const Variable own("DPR_CACHE_DIR", nullptr), caches("XDG_CACHE_HOME", nullptr);
      const Variable home("HOME", folder.path().c_str());
      CHECK(is_kept_in(".cache/dpr"));
    }
    const Variable off("DPR_CACHE_DIR", "off");
    CHECK_FALSE(Store().is_on());
  }

  TEST_CASE("store: threads that save and load one key see whole values") {
    const TempDir folder;
    std::atomic<bool> is_torn = false;
    const auto work = [&](char letter) {
      const Store store(folder.path());
      for (int i = 0; i < 50; ++i) {
        store.save("key", std::string(5000, letter));
        const auto found = store.load("key");
        if (found && *found != std::string(5000, found->front())) is_torn = true;
      }
    };
    std::thread first(work, 'a'), second(work, 'b');
    first.join();
    second.join();
    CHECK_FALSE(is_torn);
    CHECK(Store(folder.path()).load("key"));
    CHECK(files_of(folder).size() == 1);
  }

  TEST_CASE("store: a program is built once, then its binary is taken; a damaged one is built anew") {
    if (dpr::test::device_impl().info.platform == "Oclgrind") return;
    const TempDir folder;
    const Variable own("DPR_CACHE_DIR", folder.path().c_str());
    std::size_t builds = 0;
    const auto sum_of_four = [&] {
      const dpr::Device device = dpr::open_device("cpu");
      impl_of(device).keeps_binaries = true;
      impl_of(device).before_work = [&](std::string_view work) { builds += work == "scan.cl" ? 1 : 0; };
      // Options of its own, so that it is a program of its own.
      dpr::Launcher<dpr::kernel::scan_sum> launch(impl_of(device), " -DDPR_SCAN_CHUNK=128");
      const std::vector<cl_uint> values{1, 2, 3, 4}, four{4};
      const dpr::Buffer<cl_uint> in(impl_of(device), std::span<const cl_uint>(values)),
          present(impl_of(device), std::span<const cl_uint>(four));
      dpr::Buffer<cl_uint> out(impl_of(device), 1);
      launch.in_groups(1, dpr::kernel::scan_sum{.count = 4U, .present = present, .values = in, .sums = out});
      return out.download()[0];
    };
    CHECK(sum_of_four() == 10);
    CHECK(builds == 1);
    REQUIRE(files_of(folder).size() == 1);
    CHECK(sum_of_four() == 10);
    CHECK(builds == 1);
    const std::filesystem::path file = files_of(folder)[0];
    folder.write(file.filename().string(), read(file).substr(0, 5000));
    CHECK(sum_of_four() == 10);
    CHECK(builds == 2);
  }
}

}  // namespace store_test
