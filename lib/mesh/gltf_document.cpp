#include "mesh/gltf_document.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "base/input_file.hpp"
#include "dpr/error.hpp"
#include "mesh/little_endian.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

constexpr std::string_view k_magic = "glTF";
constexpr std::uint32_t k_json_chunk = 0x4e4f534a, k_binary_chunk = 0x004e4942;
constexpr std::uint64_t k_most = std::numeric_limits<std::uint32_t>::max();

/// A type of components: its number in the JSON, and how its numbers are read.
struct Component {
  std::uint32_t type;
  std::size_t bytes;
  float (*number)(std::string_view bytes, std::size_t offset);
  float largest;  ///< which normalised numbers are parts of
};

template <typename Number>
float number(std::string_view bytes, std::size_t offset) {
  return static_cast<float>(little_endian<Number>(bytes, offset));
}

template <typename Number>
constexpr Component component(std::uint32_t type) {
  return {type, sizeof(Number), number<Number>, static_cast<float>(std::numeric_limits<Number>::max())};
}

constexpr std::uint32_t k_unsigned_byte = 5121, k_unsigned_short = 5123, k_unsigned_int = 5125,
                        k_float = 5126;
constexpr std::array<Component, 6> k_components{component<std::int8_t>(5120),
                                                component<std::uint8_t>(k_unsigned_byte),
                                                component<std::int16_t>(5122),
                                                component<std::uint16_t>(k_unsigned_short),
                                                component<std::uint32_t>(k_unsigned_int),
                                                component<float>(k_float)};

const Component* component_of(std::uint64_t type) {
  const auto* const found = std::ranges::find(k_components, type, &Component::type);
  return found == k_components.end() ? nullptr : found;
}

std::uint64_t whole_number_or(const JsonNode& node, std::string_view key, std::uint64_t otherwise) {
  const std::optional<JsonNode> found = node.find(key);
  return found ? found->whole_number(k_most) : otherwise;
}

/// The bytes of base64 (RFC 4648), or nothing where a character is none of it.
std::optional<std::string> decode_base64(std::string_view text) {
  constexpr std::string_view k_digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  std::uint32_t bits = 0;
  unsigned count = 0;
  while (text.ends_with('=')) text.remove_suffix(1);
  for (const char c : text) {
    const std::size_t digit = k_digits.find(c);
    if (digit == std::string_view::npos) return {};
    bits = bits << 6U | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes += static_cast<char>(bits >> count & 0xffU);
  }
  return bytes;
}

/// A path with "%20" and the like decoded.
std::string decode_percent(std::string_view uri) {
  std::string path;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    unsigned value = 0;
    const char* const begin = uri.data() + i + 1;
    if (uri[i] == '%' && i + 2 < uri.size() &&
        std::from_chars(begin, begin + 2, value, 16).ptr == begin + 2) {
      path += static_cast<char>(value);
      i += 2;
    } else {
      path += uri[i];
    }
  }
  return path;
}

}  // namespace

GltfDocument::GltfDocument(std::filesystem::path file, std::string_view bytes) : file_(std::move(file)) {
  if (bytes.starts_with(k_magic)) {
    read_container(bytes);
  } else {
    json_ = parse_json(file_, scan::without_byte_order_mark(bytes));
  }
}

void GltfDocument::read_container(std::string_view bytes) {
  const auto require = [&](bool holds, const std::string& reason) {
    if (!holds) throw IoError(file_, reason);
  };
  constexpr std::size_t k_header = 12, k_chunk_header = 8;
  require(bytes.size() >= k_header, "the file is truncated");
  const auto version = little_endian<std::uint32_t>(bytes, 4);
  require(version == 2, "got version " + std::to_string(version) + " of GLB, expected 2");
  const auto length = little_endian<std::uint32_t>(bytes, 8);
  require(length <= bytes.size(),
          "the file is truncated: its header promises " + std::to_string(length) + " bytes");
  require(length == bytes.size(),
          "the file goes on after the " + std::to_string(length) + " bytes that its header promises");
  for (std::size_t place = k_header, chunk = 0; place < bytes.size(); ++chunk) {
    require(bytes.size() - place >= k_chunk_header, "the file is truncated");
    const auto size = little_endian<std::uint32_t>(bytes, place),
               type = little_endian<std::uint32_t>(bytes, place + 4);
    place += k_chunk_header;
    require(size <= bytes.size() - place, "chunk " + std::to_string(chunk) + " is longer than the file");
    require(chunk > 0 || type == k_json_chunk, "the first chunk is not JSON");
    if (chunk == 0) json_ = parse_json(file_, bytes.substr(place, size));
    if (chunk == 1 && type == k_binary_chunk) {
      binary_ = bytes.substr(place, size);
      has_binary_ = true;
    }
    place += size;
  }
}

const JsonNode& GltfDocument::named(const std::string& list, const JsonNode& number) {
  auto known = lists_.find(list);
  if (known == lists_.end()) {
    const std::optional<JsonNode> found = root().find(list);
    known = lists_.emplace(list, found ? found->elements() : std::vector<JsonNode>()).first;
  }
  if (known->second.empty()) number.fail("a number", "none: there are no " + list);
  return known->second[number.whole_number(known->second.size() - 1)];
}

bool GltfDocument::decode(const JsonNode& uri, std::string& data) {
  const std::string text = uri.string();
  if (!text.starts_with("data:")) return false;
  constexpr std::string_view k_encoding = ";base64,";
  const std::size_t end = text.find(k_encoding);
  std::optional<std::string> decoded;
  if (end != std::string::npos)
    decoded = decode_base64(std::string_view(text).substr(end + k_encoding.size()));
  if (!decoded) uri.fail("other data", "base64");
  data = std::move(*decoded);
  return true;
}

std::filesystem::path GltfDocument::beside(const JsonNode& uri) const {
  const std::string text = uri.string();
  if (text.find("://") != std::string::npos) uri.fail("\"" + text + "\"", "a file beside the document");
  return file_.parent_path() / decode_percent(text);
}

std::string_view GltfDocument::buffer(const JsonNode& number) {
  const JsonNode& buffer = named("buffers", number);
  const std::uint64_t length = buffer.at("byteLength").whole_number(k_most);
  const auto index = static_cast<std::size_t>(number.whole_number(k_most));
  const std::optional<JsonNode> uri = buffer.find("uri");
  std::string_view bytes = binary_;
  if (uri) {
    auto known = buffers_.find(index);
    if (known == buffers_.end()) {
      std::string data;
      if (!decode(*uri, data)) data = read_file(beside(*uri));
      known = buffers_.emplace(index, std::move(data)).first;
    }
    bytes = known->second;
  } else if (index > 0 || !has_binary_) {
    buffer.fail("no \"uri\"", "one: the file has no bytes for it");
  }
  if (bytes.size() < length) buffer.fail(std::to_string(bytes.size()) + " bytes", std::to_string(length));
  return bytes.substr(0, length);
}

std::string_view GltfDocument::view(const JsonNode& number) {
  const JsonNode& view = named("bufferViews", number);
  if (const auto extensions = view.find("extensions");
      extensions && extensions->find("EXT_meshopt_compression"))
    view.fail("compressed bytes", "bytes as they are");
  const std::string_view bytes = buffer(view.at("buffer"));
  const std::uint64_t offset = whole_number_or(view, "byteOffset", 0);
  const std::uint64_t length = view.at("byteLength").whole_number(k_most);
  if (offset > bytes.size() || length > bytes.size() - offset) {
    view.fail(std::to_string(length) + " bytes from " + std::to_string(offset) + " on",
              "some within its buffer's " + std::to_string(bytes.size()));
  }
  return bytes.substr(offset, length);
}

GltfDocument::Accessor GltfDocument::accessor(const JsonNode& number) {
  const JsonNode& node = named("accessors", number);
  if (node.find("sparse")) node.fail("a sparse accessor", "one without \"sparse\"");
  const JsonNode type_node = node.at("componentType"), shape_node = node.at("type");
  const Component* const component = component_of(type_node.whole_number(k_most));
  if (!component) type_node.fail("another type", "5120 to 5123, 5125 or 5126");
  constexpr std::array<std::string_view, 4> k_shapes{"SCALAR", "VEC2", "VEC3", "VEC4"};
  const std::string shape = shape_node.string();
  const auto* const found = std::ranges::find(k_shapes, shape);
  if (found == k_shapes.end()) shape_node.fail("\"" + shape + "\"", "SCALAR, VEC2, VEC3 or VEC4");
  const std::optional<JsonNode> view_number = node.find("bufferView");
  if (!view_number) node.fail("no \"bufferView\"", "one");
  const std::optional<JsonNode> normalized = node.find("normalized");
  Accessor accessor{view(*view_number),
                    node.at("count").whole_number(k_most),
                    0,
                    static_cast<std::size_t>(found - k_shapes.begin()) + 1,
                    component->type,
                    normalized && normalized->boolean()};
  const std::uint64_t size = accessor.components * component->bytes,
                      offset = whole_number_or(node, "byteOffset", 0);
  accessor.stride = whole_number_or(named("bufferViews", *view_number), "byteStride", size);
  if (accessor.stride < size)
    node.fail("a \"byteStride\" of " + std::to_string(accessor.stride), std::to_string(size) + " or more");
  const std::uint64_t end = accessor.count == 0 ? 0 : offset + accessor.stride * (accessor.count - 1) + size;
  if (offset > accessor.bytes.size() || end > accessor.bytes.size()) {
    node.fail(std::to_string(accessor.count) + " elements that end at byte " + std::to_string(end),
              "an end within its view's " + std::to_string(accessor.bytes.size()));
  }
  accessor.bytes = accessor.bytes.substr(offset);
  return accessor;
}

std::vector<glm::vec4> GltfDocument::vectors(const JsonNode& number) {
  const Accessor from = accessor(number);
  if (from.components < 2) number.fail("an accessor of single numbers", "one of vectors");
  const Component& component = *component_of(from.type);
  const bool is_scaled = from.is_normalized && from.type != k_float;
  std::vector<glm::vec4> vectors(from.count, glm::vec4(0, 0, 0, 1));
  for (std::size_t i = 0; i < from.count; ++i) {
    for (std::size_t c = 0; c < from.components; ++c) {
      float& value = vectors[i][static_cast<int>(c)];
      value = component.number(from.bytes, i * from.stride + c * component.bytes);
      if (is_scaled) value = std::max(value / component.largest, -1.0F);
    }
  }
  return vectors;
}

std::vector<std::uint32_t> GltfDocument::indices(const JsonNode& number) {
  const Accessor from = accessor(number);
  const bool is_unsigned =
      from.type == k_unsigned_byte || from.type == k_unsigned_short || from.type == k_unsigned_int;
  if (from.components != 1 || !is_unsigned)
    number.fail("an accessor of others", "one of unsigned whole numbers");
  std::vector<std::uint32_t> indices(from.count);
  for (std::size_t i = 0; i < from.count; ++i) {
    const std::size_t place = i * from.stride;
    if (from.type == k_unsigned_byte) indices[i] = little_endian<std::uint8_t>(from.bytes, place);
    if (from.type == k_unsigned_short) indices[i] = little_endian<std::uint16_t>(from.bytes, place);
    if (from.type == k_unsigned_int) indices[i] = little_endian<std::uint32_t>(from.bytes, place);
  }
  return indices;
}

}  // namespace dpr
