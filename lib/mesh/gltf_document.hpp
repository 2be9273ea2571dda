// A glTF 2.0 document as Khronos specifies it: JSON, the buffers that it names, and the numbers in them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/json_node.hpp"

namespace dpr {

/// A document read from GLB or from JSON. What it names is checked where it is asked for: every function throws
/// InvalidArgument, with the place in the JSON, where that is of another kind or lies outside what holds it.
class GltfDocument {
 public:
  /// `bytes` are the file's content, which must outlive this; beside the file its buffers are looked for.
  GltfDocument(std::filesystem::path file, std::string_view bytes);

  const std::filesystem::path& file() const { return file_; }
  JsonNode root() const { return {json_, file_}; }
  /// The element of a list at the root that a number in the JSON names.
  const JsonNode& named(const std::string& list, const JsonNode& number);

  /// [element] the vectors of an accessor: two to four numbers of any type, of 0, 0, 0, 1.
  std::vector<glm::vec4> vectors(const JsonNode& accessor);
  /// [element] the whole numbers of an accessor.
  std::vector<std::uint32_t> indices(const JsonNode& accessor);
  /// The bytes of a buffer view.
  std::string_view view(const JsonNode& number);
  /// True where a URI holds its data itself; then `data` gets them.
  static bool decode(const JsonNode& uri, std::string& data);
  /// The file that another URI names, beside the document.
  std::filesystem::path beside(const JsonNode& uri) const;

 private:
  struct Accessor {
    std::string_view bytes;  ///< from the first element on
    std::size_t count, stride, components;
    std::uint32_t type;
    bool is_normalized;
  };

  void read_container(std::string_view bytes);
  Accessor accessor(const JsonNode& number);
  std::string_view buffer(const JsonNode& number);

  std::filesystem::path file_;
  nlohmann::json json_;
  std::string_view binary_;  ///< GLB's second chunk
  bool has_binary_ = false;
  std::map<std::string, std::vector<JsonNode>> lists_;
  std::map<std::size_t, std::string> buffers_;  ///< those of files and of data URIs, by number
};

}  // namespace dpr
