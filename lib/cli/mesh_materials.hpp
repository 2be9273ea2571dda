// Which materials and textures an OBJ file names.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dpr::cli {

/// A file that another one names.
struct NamedFile {
  std::string name;
  bool exists = false;
};

struct MeshMaterials {
  std::vector<NamedFile> libraries;    ///< mtllib
  std::vector<std::string> materials;  ///< usemtl
  std::vector<NamedFile> textures;     ///< map_Kd of the libraries
};

/// Each once, in the order of the files; nothing for other files than OBJ. Throws IoError.
MeshMaterials mesh_materials(const std::filesystem::path& file);

}  // namespace dpr::cli
