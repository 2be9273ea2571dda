// Mesh files: their content goes to the reader of its format, and comes from the writer.
#include <algorithm>
#include <array>
#include <optional>
#include <set>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "base/output_file.hpp"
#include "dpr/mesh.hpp"
#include "dpr/notes.hpp"
#include "image/codec.hpp"
#include "mesh/face_texture.hpp"
#include "mesh/mesh_reader.hpp"
#include "mesh/opacity.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

bool is_known(const std::string& extension) {
  constexpr std::array<std::string_view, 6> k_known{".obj", ".ply", ".off", ".stl", ".gltf", ".glb"};
  return std::ranges::find(k_known, extension) != k_known.end();
}

void append(std::string& text, const glm::vec3& values) {
  for (int i = 0; i < 3; ++i) text += " " + checks::text(values[i]);
}

/// Texture and material of a face.
struct ObjSurface {
  std::uint32_t texture = k_no_texture, material = 0;
  auto operator<=>(const ObjSurface&) const = default;
};

ObjSurface surface_of(const Mesh& mesh, std::size_t face) {
  return {texture_of(mesh, face), mesh.face_materials.empty() ? 0 : mesh.face_materials[face]};
}

/// Its name in an OBJ's library.
std::string surface_name(const Mesh& mesh, const ObjSurface& surface) {
  return (surface.texture == k_no_texture ? "plain" : "texture" + std::to_string(surface.texture)) +
         (mesh.materials.size() > 1 ? "_" + std::to_string(surface.material) : "");
}

bool has_library(const Mesh& mesh) { return !mesh.textures.empty() || !mesh.materials.empty(); }

/// Of the PNG file beside an OBJ: image.png, or image.0.png and so on of several.
std::filesystem::path texture_file(const std::filesystem::path& file, std::size_t textures,
                                   std::size_t texture) {
  const std::string number = textures > 1 ? "." + std::to_string(texture) : "";
  return std::filesystem::path(file).replace_extension(number + ".png");
}

std::filesystem::path material_file(const std::filesystem::path& file) {
  return std::filesystem::path(file).replace_extension(".mtl");
}

/// Writes an OBJ's library, and the textures beside it.
void write_obj_materials(const std::filesystem::path& file, const Mesh& mesh) {
  const auto image = [&](std::size_t texture) { return texture_file(file, mesh.textures.size(), texture); };
  for (std::size_t i = 0; i < mesh.textures.size(); ++i)
    write_whole_file(image(i), encode_texture(image(i), mesh.textures[i]));
  std::set<ObjSurface> surfaces;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) surfaces.insert(surface_of(mesh, f));
  std::string text;
  for (const ObjSurface& surface : surfaces) {
    text += "newmtl " + surface_name(mesh, surface) + "\nKd 1 1 1\n";
    if (mesh.materials.empty()) {
      text += "illum 1\n";  // without highlights
    } else {
      const Material& material = mesh.materials[surface.material];
      text += "illum 2\nKs";
      append(text, material.specular);
      if (material.shininess) text += "\nNs " + checks::text(*material.shininess);
      text += '\n';
    }
    if (surface.texture == k_no_texture) continue;
    const bool is_clamped = mesh.textures[surface.texture].wrap == Wrap::clamp;
    text += std::string("map_Kd ") + (is_clamped ? "-clamp on " : "") +
            image(surface.texture).filename().string() + "\n";
  }
  write_whole_file(material_file(file), text);
}

std::string obj_text(const std::filesystem::path& file, const Mesh& mesh) {
  if (!mesh.face_colors.empty()) {
    throw IoError(file, "OBJ has no face colours: expected vertex colours, or the extension .ply");
  }
  for (const Material& material : mesh.materials) {
    if (glm::any(glm::lessThan(material.specular, glm::vec3(0))))
      throw IoError(file, "OBJ has no highlights below 0: expected a material with a specular of at least 0");
  }
  std::string text;
  if (has_library(mesh)) text += "mtllib " + material_file(file).filename().string() + "\n";
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    text += "v";
    append(text, mesh.positions[i]);
    if (!mesh.vertex_colors.empty()) append(text, mesh.vertex_colors[i]);
    text += '\n';
  }
  const bool has_texcoords = !mesh.face_texcoords.empty(), has_normals = !mesh.face_normals.empty();
  for (const glm::vec2& uv : mesh.texcoords)
    text += "vt " + checks::text(uv.x) + " " + checks::text(uv.y) + "\n";
  for (const glm::vec3& normal : mesh.normals) {
    text += "vn";
    append(text, normal);
    text += '\n';
  }
  std::optional<ObjSurface> last;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const ObjSurface surface = surface_of(mesh, f);
    if (has_library(mesh) && last != surface) text += "usemtl " + surface_name(mesh, surface) + "\n";
    last = surface;
    text += "f";
    for (int i = 0; i < 3; ++i) {
      text += " " + std::to_string(mesh.faces[f][i] + 1);
      if (has_texcoords || has_normals) text += "/";
      if (has_texcoords) text += std::to_string(mesh.face_texcoords[f][i] + 1);
      if (has_normals) text += "/" + std::to_string(mesh.face_normals[f][i] + 1);
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

Mesh parse_mesh(const std::filesystem::path& file, std::string bytes, Notes& notes) {
  const std::string extension = lower_case_extension(file);
  Mesh mesh;
  if (extension == ".obj") mesh = read_obj(file, bytes, notes);
  if (extension == ".ply") mesh = read_ply(file, std::move(bytes), notes);
  if (extension == ".off") mesh = read_off(file, bytes);
  if (extension == ".stl") mesh = read_stl(file, bytes, notes);
  if (extension == ".gltf" || extension == ".glb") mesh = read_gltf(file, bytes, notes);
  validate(mesh, file.string());
  return mesh;
}

Mesh read_mesh(const std::filesystem::path& file, Notes& notes) {
  const std::string extension = lower_case_extension(file);
  if (!is_known(extension)) {
    throw IoError(file, "got the extension " + scan::quoted(extension) +
                            ", expected .obj, .ply, .off, .stl, .gltf or .glb" +
                            (extension == ".json" ? "; a scene is given by --scene" : ""));
  }
  return parse_mesh(file, read_file(file), notes);
}

Mesh read_mesh(const std::filesystem::path& file) {
  Notes ignored;
  return read_mesh(file, ignored);
}

std::vector<std::filesystem::path> written_files(const std::filesystem::path& file, std::size_t textures) {
  std::vector<std::filesystem::path> files{file};
  if (lower_case_extension(file) != ".obj" || textures == 0) return files;
  files.push_back(material_file(file));
  for (std::size_t i = 0; i < textures; ++i) files.push_back(texture_file(file, textures, i));
  return files;
}

void write_mesh(const std::filesystem::path& file, const Mesh& mesh) {
  const std::string extension = lower_case_extension(file);
  if (extension != ".obj" && extension != ".ply" && extension != ".glb") {
    throw IoError(file, "got the extension " + scan::quoted(extension) + ", expected .obj, .ply or .glb");
  }
  validate(mesh, "mesh for " + file.string());
  require_opaque(mesh, "mesh for " + file.string());
  if (extension == ".obj") {
    const std::string text = obj_text(file, mesh);
    if (has_library(mesh)) write_obj_materials(file, mesh);
    write_whole_file(file, text);
  }
  if (extension == ".ply") write_whole_file(file, ply_text(mesh));
  if (extension == ".glb") write_whole_file(file, glb_bytes(file, mesh));
}

}  // namespace dpr
