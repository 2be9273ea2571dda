// A model that the reader of a page turns by hand: coloured triangles, and the cameras around them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dpr/camera.hpp"
#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "mesh/bounding_box.hpp"

namespace dpr::cli {

/// Larger models are left out of pages, which would take long to load.
inline constexpr std::size_t k_most_model_faces = 300'000;

/// Drawn as a pyramid from the camera's centre to its picture; a lens is left out.
struct ModelCamera {
  Camera camera{};
  int width = 0, height = 0;  ///< pixels of its picture, of which the shape is drawn
  float depth = 1;            ///< of the picture's plane, along the axis
  std::string label{};        ///< short, beside the pyramid
  std::string name{};         ///< shown in its place where the reader points at it
  bool stands_out = false;    ///< in another colour
  Image picture{};            ///< shown on its plane; empty: none
};

/// Where the reader looks from at first.
struct Viewpoint {
  Camera camera;  ///< without a lens
  int width = 0, height = 0;
};

struct Model {
  std::string heading, caption;
  std::vector<glm::vec3> positions, normals, colors;  ///< [vertex] world; linear RGB
  std::vector<glm::vec2> texcoords;                   ///< [vertex] as Texture has them
  std::vector<glm::uvec3> faces;
  std::vector<std::uint32_t> face_textures;  ///< [face] index into textures, or k_no_texture
  std::vector<Texture> textures;             ///< which are multiplied by the colours
  std::vector<ModelCamera> cameras{};
  Viewpoint start{};
  glm::vec3 pivot{0.0F};     ///< it is turned about this point
  glm::vec3 up{0.0F, 1, 0};  ///< sideways turns are about this direction, a unit vector
};

/// Adds a mesh, its normals from the faces around its vertices.
void add_mesh(Model& model, const Mesh& mesh, const glm::mat4& transform = glm::mat4(1.0F));

/// Where all of the model's points and cameras are in sight, above the first camera and beside it; cameras far away are
/// left out of sight. The model must have some vertices, and its pivot.
Viewpoint overview(const Model& model);

/// Mean of the cameras' directions upwards; the y axis where they have none in common.
glm::vec3 common_up(const std::vector<ModelCamera>& cameras);

/// The model's data as the page's script reads them: safe within a script element.
std::string model_data(const Model& model);

}  // namespace dpr::cli
