// The reader of PLY: OpenMesh reads the body, below a header of our own (ply_header.hpp).
#include <OpenMesh/Core/IO/IOManager.hh>
#include <algorithm>
#include <locale>
#include <mutex>
#include <numeric>
#include <sstream>

#include "base/checks.hpp"
#include "dpr/error.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/ply_header.hpp"
#include "mesh/ply_importer.hpp"
#include "mesh/scan_text.hpp"
#include "mesh/silent_openmesh.hpp"

namespace dpr {
namespace {

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

/// Throws the reason why OpenMesh ended at that position, before the end of the faces.
[[noreturn]] void fail_incomplete(const std::filesystem::path& file, const PlyHeader& header,
                                  std::istream& in, std::streamoff position) {
  in.seekg(0, std::ios::end);
  if (position == in.tellg()) throw IoError(file, "the file is truncated");
  if (header.binary) throw IoError(file, "OpenMesh cannot read the file");
  const auto begin = static_cast<std::streamoff>(header.text.size());
  std::string read(static_cast<std::size_t>(std::max<std::streamoff>(position - begin, 0)), ' ');
  in.seekg(begin);
  in.read(read.data(), static_cast<std::streamsize>(read.size()));
  const auto lines = static_cast<std::size_t>(std::ranges::count(read, '\n'));
  throw IoError(file, "got no number where one must be", header.lines + 1 + lines);
}

/// Throws unless OpenMesh came to the end of the faces, and the file does not go on.
void check_end(const std::filesystem::path& file, const PlyHeader& header, bool complete, std::istream& in) {
  in.exceptions(std::ios::goodbit);
  const bool at_end = in.eof();
  in.clear();
  if (at_end) in.seekg(0, std::ios::end);
  if (!complete) fail_incomplete(file, header, in, in.tellg());
  if (!header.ends_with_faces) return;
  if (!header.binary) in >> std::ws;
  if (in.peek() != std::istream::traits_type::eof())
    throw IoError(file, "the file goes on after the last face that its header promises");
}

template <typename Number, typename Handle>
void take_channel(PlyImporter& importer, const char* name, double one, int channel,
                  std::vector<glm::vec3>& vectors) {
  Handle handle;
  if (!importer.kernel()->get_property_handle(handle, name)) return;
  const std::vector<Number>& values = importer.kernel()->property(handle).data_vector();
  for (std::size_t i = 0; i < vectors.size(); ++i)
    vectors[i][channel] = static_cast<float>(static_cast<double>(values[i]) / one);
}

void take_custom_colors(const std::filesystem::path& file, const PlyHeader& header, PlyImporter& importer) {
  const ColorForm &of_vertices = header.vertex_colors, &of_faces = header.face_colors;
  if (of_vertices.custom) importer.vertex_colors.resize(header.vertices, glm::vec3(1));
  if (of_faces.custom) importer.polygon_colors.resize(header.polygons, glm::vec3(1));
  std::vector<glm::vec3>&vertices = importer.vertex_colors, &polygons = importer.polygon_colors;
  for (int c = 0; c < 3; ++c) {
    const char* const name = k_custom_colors[static_cast<std::size_t>(c)];
    take_channel<float, OpenMesh::VPropHandleT<float>>(importer, name, of_vertices.one, c, vertices);
    take_channel<double, OpenMesh::VPropHandleT<double>>(importer, name, of_vertices.one, c, vertices);
    take_channel<float, OpenMesh::FPropHandleT<float>>(importer, name, of_faces.one, c, polygons);
    take_channel<double, OpenMesh::FPropHandleT<double>>(importer, name, of_faces.one, c, polygons);
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

/// Vectors of vertices that arrive as custom properties.
template <std::size_t count>
std::vector<glm::vec3> custom_vectors(PlyImporter& importer, const std::array<const char*, count>& names) {
  std::vector<glm::vec3> vectors(importer.positions.size());
  for (std::size_t i = 0; i < count; ++i) {
    take_channel<float, OpenMesh::VPropHandleT<float>>(importer, names[i], 1, static_cast<int>(i), vectors);
    take_channel<double, OpenMesh::VPropHandleT<double>>(importer, names[i], 1, static_cast<int>(i), vectors);
  }
  return vectors;
}

/// Coordinates of the corners of polygons, 2 numbers each. Those of a polygon that has none, or too few, are
/// left at k_no_texture, all of its triangles.
template <typename Number>
void take_corner_texcoords(PlyImporter& importer, Mesh& mesh) {
  OpenMesh::FPropHandleT<std::vector<Number>> handle;
  if (!importer.kernel()->get_property_handle(handle, k_custom_corner_texcoords)) return;
  const std::vector<std::vector<Number>>& lists = importer.kernel()->property(handle).data_vector();
  std::vector<std::uint32_t> corners;
  std::size_t begin = 0;
  for (std::size_t polygon = 0; polygon < importer.polygon_ends.size(); ++polygon) {
    const std::size_t end = importer.polygon_ends[polygon];
    corners.resize(end - begin + 2);
    if (lists[polygon].size() == 2 * corners.size()) {
      std::iota(corners.begin(), corners.end(), static_cast<std::uint32_t>(mesh.texcoords.size()));
      for (std::size_t i = 0; i < corners.size(); ++i)
        mesh.texcoords.emplace_back(lists[polygon][2 * i], lists[polygon][2 * i + 1]);
      append_fan(corners, mesh.face_texcoords);
    }
    mesh.face_texcoords.resize(end, glm::uvec3(k_no_texture));
    begin = end;
  }
}

/// Numbers of textures in any of the types, to [polygon].x.
template <typename... Numbers>
void take_texture_numbers(PlyImporter& importer, std::vector<glm::vec3>& of_polygons) {
  (take_channel<Numbers, OpenMesh::FPropHandleT<Numbers>>(importer, k_custom_texture, 1, 0, of_polygons),
   ...);
}

/// [face] the number of its texture in the file.
std::vector<std::uint32_t> texture_numbers(const std::filesystem::path& file, const PlyHeader& header,
                                           PlyImporter& importer, Notes& notes) {
  std::vector<glm::vec3> of_polygons(importer.polygon_ends.size());
  take_texture_numbers<signed char, unsigned char, short, unsigned short, int, unsigned, double>(importer,
                                                                                                 of_polygons);
  std::vector<std::uint32_t> numbers;
  bool is_told = false;
  for (std::size_t i = 0; i < of_polygons.size(); ++i) {
    const float number = of_polygons[i].x;
    const bool is_one = number >= 0 && number < static_cast<float>(header.textures.size());
    numbers.resize(importer.polygon_ends[i], is_one ? static_cast<std::uint32_t>(number) : k_no_texture);
    if (is_one || is_told) continue;
    is_told = true;
    notes.push_back(file.string() + ": the texture number " + checks::text(number) +
                    " (texnumber) is not from 0 to " + std::to_string(header.textures.size() - 1) +
                    ": such faces have no texture");
  }
  return numbers;
}

/// Reads the textures that the header names, beside the file, for the faces that have coordinates in them.
void take_textures(const std::filesystem::path& file, const PlyHeader& header, PlyImporter& importer,
                   Mesh& mesh, Notes& notes) {
  std::vector<std::uint32_t> known;  // [number in the file] among the mesh's
  for (const std::string& name : header.textures) {
    const std::filesystem::path path = file.parent_path() / std::filesystem::path(name);
    std::error_code error;
    const bool is_there = std::filesystem::is_regular_file(path, error);
    if (is_there && !mesh.face_texcoords.empty()) {
      known.push_back(static_cast<std::uint32_t>(mesh.textures.size()));
      mesh.textures.push_back(read_texture(path));
      mesh.textures.back().opacities.clear();
      continue;
    }
    known.push_back(k_no_texture);
    notes.push_back(file.string() + ": the texture " + scan::quoted(name) + " (TextureFile)" +
                    (is_there ? " is left out: there are no coordinates in it" : what_is_wrong(path)) +
                    ": its faces have the colours of the file alone");
  }
  if (mesh.textures.empty()) return;
  mesh.face_textures = texture_numbers(file, header, importer, notes);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    std::uint32_t& number = mesh.face_textures[f];
    if (number != k_no_texture) number = known[number];
    if (mesh.face_texcoords[f][0] == k_no_texture) number = k_no_texture;
  }
  if (std::ranges::all_of(mesh.face_textures, [](std::uint32_t t) { return t == 0; }))
    mesh.face_textures.clear();
  if (mesh.vertex_colors.empty() && mesh.face_colors.empty()) return;
  notes.push_back(file.string() + ": the colours are left out: there is a texture in their place");
  mesh.vertex_colors.clear();
  mesh.face_colors.clear();
}

/// Faces without coordinates get (0, 0) where others show a texture; where none does, there are coordinates of
/// all faces or none.
void complete_texcoords(Mesh& mesh) {
  const auto is_without = [](const glm::uvec3& corners) { return corners[0] == k_no_texture; };
  if (std::ranges::none_of(mesh.face_texcoords, is_without)) return;
  if (mesh.textures.empty()) {
    mesh.texcoords.clear();
    mesh.face_texcoords.clear();
    return;
  }
  const glm::uvec3 origin(static_cast<std::uint32_t>(mesh.texcoords.size()));
  mesh.texcoords.emplace_back(0, 0);
  std::ranges::replace_if(mesh.face_texcoords, is_without, origin);
}

/// Colours of polygons for each of their triangles.
std::vector<glm::vec3> triangle_colors(const PlyImporter& importer) {
  std::vector<glm::vec3> colors;
  for (std::size_t i = 0; i < importer.polygon_colors.size(); ++i)
    colors.resize(importer.polygon_ends[i], importer.polygon_colors[i]);
  return colors;
}

}  // namespace

Mesh read_ply(const std::filesystem::path& file, std::string bytes, Notes& notes) {
  const PlyHeader header = read_ply_header(file, bytes);
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
  if (header.has_corner_texcoords) {
    take_corner_texcoords<float>(importer, mesh);
    take_corner_texcoords<double>(importer, mesh);
  } else if (header.has_texcoords) {
    for (const glm::vec3& uv : custom_vectors(importer, k_custom_texcoords)) mesh.texcoords.emplace_back(uv);
    mesh.face_texcoords = importer.triangles;
  }
  if (header.has_normals) {
    mesh.normals = custom_vectors(importer, k_custom_normals);
    mesh.face_normals = importer.triangles;
  }
  mesh.positions = std::move(importer.positions);
  mesh.faces = std::move(importer.triangles);
  take_textures(file, header, importer, mesh, notes);
  complete_texcoords(mesh);
  return mesh;
}

}  // namespace dpr
