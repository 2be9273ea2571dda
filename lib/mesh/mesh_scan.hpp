// The look at a mesh file before OpenMesh reads it.
//
// OpenMesh's readers pass over what they do not understand: a vertex line that does not parse is left out and
// every later index means another vertex; a face with two equal corners is dropped; numbers missing at the
// end are zero. The scan of a format finds such things, with the line they are on, counts what must arrive,
// and hands OpenMesh a text without the constructs that it misreads. Each scan says which those are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace dpr {

using Polygon = std::vector<std::uint32_t>;

struct MeshScan {
  std::string text;                     ///< what OpenMesh is to read in place of the file
  bool binary = false;                  ///< of the text
  std::size_t header_bytes = 0;         ///< where the body of a PLY text begins,
  std::size_t header_lines = 0;         ///< and after how many lines of the file
  bool ends_with_polygons = false;      ///< nothing may follow the polygons of a PLY text
  std::optional<std::size_t> vertices;  ///< how many vertices must arrive, where the file fixes that
  std::size_t polygons = 0;             ///< how many polygons must arrive
  bool asks_custom_properties = false;  ///< PLY: colours in floats, or lists beside the corners
  bool asks_material_colors = false;  ///< OBJ: the material files are there and all materials come from them
  bool has_vertex_colors = false;     ///< PLY: in a form that OpenMesh hands on
  bool has_face_colors = false;       ///< PLY: in a form that OpenMesh hands on
  std::vector<glm::vec3> vertex_colors;  ///< OBJ, OFF: read by the scan; empty if there are none
  std::vector<glm::vec3> face_colors;    ///< OFF: [polygon] read by the scan; empty if there are none
  std::vector<glm::vec2> texcoords;      ///< OBJ: read by the scan; OpenMesh does not hand them on
  std::vector<Polygon>
      polygon_texcoords;  ///< OBJ: [polygon] indices into texcoords; empty if a corner has none
  std::map<std::size_t, Polygon>
      repeated_corners;  ///< OBJ: polygons with equal corners, by their number in the file
};

MeshScan scan_obj(const std::filesystem::path& file, std::string text);
MeshScan scan_ply(const std::filesystem::path& file, const std::string& text);
MeshScan scan_off(const std::filesystem::path& file, const std::string& text);
MeshScan scan_stl(const std::filesystem::path& file, const std::string& text);

/// The names under which a scanned PLY text holds its colours in floats: OpenMesh cuts floats called "red" to
/// eight bits, custom properties pass whole.
inline constexpr const char* k_ply_float_colors[] = {"dpr_red", "dpr_green", "dpr_blue"};

}  // namespace dpr
