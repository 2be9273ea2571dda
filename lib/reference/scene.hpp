/// The scene of the reference renderer: the scene file in doubles.
#pragma once

#include "aggregate.hpp"
#include "priors.hpp"
#include "rasterize.hpp"
#include "shade.hpp"
#include "transform.hpp"

#include <optional>
#include <vector>

namespace dpr::reference {

struct Mesh {
  std::vector<Vec3d> positions;      ///< object space
  std::vector<Face> faces;           ///< vertex indices, counter-clockwise seen from outside
  std::vector<Vec3d> vertex_colors;  ///< one per vertex, or empty
  std::vector<Vec3d> face_colors;    ///< one per face, or empty; without any colours the mesh is white
  Mat4d transform = k_identity;      ///< object to world
  std::vector<Vec2d> texcoords;      ///< texture coordinates, or empty
  std::vector<Face> face_texcoords;  ///< indices into texcoords, or empty
  std::vector<Texture> textures;     ///< or empty
  std::vector<int> face_textures;    ///< one per face, -1 for none; empty: all faces have the first
  std::vector<Vec3d> normals{};      ///< object space, or empty: those of vertices are computed
  std::vector<Face> face_normals{};  ///< indices into normals, or empty
  std::vector<Material> materials{};
  std::vector<std::size_t> face_materials{};  ///< one per face; empty: all faces have the first
  std::vector<double> vertex_opacities{};     ///< one per vertex, or empty
  std::vector<double> face_opacities{};       ///< one per face, or empty; without any the mesh is opaque
  std::vector<Texture> opacity_textures{};    ///< one per texture, or none, three times the same; no texels: opaque
};

struct Smoothing {
  Prior occupancy_prior = Prior::gaussian;
  Prior depth_prior = Prior::gaussian;
  double sigma = 1e-3;
  double gamma = 1e-2;
  double alpha = 1.0;
  Composition composition = Composition::barrier;
  double blur_radius = 9.21e-3;
  double background_depth = 1e-10;
  DistanceMetric distance = DistanceMetric::squared;
};

struct Scene {
  int width = 0;
  int height = 0;
  Camera camera;
  Vec3d background;
  std::vector<Mesh> meshes;
  std::optional<Lights> lights;
  Smoothing smoothing;
  bool perspective_correct = true;
};

/// The texture of a face of a mesh; -1: none.
inline int face_texture(const Mesh& mesh, std::size_t face) {
  if (mesh.textures.empty()) return -1;
  return mesh.face_textures.empty() ? 0 : mesh.face_textures[face];
}

/// Empty where no mesh has materials or normals of its own.
inline std::vector<FaceLook> face_looks(const Scene& scene) {
  std::vector<FaceLook> looks;
  bool is_plain = true;
  for (const Mesh& mesh : scene.meshes) {
    is_plain = is_plain && mesh.materials.empty() && mesh.face_normals.empty();
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      FaceLook& look = looks.emplace_back();
      if (!mesh.materials.empty())
        look.material = mesh.materials[mesh.face_materials.empty() ? 0 : mesh.face_materials[f]];
      if (mesh.face_normals.empty()) continue;
      look.normals.emplace();
      for (std::size_t i = 0; i < 3; ++i)
        (*look.normals)[i] = transformed_normal(mesh.transform, mesh.normals[mesh.face_normals[f][i]]);
    }
  }
  return is_plain ? std::vector<FaceLook>() : looks;
}

}  // namespace dpr::reference
