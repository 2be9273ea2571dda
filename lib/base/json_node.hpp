// JSON files read strictly: every value is asked for by type, and an error says where in the file it is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dpr {

/// Parses a file. Throws IoError where it cannot be read or is not JSON, with the line, and InvalidArgument
/// where an object has the same key twice (the JSON library would keep the last one without a word).
nlohmann::json read_json(const std::filesystem::path& file);

/// The same of a text; `file` is what messages call it.
nlohmann::json parse_json(const std::filesystem::path& file, std::string_view text);

/// A value of a JSON document and the path to it, such as "meshes[0].transform[2]". A view: the document must
/// outlive it. Every function that returns a value throws InvalidArgument where the value is of another kind.
class JsonNode {
 public:
  JsonNode(const nlohmann::json& document, const std::filesystem::path& file)
      : value_(&document), file_(file.string()) {}

  /// Throws unless this is an object without keys other than these.
  void require_keys(std::initializer_list<std::string_view> known) const {
    require_keys(std::span(known.begin(), known.size()));
  }
  void require_keys(std::span<const std::string_view> known) const;
  /// A member, if there is one; this must be an object.
  std::optional<JsonNode> find(std::string_view key) const;
  /// A member that must be there.
  JsonNode at(std::string_view key) const;
  /// The elements; this must be a list, of that length where one is given.
  std::vector<JsonNode> elements(std::optional<std::size_t> count = {}) const;

  float number() const;  ///< finite, also as a float
  bool boolean() const;
  std::string string() const;
  /// The file that this names, relative to the folder. Throws IoError, which names this too, where there is
  /// none.
  std::filesystem::path file_in(const std::filesystem::path& folder) const;
  glm::vec3 vec3() const;
  glm::mat4 mat4() const;  ///< four rows of four
  /// A whole number of at most that value; negative ones are refused.
  std::uint64_t whole_number(std::uint64_t most) const;
  int image_side() const;  ///< pixels, from 1 to the largest side of an image

  /// Name of this value in messages: "sigma (FILE)" and the like.
  std::string name() const;
  /// Throws InvalidArgument about this value.
  [[noreturn]] void fail(const std::string& got, const std::string& expected) const;

 private:
  JsonNode(const nlohmann::json& value, std::string path, std::string file)
      : value_(&value), path_(std::move(path)), file_(std::move(file)) {}

  [[noreturn]] void fail_type(const std::string& expected) const;
  std::string member_path(std::string_view key) const;

  const nlohmann::json* value_;
  std::string path_, file_;
};

}  // namespace dpr
