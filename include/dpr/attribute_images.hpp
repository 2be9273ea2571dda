// Images of other numbers than colours, with gradients: depth, position, normal, texture coordinates, and
// whatever a caller has at the vertices.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string_view>

#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/image.hpp"
#include "dpr/renderer.hpp"

namespace dpr {

/// An attribute that a surface shows in place of its colour. depth: along the view direction, world units.
/// position: world space. normal: the faces', world space, of length 1, on the side from which they wind
/// counter-clockwise. texcoords: u and v.
enum class Attribute { depth, position, normal, texcoords };

DPR_API std::string_view to_string(Attribute attribute);
/// The inverse; `where` names the argument in the InvalidArgument thrown for an unknown word.
DPR_API Attribute parse_attribute(std::string_view word, std::string_view where);

/// Images of an attribute, as a renderer's smoothing blends it, and their gradients: by way of what the
/// surface shows, and of how much of it is seen.
///
/// With w_j the weights of a pixel's faces, which blend its colour, and a_j what they show there,
///
///     RGB = sum_j w_j a_j ,  A = sum_j w_j
///
/// depth in all three channels, texture coordinates in red and green. RGB / A is the expectation
/// over what is seen, the depth of AuxiliaryOutputs; its normal is RGB made of length 1. What is here is not
/// divided: it is linear in the weights, so that values and gradients stay finite where a surface fades out,
/// and smooth where its weights do. A loss of e = RGB / A with the gradient g has g / A by RGB, and
/// -<g, e> / A by A.
///
/// In the barrier composition weights need not fade: (gamma / alpha) ln p is little beside the difference of
/// depths, so that a face over the background may have all the weight up to the blur radius, and none beyond
/// it. No gradient knows of that step. Where the default radius leaves one, gradients at silhouettes are
/// those of the interior alone, and may have the sign opposite to that of moving the silhouette, for
/// attributes, which are far from 0, above all. They are right with a blur_radius at which the weight is gone
/// (0.5 for sigma 1e-3 and gamma 1e-2), and say something of larger steps if it goes over more than a pixel.
///
/// With noise on the pixel an edge between faces whose numbers differ is a contour, as between colours.
///
/// A renderer of its own shows the same faces; a forward and a backward pass cost about what those of the
/// image do, in the barrier composition twice that, whose alpha is not the sum of the weights. Sampled
/// estimators draw noise of their own for every view and three channels.
class DPR_API AttributeImages {
 public:
  AttributeImages(const Device& device, Attribute attribute);
  /// Images of the caller's values at the vertices, [vertex][channel], as set_values() has them. Throws
  /// InvalidArgument for no channels.
  AttributeImages(const Device& device, std::size_t channels, std::span<const float> values);
  ~AttributeImages();
  AttributeImages(AttributeImages&&) noexcept;
  AttributeImages& operator=(AttributeImages&&) noexcept;

  /// New numbers for the next forward(): [vertex][channel], the vertices of all meshes one after the other,
  /// instances' among them, which may have numbers of their own. Throws InvalidArgument for numbers that are
  /// not finite, and for attributes that the scene gives.
  void set_values(std::span<const float> values);

  /// Renders what the renderer's last forward() shows: its scene, views, shapes, smoothing and culling as
  /// they are now. Throws InvalidArgument before that, for a renderer of another Device, for values that do
  /// not fit its vertices, for texcoords of a mesh without, and for opacities below 1. What comes from buffers, as
  /// dpr/opencl_handles.hpp has it, is followed on the device; that also does all of this without the host.
  void forward(const Renderer& renderer);

  std::size_t channels() const;
  /// Number of a view's images: one for every three channels.
  std::size_t groups() const;
  /// The image of a view: RGB, and A, as above, of the channels from 3 * group on. Blocks.
  Image image(std::size_t view = 0, std::size_t group = 0) const;

  /// Gradients of the sum over images and pixels of <grad_images, image>, RGBA, [group][view]. Those that the
  /// renderer's scene asked for at the forward pass, of positions, transforms, cameras, distortion and
  /// smoothing, and for texcoords of these; the rest is zero or empty. dpr::add() sums them with others.
  SceneGradient backward(std::span<const Image> grad_images);
  /// Gradient of the values at the vertices, [vertex][channel], after backward(). Empty for other attributes.
  std::span<const float> grad_values() const;

  struct DPR_LOCAL Impl;

 private:
  friend struct Internals;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dpr
