// The reader of OBJ's material libraries: how each material reflects light, its texture and the options of
// that.
#include <algorithm>
#include <array>
#include <span>

#include "dpr/error.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

/// Kd or Ks with r g b, or r alone for all three.
glm::vec3 rgb(const std::filesystem::path& file, std::size_t line,
              const std::vector<std::string_view>& words) {
  glm::vec3 values;
  for (int i = 0; i < 3; ++i) {
    const std::size_t word = words.size() == 2 ? 1 : static_cast<std::size_t>(i) + 1;
    const std::optional<float> value =
        word < words.size() ? scan::parse_coordinate(words[word]) : std::nullopt;
    if (!value || *value < 0) {
      throw IoError(
          file, "expected " + std::string(words[0]) + " with one or three finite numbers, at least 0", line);
    }
    values[i] = *value;
  }
  return values;
}

/// The last word: d may have an option before it.
float last_number(const std::filesystem::path& file, std::size_t line,
                  const std::vector<std::string_view>& words) {
  const std::optional<float> value = words.size() > 1 ? scan::parse_coordinate(words.back()) : std::nullopt;
  if (!value) throw IoError(file, "expected " + std::string(words[0]) + " with a finite number", line);
  return *value;
}

/// Maps of what varies over a surface beside the diffuse colour.
constexpr std::array<std::string_view, 10> k_unread_maps{"bump",  "decal",  "disp",   "map_bump", "map_Bump",
                                                         "map_d", "map_Ks", "map_Ns", "norm",     "refl"};

/// A statement of numbers, with the comment behind them left out.
void read_reflection(const std::filesystem::path& file, std::size_t line,
                     const std::vector<std::string_view>& words, ObjReflection& reflection) {
  if (words[0] == "Kd") reflection.diffuse = rgb(file, line, words);
  if (words[0] == "Ks") reflection.specular = rgb(file, line, words);
  if (words[0] == "Ns") {
    reflection.shininess = last_number(file, line, words);
    if (*reflection.shininess < 0) throw IoError(file, "expected Ns with a number, at least 0", line);
  }
  if (words[0] == "illum") reflection.has_highlights = last_number(file, line, words) >= 2;
  if (words[0] == "d") reflection.opacity = last_number(file, line, words);
  if (words[0] == "Tr") reflection.opacity = 1 - last_number(file, line, words);
  if (std::ranges::find(k_unread_maps, words[0]) == k_unread_maps.end()) return;
  if (!reflection.unread.empty()) reflection.unread += ", ";
  reflection.unread += words[0];
}

/// An option of a texture, and how many words may follow it.
struct TextureOption {
  std::string_view name;
  std::size_t least, most;
  bool is_number;
};

constexpr std::array<TextureOption, 13> k_texture_options{{{"-blendu", 1, 1, false},
                                                           {"-blendv", 1, 1, false},
                                                           {"-bm", 1, 1, true},
                                                           {"-boost", 1, 1, true},
                                                           {"-cc", 1, 1, false},
                                                           {"-clamp", 1, 1, false},
                                                           {"-imfchan", 1, 1, false},
                                                           {"-mm", 2, 2, true},
                                                           {"-o", 1, 3, true},
                                                           {"-s", 1, 3, true},
                                                           {"-t", 1, 3, true},
                                                           {"-texres", 1, 1, true},
                                                           {"-type", 1, 1, false}}};

using Words = std::span<const std::string_view>;

/// The words of an option at the beginning of `words`.
Words option_words(const std::filesystem::path& file, std::size_t line, const TextureOption& option,
                   Words words) {
  std::size_t count = 1;
  const auto fits = [&] {
    return count < words.size() && (!option.is_number || scan::parse_coordinate(words[count]));
  };
  while (count <= option.most && fits()) ++count;
  if (count > option.least) return words.first(count);
  throw IoError(file,
                "expected " + std::string(option.name) + " with " + std::to_string(option.least) +
                    (option.is_number ? " finite numbers or more" : " word"),
                line);
}

void apply_option(const std::filesystem::path& file, std::size_t line, Words words, ObjMaterial& material) {
  const auto take = [&](glm::vec2& value) {
    for (std::size_t i = 0; i < 2 && i + 1 < words.size(); ++i)
      value[static_cast<int>(i)] = *scan::parse_coordinate(words[i + 1]);
  };
  if (words[0] == "-s") {
    take(material.scale);
  } else if (words[0] == "-o") {
    take(material.offset);
  } else if (words[0] == "-clamp") {
    if (words[1] != "on" && words[1] != "off")
      throw IoError(file, "got -clamp " + std::string(words[1]) + ", expected on or off", line);
    material.wrap = words[1] == "on" ? Wrap::clamp : Wrap::repeat;
  } else {
    if (!material.ignored_options.empty()) material.ignored_options += ", ";
    material.ignored_options += words[0];
  }
}

/// map_Kd [options] name, which may have spaces inside.
void read_texture_map(const std::filesystem::path& file, const scan::Lines& lines, Words words,
                      ObjMaterial& material) {
  ObjMaterial plain;
  plain.reflection = material.reflection;
  material = plain;
  std::string_view before = words[0];
  words = words.subspan(1);
  while (!words.empty()) {
    const auto* const option = std::ranges::find(k_texture_options, words[0], &TextureOption::name);
    if (option == k_texture_options.end()) break;
    const Words taken = option_words(file, lines.number(), *option, words);
    apply_option(file, lines.number(), taken, material);
    before = taken.back();
    words = words.subspan(taken.size());
  }
  material.texture = scan::behind(lines.line(), before);
  std::string path = material.texture;
  std::ranges::replace(path, '\\', '/');  // as Windows writes it
  material.texture_file = file.parent_path() / path;
}

}  // namespace

void read_mtl(const std::filesystem::path& file, std::string_view text, ObjMaterials& materials) {
  scan::Lines lines(scan::without_byte_order_mark(text));
  std::vector<std::string_view> words;
  ObjMaterial* material = nullptr;
  while (lines.next()) {
    scan::split(lines.line(), words);
    if (words.empty()) continue;
    const std::string_view rest = scan::behind(lines.line(), words[0]);
    if (words[0] == "newmtl") material = &(materials[std::string(rest)] = {});
    if (!material) continue;
    if (words[0] == "map_Kd") read_texture_map(file, lines, words, *material);
    scan::split(lines.line().substr(0, lines.line().find('#')), words);
    if (!words.empty()) read_reflection(file, lines.number(), words, material->reflection);
  }
}

}  // namespace dpr
