// A scene as it is described in a file: everything a render needs.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "dpr/camera.hpp"
#include "dpr/export.h"
#include "dpr/light.hpp"
#include "dpr/mesh.hpp"
#include "dpr/smoothing.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// A mesh and where it stands.
struct Instance {
  Mesh mesh;
  mat4 transform{1.0F};  ///< object to world; affine, may hold a scale
  /// An earlier entry of Scene::meshes whose mesh stands here too. `mesh` is empty then.
  std::optional<std::size_t> instance_of = std::nullopt;
};

/// Faces that are left out: none; those that wind clockwise in the image, as the outside of a mesh does seen
/// from within; or the others. A mirroring transform turns the winding.
enum class Cull { none, back, front };

/// Gradients that the backward pass computes. Nothing is computed that is not asked for.
struct GradientRequest {
  bool positions = true;    ///< vertex positions, object space
  bool colors = true;       ///< vertex or face colours
  bool transform = true;    ///< rotation and translation of every mesh
  bool camera = true;       ///< the view's rotation and translation, and the projection but for distortion
  bool lights = false;      ///< everything of the lights but shininess
  bool smoothing = true;    ///< sigma, gamma, alpha
  bool background = true;   ///< background colour
  bool texture = false;     ///< texels of every texture
  bool texcoords = false;   ///< texture coordinates of textured meshes
  bool distortion = false;  ///< coefficients of lenses
  bool normals = false;     ///< normals that meshes give; 0 without lights
  bool materials = false;   ///< coefficients of the materials that meshes give; 0 without lights
  bool opacities = false;   ///< vertex or face opacities
  bool texel_opacities = false;  ///< of textures that have some

  bool operator==(const GradientRequest&) const = default;
};

struct Scene {
  int width = 128, height = 128;
  Camera camera;
  vec3 background{0.0F};
  std::vector<Instance> meshes;
  std::optional<Lights> lights;  ///< none: colours as they are
  Smoothing smoothing;
  bool perspective_correct = true;
  Cull cull = Cull::none;
  GradientRequest gradients;
};

/// The mesh that stands at an entry of Scene::meshes: its own, or that which it is an instance of.
inline const Mesh& mesh_of(const Scene& scene, std::size_t entry) {
  return scene.meshes[scene.meshes[entry].instance_of.value_or(entry)].mesh;
}

/// Throws InvalidArgument where the scene cannot be rendered: size, camera, meshes, transforms, lights,
/// smoothing.
DPR_API void validate(const Scene& scene);

/// Reads the scene format of lib/cli/README.md. Mesh files are relative to the scene file. An unknown key is
/// an error that names it. Throws IoError where the file cannot be read or is not JSON (with the line),
/// InvalidArgument else.
DPR_API Scene read_scene(const std::filesystem::path& file);

}  // namespace dpr
