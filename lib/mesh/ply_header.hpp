// Parsed header of a PLY file, and the header that OpenMesh reads instead.
//
// OpenMesh 9 treats such a file so:
// - a number that it cannot read is a zero, and at the end of the file it goes on with zeros;
// - colours in floats are cut to eight bits, downwards; those of other types, and 300 in a text, wrap around;
// - a list other than the corners is skipped as if it were one number, unless custom properties are
//   asked for; then it is allocated at the length it claims, and in a text a property of type uchar is one
//   character;
// - lists may be counted by uint8, uint16, uchar and int alone;
// - a normal that is not in floats is not skipped at all;
// - a header that never ends is read for ever.
//
// So its stream throws at the first number that cannot be read; and every property but the coordinates, the
// corners and a binary file's colours in bytes gets a name that means nothing to OpenMesh, and types that it
// skips correctly.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace dpr {

/// The names under which colours pass OpenMesh whole, as custom properties; what it calls "red" it cuts to
/// eight bits.
inline constexpr std::array<const char*, 3> k_custom_colors{"dpr_red", "dpr_green", "dpr_blue"};

/// The same for texture coordinates and normals of vertices.
inline constexpr std::array<const char*, 2> k_custom_texcoords{"dpr_u", "dpr_v"};
inline constexpr std::array<const char*, 3> k_custom_normals{"dpr_nx", "dpr_ny", "dpr_nz"};

/// Those of the corners of a face, in one list, and the number of the face's texture.
inline constexpr const char* k_custom_corner_texcoords = "dpr_texcoord";
inline constexpr const char* k_custom_texture = "dpr_texnumber";

/// Form in which the colours of an element arrive.
struct ColorForm {
  bool custom = false;  ///< as custom properties
  bool native = false;  ///< as OpenMesh's colours
  double one = 1;       ///< what stands for the full intensity in a custom property
};

/// Contents of a header, known before the body is read.
struct PlyHeader {
  std::string text;       ///< for OpenMesh
  std::size_t bytes = 0;  ///< of the header in the file
  std::size_t lines = 0;  ///< of the header in the file
  bool binary = false;
  bool ends_with_faces = false;  ///< nothing may follow
  bool has_custom_properties = false;
  std::size_t vertices = 0, polygons = 0;
  ColorForm vertex_colors, face_colors;
  bool has_texcoords = false, has_normals = false;                 ///< of vertices, as custom properties
  bool has_corner_texcoords = false, has_texture_numbers = false;  ///< of faces, the same
  std::vector<std::string> textures;                               ///< "comment TextureFile", as written
};

/// Throws IoError where the header is wrong, or the file too short for what it promises.
PlyHeader read_ply_header(const std::filesystem::path& file, std::string_view bytes);

}  // namespace dpr
