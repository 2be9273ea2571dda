// Noise on the pixel: from the samples of the rigid image to the image, and back.
#pragma once

#include <memory>
#include <optional>

#include "renderer/back_faces.hpp"
#include "stages/antialias.hpp"
#include "stages/blur.hpp"
#include "stages/blur_sampled.hpp"
#include "stages/contour.hpp"

namespace dpr {

/// The raster of rigid samples around a frame of pixels.
struct Raster {
  int supersampling = 1;  ///< samples of a pixel along each axis
  int margin = 0;         ///< samples around the frame
};

/// Scale of the pixel's noise that is left to the blur, in pixels of a frame whose shorter side is that
/// long; and its derivative by sigma.
struct PixelScale {
  double value, by_sigma;
};
PixelScale pixel_scale(const Smoothing& smoothing, int short_side);

/// Distance behind the nearest surface, in normalised depth, up to which depth noise lets another be seen.
float depth_reach(const Smoothing& smoothing);

/// How samples were blended across contours. `is_whole`: they may differ outside of the covered part, too.
struct Blended {
  Antialias& antialias;
  const KeptSamples& kept;
  bool is_whole;
};

class PixelNoise {
 public:
  explicit PixelNoise(Device::Impl& device);

  Contour contour;
  Antialias antialias;
  Blur blur;
  std::shared_ptr<BlurSampled> sampled;  // takes its place where the noise is sampled
  std::optional<Edges> edges;            // of the scene; made for its first frame
  BackFaces back_faces;                  // of the edges' meshes

  /// Before forward(), smooth() and blur_forward(), after the antialiasing's find_front() of all bands. `tile_starts` are
  /// the runs of the frame's pairs.
  void prepare(const ContourInputs& in, const Blur::Size& size, const Buffer<cl_uint>& tile_starts);
  /// From samples, which are blended in place, to the image.
  void forward(const ContourInputs& in, Buffer<cl_float4>& raster, const Blur::Size& size);
  /// prepare() and forward() of a frame in bands of samples: at first; of each, in order, whose samples the raster
  /// holds, with those around it (Antialias::k_rows_around); at last. `rows` are the band's, of tiles.
  void start(const ContourInputs& in, const Buffer<cl_uint>& tile_starts);
  void add(const ContourInputs& in, Buffer<cl_float4>& raster, const Blur::Size& size, const Range& rows);
  void finish(const Blur::Size& size);
  /// backward() of such a frame in the same way, of bands that have been rendered again.
  void start_backward(const Blur::Size& size, const BufferRef<cl_float4>& grad_image, bool by_scale);
  void backward(const ContourInputs& in, Buffer<cl_float4>& raster, const Blur::Size& size, const Range& rows,
                bool by_scale, Buffer<float>& scratch);
  void finish_backward(const Blur::Size& size, const BufferRef<cl_float4>& grad_image, bool by_scale);

  /// The raster holds samples as they were before forward(): bands have been rendered again.
  void unblend() { is_blended_ = raster_is_gradient_ = false; }
  /// To `grad_raster` and the contours' ends; and, if asked for, to the scale. `is_whole`: the raster is not
  /// rendered again, by bands, before the gradient is read. That takes its place then, unless the scale's
  /// gradient is asked for and found by the raster itself. `scratch`, here and below: see Aggregate::scratch().
  void backward(const ContourInputs& in, Buffer<cl_float4>& raster, const Blur::Size& size,
                const BufferRef<cl_float4>& grad_image, bool by_scale, bool is_whole, Buffer<float>& scratch);
  /// True if backward() lacks the raster, whose place a gradient has taken, and the blur does not hold all
  /// that the scale's gradient needs of it.
  bool lacks_raster(bool by_scale) const {
    return by_scale && raster_is_gradient_ && (blur.scale_reads_raster() || !blur_holds_image_);
  }
  /// The same of a frame in bands of samples, of which it is the blur that holds what is needed.
  bool lacks_image(bool by_scale) const { return by_scale && !blur_holds_image_; }

  /// Bytes a sample, of which the gradient's are a raster's that is not held where the frame is whole.
  static constexpr std::size_t k_sample_bytes = Antialias::k_sample_bytes + KeptSamples::k_sample_bytes;

  /// Samples other than those of forward() the same way, to [view][height][width].
  void smooth(const ContourInputs& in, Buffer<cl_float4>& samples, const Blur::Size& size,
              Buffer<cl_float4>& pixels);

  /// The part of smooth() that smooth_backward() and smooth_tangent() need: blends samples in place.
  void blend(Buffer<cl_float4>& samples, const shared::FrameParams& p);
  /// Number of the samples that smooth() and blend() took last: others have another. Never 0 after them.
  std::uint64_t smoothed() const { return smoothed_; }
  /// From the gradient of what smooth() made of the last samples to theirs, and to the contours' ends.
  void smooth_backward(const ContourInputs& in, const Blur::Size& size,
                       const BufferRef<cl_float4>& grad_image, Buffer<cl_float4>& grad_samples,
                       Buffer<float>& scratch);

  /// From the tangents of the samples that smooth() took last, which are blended in place, to those of its pixels,
  /// along a group's directions.
  void smooth_tangent(const ContourInputs& in, const Blur::Size& size, const Tangents& tangents,
                      Buffer<cl_float4>& samples, Buffer<cl_float4>& pixels, Buffer<float>& scratch);

  /// The same of the samples that forward() took.
  void tangent(const ContourInputs& in, const Blur::Size& size, const Tangents& tangents,
               Buffer<cl_float4>& samples, Buffer<cl_float4>& pixels, Buffer<float>& scratch);

  /// The same of samples that others have blended.
  void tangent(const ContourInputs& in, const Blended& of, const Blur::Size& size, const Tangents& tangents,
               Buffer<cl_float4>& samples, Buffer<cl_float4>& pixels, Buffer<float>& scratch);

  /// From samples whose contours are blended to [view][height][width]. `is_whole`: see Blended.
  void blur_forward(const Blur::Size& size, const Buffer<cl_float4>& blended, Buffer<cl_float4>& pixels,
                    bool is_whole);

  /// Memory of so many elements, or of as many as there are samples, until backward() writes to it.
  Buffer<cl_float4>& room(const shared::FrameParams& p, std::size_t count) {
    kept_grad_.resize(device_, std::max(pixels_of(p), count));
    return kept_grad_;
  }

  const Buffer<float>& grad_scale() const { return sampled ? sampled->grad_scale : blur.grad_scale; }

  Buffer<cl_float4> image;  ///< [view][height][width] RGBA
  /// Gradient of the samples of `raster`, after backward().
  const Buffer<cl_float4>& grad_raster(const Buffer<cl_float4>& raster) const {
    return raster_is_gradient_ ? raster : grad_raster_;
  }

  std::size_t bytes() const;

 private:
  KeptSamples kept_, other_kept_;
  std::uint64_t smoothed_ = 0;
  Buffer<cl_float4> grad_raster_;  // where it has not taken the raster's place
  Buffer<cl_float4> kept_grad_;    // of a whole frame's samples; see room()
  bool is_blended_ = false;        // the raster is
  bool raster_is_gradient_ = false;
  bool blur_holds_image_ = false;  // what it keeps for the scale's gradient is of the image
  Device::Impl& device_;
};

}  // namespace dpr
