// The corpora of the fuzz targets, seeds and what fuzzing found, as an ordinary test: bad-* is refused, the
// rest is read.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "fuzz/targets.hpp"
#include "support/data.hpp"

namespace corpus_test {

using namespace dpr;

TEST_SUITE("robustness") {
  TEST_CASE("every file of the corpora is read or refused, as its name says") {
    for (const fuzz::Target& target : fuzz::targets()) {
      std::size_t read = 0, refused = 0;
      for (const std::filesystem::path& file :
           test::files_in(test::data_folder() / "fuzz" / target.name, "")) {
        std::ifstream in(file, std::ios::binary);
        const std::string content{std::istreambuf_iterator<char>(in), {}};
        const bool is_bad = file.filename().string().starts_with("bad-");
        CHECK_MESSAGE(fuzz::accepts(target, content) != is_bad, file.string());
        ++(is_bad ? refused : read);
      }
      CHECK_MESSAGE(read > 0, target.name);
      CHECK_MESSAGE(refused > 0, target.name);
    }
  }
}

}  // namespace corpus_test
