#include "renderer/pixel_noise.hpp"

#include <algorithm>
#include <cmath>

#include "renderer/renderer_impl.hpp"
#include "smoothing/priors.hpp"

namespace dpr {
namespace {

/// The raster sees contours by a tent (kernels/crossing.h), whose variance exceeds that of a sample's cell by
/// a twelfth: so much less is the blur's, if the density has a variance. Below that the blur vanishes
/// smoothly.
PixelScale beside_tent(const PixelScale& noise, const Smoothing& smoothing) {
  const double variance = row_of(smoothing.occupancy_prior).variance;
  if (!std::isfinite(variance)) return noise;
  const double samples = smoothing.supersampling;
  const double excess = 1 / (12 * variance * samples * samples), squared = noise.value * noise.value;
  const double whole = squared + excess, root = std::sqrt(whole);
  return {squared / root, noise.by_sigma * noise.value * (whole + excess) / (whole * root)};
}

}  // namespace

PixelScale pixel_scale(const Smoothing& smoothing, int short_side) {
  const double pixels = short_side / 2.0, sigma = static_cast<double>(smoothing.sigma);
  if (smoothing.distance == DistanceMetric::euclidean)
    return beside_tent({pixels * sigma, pixels}, smoothing);
  return beside_tent({pixels * std::sqrt(sigma), pixels * 0.5 / std::sqrt(sigma)}, smoothing);
}

float depth_reach(const Smoothing& smoothing) {
  constexpr double k_seen = 1e-3;  // of the weight
  // The difference of two depths has noise of twice the variance.
  return smoothing.gamma * static_cast<float>(std::sqrt(2.0) * reach(smoothing.depth_prior, k_seen));
}

PixelNoise::PixelNoise(Device::Impl& device)
    : contour(device), antialias(device), blur(device), device_(device) {}

namespace {

Blur::Lines lines_of_band(const shared::FrameParams& p, const Range& rows) {
  return {lines_of(p, rows), p.first_sample / p.width};
}

}  // namespace

void PixelNoise::start(const ContourInputs& in, const Buffer<cl_uint>& tile_starts) {
  blur.find_extents(in.p, tile_starts);
}

void PixelNoise::add(const ContourInputs& in, Buffer<cl_float4>& raster, const Blur::Size& size,
                     const Range& rows) {
  antialias.cross(in, contour, rows);
  antialias.forward(in.p, contour, raster, kept_, rows);
  blur.add(size, raster, lines_of_band(in.p, rows));
}

void PixelNoise::finish(const Blur::Size& size) {
  image.resize(device_, size.views * size.width * size.height);
  blur.finish(size, image);
  blur_holds_image_ = true;
}

void PixelNoise::start_backward(const Blur::Size& size, const BufferRef<cl_float4>& grad_image,
                                bool by_scale) {
  blur.start_backward(size, grad_image, by_scale);
  blur_holds_image_ = by_scale;
}

void PixelNoise::backward(const ContourInputs& in, Buffer<cl_float4>& raster, const Blur::Size& size,
                          const Range& rows, bool by_scale, Buffer<float>& scratch) {
  antialias.cross(in, contour, rows);
  antialias.forward(in.p, contour, raster, kept_, rows);
  if (by_scale) blur.add_scale(size, raster, lines_of_band(in.p, rows));
  blur.backward_part(size, lines_of(in.p, window_of(in.p)), grad_raster_, by_scale);
  antialias.backward(in, contour, kept_, grad_raster_, {raster, scratch}, rows);  // the raster has been read
}

void PixelNoise::finish_backward(const Blur::Size& size, const BufferRef<cl_float4>& grad_image,
                                 bool by_scale) {
  if (by_scale) blur.backward_scale(size, grad_image);
}

void PixelNoise::prepare(const ContourInputs& in, const Blur::Size& size,
                         const Buffer<cl_uint>& tile_starts) {
  if (!sampled) blur.find_extents(in.p, tile_starts);
  antialias.cross(in, contour);
  if (sampled) sampled->draw(size, in.p.first_view);
}

void PixelNoise::forward(const ContourInputs& in, Buffer<cl_float4>& raster, const Blur::Size& size) {
  antialias.forward(in.p, contour, raster, kept_);
  is_blended_ = true;
  blur_forward(size, raster, image, false);
  blur_holds_image_ = true;
}

void PixelNoise::blur_forward(const Blur::Size& size, const Buffer<cl_float4>& blended,
                              Buffer<cl_float4>& pixels, bool is_whole) {
  pixels.resize(device_, size.views * size.width * size.height);
  if (sampled) {
    sampled->forward(blended, pixels);
  } else if (is_whole) {
    blur.forward_whole(size, blended, pixels);
  } else {
    blur.forward(size, blended, pixels);
  }
}

void PixelNoise::smooth(const ContourInputs& in, Buffer<cl_float4>& samples, const Blur::Size& size,
                        Buffer<cl_float4>& pixels) {
  blend(samples, in.p);
  blur_forward(size, samples, pixels, true);
  blur_holds_image_ = false;
}

void PixelNoise::blend(Buffer<cl_float4>& samples, const shared::FrameParams& p) {
  antialias.forward(p, contour, samples, other_kept_);
  ++smoothed_;
}

void PixelNoise::smooth_backward(const ContourInputs& in, const Blur::Size& size,
                                 const BufferRef<cl_float4>& grad_image, Buffer<cl_float4>& grad_samples,
                                 Buffer<float>& scratch) {
  if (sampled) {
    sampled->backward(grad_image, grad_samples);
  } else {
    blur.backward(size, grad_image, grad_samples, false);
  }
  blur_holds_image_ = false;
  antialias.backward(in, contour, other_kept_, grad_samples, {kept_grad_, scratch});
}

namespace {

/// Images of all directions, one after the other.
Blur::Size along_all(Blur::Size size, const Tangents& tangents) {
  size.views *= tangents.params.directions;
  return size;
}

}  // namespace

void PixelNoise::smooth_tangent(const ContourInputs& in, const Blur::Size& size, const Tangents& tangents,
                                Buffer<cl_float4>& samples, Buffer<cl_float4>& pixels,
                                Buffer<float>& scratch) {
  tangent(in, {antialias, other_kept_, true}, size, tangents, samples, pixels, scratch);
}

void PixelNoise::backward(const ContourInputs& in, Buffer<cl_float4>& raster, const Blur::Size& size,
                          const BufferRef<cl_float4>& grad_image, bool by_scale, bool is_whole,
                          Buffer<float>& scratch) {
  if (by_scale && !raster_is_gradient_) {
    if (!is_blended_) antialias.forward(in.p, contour, raster, kept_);
    is_blended_ = true;
    if (!sampled && !blur_holds_image_) blur.forward(size, raster, image);
    blur_holds_image_ = true;
  }
  raster_is_gradient_ = is_whole && !sampled && !(by_scale && blur.scale_reads_raster());
  Buffer<cl_float4>& grad_raster = raster_is_gradient_ ? raster : grad_raster_;
  if (sampled) {
    sampled->backward(grad_image, grad_raster);
    if (by_scale) sampled->backward_scale(raster, grad_image);
  } else {
    blur.backward(size, grad_image, grad_raster, by_scale);
    if (by_scale) blur.backward_scale(size, raster, grad_image);
    blur_holds_image_ = by_scale;
  }
  antialias.backward(in, contour, kept_, grad_raster, {kept_grad_, scratch});
}

void PixelNoise::tangent(const ContourInputs& in, const Blur::Size& size, const Tangents& tangents,
                         Buffer<cl_float4>& samples, Buffer<cl_float4>& pixels, Buffer<float>& scratch) {
  tangent(in, {antialias, kept_, false}, size, tangents, samples, pixels, scratch);
}

void PixelNoise::tangent(const ContourInputs& in, const Blended& of, const Blur::Size& size,
                         const Tangents& tangents, Buffer<cl_float4>& samples, Buffer<cl_float4>& pixels,
                         Buffer<float>& scratch) {
  of.antialias.tangent(in, contour, of.kept, tangents, samples, {kept_grad_, scratch});
  blur_forward(along_all(size, tangents), samples, pixels, of.is_whole);
  blur_holds_image_ = false;
}

std::size_t PixelNoise::bytes() const {
  return contour.bytes() + antialias.bytes() + blur.bytes() + (sampled ? sampled->bytes() : 0) +
         (edges ? edges->bytes() : 0) + image.capacity_bytes() + kept_.bytes() + other_kept_.bytes() +
         grad_raster_.capacity_bytes() + kept_grad_.capacity_bytes();
}

void Renderer::Impl::find_edges() {
  if (!pixel_noise) return;
  if (!pixel_noise->edges || pixel_noise->edges->sees_through != is_see_through) {
    pixel_noise->edges.emplace(impl_of(device), scene, geometry->views_of_faces, is_see_through);
    pixel_noise->back_faces = BackFaces(std::move(pixel_noise->edges->solids));
    setup.forget_volumes();
    for (std::size_t mesh = 0; mesh < scene.meshes.size(); ++mesh) {
      if (!clip_planes.knows(mesh)) pixel_noise->back_faces.forget(mesh);
    }
    has_moved = true;
  }
  if (has_moved) pixel_noise->edges->join(frame, *geometry);
  has_moved = false;
}

void Renderer::Impl::take_windings(const Impl& of, std::size_t copies) {
  shape_positions_.clear();
  shape_windings_.clear();
  for (std::size_t copy = 0; copy < copies; ++copy)
    shape_windings_.insert(shape_windings_.end(), of.shape_windings_.begin(), of.shape_windings_.end());
}

/// Of shapes that the device alone knows none are known to be hidden.
void Renderer::Impl::hide_back_faces() {
  const std::size_t count = views.size() * scene.meshes.size();
  const bool has_shapes = frame.position_stride != 0;
  const bool may_hide = pixel_noise && layers == 1 && !sees_through() &&
                        (!has_shapes || clip_planes.knows_views()) && !has_device_poses &&
                        scene.cull == Cull::none;
  const auto hides_none = [](float orientation) { return orientation == 0; };
  if (!may_hide && uploaded_hidden_.size() == count && std::ranges::all_of(uploaded_hidden_, hides_none)) {
    hides_by_device_ = false;
    return;
  }
  std::vector<float> hidden(count);
  hides_by_device_ = false;
  if (may_hide) {
    BackFaces& back_faces = pixel_noise->back_faces;
    if (has_shapes) {
      if (shape_windings_.empty())
        shape_windings_ = back_faces.windings_of(scene, *geometry, shape_positions_);
      shape_positions_.clear();
    } else {
      back_faces.measure(scene, [&](std::size_t mesh) { setup.measure(*geometry, scene, mesh); });
      hides_by_device_ = back_faces.are_on_device();
    }
    hidden = back_faces.hidden(scene, views, clip_planes, depth_reach(scene.smoothing),
                               has_shapes ? std::span<const int>(shape_windings_) : std::span<const int>());
  }
  if (hidden == uploaded_hidden_) return;
  uploaded_hidden_.clear();
  hidden_.upload(impl_of(device), hidden);
  uploaded_hidden_ = std::move(hidden);
}

}  // namespace dpr
