// Mesh files. Reading: the file is scanned, OpenMesh reads it into a polygon soup, the soup is compared with
// what the scan counted, and polygons become triangle fans. Writing needs no library.
#include <OpenMesh/Core/IO/IOManager.hh>
#include <OpenMesh/Core/IO/reader/OFFReader.hh>
#include <algorithm>
#include <locale>
#include <mutex>
#include <sstream>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "base/temporary_file.hpp"
#include "dpr/mesh.hpp"
#include "mesh/mesh_scan.hpp"
#include "mesh/scan_text.hpp"
#include "mesh/silent_openmesh.hpp"
#include "mesh/soup_importer.hpp"

namespace dpr {
namespace {

MeshScan scan_file(const std::filesystem::path& file, const std::string& extension) {
  if (extension == ".obj") return scan_obj(file, read_file(file));
  if (extension == ".ply") return scan_ply(file, read_file(file));
  if (extension == ".off") return scan_off(file, read_file(file));
  if (extension == ".stl") return scan_stl(file, read_file(file));
  throw IoError(file, "got the extension " + scan::quoted(extension) + ", expected .obj, .ply, .off or .stl");
}

// OpenMesh's readers make streams of their own, which take the program's locale: with one that writes 0,5
// they would read 0.5 as 0 or 5. A program in the classic locale, as most are, is left alone.
class ClassicLocale {
 public:
  ClassicLocale() {
    if (before_ != std::locale::classic()) std::locale::global(std::locale::classic());
  }
  ~ClassicLocale() {
    if (before_ != std::locale::classic()) std::locale::global(before_);
  }
  ClassicLocale(const ClassicLocale&) = delete;
  ClassicLocale& operator=(const ClassicLocale&) = delete;

 private:
  std::locale before_;
};

OpenMesh::IO::Options options_for(const MeshScan& scan) {
  OpenMesh::IO::Options options;
  if (scan.binary) options += OpenMesh::IO::Options::Binary;
  if (scan.has_vertex_colors) options += OpenMesh::IO::Options::VertexColor;
  if (scan.has_face_colors || scan.asks_material_colors) options += OpenMesh::IO::Options::FaceColor;
  if (scan.asks_custom_properties) options += OpenMesh::IO::Options::Custom;
  return options;
}

std::size_t line_at(const MeshScan& scan, std::size_t position) {
  const auto begin = scan.text.begin();
  const auto lines = std::count(begin + static_cast<std::ptrdiff_t>(scan.header_bytes),
                                begin + static_cast<std::ptrdiff_t>(position), '\n');
  return scan.header_lines + 1 + static_cast<std::size_t>(lines);
}

// OpenMesh takes a number that it cannot read for a zero, and at the end of the file goes on with zeros. A
// stream that throws stops it at the first one, where the line can still be told.
void read_ply(const std::filesystem::path& file, const MeshScan& scan, SoupImporter& soup) {
  std::istringstream in(scan.text);
  OpenMesh::IO::Options options = options_for(scan);
  bool complete = false;
  try {
    in.exceptions(std::ios::failbit | std::ios::badbit);
    complete = OpenMesh::IO::IOManager().read(in, "ply", soup, options);
  } catch (const std::ios_base::failure&) {
    complete = false;
  }
  in.exceptions(std::ios::goodbit);
  const bool at_end = in.eof();
  in.clear();
  const std::size_t end = scan.text.size();
  const std::size_t position = at_end ? end : static_cast<std::size_t>(in.tellg());
  if (!complete && position == end) throw IoError(file, "the file is truncated");
  if (!complete && scan.binary) throw IoError(file, "OpenMesh cannot read the file");
  if (!complete) throw IoError(file, "got no number where one must be", line_at(scan, position));
  if (!scan.ends_with_polygons) return;
  const std::size_t rest = scan.binary ? position : scan.text.find_first_not_of(" \t\r\n", position);
  if (rest < end) throw IoError(file, "the file goes on after the last face that its header promises");
}

// Readers keep state between files, so only one thread at a time may use them.
SoupImporter read_soup(const std::filesystem::path& file, const std::string& extension,
                       const MeshScan& scan) {
  static std::mutex openmesh;
  const std::lock_guard lock(openmesh);
  const SilentOpenMesh silence;  // the scan has said it better
  const ClassicLocale locale;
  SoupImporter soup;
  OpenMesh::IO::Options options = options_for(scan);
  bool complete = true;
  if (extension == ".ply") {
    read_ply(file, scan, soup);
  } else if (extension == ".obj") {
    // By name, because material files are looked for beside the file.
    complete = OpenMesh::IO::IOManager().read(file.string(), soup, options);
  } else {
    std::istringstream in(scan.text);
    // A stream is read with the header options of the last file; this look at the header makes it this one.
    if (extension == ".off") static_cast<void>(OpenMesh::IO::OFFReader().can_u_read(file.string()));
    complete = OpenMesh::IO::IOManager().read(in, extension.substr(1), soup, options);
  }
  if (!complete) throw IoError(file, "OpenMesh cannot read the file");
  return soup;
}

bool has_three_different(Polygon corners) {
  std::sort(corners.begin(), corners.end());
  return std::unique(corners.begin(), corners.end()) - corners.begin() >= 3;
}

// OpenMesh shortens polygons with equal corners, and drops those with fewer than three different ones; the
// scan has kept them.
void restore_repeated_corners(const MeshScan& scan, SoupImporter& soup) {
  if (scan.repeated_corners.empty()) return;
  const bool has_colors = !soup.face_colors.empty();
  if (has_colors) soup.face_colors.resize(soup.polygons.size(), glm::vec3(1));
  std::vector<Polygon> polygons;
  std::vector<glm::vec3> colors;
  std::size_t next = 0;
  while (polygons.size() < scan.polygons || next < soup.polygons.size()) {
    const auto repeated = scan.repeated_corners.find(polygons.size());
    const bool is_repeated = repeated != scan.repeated_corners.end();
    const bool arrived =
        next < soup.polygons.size() && (!is_repeated || has_three_different(repeated->second));
    if (!arrived && !is_repeated) break;
    polygons.push_back(is_repeated ? repeated->second : soup.polygons[next]);
    if (has_colors) colors.push_back(arrived ? soup.face_colors[next] : glm::vec3(1));
    if (arrived) ++next;
  }
  soup.polygons = std::move(polygons);
  soup.face_colors = std::move(colors);
}

void compare(const std::filesystem::path& file, const MeshScan& scan, const SoupImporter& soup) {
  if (soup.polygons.size() != scan.polygons) {
    throw IoError(file, "got " + std::to_string(soup.polygons.size()) + " faces, expected " +
                            std::to_string(scan.polygons));
  }
  if (scan.vertices && soup.positions.size() != *scan.vertices) {
    throw IoError(file, "got " + std::to_string(soup.positions.size()) + " vertices, expected " +
                            std::to_string(*scan.vertices));
  }
  for (std::size_t i = 0; i < soup.polygons.size(); ++i) {
    if (soup.polygons[i].size() >= 3) continue;
    throw IoError(file, "face " + std::to_string(i) + " has " + std::to_string(soup.polygons[i].size()) +
                            " corners, expected at least three");
  }
}

template <typename Number, typename Handle>
void take_channel(SoupImporter& soup, int channel, std::vector<glm::vec3>& colors, std::size_t size) {
  Handle handle;
  if (!soup.kernel()->get_property_handle(handle, k_ply_float_colors[channel])) return;
  colors.resize(size, glm::vec3(1));
  for (std::size_t i = 0; i < size; ++i) {
    colors[i][channel] = static_cast<float>(soup.kernel()->property(handle).data_vector()[i]);
  }
}

void take_float_colors(SoupImporter& soup) {
  for (int channel = 0; channel < 3; ++channel) {
    const std::size_t vertices = soup.positions.size(), polygons = soup.polygons.size();
    take_channel<float, OpenMesh::VPropHandleT<float>>(soup, channel, soup.vertex_colors, vertices);
    take_channel<double, OpenMesh::VPropHandleT<double>>(soup, channel, soup.vertex_colors, vertices);
    take_channel<float, OpenMesh::FPropHandleT<float>>(soup, channel, soup.face_colors, polygons);
    take_channel<double, OpenMesh::FPropHandleT<double>>(soup, channel, soup.face_colors, polygons);
  }
}

void take_scanned_colors(MeshScan& scan, SoupImporter& soup) {
  if (!scan.vertex_colors.empty()) soup.vertex_colors = std::move(scan.vertex_colors);
  if (!scan.face_colors.empty()) soup.face_colors = std::move(scan.face_colors);
  if (!soup.vertex_colors.empty()) soup.vertex_colors.resize(soup.positions.size(), glm::vec3(1));
  if (!soup.face_colors.empty()) soup.face_colors.resize(soup.polygons.size(), glm::vec3(1));
}

Mesh triangulate(SoupImporter soup, MeshScan scan) {
  Mesh mesh;
  mesh.texcoords = std::move(scan.texcoords);
  mesh.positions = std::move(soup.positions);
  mesh.vertex_colors = std::move(soup.vertex_colors);
  const bool has_face_colors = mesh.vertex_colors.empty() && !soup.face_colors.empty();
  for (std::size_t i = 0; i < soup.polygons.size(); ++i) {
    const Polygon& polygon = soup.polygons[i];
    for (std::size_t corner = 2; corner < polygon.size(); ++corner) {
      mesh.faces.emplace_back(polygon[0], polygon[corner - 1], polygon[corner]);
      if (has_face_colors) mesh.face_colors.push_back(soup.face_colors[i]);
      if (mesh.texcoords.empty()) continue;
      const Polygon& texcoords = scan.polygon_texcoords[i];
      mesh.face_texcoords.emplace_back(texcoords[0], texcoords[corner - 1], texcoords[corner]);
    }
  }
  return mesh;
}

void append(std::string& text, const glm::vec3& values) {
  for (int i = 0; i < 3; ++i) text += " " + checks::text(values[i]);
}

std::string obj_text(const std::filesystem::path& file, const Mesh& mesh) {
  if (!mesh.face_colors.empty()) {
    throw IoError(file, "OBJ has no face colours: expected vertex colours, or the extension .ply");
  }
  std::string text;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    text += "v";
    append(text, mesh.positions[i]);
    if (!mesh.vertex_colors.empty()) append(text, mesh.vertex_colors[i]);
    text += '\n';
  }
  const bool has_texcoords = !mesh.face_texcoords.empty();
  for (const glm::vec2& uv : mesh.texcoords)
    text += "vt " + checks::text(uv.x) + " " + checks::text(uv.y) + "\n";
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    text += "f";
    for (int i = 0; i < 3; ++i) {
      text += " " + std::to_string(mesh.faces[f][i] + 1);
      if (has_texcoords) text += "/" + std::to_string(mesh.face_texcoords[f][i] + 1);
    }
    text += '\n';
  }
  return text;
}

void append_bytes(std::string& text, const glm::vec3& color) {
  const glm::vec3 bytes = glm::round(255.0F * glm::clamp(color, 0.0F, 1.0F));
  for (int i = 0; i < 3; ++i) text += " " + std::to_string(static_cast<int>(bytes[i]));
}

std::string ply_text(const Mesh& mesh) {
  const std::string colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(mesh.positions.size()) +
                     "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!mesh.vertex_colors.empty()) text += colors;
  text += "element face " + std::to_string(mesh.faces.size()) + "\nproperty list uchar int vertex_indices\n";
  if (!mesh.face_colors.empty()) text += colors;
  text += "end_header\n";
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis)
      text += (axis > 0 ? " " : "") + checks::text(mesh.positions[i][axis]);
    if (!mesh.vertex_colors.empty()) append_bytes(text, mesh.vertex_colors[i]);
    text += '\n';
  }
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    text += "3";
    for (int corner = 0; corner < 3; ++corner) text += " " + std::to_string(mesh.faces[i][corner]);
    if (!mesh.face_colors.empty()) append_bytes(text, mesh.face_colors[i]);
    text += '\n';
  }
  return text;
}

}  // namespace

Mesh read_mesh(const std::filesystem::path& file) {
  const std::string extension = lower_case_extension(file);
  MeshScan scan = scan_file(file, extension);
  SoupImporter soup = read_soup(file, extension, scan);
  restore_repeated_corners(scan, soup);
  compare(file, scan, soup);
  if (scan.asks_custom_properties) take_float_colors(soup);
  take_scanned_colors(scan, soup);
  Mesh mesh = triangulate(std::move(soup), std::move(scan));
  validate(mesh, file.string());
  return mesh;
}

void write_mesh(const std::filesystem::path& file, const Mesh& mesh) {
  const std::string extension = lower_case_extension(file);
  if (extension != ".obj" && extension != ".ply") {
    throw IoError(file, "got the extension " + scan::quoted(extension) + ", expected .obj or .ply");
  }
  validate(mesh, "mesh for " + file.string());
  const std::string text = extension == ".obj" ? obj_text(file, mesh) : ply_text(mesh);
  write_whole_file(file, [&](std::ostream& out) { out << text; });
}

}  // namespace dpr
