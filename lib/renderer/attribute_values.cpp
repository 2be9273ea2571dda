#include "renderer/attribute_values.hpp"

#include "base/checks.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr {

using glm::dvec3;

AttributeDomain domain_of(Attribute attribute) {
  switch (attribute) {
    case Attribute::depth:
    case Attribute::position:
      return AttributeDomain::vertices;
    case Attribute::normal:
      return AttributeDomain::faces;
    case Attribute::texcoords:
      return AttributeDomain::corners;
  }
  return AttributeDomain::vertices;
}

Mesh shown_mesh(const Mesh& mesh, AttributeDomain domain) {
  Mesh shown;
  if (domain != AttributeDomain::corners) {
    shown.positions = mesh.positions;
    shown.faces = mesh.faces;
    const bool of_faces = domain == AttributeDomain::faces;
    (of_faces ? shown.face_colors : shown.vertex_colors)
        .resize(of_faces ? mesh.faces.size() : mesh.positions.size());
    return shown;
  }
  for (const glm::uvec3& face : mesh.faces) {
    const auto first = static_cast<unsigned>(shown.positions.size());
    for (int corner = 0; corner < 3; ++corner) shown.positions.push_back(mesh.positions[face[corner]]);
    shown.faces.emplace_back(first, first + 1, first + 2);
  }
  shown.vertex_colors.resize(shown.positions.size());
  return shown;
}

namespace {

/// A face's normal before it is made of length 1, and the world positions of its corners.
struct FaceNormal {
  FaceNormal(const glm::dmat4& to_world, std::span<const glm::vec3> positions, const glm::uvec3& face) {
    for (int i = 0; i < 3; ++i) corner[i] = dvec3(to_world * glm::dvec4(positions[face[i]], 1.0));
    cross = glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
    const double length = glm::length(cross);
    inverse_length = length > 0 ? 1 / length : 0;  // a face without area has none
  }
  dvec3 unit() const { return inverse_length * cross; }

  dvec3 corner[3], cross;
  double inverse_length;
};

/// visit(mesh, its positions, where its first vertex and face are among all) for every mesh.
template <typename Visit>
void for_each_mesh(const ShownView& shown, const Visit& visit) {
  std::size_t first_vertex = 0, first_face = 0;
  for (std::size_t m = 0; m < shown.scene.meshes.size(); ++m) {
    const Mesh& mesh = shown.scene.meshes[m].mesh;
    visit(m, shown.positions.subspan(first_vertex, mesh.positions.size()), first_vertex, first_face);
    first_vertex += mesh.positions.size();
    first_face += mesh.faces.size();
  }
}

glm::vec3 vertex_value(Attribute attribute, const glm::dmat4& view, const glm::dvec4& world) {
  if (attribute == Attribute::position) return glm::vec3(world);
  return glm::vec3(static_cast<float>(-(view * world).z));
}

}  // namespace

std::vector<glm::vec3> attribute_values(Attribute attribute, const ShownView& shown) {
  std::vector<glm::vec3> values;
  const glm::dmat4 view(shown.view.camera.view);
  for_each_mesh(shown, [&](std::size_t m, std::span<const glm::vec3> positions, std::size_t, std::size_t) {
    const glm::dmat4 to_world(shown.view.transforms[m]);
    if (attribute == Attribute::normal) {
      for (const glm::uvec3& face : shown.scene.meshes[m].mesh.faces)
        values.emplace_back(FaceNormal(to_world, positions, face).unit());
    } else {
      for (const glm::vec3& p : positions)
        values.push_back(vertex_value(attribute, view, to_world * glm::dvec4(p, 1.0)));
    }
  });
  return values;
}

Scene texcoords_in_force(const Renderer::Impl& source) {
  Scene scene;
  for (std::size_t m = 0; m < source.scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(source.scene, m);
    Mesh& in_force = scene.meshes.emplace_back().mesh;
    in_force.texcoords = mesh.texcoords;
    in_force.face_texcoords = mesh.face_texcoords;
    const MeshRange& range = source.geometry->meshes[m];
    if (range.texcoords == 0) continue;  // without textures only the host has them
    std::vector<cl_float4> values(range.texcoords);
    source.geometry->textures.texcoord_values.download(values, range.first_texcoord);
    for (std::size_t i = 0; i < values.size(); ++i)
      in_force.texcoords[i] = glm::vec2(values[i].s[0], values[i].s[1]);
  }
  return scene;
}

std::vector<glm::vec3> texcoord_values(const Scene& scene) {
  std::vector<glm::vec3> values;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = scene.meshes[m].mesh;
    if (mesh.face_texcoords.empty()) {
      throw InvalidArgument("texcoords (attribute images)",
                            "mesh " + std::to_string(m) + ", which has no texture coordinates",
                            "texture coordinates on all meshes");
    }
    for (const glm::uvec3& face : mesh.face_texcoords) {
      for (int corner = 0; corner < 3; ++corner) values.emplace_back(mesh.texcoords[face[corner]], 0);
    }
  }
  return values;
}

namespace {

/// Gradients of the world positions of a mesh, [vertex], as its transform and its positions have them.
void add_world_gradient(const glm::dmat4& to_world, std::span<const glm::vec3> positions,
                        std::span<const dvec3> grad_world, std::span<dvec3> grad_positions,
                        PoseGradient& grad_transform) {
  const glm::dmat3 linear(to_world);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const dvec3& g = grad_world[i];
    grad_transform.rotation += glm::cross(linear * dvec3(positions[i]), g);
    grad_transform.translation += g;
    grad_positions[i] += glm::transpose(linear) * g;
  }
}

/// The depth of a point of the world; the camera's own gradient is added to.
dvec3 depth_gradient(const glm::dmat4& view, const dvec3& world, double grad_depth, PoseGradient& grad_view) {
  const glm::dmat3 linear(view);
  const dvec3 in_camera(0, 0, -grad_depth);
  grad_view.rotation += glm::cross(linear * world, in_camera);
  grad_view.translation += in_camera;
  return glm::transpose(linear) * in_camera;
}

void add_normal_gradient(const FaceNormal& normal, const dvec3& grad, const glm::uvec3& face,
                         std::span<dvec3> grad_world) {
  const dvec3 unit = normal.unit(), g = normal.inverse_length * (grad - unit * glm::dot(unit, grad));
  for (int i = 0; i < 3; ++i) {
    // cross(b - a, c - a) . g has the gradient cross(b - c, g) by a, and so on around the face.
    grad_world[face[i]] += glm::cross(normal.corner[(i + 1) % 3] - normal.corner[(i + 2) % 3], g);
  }
}

}  // namespace

void add_geometry_gradient(Attribute attribute, const ShownView& shown,
                           std::span<const glm::vec3> grad_values, const GeometryGradient& gradient) {
  const glm::dmat4 view(shown.view.camera.view);
  for_each_mesh(shown, [&](std::size_t m, std::span<const glm::vec3> positions, std::size_t first_vertex,
                           std::size_t first_face) {
    const glm::dmat4 to_world(shown.view.transforms[m]);
    const std::vector<glm::uvec3>& faces = shown.scene.meshes[m].mesh.faces;
    std::vector<dvec3> grad_world(positions.size(), dvec3(0.0));
    for (std::size_t i = 0; attribute != Attribute::normal && i < positions.size(); ++i) {
      const dvec3 g(grad_values[first_vertex + i]), world(to_world * glm::dvec4(positions[i], 1.0));
      grad_world[i] = attribute == Attribute::position
                          ? g
                          : depth_gradient(view, world, g.x + g.y + g.z, gradient.view.camera.view);
    }
    for (std::size_t i = 0; attribute == Attribute::normal && i < faces.size(); ++i) {
      add_normal_gradient(FaceNormal(to_world, positions, faces[i]), dvec3(grad_values[first_face + i]),
                          faces[i], grad_world);
    }
    add_world_gradient(to_world, positions, grad_world,
                       gradient.positions.subspan(first_vertex, positions.size()),
                       gradient.view.transforms[m]);
  });
}

}  // namespace dpr
