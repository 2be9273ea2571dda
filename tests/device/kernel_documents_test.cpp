// Every kernel says who its work-items are and what its arguments hold.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "support/data.hpp"

namespace {

struct Documented {
  std::string text;
  std::vector<std::string> arguments;  // but for structs of parameters, which shared_types.h describes
};

using Kernels = std::map<std::string, Documented>;

bool has_word(const std::string& text, const std::string& word) {
  return std::regex_search(text, std::regex("\\b" + word + "\\b"));
}

std::vector<std::string> arguments_of(const std::string& list) {
  const std::regex argument(R"rx(\s*(const \w+Params|const BlurPass)?[^,]*?(\w+)\s*(,|$))rx");
  std::vector<std::string> names;
  for (std::sregex_iterator it(list.begin(), list.end(), argument), end; it != end; ++it) {
    if (!(*it)[1].matched) names.push_back((*it)[2]);
  }
  return names;
}

void add_kernels(const std::string& source, Kernels& kernels) {
  const std::regex kernel(R"rx(((?:///[^\n]*\n)*)(?:DPR_\w+_KERNEL )?kernel void (\w+)\(([^{]*)\) \{)rx");
  for (std::sregex_iterator it(source.begin(), source.end(), kernel), end; it != end; ++it) {
    Documented& found = kernels[(*it)[2]];  // there before where a kernel is written twice
    found = {found.text + (*it)[1].str(), arguments_of((*it)[3])};
  }
}

/// True if a kernel's text has the word, or that of a kernel which it refers to.
bool says(const Kernels& kernels, const std::string& name, const std::string& word,
          std::set<std::string>& seen) {
  if (!seen.insert(name).second) return false;
  const std::string& text = kernels.at(name).text;
  if (has_word(text, word)) return true;
  for (const auto& [other, documented] : kernels) {
    if (has_word(text, other) && says(kernels, other, word, seen)) return true;
  }
  return false;
}

std::vector<std::string> unsaid(const Kernels& kernels) {
  std::vector<std::string> missing;
  for (const auto& [name, documented] : kernels) {
    std::set<std::string> seen;
    if (!says(kernels, name, "work-item", seen)) missing.push_back(name + ": its work-items");
    for (const std::string& argument : documented.arguments) {
      seen.clear();
      if (!says(kernels, name, argument, seen)) missing.push_back(name + ": " + argument);
    }
  }
  return missing;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("kernels: the text before each says what its work-items and its arguments are") {
    Kernels kernels;
    for (const auto& entry :
         std::filesystem::directory_iterator(dpr::test::data_folder() / "../../kernels")) {
      if (entry.path().extension() != ".cl") continue;
      std::ifstream file(entry.path());
      add_kernels({std::istreambuf_iterator<char>(file), {}}, kernels);
    }
    CHECK(kernels.size() > 40);
    for (const std::string& what : unsaid(kernels)) FAIL_CHECK(what);
  }

  TEST_CASE("kernels: an argument that no text names is found") {
    Kernels kernels;
    add_kernels(
        "/// One work-item per pixel.\n/// in   image  float4[pixel]\n"
        "kernel void first(const FrameParams p, const uint count, global const float4* restrict image) {\n}\n"
        "/// Image as first.\nkernel void second(global const float4* restrict image) {\n}\n"
        "kernel void third(const uint x) {\n}\n",
        kernels);
    CHECK(unsaid(kernels) == std::vector<std::string>{"first: count", "third: its work-items", "third: x"});
  }
}
