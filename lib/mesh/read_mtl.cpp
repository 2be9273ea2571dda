// The reader of OBJ's material libraries: the diffuse colour of each material and the name of its texture.
#include "dpr/error.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

/// Kd r g b, or r alone for all three.
glm::vec3 diffuse_color(const std::filesystem::path& file, std::size_t line,
                        const std::vector<std::string_view>& words) {
  glm::vec3 color;
  for (int i = 0; i < 3; ++i) {
    const std::size_t word = words.size() == 2 ? 1 : static_cast<std::size_t>(i) + 1;
    const std::optional<float> value =
        word < words.size() ? scan::parse_coordinate(words[word]) : std::nullopt;
    if (!value) throw IoError(file, "expected Kd with one or three finite numbers", line);
    color[i] = *value;
  }
  return color;
}

}  // namespace

void read_mtl(const std::filesystem::path& file, std::string_view text, Materials& materials) {
  scan::Lines lines(scan::without_byte_order_mark(text));
  std::vector<std::string_view> words;
  Material* material = nullptr;
  while (lines.next()) {
    scan::split(lines.line(), words);
    if (words.empty()) continue;
    const std::string_view rest = scan::behind(lines.line(), words[0]);
    if (words[0] == "newmtl") material = &(materials[std::string(rest)] = {});
    if (!material) continue;
    if (words[0] == "map_Kd") material->texture = rest;
    if (words[0] != "Kd") continue;
    scan::split(lines.line().substr(0, lines.line().find('#')), words);
    material->diffuse = diffuse_color(file, lines.number(), words);
  }
}

}  // namespace dpr
