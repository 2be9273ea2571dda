// The blur of the rigid image by the noise of the pixel's position, its transpose and its derivative by the
// scale.
#pragma once

#include "kernels/blur.hpp"
#include "kernels/blur_scale.hpp"
#include "smoothing/blur_kernel.hpp"
#include "stages/reduce.hpp"

namespace dpr {

/// Rasters are [view][height * supersampling + 2 * margin][width * supersampling + 2 * margin] samples,
/// images [view][height][width] pixels; both RGBA.
class Blur {
 public:
  explicit Blur(Device::Impl& device);

  struct Size {
    std::size_t views = 0, width = 0, height = 0;  ///< pixels of the image
  };

  /// A kernel on the device.
  struct Setting {
    BlurKernel kernel;
    Buffer<float> weights, weights_by_scale, reduce, expand;
  };
  /// Everything about setting the kernel that can fail.
  Setting prepare(BlurKernel kernel) const;
  void set(Setting&& prepared) noexcept { std::swap(now_, prepared); }
  const BlurKernel& kernel() const { return now_.kernel; }

  /// Finds the covered part of the rasters that follow, which need not be all alike: the tiles that have
  /// pairs. Elsewhere nothing is summed up. Until then all of a raster may differ. Where more images follow than
  /// there are views, each has the extents of its view: tangents along several directions.
  void find_extents(const shared::FrameParams& p, const Buffer<cl_uint>& tile_starts);

  void forward(const Size& size, const Buffer<cl_float4>& raster, Buffer<cl_float4>& image);
  /// The same of a raster all of which may differ, whatever extents are known.
  void forward_whole(const Size& size, const Buffer<cl_float4>& raster, Buffer<cl_float4>& image);
  /// Lines of samples, of all views one after the other, and the first of those that a raster holds.
  struct Lines {
    Range of;
    std::size_t first_held;
  };
  /// The same as forward(), to the same bits, of rasters of which lines are there at a time: those of all lines, in
  /// order; then the image.
  void add(const Size& size, const Buffer<cl_float4>& raster, const Lines& lines);
  void finish(const Size& size, Buffer<cl_float4>& image);
  /// The transpose of forward(). Takes the memory of what forward() has left for backward_scale(), unless that
  /// is kept.
  void backward(const Size& size, const BufferRef<cl_float4>& grad_image, Buffer<cl_float4>& grad_raster,
                bool keeps_forward);
  /// The same, of lines of rasters at a time, which begin and end with tiles: all but these; then lines.
  void start_backward(const Size& size, const BufferRef<cl_float4>& grad_image, bool keeps_forward);
  void backward_part(const Size& size, const Range& lines, Buffer<cl_float4>& grad_raster,
                     bool keeps_forward);
  /// The derivative by the scale of sum grad_image . image, in `grad_scale`. After forward() and backward()
  /// of the same raster and gradient, which has kept what forward() left.
  void backward_scale(const Size& size, const Buffer<cl_float4>& raster,
                      const BufferRef<cl_float4>& grad_image);
  /// The same as that, of lines at a time; then the derivative.
  void add_scale(const Size& size, const Buffer<cl_float4>& raster, const Lines& lines);
  void backward_scale(const Size& size, const BufferRef<cl_float4>& grad_image);

  /// True if backward_scale() reads the raster itself, not what forward() has kept of it.
  bool scale_reads_raster() const { return !is_coarse(); }
  /// True if backward() loads whole vectors where the image ends: memory behind it must be there.
  bool loads_behind_images() const { return is_coarse(); }

  Buffer<float> grad_scale;  ///< [view], by the scale in pixels

  std::size_t bytes() const;

 private:
  /// Along one axis: samples of the raster, and what the convolution reads and writes: samples and pixels, or
  /// nodes of the coarse grid.
  struct Axis {
    std::size_t pixels, samples, in, out;
  };
  Axis axis(std::size_t pixels) const;
  /// Number of the coarse grid's nodes before the frame whose splines reach into the frame.
  std::size_t nodes_before_frame() const;
  bool is_coarse() const { return now_.kernel.decimation > 1; }

  using Pass = shared::BlurPass;
  Pass reduction(const Axis& axis) const;
  Pass convolution(const Axis& axis) const;
  Pass expansion(const Axis& axis) const;
  /// The pass that reads the raster, and its transpose with its input.
  Pass first_pass(const Axis& y) const;
  Pass last_pass(const Axis& y) const;
  const Buffer<cl_float4>& last_input(bool keeps_forward) const;
  /// Completes a pass along the columns of so many images. Returns its work-items.
  Range set_columns(Pass& pass, std::size_t views, std::size_t width) const;
  /// What lines of the input add to all outputs; and lines of the output.
  void add_columns(Pass pass, std::size_t views, std::size_t width, const Buffer<float>& weights,
                   const Buffer<cl_float4>& in, const Lines& lines, Buffer<cl_float4>& out);
  void part_of_columns(Pass pass, std::size_t views, std::size_t width, const Buffer<float>& weights,
                       const BufferRef<cl_float4>& in, const Range& lines, Buffer<cl_float4>& out);
  void backward_scale(const Size& size, const Buffer<cl_float4>& raster,
                      const BufferRef<cl_float4>& grad_image, bool has_sums);
  void columns(Pass pass, std::size_t views, std::size_t width, const Buffer<float>& weights,
               const BufferRef<cl_float4>& in, Buffer<cl_float4>& out);
  void rows(Pass pass, std::size_t lines, const Buffer<float>& weights, const BufferRef<cl_float4>& in,
            Buffer<cl_float4>& out);
  /// The samples that an element along one axis is made of: from i * step + first up to i * step + end.
  struct Footprint {
    int step = 1, first = 0, end = 1;
    /// Footprint of the outputs of a pass whose inputs have this one.
    Footprint through(const Pass& pass) const;
  };
  /// Footprint of the convolution's inputs.
  Footprint input_footprint(const Axis& axis) const;
  /// The pass, which passes over what lies outside of the extents. `along` and `across` are of its inputs.
  Pass within_extents(Pass pass, const Footprint& along, const Footprint& across,
                      std::size_t image_lines = 1) const;
  void upload_starts(std::size_t views, std::size_t stride);
  /// Work-items of a pass of one image's columns, of a block of their rows, and of one row.
  std::size_t column_items(const Pass& pass, std::size_t width) const;
  std::size_t items_of_row(std::size_t width) const;
  std::size_t row_items(const Pass& pass) const;

  Device::Impl& device_;
  Setting now_;
  Launcher<kernel::blur_extents, kernel::blur_columns, kernel::blur_rows, kernel::blur_rows_strided,
           kernel::blur_columns_scale, kernel::blur_rows_scale>
      launch_;
  Reduce reduce_;
  /// Input of the convolution, after its columns, after its rows; the first and the last of a coarse grid
  /// only.
  Buffer<cl_float4> in_, between_, out_;
  Buffer<cl_float4> grad_in_, grad_between_, grad_out_;
  Buffer<cl_float4> scratch_;
  Buffer<cl_float4> by_scale_;  // what add_scale() has added up, as between_
  Buffer<float> products_;
  Buffer<cl_uint2> extents_;   ///< [view][row of tiles], in samples
  std::size_t tile_rows_ = 0;  ///< 0 while the extents are not known
  cl_uint extent_views_ = 1;
  Buffer<cl_uint> starts_;  ///< of the views' products
  std::size_t starts_stride_ = 0;
};

}  // namespace dpr
