// State of AttributeImages: a renderer of their own, whose colours are the attribute.
#pragma once

#include <memory>
#include <optional>

#include "dpr/attribute_images.hpp"
#include "dpr/opencl_handles.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr {

/// Elements that an attribute has numbers for.
enum class AttributeDomain { vertices, faces, corners };

struct AttributeImages::Impl {
  /// Whose faces are shown.
  struct SourceMesh {
    std::optional<std::size_t> instance_of;
    std::size_t vertices;
    std::vector<glm::uvec3> faces;
  };

  Impl(const Device& device, std::optional<Attribute> attribute, std::size_t channels);

  /// Number of groups of three channels.
  std::size_t groups() const { return (channels + 2) / 3; }
  /// Alpha is the sum of the weights but in the barrier composition. There one more group shows it.
  static bool shows_weights(const Smoothing& s) { return s.composition == Composition::barrier; }
  bool shows_weights() const { return shows_weights(renderer.scene().smoothing); }
  std::size_t passes(const Smoothing& s) const { return groups() + (shows_weights(s) ? 1 : 0); }
  std::size_t passes() const { return passes(renderer.scene().smoothing); }

  /// Throws InvalidArgument, which names the caller, unless there are images.
  void require_forward(const char* caller) const;
  /// Enqueues the images, and reads of the frame what Renderer::Impl::forward() does.
  void forward(Renderer::Impl& source, FrameSizes sizes);
  /// [group][view][height][width] RGBA
  const Buffer<cl_float4>& images() const { return shows_weights() ? weighed_ : impl_of(renderer).image(); }
  SceneGradient backward(const BufferRef<cl_float4>& grad_images);
  /// Leaves the gradients on the device: `grad_positions`, `grad_rows` and `numbers`.
  void backward_on_device(const BufferRef<cl_float4>& grad_images);
  void require_own_values() const;
  void set_values(std::span<const float> values);
  /// From the device: `count` vectors of numbers.
  void take_values(const FloatVectors& from, std::size_t count);
  /// A gradient that backward_on_device() left. Throws InvalidArgument for one that there is not.
  BufferView gradient_view(const std::string& name);

  std::optional<Attribute> attribute;  // none: the caller's numbers
  std::size_t channels;
  std::vector<float> grad_values;      // [vertex][channel] of the caller
  Renderer renderer;                   // of views [pass][view]
  std::size_t views = 0;               // of the source; 0: no images
  Buffer<cl_float4> host_grad_images;  // where gradients that come from the host go
  std::optional<FrameCounts> room;     // what reserve() asked for

 private:
  AttributeDomain domain() const;
  bool has_rows() const { return !attribute || attribute == Attribute::texcoords; }
  /// Of the renderer, for a source.
  std::size_t views_of_faces(const Renderer::Impl& source) const;
  bool shows_faces_of(const Renderer::Impl& source) const;
  void require_values(Renderer::Impl& source) const;
  void show_faces_of(const Renderer::Impl& source);
  void follow(Renderer::Impl& source);
  void follow_views(const Renderer::Impl& source);
  void follow_positions(const Renderer::Impl& source);
  void follow_shapes(const Renderer::Impl& source);
  /// Lists of rows that so many views have: one for all that have faces of their own.
  std::size_t of_rows(std::size_t its_views) const { return its_views / views_of_rows_; }
  const RowMap& row_map() const { return attribute ? texcoords_->map : vertices_; }
  const Buffer<float>& row_values() const { return attribute ? texcoords_->values : values_; }

  BufferRef<cl_float4> grad_of_rendered(const BufferRef<cl_float4>& grad_images);
  void gather();
  SceneGradient folded(SceneGradient&& of_passes);
  SceneGradient empty_gradient() const;

  ShownRows rows_;
  Launcher<kernel::attribute_weigh_forward, kernel::attribute_weigh_backward> launch_;
  Buffer<cl_float4> weighed_, grad_rendered_;
  GradientRequest wanted_;          // of the source's scene
  std::vector<SourceMesh> meshes_;  // of the source
  RowMap positions_, vertices_;  // of the source, at those that are shown; places of a mesh share positions
  bool has_own_shapes_ = false;
  std::size_t views_of_rows_ = 1;               // that share a list of rows
  std::shared_ptr<CornerTexcoords> texcoords_;  // the source's, where they are shown
  Buffer<float> values_;                        // the caller's
  std::size_t value_count_ = 0;
  Buffer<cl_float4> grad_positions_;  // [vertex] or, of views' own shapes, [view][vertex]
  Buffer<float> grad_rows_;           // [row][channel]
  Buffer<float> grad_numbers_;        // of the views, in the order of gradients' sums
  std::optional<SparseMap> fold_;     // to these, from the renderer's of [pass][view]
};

}  // namespace dpr
