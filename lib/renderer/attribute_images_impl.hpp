// What AttributeImages hold: a renderer of their own, whose colours are the attribute.
#pragma once

#include <optional>

#include "renderer/attribute_values.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr {

struct AttributeImages::Impl {
  /// Whose faces are shown: a mesh's or an instance's, of which `mesh` is the mesh.
  struct SourceMesh {
    std::size_t mesh, first_position, vertices, texcoords;
    std::vector<glm::uvec3> faces, face_texcoords;
  };

  Impl(const Device& device, std::optional<Attribute> attribute, std::size_t channels);

  /// Of three channels.
  std::size_t groups() const { return (channels + 2) / 3; }
  /// Alpha is the sum of the weights but in the barrier composition. There one more group shows it.
  bool shows_weights() const { return renderer.scene().smoothing.composition == Composition::barrier; }
  std::size_t passes() const { return groups() + (shows_weights() ? 1 : 0); }

  /// Throws InvalidArgument, which names the caller, unless there are images.
  void require_forward(const char* caller) const;
  void forward(const Renderer::Impl& source);
  /// [group][view][height][width] RGBA
  const Buffer<cl_float4>& images() const { return shows_weights() ? weighed_ : renderer.impl().image(); }
  SceneGradient backward(const Buffer<cl_float4>& grad_images);

  std::optional<Attribute> attribute;  // none: the caller's numbers
  std::size_t channels;
  std::vector<float> values, grad_values;  // [vertex][channel] of the caller
  Renderer renderer;                       // of views [pass][view]
  std::size_t views = 0;                   // of the source; 0: no images
  Buffer<cl_float4> host_grad_images;      // where gradients that come from the host go

 private:
  AttributeDomain domain() const { return attribute ? domain_of(*attribute) : AttributeDomain::vertices; }
  bool shows_faces_of(const Scene& scene) const;
  void follow(const Renderer::Impl& source);
  void take_positions(const Renderer::Impl& source);
  ShownView shown(std::size_t view) const;
  std::vector<glm::vec3> values_of(const Scene& source, std::size_t group, std::size_t view) const;

  SceneGradient folded(SceneGradient&& of_passes);
  void add_positions(const SceneGradient& of_passes, std::vector<glm::dvec3>& positions) const;
  void add_by_geometry(std::span<const glm::vec3> grad, std::vector<glm::dvec3>& positions,
                       SceneGradient& gradient) const;
  void sum_grad_values(std::span<const glm::vec3> grad);
  void set_texcoords(std::span<const glm::vec3> grad, SceneGradient& gradient) const;
  void add_to_positions(std::span<const glm::dvec3> positions, SceneGradient& gradient) const;

  Kernel<cl_uint, cl_uint, In<cl_float4>, Out<cl_float4>> weigh_, weigh_backward_;
  Buffer<cl_float4> weighed_, grad_rendered_;
  GradientRequest wanted_;            // of the source's scene
  std::vector<SourceMesh> meshes_;    // of the source
  std::vector<glm::vec3> positions_;  // shown: [vertex] or, of views' own shapes, [view][vertex]
  bool has_own_shapes_ = false;
};

}  // namespace dpr
