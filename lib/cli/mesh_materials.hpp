// Materials and textures that an OBJ file names.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dpr::cli {

struct MeshMaterial {
  std::string name;     ///< usemtl
  std::string texture;  ///< map_Kd of its library; empty if there is none
};

/// Those that faces use, each once, in the order of the file; none of other files than OBJ. Throws IoError.
std::vector<MeshMaterial> mesh_materials(const std::filesystem::path& file);

}  // namespace dpr::cli
