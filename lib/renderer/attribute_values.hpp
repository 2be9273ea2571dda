// What surfaces show in place of their colours, and the way back from its gradients to the geometry.
#pragma once

#include <span>
#include <vector>

#include "dpr/attribute_images.hpp"

namespace dpr {

/// Where the numbers of an attribute stand.
enum class AttributeDomain { vertices, faces, corners };

AttributeDomain domain_of(Attribute attribute);

/// The mesh with a colour for every number of the domain. Corners become vertices, face after face.
Mesh shown_mesh(const Mesh& mesh, AttributeDomain domain);

/// A view's geometry: positions are [vertex], object space, of all meshes of the shown scene one after the
/// other.
struct ShownView {
  const Scene& scene;
  const View& view;
  std::span<const glm::vec3> positions;
};

/// What the view shows of an attribute, [vertex] or [face] by its domain.
std::vector<glm::vec3> attribute_values(Attribute attribute, const ShownView& shown);
/// The scene's meshes, of which there is nothing but the texture coordinates and the faces' indices of them.
/// Those are the ones in force, which a buffer may have given, so that only the device knows them. Blocks.
Scene texcoords_in_force(const Renderer::Impl& source);
/// The texture coordinates of all meshes, [corner]. Throws InvalidArgument where one has none.
std::vector<glm::vec3> texcoord_values(const Scene& scene);

/// Gradients of a view's geometry.
struct GeometryGradient {
  std::span<glm::dvec3> positions;  ///< [vertex] object space; added to
  ViewGradient& view;               ///< added to
};

/// From the gradients of a view's attribute_values() to its geometry.
void add_geometry_gradient(Attribute attribute, const ShownView& shown,
                           std::span<const glm::vec3> grad_values, const GeometryGradient& gradient);

}  // namespace dpr
