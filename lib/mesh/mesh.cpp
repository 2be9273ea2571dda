// Validity of a mesh, and materials of glTF's metal and roughness.
#include "dpr/mesh.hpp"

#include <algorithm>
#include <cmath>

#include "base/checks.hpp"

namespace dpr {
namespace {

void validate_colors(const std::vector<glm::vec3>& colors, std::size_t expected, const std::string& list,
                     const std::string& elements, const std::string& name) {
  if (!colors.empty() && colors.size() != expected) {
    throw InvalidArgument(checks::in(list, name), std::to_string(colors.size()) + " colours",
                          std::to_string(expected) + ", one for each of the " + elements + ", or none");
  }
  for (std::size_t i = 0; i < colors.size(); ++i) {
    if (checks::is_finite(colors[i])) continue;
    throw InvalidArgument(checks::in(checks::element(list, i), name), checks::text(colors[i]),
                          "finite numbers");
  }
}

void validate_texcoords(const Mesh& mesh, const std::string& name) {
  if (!mesh.face_texcoords.empty() && mesh.face_texcoords.size() != mesh.faces.size()) {
    throw InvalidArgument(checks::in("face_texcoords", name), std::to_string(mesh.face_texcoords.size()),
                          std::to_string(mesh.faces.size()) + ", one for each of the faces, or none");
  }
  for (std::size_t i = 0; i < mesh.texcoords.size(); ++i) {
    const glm::vec3 uv(mesh.texcoords[i], 0);
    if (checks::is_finite(uv)) continue;
    throw InvalidArgument(checks::in(checks::element("texcoords", i), name), checks::text(uv),
                          "finite numbers");
  }
  for (std::size_t i = 0; i < mesh.face_texcoords.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const std::uint32_t index = mesh.face_texcoords[i][corner];
      if (index < mesh.texcoords.size()) continue;
      throw InvalidArgument(
          checks::in(checks::element("face_texcoords", i), name),
          "texture coordinate " + std::to_string(index),
          "an index below the number of texcoords, " + std::to_string(mesh.texcoords.size()));
    }
  }
}

void validate_textures(const Mesh& mesh, const std::string& name) {
  for (std::size_t i = 0; i < mesh.textures.size(); ++i)
    validate(mesh.textures[i], checks::in(checks::element("textures", i), name));
  if (!mesh.textures.empty() && mesh.face_texcoords.empty()) {
    throw InvalidArgument(checks::in("face_texcoords", name), "none beside textures",
                          "one for each of the " + std::to_string(mesh.faces.size()) + " faces");
  }
  if (!mesh.face_textures.empty() && mesh.face_textures.size() != mesh.faces.size()) {
    throw InvalidArgument(checks::in("face_textures", name), std::to_string(mesh.face_textures.size()),
                          std::to_string(mesh.faces.size()) + ", one for each of the faces, or none");
  }
  for (std::size_t i = 0; i < mesh.face_textures.size(); ++i) {
    const std::uint32_t index = mesh.face_textures[i];
    if (index < mesh.textures.size() || index == k_no_texture) continue;
    throw InvalidArgument(
        checks::in(checks::element("face_textures", i), name), "texture " + std::to_string(index),
        "k_no_texture, or an index below the number of textures, " + std::to_string(mesh.textures.size()));
  }
}

void validate_normals(const Mesh& mesh, const std::string& name) {
  if (!mesh.face_normals.empty() && mesh.face_normals.size() != mesh.faces.size()) {
    throw InvalidArgument(checks::in("face_normals", name), std::to_string(mesh.face_normals.size()),
                          std::to_string(mesh.faces.size()) + ", one for each of the faces, or none");
  }
  for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
    if (checks::is_finite(mesh.normals[i])) continue;
    throw InvalidArgument(checks::in(checks::element("normals", i), name), checks::text(mesh.normals[i]),
                          "finite numbers");
  }
  for (std::size_t i = 0; i < mesh.face_normals.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const std::uint32_t index = mesh.face_normals[i][corner];
      if (index < mesh.normals.size()) continue;
      throw InvalidArgument(checks::in(checks::element("face_normals", i), name),
                            "normal " + std::to_string(index),
                            "an index below the number of normals, " + std::to_string(mesh.normals.size()));
    }
  }
}

void validate_materials(const Mesh& mesh, const std::string& name) {
  for (std::size_t i = 0; i < mesh.materials.size(); ++i)
    validate(mesh.materials[i], checks::in(checks::element("materials", i), name));
  if (!mesh.face_materials.empty() && mesh.face_materials.size() != mesh.faces.size()) {
    throw InvalidArgument(checks::in("face_materials", name), std::to_string(mesh.face_materials.size()),
                          std::to_string(mesh.faces.size()) + ", one for each of the faces, or none");
  }
  for (std::size_t i = 0; i < mesh.face_materials.size(); ++i) {
    if (mesh.face_materials[i] < mesh.materials.size()) continue;
    throw InvalidArgument(checks::in(checks::element("face_materials", i), name),
                          "material " + std::to_string(mesh.face_materials[i]),
                          "an index below the number of materials, " + std::to_string(mesh.materials.size()));
  }
}

void validate_opacities(const std::vector<float>& opacities, std::size_t expected, const std::string& list,
                        const std::string& elements, const std::string& name) {
  if (!opacities.empty() && opacities.size() != expected) {
    throw InvalidArgument(checks::in(list, name), std::to_string(opacities.size()) + " opacities",
                          std::to_string(expected) + ", one for each of the " + elements + ", or none");
  }
  for (std::size_t i = 0; i < opacities.size(); ++i)
    checks::require_opacity(opacities[i], [&] { return checks::in(checks::element(list, i), name); });
}

void validate_faces(const Mesh& mesh, const std::string& name) {
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const std::uint32_t index = mesh.faces[i][corner];
      if (index < mesh.positions.size()) continue;
      throw InvalidArgument(
          checks::in(checks::element("faces", i), name), "vertex " + std::to_string(index),
          "an index below the number of vertices, " + std::to_string(mesh.positions.size()));
    }
  }
}

}  // namespace

void validate(const Material& material, const std::string& name) {
  if (!checks::is_finite(material.specular))
    throw InvalidArgument("specular of " + name, checks::text(material.specular), "finite numbers");
  const float shininess = material.shininess.value_or(1);
  if (!(shininess >= 1 && std::isfinite(shininess)))
    throw InvalidArgument("shininess of " + name, checks::text(shininess), "a finite number >= 1");
}

ColoredMaterial metallic_roughness(const vec3& base_color, float metallic, float roughness) {
  constexpr float k_dielectric = 0.04F, k_least_alpha = 1e-3F;  // of glTF; of the kernels
  checks::require_finite(base_color, "base_color");
  const auto require_share = [](float value, const char* argument) {
    if (!(value >= 0 && value <= 1))
      throw InvalidArgument(argument, checks::text(value), "a number from 0 to 1");
  };
  require_share(metallic, "metallic");
  require_share(roughness, "roughness");
  const float alpha = std::max(roughness * roughness, k_least_alpha);
  const vec3 dielectric(k_dielectric);
  return {(1 - metallic) * base_color,
          {dielectric + metallic * (base_color - dielectric), 2 / (alpha * alpha) - 1}};
}

void validate(const Mesh& mesh, const std::string& name) {
  if (mesh.faces.empty()) throw InvalidArgument(checks::in("faces", name), "none", "at least one");
  // Names are put together only where something is wrong: a mesh may have millions of vertices.
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    if (checks::is_finite(mesh.positions[i])) continue;
    throw InvalidArgument(checks::in(checks::element("positions", i), name), checks::text(mesh.positions[i]),
                          "finite numbers");
  }
  validate_faces(mesh, name);
  if (!mesh.vertex_colors.empty() && !mesh.face_colors.empty()) {
    throw InvalidArgument(checks::in("vertex_colors", name), "them beside face_colors",
                          "at most one of the two");
  }
  validate_colors(mesh.vertex_colors, mesh.positions.size(), "vertex_colors", "vertices", name);
  validate_colors(mesh.face_colors, mesh.faces.size(), "face_colors", "faces", name);
  validate_texcoords(mesh, name);
  validate_textures(mesh, name);
  validate_normals(mesh, name);
  validate_materials(mesh, name);
  if (!mesh.vertex_opacities.empty() && !mesh.face_opacities.empty()) {
    throw InvalidArgument(checks::in("vertex_opacities", name), "them beside face_opacities",
                          "at most one of the two");
  }
  validate_opacities(mesh.vertex_opacities, mesh.positions.size(), "vertex_opacities", "vertices", name);
  validate_opacities(mesh.face_opacities, mesh.faces.size(), "face_opacities", "faces", name);
}

}  // namespace dpr
