#include "stages/blur.hpp"

#include <algorithm>
#include <utility>

namespace dpr {
namespace {

/// As kernels/blur.h has them: outputs of a work-item along its pass, in vectors along rows; pixels of a
/// vector; blocks beside each other.
std::size_t block_of(const Device::Impl& device) { return device.info.lanes == 1 ? 4 : 8; }
constexpr std::size_t k_row_block = 4;
std::size_t pixels_of_vector(const Device::Impl& device) {
  return std::max<std::size_t>(1, device.info.lanes / 4);
}
std::size_t pixels_of_blocks(const Device::Impl& device) {
  return (device.info.lanes == 1 ? 1 : 4) * pixels_of_vector(device);
}

std::size_t groups(std::size_t items, std::size_t group) { return (items + group - 1) / group; }

/// Zeros beyond the taps, for the other outputs of a block; the steps are at most `step`.
std::vector<float> padded(const std::vector<float>& weights, int step, std::size_t block) {
  const std::size_t padding = (block - 1) * static_cast<std::size_t>(step);
  std::vector<float> result(weights.size() + 2 * padding);
  std::copy(weights.begin(), weights.end(), result.begin() + static_cast<std::ptrdiff_t>(padding));
  return result;
}

cl_int to_int(std::size_t value) { return static_cast<cl_int>(value); }

/// Without its lines and their width.
shared::BlurPass pass_of(std::size_t out_length, std::size_t in_length, int out_step, int in_step, int offset,
                         std::size_t taps) {
  shared::BlurPass pass{};
  pass.out_length = static_cast<cl_uint>(out_length);
  pass.in_length = static_cast<cl_uint>(in_length);
  pass.out_step = out_step;
  pass.in_step = in_step;
  pass.offset = offset;
  pass.taps = to_int(taps);
  return pass;
}

shared::BlurPass transposed(shared::BlurPass pass) {
  std::swap(pass.out_length, pass.in_length);
  std::swap(pass.out_step, pass.in_step);
  pass.offset = pass.taps - 1 - pass.offset;
  return pass;
}

}  // namespace

Blur::Blur(Device::Impl& device) : device_(device), launch_(device), reduce_(device) {
  extents_.resize(device_, 1);  // kernels have the argument where nothing is known, too
}

Blur::Setting Blur::prepare(BlurKernel kernel) const {
  Setting setting;
  const int step = kernel.decimation > 1 ? 1 : kernel.supersampling;
  const std::size_t block = block_of(device_);
  setting.weights.upload(device_, padded(kernel.weights, step, block));
  setting.weights_by_scale.upload(device_, padded(kernel.weights_by_scale, step, block));
  setting.reduce.upload(device_, padded(kernel.reduce, kernel.decimation, block));
  setting.expand.upload(device_,
                        padded(kernel.expand, std::max(kernel.decimation, kernel.supersampling), block));
  setting.kernel = std::move(kernel);
  return setting;
}

Blur::Axis Blur::axis(std::size_t pixels) const {
  const BlurKernel& k = now_.kernel;
  const std::size_t in_frame = pixels * static_cast<std::size_t>(k.supersampling);
  const std::size_t samples = in_frame + 2 * static_cast<std::size_t>(k.margin);
  if (!is_coarse()) return {pixels, samples, samples, pixels};
  // Nodes whose splines reach into the frame.
  const std::size_t spacing = static_cast<std::size_t>(k.decimation), reach = k.reduce.size() / 2;
  const std::size_t out = nodes_before_frame() + (in_frame - 1 + reach) / spacing + 1;
  return {pixels, samples, out + k.weights.size() - 1, out};
}

std::size_t Blur::nodes_before_frame() const {
  return now_.kernel.reduce.size() / 2 / static_cast<std::size_t>(now_.kernel.decimation);
}

shared::BlurPass Blur::reduction(const Axis& axis) const {
  const BlurKernel& k = now_.kernel;
  const int radius = to_int(k.weights.size() / 2);
  const int before = to_int(nodes_before_frame()) + radius;
  const int offset = k.margin + to_int(k.reduce.size() / 2) - before * k.decimation;
  return pass_of(axis.in, axis.samples, k.decimation, 1, offset, k.reduce.size());
}

shared::BlurPass Blur::convolution(const Axis& axis) const {
  const std::size_t taps = now_.kernel.weights.size();
  const int step = is_coarse() ? 1 : now_.kernel.supersampling;
  return pass_of(axis.out, axis.in, step, 1, to_int(taps) - 1, taps);
}

shared::BlurPass Blur::expansion(const Axis& axis) const {
  const BlurKernel& k = now_.kernel;
  // The middle of the spline of the first node that is not before the frame, at sample 0.
  const int before = to_int(nodes_before_frame()) * k.decimation;
  const int offset = before + to_int(k.reduce.size() / 2) + k.supersampling - 1;
  return pass_of(axis.pixels, axis.out, k.supersampling, k.decimation, offset, k.expand.size());
}

std::size_t Blur::column_items(const Pass& pass, std::size_t width) const {
  return groups(pass.out_length, block_of(device_)) * items_of_row(width);
}

std::size_t Blur::items_of_row(std::size_t width) const { return groups(width, pixels_of_blocks(device_)); }

std::size_t Blur::row_items(const Pass& pass) const {
  return groups(pass.out_length, k_row_block * pixels_of_blocks(device_));
}

void Blur::find_extents(const shared::FrameParams& p, const Buffer<cl_uint>& tile_starts) {
  const std::size_t rows = std::size_t{p.views} * p.tiles_y;
  extents_.resize(device_, rows);
  launch_(rows, kernel::blur_extents{.p = p, .tile_starts = tile_starts, .extents = extents_});
  tile_rows_ = p.tiles_y;
  extent_views_ = p.views;
}

Blur::Footprint Blur::Footprint::through(const Pass& pass) const {
  // Either the inputs are next to each other, or the pass counts in samples already.
  const int unit = pass.in_step == 1 ? step : 1;
  return {pass.out_step * unit, (pass.offset - pass.taps + 1) * unit + first, pass.offset * unit + end};
}

Blur::Footprint Blur::input_footprint(const Axis& axis) const {
  return is_coarse() ? Footprint().through(reduction(axis)) : Footprint();
}

Blur::Pass Blur::within_extents(Pass pass, const Footprint& along, const Footprint& across,
                                std::size_t image_lines) const {
  pass.tile_rows = static_cast<cl_uint>(tile_rows_);
  pass.views = extent_views_;
  pass.image_lines = static_cast<cl_uint>(image_lines);
  pass.along_step = along.step;
  pass.along_first = along.first;
  pass.along_end = along.end;
  pass.across_step = across.step;
  pass.across_first = across.first;
  pass.across_end = across.end;
  return pass;
}

Range Blur::set_columns(Pass& pass, std::size_t views, std::size_t width) const {
  pass.lines = static_cast<cl_uint>(views);
  pass.width = static_cast<cl_uint>(width);
  pass.last_row = to_int(pass.in_length);
  pass.items = static_cast<cl_uint>(views * column_items(pass, width));
  return std::size_t{pass.items};
}

void Blur::columns(Pass pass, std::size_t views, std::size_t width, const Buffer<float>& weights,
                   const BufferRef<cl_float4>& in, Buffer<cl_float4>& out) {
  const Range items = set_columns(pass, views, width);
  out.resize(device_, views * pass.out_length * width);
  launch_(items,
          kernel::blur_columns{.p = pass, .extents = extents_, .weights = weights, .in = in, .out = out});
}

namespace {

/// The lines of an image among those of all, counted from its first.
Range lines_of_image(const Range& lines, std::size_t image, std::size_t length) {
  const std::size_t begin = image * length, first = std::max(lines.first, begin),
                    last = std::min<std::size_t>(lines.last(), begin + length);
  return {first - begin, last - first};
}

}  // namespace

void Blur::add_columns(Pass pass, std::size_t views, std::size_t width, const Buffer<float>& weights,
                       const Buffer<cl_float4>& in, const Lines& lines, Buffer<cl_float4>& out) {
  set_columns(pass, views, width);
  out.resize(device_, views * pass.out_length * width);
  pass.in_shift = static_cast<cl_uint>(lines.first_held * width);
  const std::size_t items = column_items(pass, width), length = pass.in_length;
  for (std::size_t view = lines.of.first / length; view * length < lines.of.last(); ++view) {
    const Range rows = lines_of_image(lines.of, view, length);
    pass.first_row = to_int(rows.first);
    pass.last_row = to_int(rows.last());
    pass.items = static_cast<cl_uint>((view + 1) * items);
    launch_(Range(view * items, items),
            kernel::blur_columns{.p = pass, .extents = extents_, .weights = weights, .in = in, .out = out});
  }
}

void Blur::part_of_columns(Pass pass, std::size_t views, std::size_t width, const Buffer<float>& weights,
                           const BufferRef<cl_float4>& in, const Range& lines, Buffer<cl_float4>& out) {
  set_columns(pass, views, width);
  out.resize(device_, lines.count * width);
  pass.out_shift = static_cast<cl_uint>(lines.first * width);
  const std::size_t length = pass.out_length, block = block_of(device_), of_row = items_of_row(width);
  const std::size_t blocks_of_image = groups(length, block);
  for (std::size_t view = lines.first / length; view * length < lines.last(); ++view) {
    const Range rows = lines_of_image(lines, view, length);
    const Range items((view * blocks_of_image + rows.first / block) * of_row,
                      groups(rows.count, block) * of_row);
    pass.items = items.last();
    launch_(items,
            kernel::blur_columns{.p = pass, .extents = extents_, .weights = weights, .in = in, .out = out});
  }
}

void Blur::rows(Pass pass, std::size_t lines, const Buffer<float>& weights, const BufferRef<cl_float4>& in,
                Buffer<cl_float4>& out) {
  pass.lines = static_cast<cl_uint>(lines);
  out.resize(device_, lines * pass.out_length);
  if (pass.in_step == 1 && pass.out_step == 1) {
    launch_(lines * row_items(pass),
            kernel::blur_rows{.p = pass, .extents = extents_, .weights = weights, .in = in, .out = out});
  } else {
    const std::size_t blocks = groups(pass.out_length, block_of(device_));
    launch_(
        groups(lines, pixels_of_vector(device_)) * blocks,
        kernel::blur_rows_strided{.p = pass, .extents = extents_, .weights = weights, .in = in, .out = out});
  }
}

Blur::Pass Blur::first_pass(const Axis& y) const {
  return within_extents(is_coarse() ? reduction(y) : convolution(y), {}, {});
}

void Blur::forward(const Size& size, const Buffer<cl_float4>& raster, Buffer<cl_float4>& image) {
  const Axis x = axis(size.width), y = axis(size.height);
  columns(first_pass(y), size.views, x.samples, is_coarse() ? now_.reduce : now_.weights, raster,
          is_coarse() ? scratch_ : between_);
  finish(size, image);
}

void Blur::forward_whole(const Size& size, const Buffer<cl_float4>& raster, Buffer<cl_float4>& image) {
  const std::size_t known = std::exchange(tile_rows_, 0);
  forward(size, raster, image);
  tile_rows_ = known;
}

void Blur::add(const Size& size, const Buffer<cl_float4>& raster, const Lines& lines) {
  add_columns(first_pass(axis(size.height)), size.views, axis(size.width).samples,
              is_coarse() ? now_.reduce : now_.weights, raster, lines, is_coarse() ? scratch_ : between_);
}

void Blur::finish(const Size& size, Buffer<cl_float4>& image) {
  const Axis x = axis(size.width), y = axis(size.height);
  const Footprint sample, in_x = input_footprint(x), in_y = input_footprint(y);
  const Footprint out_x = in_x.through(convolution(x)), out_y = in_y.through(convolution(y));
  if (is_coarse()) {
    rows(within_extents(reduction(x), sample, in_y, y.in), size.views * y.in, now_.reduce, scratch_, in_);
    columns(within_extents(convolution(y), in_y, in_x), size.views, x.in, now_.weights, in_, between_);
  }
  rows(within_extents(convolution(x), in_x, out_y, y.out), size.views * y.out, now_.weights, between_,
       is_coarse() ? out_ : image);
  if (is_coarse()) {
    rows(within_extents(expansion(x), out_x, out_y, y.out), size.views * y.out, now_.expand, out_, scratch_);
    columns(within_extents(expansion(y), out_y, out_x.through(expansion(x))), size.views, x.pixels,
            now_.expand, scratch_, image);
  }
}

void Blur::backward(const Size& size, const BufferRef<cl_float4>& grad_image, Buffer<cl_float4>& grad_raster,
                    bool keeps_forward) {
  start_backward(size, grad_image, keeps_forward);
  const Axis x = axis(size.width), y = axis(size.height);
  columns(last_pass(y), size.views, x.samples, is_coarse() ? now_.reduce : now_.weights,
          last_input(keeps_forward), grad_raster);
}

void Blur::backward_part(const Size& size, const Range& lines, Buffer<cl_float4>& grad_raster,
                         bool keeps_forward) {
  part_of_columns(last_pass(axis(size.height)), size.views, axis(size.width).samples,
                  is_coarse() ? now_.reduce : now_.weights, last_input(keeps_forward), lines, grad_raster);
}

Blur::Pass Blur::last_pass(const Axis& y) const {
  return transposed(is_coarse() ? reduction(y) : convolution(y));
}

const Buffer<cl_float4>& Blur::last_input(bool keeps_forward) const {
  if (is_coarse()) return scratch_;
  return keeps_forward ? grad_between_ : between_;
}

void Blur::start_backward(const Size& size, const BufferRef<cl_float4>& grad_image, bool keeps_forward) {
  const Axis x = axis(size.width), y = axis(size.height);
  Buffer<cl_float4>& grad_in = keeps_forward ? grad_in_ : in_;
  Buffer<cl_float4>& grad_between = keeps_forward ? grad_between_ : between_;
  Buffer<cl_float4>& grad_out = keeps_forward ? grad_out_ : out_;
  if (is_coarse()) {
    columns(transposed(expansion(y)), size.views, x.pixels, now_.expand, grad_image, scratch_);
    rows(transposed(expansion(x)), size.views * y.out, now_.expand, scratch_, grad_out);
  }
  rows(transposed(convolution(x)), size.views * y.out, now_.weights, is_coarse() ? grad_out : grad_image,
       grad_between);
  if (is_coarse()) {
    columns(transposed(convolution(y)), size.views, x.in, now_.weights, grad_between, grad_in);
    rows(transposed(reduction(x)), size.views * y.in, now_.reduce, grad_in, scratch_);
  }
}

/// Nothing where they are there: an upload waits for the device.
void Blur::upload_starts(std::size_t views, std::size_t stride) {
  if (starts_stride_ == stride && starts_.size() == views + 1) return;
  std::vector<cl_uint> starts;
  for (std::size_t view = 0; view <= views; ++view) starts.push_back(static_cast<cl_uint>(view * stride));
  starts_stride_ = 0;
  starts_.upload(device_, starts);
  starts_stride_ = stride;
}

void Blur::add_scale(const Size& size, const Buffer<cl_float4>& raster, const Lines& lines) {
  const Axis x = axis(size.width), y = axis(size.height);
  if (!is_coarse())
    add_columns(first_pass(y), size.views, x.samples, now_.weights_by_scale, raster, lines, by_scale_);
}

void Blur::backward_scale(const Size& size, const BufferRef<cl_float4>& grad_image) {
  backward_scale(size, by_scale_, grad_image, !is_coarse());
}

void Blur::backward_scale(const Size& size, const Buffer<cl_float4>& raster,
                          const BufferRef<cl_float4>& grad_image) {
  backward_scale(size, raster, grad_image, false);
}

void Blur::backward_scale(const Size& size, const Buffer<cl_float4>& raster,
                          const BufferRef<cl_float4>& grad_image, bool has_sums) {
  const Axis x = axis(size.width), y = axis(size.height);
  Pass along_columns = within_extents(convolution(y), input_footprint(y), input_footprint(x)),
       along_rows = convolution(x);
  const std::size_t of_columns = column_items(along_columns, x.in), of_rows = y.out * row_items(along_rows);
  const std::size_t stride = of_columns + of_rows;
  products_.resize(device_, size.views * stride);
  set_columns(along_columns, size.views, x.in);
  along_columns.has_sums = cl_uint{has_sums};
  along_rows.lines = static_cast<cl_uint>(size.views * y.out);
  launch_(size.views * of_columns, kernel::blur_columns_scale{.p = along_columns,
                                                              .stride = static_cast<cl_uint>(stride),
                                                              .first = 0U,
                                                              .extents = extents_,
                                                              .weights = now_.weights_by_scale,
                                                              .in = is_coarse() ? in_ : raster,
                                                              .grad = grad_between_,
                                                              .products = products_});
  launch_(size.views * of_rows, kernel::blur_rows_scale{.p = along_rows,
                                                        .stride = static_cast<cl_uint>(stride),
                                                        .first = static_cast<cl_uint>(of_columns),
                                                        .rows = static_cast<cl_uint>(y.out),
                                                        .weights = now_.weights_by_scale,
                                                        .in = between_,
                                                        .grad = is_coarse() ? grad_out_ : grad_image,
                                                        .products = products_});
  upload_starts(size.views, stride);
  reduce_({size.views * stride, 1, size.views, 1, starts_, products_}, grad_scale);
}

std::size_t Blur::bytes() const {
  std::size_t bytes = products_.capacity_bytes() + starts_.capacity_bytes() + grad_scale.capacity_bytes() +
                      reduce_.bytes() + extents_.capacity_bytes();
  for (const Buffer<float>* buffer : {&now_.weights, &now_.weights_by_scale, &now_.reduce, &now_.expand})
    bytes += buffer->capacity_bytes();
  for (const Buffer<cl_float4>* buffer :
       {&in_, &between_, &out_, &grad_in_, &grad_between_, &grad_out_, &scratch_, &by_scale_})
    bytes += buffer->capacity_bytes();
  return bytes;
}

}  // namespace dpr
