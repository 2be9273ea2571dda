// Valid mesh files in the many ways in which programs write them: random meshes, each written in random
// styles of every format, must be read as what was written. The writers share nothing with the readers.
#include <doctest/doctest.h>

#include <algorithm>
#include <bit>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <random>

#include "mesh/mesh_reader.hpp"

namespace mesh_styles_test {

using namespace dpr;

namespace {

using Polygon = std::vector<std::uint32_t>;

struct Truth {
  std::vector<glm::vec3> positions, vertex_colors;  // [vertex], the latter or none
  std::vector<Polygon> polygons;
  std::vector<glm::vec3> polygon_colors;  // [polygon] or none
};

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  unsigned below(unsigned n) { return static_cast<unsigned>(engine_() % n); }
  bool one_in(unsigned n) { return below(n) == 0; }
  float uniform() { return static_cast<float>(engine_()) / 4294967296.0F; }
  template <typename Value>
  const Value& of(const std::vector<Value>& values) {
    return values[below(static_cast<unsigned>(values.size()))];
  }
  template <typename Value>
  void shuffle(std::vector<Value>& values) {
    for (std::size_t i = values.size(); i > 1; --i)
      std::swap(values[i - 1], values[below(static_cast<unsigned>(i))]);
  }

 private:
  std::mt19937 engine_;
};

// A number of any magnitude; many are equal.
float coordinate(Random& random) {
  if (random.one_in(3)) return static_cast<float>(random.below(4));
  const int exponent = random.one_in(4) ? static_cast<int>(random.below(200)) - 100 : 0;
  return std::ldexp(2 * random.uniform() - 1, exponent);
}

Truth random_mesh(Random& random) {
  Truth truth;
  const unsigned vertices = 3 + random.below(random.one_in(8) ? 400 : 20);
  for (unsigned i = 0; i < vertices; ++i) {
    const float x = coordinate(random), y = coordinate(random);
    truth.positions.emplace_back(x, y, coordinate(random));
  }
  const unsigned polygons = 1 + random.below(30);
  for (unsigned i = 0; i < polygons; ++i) {
    Polygon& polygon = truth.polygons.emplace_back(3 + (random.one_in(3) ? random.below(5) : 0));
    for (std::uint32_t& corner : polygon) corner = random.below(vertices);
  }
  return truth;
}

// Bytes as colours, so that formats with eight bits hold them.
std::vector<glm::vec3> random_colors(Random& random, std::size_t count) {
  std::vector<glm::vec3> colors;
  for (std::size_t i = 0; i < count; ++i) {
    const unsigned r = random.below(256), g = random.below(256), b = 2 + random.below(254);
    colors.push_back(glm::vec3(r, g, b) / 255.0F);
  }
  return colors;
}

// A text in one style of ends of lines, spaces, numbers and comments.
class Text {
 public:
  explicit Text(Random& random) : random_(random), end_(random.one_in(3) ? "\r\n" : "\n") {}

  std::string content;

  void word(const std::string& text) {
    if (!content.empty() && content.back() != '\n') content += random_.of(spaces_);
    content += text;
  }
  /// Writes a number and makes it the one that the text means.
  void number(float& value) {
    char text[64];
    std::snprintf(text, sizeof text, random_.of(formats_), static_cast<double>(value));
    value = static_cast<float>(std::strtod(text, nullptr));
    word(text);
  }
  void numbers(glm::vec3& values) {
    for (int i = 0; i < 3; ++i) number(values[i]);
  }
  void end() { content += end_; }
  void line(const std::string& text) {
    word(text);
    end();
  }
  void end_with_comment() {
    if (random_.one_in(10)) content += random_.of<std::string>({" # 1 2 3", "# \\", "  #"});
    end();
    while (random_.one_in(12)) content += random_.of<std::string>({"", "# v 1 2 3", "   "}) + end_;
  }

 private:
  Random& random_;
  std::string end_;
  std::vector<std::string> spaces_{" ", " ", "  ", "\t"};
  std::vector<const char*> formats_{"%.9g", "%.9g", "%+.8e", "%.17g", "%.6f", "%E", "%#.4g"};
};

void byte_order_mark(Random& random, std::string& content) {
  if (random.one_in(6)) content.insert(0, "\xEF\xBB\xBF");
}

std::string obj(Random& random, Truth& truth) {
  Text text(random);
  if (random.one_in(2)) text.line("o thing # 7");
  text.line("vt 0.5 0.25");
  text.line("vn 0 0 1");
  const bool colored = random.one_in(3);
  if (colored) truth.vertex_colors = random_colors(random, truth.positions.size());
  std::size_t written = 0;
  const auto vertices_to = [&](std::size_t end) {
    for (; written < end; ++written) {
      text.word("v");
      text.numbers(truth.positions[written]);
      if (colored && random.one_in(10))
        truth.vertex_colors[written] = glm::vec3(1);
      else if (colored)
        text.numbers(truth.vertex_colors[written]);
      else if (random.one_in(8))
        text.word("1.0");
      text.end_with_comment();
    }
  };
  const std::vector<std::string> endings{"", "", "/1", "//1", "/1/1", "/-1", "/1/"};
  for (const Polygon& polygon : truth.polygons) {
    if (random.one_in(2)) vertices_to(truth.positions.size());
    if (random.one_in(8))
      text.line(random.of<std::string>({"s off", "g a b", "usemtl gold", "l 1 2", "# f 1 2"}));
    text.word("f");
    for (const std::uint32_t corner : polygon) {
      const bool relative = corner < written && random.one_in(3);
      const long index = relative ? static_cast<long>(corner) - static_cast<long>(written) : corner + 1L;
      text.word(std::to_string(index) + random.of(endings));
    }
    text.end_with_comment();
  }
  vertices_to(truth.positions.size());
  byte_order_mark(random, text.content);
  return text.content;
}

std::string off(Random& random, Truth& truth) {
  Text text(random);
  const bool texcoords = random.one_in(4), colors = random.one_in(3), normals = random.one_in(3);
  const std::string counts = std::to_string(truth.positions.size()) + " " +
                             std::to_string(truth.polygons.size()) + (random.one_in(2) ? " 0" : "");
  text.word(std::string(texcoords ? "ST" : "") + (colors ? "C" : "") + (normals ? "N" : "") + "OFF");
  if (random.one_in(4))
    text.word(counts);
  else
    text.end_with_comment(), text.word(counts);
  text.end_with_comment();
  if (colors) truth.vertex_colors = random_colors(random, truth.positions.size());
  const bool in_bytes = random.one_in(2), alpha = random.one_in(2);
  const auto color = [&](glm::vec3& value) {
    for (int i = 0; i < 3; ++i) {
      if (in_bytes)
        text.word(std::to_string(std::lround(255 * value[i])));
      else
        text.number(value[i]);
    }
    if (alpha) text.word(in_bytes ? "255" : "0.5");
  };
  for (std::size_t i = 0; i < truth.positions.size(); ++i) {
    text.numbers(truth.positions[i]);
    if (normals) text.word("0 0 1");
    if (colors) color(truth.vertex_colors[i]);
    if (texcoords) text.word("0.25 0.75");
    text.end_with_comment();
  }
  const bool face_colors = !in_bytes || random.one_in(2);
  if (face_colors) truth.polygon_colors = random_colors(random, truth.polygons.size());
  for (std::size_t i = 0; i < truth.polygons.size(); ++i) {
    text.word(std::to_string(truth.polygons[i].size()));
    for (const std::uint32_t corner : truth.polygons[i]) text.word(std::to_string(corner));
    if (face_colors) color(truth.polygon_colors[i]);
    text.end_with_comment();
  }
  byte_order_mark(random, text.content);
  return text.content;
}

// The values of a PLY: in a text words, else bytes of either order.
class PlyBody {
 public:
  PlyBody(Random& random, const std::string& format) : text(random), format_(format) {}

  Text text;

  void value(const std::string& type, double number) {
    if (type == "float" || type == "float32") return real(static_cast<float>(number));
    if (type == "double" || type == "float64") return real(number);
    const auto whole = static_cast<std::int64_t>(number);
    if (format_ == "ascii") return text.word(std::to_string(whole));
    const std::size_t size = type.find("char") != type.npos || type.ends_with("int8")  ? 1
                             : type.find("short") != type.npos || type.ends_with("16") ? 2
                                                                                       : 4;
    bytes(static_cast<std::uint64_t>(whole), size);
  }
  void coordinate(const std::string& type, float& number) {
    if (format_ == "ascii")
      text.number(number);
    else
      value(type, static_cast<double>(number));
  }
  void end() {
    if (format_ == "ascii") text.end();
  }

 private:
  template <typename Real>
  void real(Real number) {
    if (format_ != "ascii") {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &number, sizeof number);
      return bytes(bits, sizeof number);
    }
    char word[64];
    std::snprintf(word, sizeof word, "%.17g", static_cast<double>(number));
    text.word(word);
  }
  void bytes(std::uint64_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t place = format_ == "binary_big_endian" ? size - 1 - i : i;
      text.content += static_cast<char>(value >> (8 * place) & 0xffU);
    }
  }

  std::string format_;
};

class PlyWriter {
 public:
  PlyWriter(Random& random, Truth& truth)
      : random_(random),
        truth_(truth),
        format_(random.of<std::string>({"ascii", "binary_little_endian", "binary_big_endian"})),
        header_(random),
        body_(random, format_) {}

  std::string run() {
    header_.line("ply");
    header_.line("format " + format_ + " 1.0");
    header_.line("comment element vertex 9");
    if (random_.one_in(2)) header_.line("obj_info made at random");
    if (random_.one_in(3)) other_element("camera");
    vertices();
    if (random_.one_in(3)) other_element("light");
    faces();
    if (random_.one_in(3)) other_element("edge");
    header_.line("end_header");
    byte_order_mark(random_, header_.content);
    return header_.content + body_.text.content;
  }

 private:
  struct Property {
    std::string type, name;
  };

  std::string scalar() { return random_.of(scalars_); }

  void declare(const std::vector<Property>& properties) {
    for (const Property& property : properties)
      header_.line("property " + property.type + " " + property.name);
  }

  void other_element(const std::string& name) {
    const unsigned count = 1 + random_.below(3);
    const std::vector<Property> properties{{scalar(), "x"}, {scalar(), "red"}};
    header_.line("element " + name + " " + std::to_string(count));
    declare(properties);
    for (unsigned i = 0; i < count; ++i) {
      for (const Property& property : properties) body_.value(property.type, 7);
      body_.end();
    }
  }

  std::vector<Property> color_properties() {
    const std::string prefix = random_.one_in(3) ? "diffuse_" : "",
                      type = random_.of<std::string>({"uchar", "uint8", "float", "float32", "double"});
    return {{type, prefix + "red"}, {type, prefix + "green"}, {type, prefix + "blue"}};
  }

  void color(const Property& property, const glm::vec3& value) {
    const int channel = property.name.ends_with("red") ? 0 : property.name.ends_with("green") ? 1 : 2;
    const bool in_bytes = property.type.starts_with("u");
    const auto number = static_cast<double>(value[channel]);
    body_.value(property.type, in_bytes ? std::round(255 * number) : number);
  }

  void vertices() {
    header_.line("element vertex " + std::to_string(truth_.positions.size()));
    std::vector<Property> properties;
    for (const char* axis : {"x", "y", "z"})
      properties.push_back({random_.of<std::string>({"float", "float32", "double", "float64"}), axis});
    if (random_.one_in(2)) {
      truth_.vertex_colors = random_colors(random_, truth_.positions.size());
      for (const Property& property : color_properties()) properties.push_back(property);
    }
    for (const char* name : {"nx", "quality", "s", "alpha"}) {
      if (random_.one_in(4)) properties.push_back({scalar(), name});
    }
    random_.shuffle(properties);
    declare(properties);
    for (std::size_t i = 0; i < truth_.positions.size(); ++i) {
      for (const Property& property : properties) {
        const std::string& name = property.name;
        if (name == "x" || name == "y" || name == "z")
          body_.coordinate(property.type, truth_.positions[i][name[0] - 'x']);
        else if (name.ends_with("red") || name.ends_with("green") || name.ends_with("blue"))
          color(property, truth_.vertex_colors[i]);
        else
          body_.value(property.type, 9);
      }
      body_.end();
    }
  }

  void faces() {
    header_.line("element face " + std::to_string(truth_.polygons.size()));
    const std::string count_type =
                          random_.of<std::string>({"uchar", "uint8", "char", "ushort", "int", "uint32"}),
                      index_type = random_.of<std::string>({"int", "uint", "int32", "ushort", "short"});
    header_.line("property list " + count_type + " " + index_type + " " +
                 random_.of<std::string>({"vertex_indices", "vertex_index"}));
    std::vector<Property> properties;
    if (random_.one_in(2)) {
      properties = color_properties();
      truth_.polygon_colors = random_colors(random_, truth_.polygons.size());
    }
    if (random_.one_in(3)) properties.push_back({scalar(), "group"});
    if (random_.one_in(3)) properties.push_back({"list uchar float", "texcoord"});
    if (random_.one_in(4)) properties.push_back({"list ushort short", "neighbours"});
    random_.shuffle(properties);
    declare(properties);
    for (std::size_t i = 0; i < truth_.polygons.size(); ++i) {
      body_.value(count_type, static_cast<double>(truth_.polygons[i].size()));
      for (const std::uint32_t corner : truth_.polygons[i]) body_.value(index_type, corner);
      for (const Property& property : properties) {
        if (property.type.starts_with("list"))
          list(property.type);
        else if (property.name == "group")
          body_.value(property.type, 3);
        else
          color(property, truth_.polygon_colors[i]);
      }
      body_.end();
    }
  }

  void list(const std::string& type) {
    const bool short_list = type.ends_with("short");
    const unsigned length = random_.below(7);
    body_.value(short_list ? "ushort" : "uchar", length);
    for (unsigned i = 0; i < length; ++i) body_.value(short_list ? "short" : "float", 5);
  }

  Random& random_;
  Truth& truth_;
  std::string format_;
  Text header_;
  PlyBody body_;
  const std::vector<std::string> scalars_{"char",  "uchar",  "short",   "ushort", "int",   "uint",
                                          "float", "double", "int8",    "uint8",  "int16", "uint16",
                                          "int32", "uint32", "float32", "float64"};
};

std::vector<glm::uvec3> fans(const Truth& truth, std::vector<glm::vec3>* colors = nullptr) {
  std::vector<glm::uvec3> faces;
  for (std::size_t p = 0; p < truth.polygons.size(); ++p) {
    const Polygon& polygon = truth.polygons[p];
    for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
      faces.emplace_back(polygon[0], polygon[i], polygon[i + 1]);
      if (colors && !truth.polygon_colors.empty()) colors->push_back(truth.polygon_colors[p]);
    }
  }
  return faces;
}

std::string text_stl(Random& random, Truth& truth) {
  Text text(random);
  text.line("solid made by nobody");
  std::vector<glm::vec3> written;
  for (glm::vec3& position : truth.positions) {
    Text digits(random);  // a vertex has the same digits in every facet
    digits.numbers(position);
  }
  for (const glm::uvec3& face : fans(truth)) {
    text.line("facet normal nan 0 1");
    text.line("outer loop");
    for (int i = 0; i < 3; ++i) {
      const glm::vec3& p = truth.positions[face[i]];
      char line[128];
      std::snprintf(line, sizeof line, "vertex %.9g %.9g\t%.9g", static_cast<double>(p.x),
                    static_cast<double>(p.y), static_cast<double>(p.z));
      text.line(line);
    }
    text.line("endloop");
    text.line("endfacet");
  }
  text.line("endsolid");
  byte_order_mark(random, text.content);
  return text.content;
}

std::string binary_stl(Random& random, const Truth& truth) {
  std::string bytes = random.one_in(2) ? "solid, and yet binary" : "nothing";
  bytes.resize(80, ' ');
  const auto append = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  static_assert(std::endian::native == std::endian::little);
  const std::vector<glm::uvec3> faces = fans(truth);
  append(static_cast<std::uint32_t>(faces.size()));
  for (const glm::uvec3& face : faces) {
    append(glm::vec3(0));
    for (int i = 0; i < 3; ++i) append(truth.positions[face[i]]);
    append(std::uint16_t{0x1234});
  }
  return bytes;
}

// Positions one by one, looked up naively; facets with equal corners left out.
Mesh welded(const Truth& truth) {
  Mesh mesh;
  const auto vertex = [&](const glm::vec3& position) {
    const auto found = std::find(mesh.positions.begin(), mesh.positions.end(), position);
    if (found == mesh.positions.end()) mesh.positions.push_back(position);
    return static_cast<std::uint32_t>(std::find(mesh.positions.begin(), mesh.positions.end(), position) -
                                      mesh.positions.begin());
  };
  for (const glm::uvec3& face : fans(truth)) {
    const glm::vec3 &a = truth.positions[face.x], &b = truth.positions[face.y], &c = truth.positions[face.z];
    if (a == b || b == c || c == a) continue;
    const std::uint32_t first = vertex(a), second = vertex(b);
    mesh.faces.emplace_back(first, second, vertex(c));
  }
  return mesh;
}

bool is_near(const std::vector<glm::vec3>& a, const std::vector<glm::vec3>& b) {
  return std::ranges::equal(
      a, b, [](const glm::vec3& x, const glm::vec3& y) { return glm::length(x - y) < 1e-6F; });
}

/// The content as it is read, compared with the truth: positions bit for bit, the colours up to the rounding
/// of a division.
bool is_read(const std::string& name, const std::string& content, const Truth& truth) {
  Notes notes;
  const Mesh mesh = parse_mesh(name, content, notes);
  std::vector<glm::vec3> face_colors;
  const std::vector<glm::uvec3> faces = fans(truth, &face_colors);
  if (!truth.vertex_colors.empty()) face_colors.clear();
  return mesh.positions == truth.positions && mesh.faces == faces &&
         is_near(mesh.vertex_colors, truth.vertex_colors) && is_near(mesh.face_colors, face_colors);
}

bool is_welded(const std::string& content, const Truth& truth) {
  const Mesh expected = welded(truth);
  if (expected.faces.empty()) return true;  // no mesh to read
  Notes notes;
  const Mesh mesh = parse_mesh("random.stl", content, notes);
  return mesh.positions == expected.positions && mesh.faces == expected.faces;
}

}  // namespace

TEST_SUITE("robustness") {
  TEST_CASE("random meshes in random styles of every format are read as they were written") {
    constexpr unsigned k_meshes = 400;
    for (unsigned seed = 0; seed < k_meshes; ++seed) {
      CAPTURE(seed);
      Random random(seed);
      const Truth mesh = random_mesh(random);
      for (int i = 0; i < 2; ++i) {
        Truth truth = mesh;
        const std::string content = obj(random, truth);
        CHECK_MESSAGE(is_read("random.obj", content, truth), content);
      }
      for (int i = 0; i < 3; ++i) {
        Truth truth = mesh;
        const std::string content = PlyWriter(random, truth).run();
        CHECK_MESSAGE(is_read("random.ply", content, truth), content);
      }
      Truth truth = mesh;
      const std::string content = off(random, truth);
      CHECK_MESSAGE(is_read("random.off", content, truth), content);
      truth = mesh;
      const std::string facets = text_stl(random, truth);
      CHECK_MESSAGE(is_welded(facets, truth), facets);
      CHECK(is_welded(binary_stl(random, mesh), mesh));
    }
  }

  TEST_CASE("a mesh with one index or one digit changed is not taken for the same") {
    Random random(1);
    Truth truth = random_mesh(random);
    const std::string content = obj(random, truth);
    REQUIRE(is_read("random.obj", content, truth));
    Truth other = truth;
    std::swap(other.polygons[0][0], other.polygons[0][1]);
    CHECK(is_read("random.obj", content, other) == (other.polygons[0][0] == other.polygons[0][1]));
    other = truth;
    other.positions[1].z = std::nextafter(other.positions[1].z, 1e9F);
    CHECK_FALSE(is_read("random.obj", content, other));
  }
}

}  // namespace mesh_styles_test
