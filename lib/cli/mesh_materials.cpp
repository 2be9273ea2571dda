#include "cli/mesh_materials.hpp"

#include <algorithm>

#include "base/input_file.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/scan_text.hpp"

namespace dpr::cli {
namespace {

/// A library that is not there has no materials; the reader of meshes says so.
void read_library(const std::filesystem::path& file, ObjMaterials& materials) {
  std::error_code error;
  if (std::filesystem::is_regular_file(file, error)) read_mtl(file, read_file(file), materials);
}

}  // namespace

std::vector<MeshMaterial> mesh_materials(const std::filesystem::path& file) {
  std::vector<MeshMaterial> used;
  if (lower_case_extension(file) != ".obj") return used;
  const std::string text = read_file(file);
  ObjMaterials materials;
  scan::Lines lines(scan::without_byte_order_mark(text));
  std::vector<std::string_view> words;
  while (lines.next()) {
    scan::split(lines.line(), words);
    if (words.size() < 2) continue;
    const std::string_view rest = scan::behind(lines.line(), words[0]);
    if (words[0] == "mtllib") {  // one name, which may have spaces, or several
      read_library(file.parent_path() / rest, materials);
      for (std::size_t i = 1; words.size() > 2 && i < words.size(); ++i)
        read_library(file.parent_path() / words[i], materials);
    }
    if (words[0] != "usemtl" || std::ranges::find(used, rest, &MeshMaterial::name) != used.end()) continue;
    const auto found = materials.find(rest);
    used.push_back({std::string(rest), found == materials.end() ? "" : found->second.texture});
  }
  return used;
}

}  // namespace dpr::cli
