// The reader of PLY: the header is read, checked and written anew, and OpenMesh reads the body.
//
// What OpenMesh 9 does with such a file:
// - a number that it cannot read is a zero, and at the end of the file it goes on with zeros;
// - colours in floats are cut to eight bits, downwards; those of other types, and 300 in a text, wrap around;
// - a list other than the corners is skipped as if it were one number, unless custom properties are asked
// for;
//   then it is allocated at the length it claims, and in a text a property of type uchar is one character;
// - lists may be counted by uint8, uint16, uchar and int alone;
// - a normal that is not in floats is not skipped at all;
// - a header that never ends is read for ever.
//
// So its stream throws at the first number that cannot be read; and every property but the coordinates, the
// corners and a binary file's colours in bytes gets a name that means nothing to OpenMesh, and types that it
// skips correctly.
#include <OpenMesh/Core/IO/IOManager.hh>
#include <algorithm>
#include <array>
#include <locale>
#include <mutex>
#include <sstream>

#include "dpr/error.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/ply_importer.hpp"
#include "mesh/scan_text.hpp"
#include "mesh/silent_openmesh.hpp"

namespace dpr {
namespace {

struct Property {
  std::string name, type, list_count_type;  // the last one is empty but for lists
};

struct Element {
  std::string name;
  std::uint32_t count = 0;
  std::vector<Property> properties;
};

// Types by their short names; both names mean the same, and OpenMesh does not know all of both everywhere.
std::string short_type(std::string_view type) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 8> k_types{{{"int8", "char"},
                                                                                  {"uint8", "uchar"},
                                                                                  {"int16", "short"},
                                                                                  {"uint16", "ushort"},
                                                                                  {"int32", "int"},
                                                                                  {"uint32", "uint"},
                                                                                  {"float32", "float"},
                                                                                  {"float64", "double"}}};
  for (const auto& [long_name, short_name] : k_types) {
    if (type == long_name || type == short_name) return std::string(short_name);
  }
  return {};
}

bool is_floating(const std::string& type) { return type == "float" || type == "double"; }

std::size_t size_of(const std::string& type) {
  if (type.ends_with("char")) return 1;
  if (type.ends_with("short")) return 2;
  return type == "double" ? 8 : 4;
}

/// The names under which colours pass OpenMesh whole, as custom properties; what it calls "red" it cuts to
/// eight bits.
constexpr std::array<const char*, 3> k_custom_colors{"dpr_red", "dpr_green", "dpr_blue"};

/// How the colours of an element arrive.
struct ColorForm {
  bool custom = false;  ///< as custom properties
  bool native = false;  ///< as OpenMesh's colours
  double one = 1;       ///< what stands for the full intensity in a custom property
};

/// What is known of a file before its body is read.
struct PlyHeader {
  std::string text;       ///< for OpenMesh
  std::size_t bytes = 0;  ///< of the header in the file
  std::size_t lines = 0;  ///< of the header in the file
  bool binary = false;
  bool ends_with_faces = false;  ///< nothing may follow
  bool has_custom_properties = false;
  std::size_t vertices = 0, polygons = 0;
  ColorForm vertex_colors, face_colors;
};

class PlyHeaderReader {
 public:
  PlyHeaderReader(const std::filesystem::path& file, std::string_view bytes)
      : file_(file), size_(bytes.size()), lines_(scan::without_byte_order_mark(bytes)) {}

  void run() {
    read_header();
    Element& vertex = find("vertex");
    Element& face = find("face");
    check_order();
    std::vector<const Element*> read;
    for (const Element& element : elements_) {
      if (!element.properties.empty()) read.push_back(&element);
      if (&element == &face) break;  // what follows the faces is not read
    }
    header.binary = format_ != "ascii";
    prepare_vertices(vertex);
    prepare_faces(face);
    header.vertices = vertex.count;
    header.polygons = face.count;
    header.ends_with_faces = &face == &elements_.back();
    header.lines = lines_.number();
    header.bytes = size_ - lines_.rest().size();
    write_header(read);
    check_size(read);
    if (!header.binary && has_lists(face)) check_lists(face);
  }

  PlyHeader header;

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw IoError(file_, reason, lines_.number()); }

  void next_line() {
    if (!lines_.next()) fail("the header has no end: expected \"end_header\"");
    scan::split(lines_.line(), words_);
  }

  void read_header() {
    if (lines_.next()) scan::split(lines_.line(), words_);
    if (words_.size() != 1 || (words_[0] != "ply" && words_[0] != "PLY")) fail("not a PLY file");
    for (next_line(); words_.empty() || words_[0] != "end_header"; next_line()) {
      if (words_.empty() || words_[0] == "comment" || words_[0] == "obj_info") continue;
      if (words_[0] == "format") {
        format();
      } else if (words_[0] == "element") {
        element();
      } else if (words_[0] == "property") {
        property();
      } else {
        fail("got " + scan::quoted(words_[0]) + ", expected format, element, property or end_header");
      }
    }
    if (format_.empty()) fail("the header names no format");
  }

  void format() {
    constexpr std::array<std::string_view, 3> k_formats{"ascii", "binary_little_endian", "binary_big_endian"};
    if (words_.size() < 2 || std::find(k_formats.begin(), k_formats.end(), words_[1]) == k_formats.end()) {
      fail("expected the format ascii, binary_little_endian or binary_big_endian");
    }
    format_ = words_[1];
  }

  void element() {
    const std::optional<std::uint32_t> count =
        words_.size() == 3 ? scan::parse<std::uint32_t>(words_[2]) : std::nullopt;
    if (!count) fail("expected \"element NAME COUNT\"");
    elements_.push_back({std::string(words_[1]), *count, {}});
  }

  void property() {
    const bool is_list = words_.size() == 5 && words_[1] == "list";
    if (elements_.empty() || (!is_list && words_.size() != 3)) {
      fail("expected \"property TYPE NAME\" or \"property list TYPE TYPE NAME\" after an element");
    }
    Property property{std::string(words_.back()), short_type(words_[words_.size() - 2]), {}};
    if (is_list) property.list_count_type = short_type(words_[2]);
    if (property.type.empty() || (is_list && property.list_count_type.empty())) {
      fail("a property of unknown type: expected char, uchar, short, ushort, int, uint, float or double");
    }
    if (is_floating(property.list_count_type)) fail("a list counted in floats");
    const bool is_corners = property.name == "vertex_indices" || property.name == "vertex_index";
    if (format_ != "ascii" && property.list_count_type.ends_with("int") && !is_corners) {
      fail("the list " + property.name + " counted in int: expected uchar or ushort");
    }
    for (const Property& other : elements_.back().properties) {
      if (other.name == property.name) fail("the property " + property.name + " twice");
    }
    elements_.back().properties.push_back(std::move(property));
  }

  Element& find(const std::string& name) {
    const auto is_named = [&](const Element& element) { return element.name == name; };
    const auto found = std::find_if(elements_.begin(), elements_.end(), is_named);
    if (found == elements_.end()) fail("the header has no element " + name);
    if (std::find_if(std::next(found), elements_.end(), is_named) != elements_.end()) {
      fail("the header has the element " + name + " twice");
    }
    return *found;
  }

  void check_order() const {
    bool vertices_seen = false;
    for (const Element& element : elements_) {
      vertices_seen = vertices_seen || element.name == "vertex";
      if (element.name == "face") {
        if (!vertices_seen) fail("the element face before the element vertex");
        return;
      }
      for (const Property& property : element.properties) {
        if (property.list_count_type.empty()) continue;
        fail("the list " + property.name + " of the element " + element.name +
             ": expected lists of faces only");
      }
    }
  }

  void prepare_vertices(Element& vertex) {
    for (const char* axis : {"x", "y", "z"}) {
      const Property* property = find(vertex, axis);
      if (!property || !is_floating(property->type)) {
        fail("expected the vertex properties x, y and z, each float or double");
      }
    }
    header.vertex_colors = prepare_colors(vertex);
    rename(vertex, {"x", "y", "z"}, header.vertex_colors);
  }

  void prepare_faces(Element& face) {
    const Property* corners = face.properties.empty() ? nullptr : &face.properties[0];
    if (!corners || (corners->name != "vertex_indices" && corners->name != "vertex_index") ||
        corners->list_count_type.empty() || is_floating(corners->type)) {
      fail("expected the list vertex_indices as the first property of the element face");
    }
    header.face_colors = prepare_colors(face);
    rename(face, {"vertex_indices", "vertex_index"}, header.face_colors);
    header.has_custom_properties =
        has_lists(face) || header.vertex_colors.custom || header.face_colors.custom;
  }

  // Lists beside the corners.
  static bool has_lists(const Element& face) {
    const auto is_list = [](const Property& property) { return !property.list_count_type.empty(); };
    return std::any_of(face.properties.begin() + 1, face.properties.end(), is_list);
  }

  /// Throws where the file is too short for the numbers that its header promises, however short the lists.
  void check_size(const std::vector<const Element*>& read) const {
    std::uint64_t least = 0;
    for (const Element* element : read) {
      std::uint64_t bytes = 0;
      for (const Property& property : element->properties) {
        const bool is_list = !property.list_count_type.empty();
        const std::string& type = is_list ? property.list_count_type : property.type;
        bytes += header.binary ? size_of(type) : 2;  // in a text a digit and what parts it from the next
      }
      least += element->count * bytes;
    }
    // The last number of a text need not be parted from anything.
    if (lines_.rest().size() + (header.binary ? 0 : 1) >= least) return;
    throw IoError(file_,
                  "the file is truncated: its header promises " + std::to_string(least) + " bytes or more");
  }

  // No list of a face in a text may claim more than its line holds.
  void check_lists(const Element& face) {
    std::uint64_t before = 0;
    for (const Element* element = elements_.data(); element != &face; ++element) {
      before += element->properties.empty() ? 0 : element->count;
    }
    for (std::uint64_t i = 0; i < before + face.count && lines_.next();) {
      scan::split(lines_.line(), words_);
      if (words_.empty()) continue;
      if (i++ < before) continue;
      std::size_t word = 0;
      for (const Property& property : face.properties) {
        if (word >= words_.size()) fail("too few numbers for a face");
        const auto length = scan::parse<std::uint32_t>(words_[word++]);
        if (property.list_count_type.empty()) continue;
        if (!length || *length > words_.size() - word) fail("too few numbers for a face");
        word += *length;
      }
    }
  }

  // Only all three together are colours.
  ColorForm prepare_colors(Element& element) const {
    constexpr std::array<const char*, 3> k_names{"red", "green", "blue"};
    std::array<Property*, 3> channels{};
    for (std::size_t i = 0; i < k_names.size(); ++i) {
      channels[i] = find(element, k_names[i]);
      if (!channels[i]) channels[i] = find(element, "diffuse_" + std::string(k_names[i]));
      if (!channels[i] || !channels[i]->list_count_type.empty()) return {};
    }
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const std::string& type = channels[i]->type;
      if (type != channels[0]->type || (type != "uchar" && !is_floating(type))) {
        fail("the colours of the element " + element.name + " in " + type +
             ": expected uchar, float or double");
      }
      channels[i]->name = type == "uchar" && header.binary ? k_names[i] : k_custom_colors[i];
    }
    const bool in_bytes = channels[0]->type == "uchar", native = in_bytes && header.binary;
    return {!native, native, in_bytes ? 255.0 : 1.0};
  }

  static Property* find(Element& element, const std::string& name) {
    for (Property& property : element.properties) {
      if (property.name == name) return &property;
    }
    return nullptr;
  }

  static void rename(Element& element, std::initializer_list<std::string_view> kept,
                     const ColorForm& colors) {
    for (Property& property : element.properties) {
      const auto is_it = [&](std::string_view name) { return name == property.name; };
      if (std::any_of(kept.begin(), kept.end(), is_it)) continue;
      if (colors.custom && std::ranges::any_of(k_custom_colors, is_it)) continue;
      const bool is_color = property.name == "red" || property.name == "green" || property.name == "blue";
      if (!(is_color && colors.native)) property.name = "dpr_other_" + property.name;
    }
  }

  // The type under which OpenMesh reads a property as it stands: in a text the types only say how to parse.
  std::string written_type(const Property& property) const {
    if (header.binary) return property.type;
    if (property.name.starts_with("dpr_")) return "double";
    return is_floating(property.type) || property.type == "uchar" ? property.type : "int";
  }

  std::string written_count_type(const Property& property) const {
    const std::string& type = property.list_count_type;
    if (!header.binary || type == "uint" || type == "int") return "int";
    return type == "uchar" || type == "char" ? "uchar" : "uint16";
  }

  void write_header(const std::vector<const Element*>& elements) {
    header.text = "ply\nformat " + format_ + " 1.0\n";
    for (const Element* element : elements) {
      header.text += "element " + element->name + " " + std::to_string(element->count) + "\n";
      for (const Property& property : element->properties) {
        header.text += "property ";
        if (!property.list_count_type.empty()) header.text += "list " + written_count_type(property) + " ";
        header.text += written_type(property) + " " + property.name + "\n";
      }
    }
    header.text += "end_header\n";
  }

  const std::filesystem::path& file_;
  std::size_t size_;
  scan::Lines lines_;
  std::vector<std::string_view> words_;
  std::string format_;
  std::vector<Element> elements_;
};

/// OpenMesh's reader keeps state between files, so only one thread at a time may use it.
bool read_with_openmesh(std::istream& in, const PlyHeader& header, PlyImporter& importer) {
  using OpenMesh::IO::Options;
  static std::mutex openmesh;
  const std::lock_guard lock(openmesh);
  const SilentOpenMesh silence;  // our own errors say it better
  Options options;
  if (header.binary) options += Options::Binary;
  if (header.vertex_colors.native) options += Options::VertexColor;
  if (header.face_colors.native) options += Options::FaceColor;
  if (header.has_custom_properties) options += Options::Custom;
  try {
    in.imbue(std::locale::classic());
    in.exceptions(std::ios::failbit | std::ios::badbit);
    return OpenMesh::IO::IOManager().read(in, "ply", importer, options);
  } catch (const std::ios_base::failure&) {
    return false;
  }
}

/// Throws unless OpenMesh came to the end of the faces, and the file does not go on.
void check_end(const std::filesystem::path& file, const PlyHeader& header, bool complete,
               std::istringstream& in) {
  in.exceptions(std::ios::goodbit);
  const std::string_view text = in.view();
  const bool at_end = in.eof();
  in.clear();
  const std::size_t position = at_end ? text.size() : static_cast<std::size_t>(in.tellg());
  if (!complete && position == text.size()) throw IoError(file, "the file is truncated");
  if (!complete && header.binary) throw IoError(file, "OpenMesh cannot read the file");
  if (!complete) {
    const std::string_view read = text.substr(header.text.size(), position - header.text.size());
    const auto lines = static_cast<std::size_t>(std::ranges::count(read, '\n'));
    throw IoError(file, "got no number where one must be", header.lines + 1 + lines);
  }
  if (!header.ends_with_faces) return;
  const std::size_t rest = header.binary ? position : text.find_first_not_of(" \t\r\n", position);
  if (rest < text.size())
    throw IoError(file, "the file goes on after the last face that its header promises");
}

template <typename Number, typename Handle>
void take_channel(PlyImporter& importer, const ColorForm& form, int channel, std::vector<glm::vec3>& colors) {
  Handle handle;
  if (!importer.kernel()->get_property_handle(handle, k_custom_colors[static_cast<std::size_t>(channel)]))
    return;
  const std::vector<Number>& values = importer.kernel()->property(handle).data_vector();
  for (std::size_t i = 0; i < colors.size(); ++i)
    colors[i][channel] = static_cast<float>(static_cast<double>(values[i]) / form.one);
}

void take_custom_colors(const std::filesystem::path& file, const PlyHeader& header, PlyImporter& importer) {
  const ColorForm &of_vertices = header.vertex_colors, &of_faces = header.face_colors;
  if (of_vertices.custom) importer.vertex_colors.resize(header.vertices, glm::vec3(1));
  if (of_faces.custom) importer.polygon_colors.resize(header.polygons, glm::vec3(1));
  for (int c = 0; c < 3; ++c) {
    take_channel<float, OpenMesh::VPropHandleT<float>>(importer, of_vertices, c, importer.vertex_colors);
    take_channel<double, OpenMesh::VPropHandleT<double>>(importer, of_vertices, c, importer.vertex_colors);
    take_channel<float, OpenMesh::FPropHandleT<float>>(importer, of_faces, c, importer.polygon_colors);
    take_channel<double, OpenMesh::FPropHandleT<double>>(importer, of_faces, c, importer.polygon_colors);
  }
  const auto require_bytes = [&](const ColorForm& form, const std::vector<glm::vec3>& colors) {
    for (const glm::vec3& color : colors) {
      if (form.one == 1 || glm::clamp(color, 0.0F, 1.0F) == color) continue;
      throw IoError(file, "a colour in bytes that is not from 0 to 255");
    }
  };
  require_bytes(of_vertices, importer.vertex_colors);
  require_bytes(of_faces, importer.polygon_colors);
}

/// Colours of polygons for each of their triangles.
std::vector<glm::vec3> triangle_colors(const PlyImporter& importer) {
  std::vector<glm::vec3> colors;
  for (std::size_t i = 0; i < importer.polygon_colors.size(); ++i)
    colors.resize(importer.polygon_ends[i], importer.polygon_colors[i]);
  return colors;
}

}  // namespace

Mesh read_ply(const std::filesystem::path& file, std::string bytes) {
  PlyHeaderReader reader(file, bytes);
  reader.run();
  const PlyHeader& header = reader.header;
  bytes.replace(0, header.bytes, header.text);
  std::istringstream in(std::move(bytes));
  PlyImporter importer;
  const bool complete = read_with_openmesh(in, header, importer);
  check_end(file, header, complete, in);
  if (importer.short_polygon) {
    throw IoError(file, "face " + std::to_string(*importer.short_polygon) + " has fewer than three corners");
  }
  if (importer.positions.size() != header.vertices || importer.polygon_ends.size() != header.polygons)
    throw IoError(file, "OpenMesh cannot read the file");
  take_custom_colors(file, header, importer);
  Mesh mesh;
  mesh.vertex_colors = std::move(importer.vertex_colors);
  if (mesh.vertex_colors.empty()) mesh.face_colors = triangle_colors(importer);
  mesh.positions = std::move(importer.positions);
  mesh.faces = std::move(importer.triangles);
  return mesh;
}

}  // namespace dpr
