#include "cli/mesh_materials.hpp"

#include <algorithm>
#include <functional>
#include <sstream>

#include "base/input_file.hpp"

namespace dpr::cli {
namespace {

/// Calls `found` with what follows the keyword on every line that begins with it.
void for_each_line(const std::string& text, const std::string& keyword,
                   const std::function<void(const std::string&)>& found) {
  constexpr const char* k_blank = " \t\r";
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    line.erase(0, std::min(line.find_first_not_of(k_blank), line.size()));
    if (!line.starts_with(keyword)) continue;
    line.erase(0, keyword.size());
    const std::size_t begin = line.find_first_not_of(k_blank);
    if (begin == 0 || begin == std::string::npos) continue;
    found(line.substr(begin, line.find_last_not_of(k_blank) + 1 - begin));
  }
}

void add(std::vector<NamedFile>& files, const std::filesystem::path& folder, const std::string& name) {
  if (std::ranges::any_of(files, [&](const NamedFile& file) { return file.name == name; })) return;
  std::error_code error;
  files.push_back({name, std::filesystem::is_regular_file(folder / name, error)});
}

}  // namespace

MeshMaterials mesh_materials(const std::filesystem::path& file) {
  MeshMaterials result;
  if (lower_case_extension(file) != ".obj") return result;
  const std::filesystem::path folder = file.parent_path();
  const std::string text = read_file(file);
  for_each_line(text, "mtllib", [&](const std::string& name) { add(result.libraries, folder, name); });
  for_each_line(text, "usemtl", [&](const std::string& name) {
    if (std::ranges::find(result.materials, name) == result.materials.end()) result.materials.push_back(name);
  });
  for (const NamedFile& library : result.libraries) {
    if (!library.exists) continue;
    const std::string materials = read_file(folder / library.name);
    for_each_line(materials, "map_Kd", [&](const std::string& words) {
      // Options come before the name.
      const bool has_options = words.starts_with('-');
      add(result.textures, (folder / library.name).parent_path(),
          has_options ? words.substr(words.find_last_of(" \t") + 1) : words);
    });
  }
  return result;
}

}  // namespace dpr::cli
