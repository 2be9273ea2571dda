// The strict reading of JSON, on top of nlohmann's parser.
#include "base/json_node.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "dpr/error.hpp"

namespace dpr {
namespace {

std::string in_quotes(std::string_view key) { return "\"" + std::string(key) + "\""; }

// Describes a value in messages.
std::string described(const nlohmann::json& value) {
  constexpr std::size_t k_longest = 40;
  if (value.is_object()) return "an object";
  if (value.is_array()) return "a list of " + std::to_string(value.size());
  std::string text = value.dump();
  return text.size() > k_longest ? text.substr(0, k_longest) + "..." : text;
}

// Sees every key while the file is parsed; nlohmann's object keeps only the last of equal ones.
class DuplicateKeys {
 public:
  explicit DuplicateKeys(const std::filesystem::path& file) : file_(file) {}

  void see(nlohmann::json::parse_event_t event, const nlohmann::json& parsed) {
    using Event = nlohmann::json::parse_event_t;
    if (event == Event::object_start) objects_.emplace_back();
    if (event == Event::object_end) objects_.pop_back();
    if (event != Event::key) return;
    const auto key = parsed.get<std::string>();
    Object& object = objects_.back();
    object.current = key;
    if (!object.keys.insert(key).second) {
      throw InvalidArgument(path() + " (" + file_.string() + ")", "the key twice", "it once");
    }
  }

 private:
  struct Object {
    std::set<std::string> keys;
    std::string current;
  };

  std::string path() const {
    std::string text;
    for (const Object& object : objects_) text += (text.empty() ? "" : ".") + object.current;
    return text;
  }

  const std::filesystem::path& file_;
  std::vector<Object> objects_;
};

// The reason without the parser's own numbering: "[json.exception...] parse error at line 2, column 3: ...".
std::string reason_of(const nlohmann::json::exception& error) {
  const std::string text = error.what();
  const std::size_t begin = text.find("] ");
  return begin == std::string::npos ? text : text.substr(begin + 2);
}

}  // namespace

nlohmann::json read_json(const std::filesystem::path& file) { return parse_json(file, read_file(file)); }

nlohmann::json parse_json(const std::filesystem::path& file, std::string_view text) {
  DuplicateKeys duplicates(file);
  try {
    return nlohmann::json::parse(text, [&](int, nlohmann::json::parse_event_t event, nlohmann::json& parsed) {
      duplicates.see(event, parsed);
      return true;
    });
  } catch (const nlohmann::json::parse_error& parse_error) {
    const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(parse_error.byte, text.size()));
    const auto line = 1 + std::count(text.begin(), end, '\n');
    throw IoError(file, "not JSON: " + reason_of(parse_error), static_cast<std::size_t>(line));
  } catch (const nlohmann::json::exception& other) {
    throw IoError(file, "not JSON: " + reason_of(other));
  }
}

std::filesystem::path JsonNode::file_in(const std::filesystem::path& folder) const {
  std::filesystem::path file = folder / string();
  std::error_code error;
  if (!std::filesystem::exists(file, error))
    throw IoError(file, "the file does not exist, which " + name() + " names");
  return file;
}

std::string JsonNode::name() const { return (path_.empty() ? "the document" : path_) + " (" + file_ + ")"; }

void JsonNode::fail(const std::string& got, const std::string& expected) const {
  throw InvalidArgument(name(), got, expected);
}

void JsonNode::fail_type(const std::string& expected) const { fail(described(*value_), expected); }

std::string JsonNode::member_path(std::string_view key) const {
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

void JsonNode::require_keys(std::span<const std::string_view> known) const {
  if (!value_->is_object()) fail_type("an object");
  for (const auto& item : value_->items()) {
    if (std::find(known.begin(), known.end(), item.key()) != known.end()) continue;
    std::string list;
    for (const std::string_view key : known) list += (list.empty() ? "" : ", ") + std::string(key);
    throw InvalidArgument(name(), "the unknown key " + in_quotes(item.key()), "keys out of " + list);
  }
}

std::optional<JsonNode> JsonNode::find(std::string_view key) const {
  if (!value_->is_object()) fail_type("an object");
  const auto found = value_->find(key);
  if (found == value_->end()) return {};
  return JsonNode(*found, member_path(key), file_);
}

JsonNode JsonNode::at(std::string_view key) const {
  std::optional<JsonNode> member = find(key);
  if (!member) fail("no key " + in_quotes(key), "one");
  return *std::move(member);
}

std::vector<JsonNode> JsonNode::elements(std::optional<std::size_t> count) const {
  if (!value_->is_array() || (count && value_->size() != *count)) {
    fail_type(count ? "a list of " + std::to_string(*count) : "a list");
  }
  std::vector<JsonNode> nodes;
  nodes.reserve(value_->size());
  for (std::size_t i = 0; i < value_->size(); ++i) {
    nodes.push_back(JsonNode((*value_)[i], path_ + "[" + std::to_string(i) + "]", file_));
  }
  return nodes;
}

float JsonNode::number() const {
  if (!value_->is_number()) fail_type("a number");
  const auto value = value_->get<double>();
  const auto number = static_cast<float>(value);
  if (!std::isfinite(number)) fail_type("a number in the range of 32-bit floats");
  return number;
}

bool JsonNode::boolean() const {
  if (!value_->is_boolean()) fail_type("true or false");
  return value_->get<bool>();
}

std::string JsonNode::string() const {
  if (!value_->is_string()) fail_type("a string");
  return value_->get<std::string>();
}

std::uint64_t JsonNode::whole_number(std::uint64_t most) const {
  // Non-negative integers are stored as unsigned ones by the parser.
  if (!value_->is_number_unsigned() || value_->get<std::uint64_t>() > most) {
    fail_type("a whole number from 0 to " + std::to_string(most));
  }
  return value_->get<std::uint64_t>();
}

int JsonNode::image_side() const {
  constexpr auto k_most = static_cast<std::uint64_t>(checks::k_largest_side);
  if (!value_->is_number_unsigned() || value_->get<std::uint64_t>() - 1 >= k_most)
    fail_type("a whole number from 1 to " + std::to_string(k_most));
  return value_->get<int>();
}

glm::vec3 JsonNode::vec3() const {
  const std::vector<JsonNode> axes = elements(3);
  return {axes[0].number(), axes[1].number(), axes[2].number()};
}

glm::mat4 JsonNode::mat4() const {
  glm::mat4 matrix;
  const std::vector<JsonNode> rows = elements(4);
  for (int row = 0; row < 4; ++row) {
    const std::vector<JsonNode> entries = rows[static_cast<std::size_t>(row)].elements(4);
    for (int column = 0; column < 4; ++column) {
      matrix[column][row] = entries[static_cast<std::size_t>(column)].number();
    }
  }
  return matrix;
}

}  // namespace dpr
