// Views of a mesh, or of meshes of one topology, rendered from named arrays; gradients by the same names.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "batch/named_arrays.hpp"
#include "batch/render_settings.hpp"
#include "batch/renderer_pool.hpp"
#include "dpr/dpr.h"
#include "dpr/light.hpp"
#include "renderer/interpolate.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr::batch {

/// Options of rendering arrays.
struct BatchOptions {
  const RenderSettings& settings;
  /// True if there are lights where no array gives any.
  bool is_lit = false;
  /// Views of a larger batch that come before these: sampled noise is that of the larger batch.
  std::size_t first_view = 0;
  /// Names of the arrays whose gradients backward() may be asked for.
  std::vector<std::string> gradients = {};
  /// True if the image is rendered when it is asked for.
  bool defers_image = false;
};

/// Gradients that the renderer computes for these arrays; those of views' matrices by way of the positions where any
/// affine ones may move.
GradientRequest request_of(std::span<const std::string> names, bool with_affine_views);

/// A rendered batch: the renderer whose buffers hold what the backward pass differentiates, until it is
/// destroyed. Its arrays are those of dpr/dpr_frame.h.
class Batch {
 public:
  /// Throws the library's errors. Arrays are read during the call.
  Batch(std::shared_ptr<RendererPool> pool, NamedArrays arrays, const BatchOptions& options);

  /// Fills the arrays with the outputs that they name.
  void read(NamedArrays outputs);
  /// The gradients of sum <grads, outputs>, by names of outputs and of arrays, into `gradients`.
  void backward(NamedArrays grads, NamedArrays gradients);
  /// Derivatives of the images along directions, at least one: [direction][view][height][width]. `tangents` are
  /// [directions, ...] of the arrays that they name.
  void tangent(std::size_t directions, NamedArrays tangents, std::span<glm::vec4> images);
  /// Shading of the caller's own, as dpr/dpr_frame.h has it.
  dpr_raster raster();
  void read_samples(NamedArrays samples);
  void samples_backward(NamedArrays grads, NamedArrays gradients);
  void clip_space_rast(NamedArrays arrays, NamedArrays outputs);
  std::size_t covered_count() { return covered().numbers.size(); }
  void interpolate(NamedArrays arrays, const NamedArray& values);
  void interpolate_backward(NamedArrays arrays, const NamedArray& grad_values,
                            const NamedArray& grad_attributes, NamedArrays gradients);
  void resolve(const NamedArray& values, const NamedArray& images);
  /// values: none for those that resolve() took last.
  void resolve_backward(const NamedArray* values, const NamedArray& grad_images,
                        const NamedArray& grad_values, NamedArrays gradients);
  void samples_tangent(std::size_t directions, NamedArrays tangents, NamedArrays samples);
  void resolve_tangent(std::size_t directions, NamedArrays tangents, const NamedArray& values,
                       const NamedArray& value_tangents, const NamedArray& images);
  /// Numbers of all images.
  std::size_t image_floats();
  /// True if no triangle of any view was rendered.
  bool is_empty();

 private:
  /// Samples of the nearest surfaces that show a face, in order.
  struct Covered {
    std::vector<cl_uint> numbers;  ///< among all samples
    std::vector<std::int32_t> faces;
    std::vector<vec2> places;  ///< barycentrics of corners 1 and 2
  };
  const Covered& covered();
  /// Attributes of the vertices that they show, by the faces of the arrays or the mesh's; keeps those of the arrays.
  Attributes attributes_of(NamedArrays arrays, std::vector<glm::uvec3>& faces);
  SampleArrays covered_samples();
  /// Throws InvalidArgument unless an array is floats [M, channels] of the samples that show a face.
  void require_covered(const NamedArray& array, std::size_t channels);
  /// The values of all samples, or of those with a face, by the dimensions.
  SampleValues values_of(const NamedArray& array);
  /// Throws InvalidArgument for another shape than the output's, whose pixels have so many channels; 0: a
  /// number.
  void require_image(const NamedArray& array, std::size_t channels);
  /// Throws InvalidArgument for gradients that backward passes were not announced for; all others become 0.
  void start_gradients(NamedArrays gradients);
  /// Throws InvalidArgument unless an array is floats by sample or pixel, of the same channels as `like` where given;
  /// of so many directions, one after the other.
  void require_values(const NamedArray& array, bool is_by_sample, const NamedArray* like,
                      std::size_t directions = 1);
  /// The same of what samples show, by its name.
  void require_samples(const NamedArray& array, std::size_t directions);
  /// `is_affine`: whether the gradients of the views' matrices are those of any affine ones, which come from
  /// those of every view's vertices, where nothing else depends on the views. Lights, and what is measured in
  /// world space, stay where they are: with them the gradients are those of rigid motions.
  void add_gradients(SceneGradient& found, bool is_affine, NamedArrays gradients);
  void add_gradient(SceneGradient& found, bool is_affine, const NamedArray& gradient);
  /// Directions in which the arrays move as their tangents say.
  std::vector<SceneTangent> moving(std::size_t directions, NamedArrays tangents);
  /// A direction in which nothing moves, with room for what these arrays move.
  SceneTangent resting(NamedArrays tangents);
  /// Adds the motion of an array's numbers to a direction.
  void add_tangent(const NamedArray& tangent, std::span<const float> numbers, SceneTangent& direction);

  Frame frame_;
  std::optional<Covered> covered_;  ///< found when first asked for
  std::vector<std::string> wanted_;
  std::vector<glm::vec3> vertices_;  ///< [view][vertex], where the gradients of views need them
};

}  // namespace dpr::batch

struct dpr_frame {
  static constexpr const char* k_handle = "dpr_frame";
  std::unique_ptr<dpr::batch::Batch> batch;
};
