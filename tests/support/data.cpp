#include "support/data.hpp"

#include <algorithm>
#include <stdexcept>

namespace dpr::test {

namespace fs = std::filesystem;

fs::path data_folder() { return DPR_TEST_DATA; }

std::vector<fs::path> files_in(const fs::path& folder, std::string_view ending) {
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().filename().string().ends_with(ending)) found.push_back(entry.path());
  }
  if (found.empty()) throw std::runtime_error(folder.string() + " has no file *" + std::string(ending));
  std::ranges::sort(found);
  return found;
}

}  // namespace dpr::test
