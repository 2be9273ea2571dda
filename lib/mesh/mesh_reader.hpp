// The formats of mesh files: from the bytes of a file to a mesh, in one pass, and back.
//
// PLY is read by OpenMesh. OBJ, OFF and STL are not: its readers of these pass over what they do not
// understand, so that a vertex line that does not parse shifts every later index, and a check would have to
// parse the whole file a second time.
#pragma once

#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dpr/mesh.hpp"
#include "dpr/notes.hpp"

namespace dpr {

/// Reads the content of a file in the format of its extension; the mesh is valid. `file` is what messages
/// call it, and beside it the files that it names are looked for. Throws as read_mesh() does.
Mesh parse_mesh(const std::filesystem::path& file, std::string bytes, Notes& notes);

// The formats. What they return may have no face or an index out of range: parse_mesh() checks that for all.
Mesh read_obj(const std::filesystem::path& file, std::string_view text, Notes& notes);
Mesh read_ply(const std::filesystem::path& file, std::string bytes, Notes& notes);
Mesh read_off(const std::filesystem::path& file, std::string_view text);
Mesh read_stl(const std::filesystem::path& file, std::string_view bytes, Notes& notes);
Mesh read_gltf(const std::filesystem::path& file, std::string_view bytes, Notes& notes);

/// The files that write_mesh() makes of a mesh with that many textures and no materials, itself first: OBJ has others
/// beside it.
std::vector<std::filesystem::path> written_files(const std::filesystem::path& file, std::size_t textures);

/// The bytes of a GLB file of a valid mesh. Throws IoError, which names the file, where they are too many.
std::string glb_bytes(const std::filesystem::path& file, const Mesh& mesh);

/// Reflection of light by a material of OBJ, as far as the file says.
struct ObjReflection {
  std::optional<glm::vec3> diffuse, specular;  ///< Kd, Ks
  std::optional<float> shininess;              ///< Ns
  bool has_highlights = true;                  ///< illum is 2 or more, or not given
  float opacity = 1;                           ///< d, or 1 - Tr
  std::string unread;                          ///< maps that are not read, separated by commas
};

/// A material of OBJ, as far as it is of use.
struct ObjMaterial {
  ObjReflection reflection;

  // map_Kd
  std::string texture;                 ///< as the library names it; empty if there is none
  std::filesystem::path texture_file;  ///< where that is
  glm::vec2 scale{1}, offset{0};       ///< of the texture coordinates: -s, -o
  Wrap wrap = Wrap::repeat;            ///< -clamp on
  std::string ignored_options;         ///< those that are not read, separated by commas

  bool has_same_texture(const ObjMaterial& other) const {
    return texture_file == other.texture_file && scale == other.scale && offset == other.offset &&
           wrap == other.wrap;
  }
};
using ObjMaterials = std::map<std::string, ObjMaterial, std::less<>>;

/// Adds the materials of an OBJ's library, beside which its textures are. Throws IoError where a colour or an
/// option of a texture cannot be read.
void read_mtl(const std::filesystem::path& file, std::string_view text, ObjMaterials& materials);

/// Reason why a file beside a mesh is not read.
inline std::string what_is_wrong(const std::filesystem::path& file) {
  std::error_code error;
  return std::filesystem::exists(file, error) ? " is no regular file" : " is not there";
}

/// Appends a polygon as a fan of triangles about its first corner.
inline void append_fan(std::span<const std::uint32_t> corners, std::vector<glm::uvec3>& triangles) {
  for (std::size_t i = 2; i < corners.size(); ++i)
    triangles.emplace_back(corners[0], corners[i - 1], corners[i]);
}

/// Gives the elements from `first` to `end` a colour. Those before without one become white.
inline void append_color(const glm::vec3& color, std::size_t first, std::size_t end,
                         std::vector<glm::vec3>& colors) {
  colors.resize(first, glm::vec3(1));
  colors.resize(end, color);
}

}  // namespace dpr
