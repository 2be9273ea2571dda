// What the memory budget holds of a frame; and frames in bands of samples, where it does not hold all samples of
// noise on the pixel.
#include <algorithm>

#include "renderer/renderer_impl.hpp"

namespace dpr {
namespace {

/// Rows of tiles of a band at the least: with those around it, which are rendered with each band they are around,
/// more bands would take more time than they save memory.
constexpr std::size_t k_least_rows = 6;

constexpr std::size_t k_around = Antialias::k_rows_around;

std::size_t divided_up(std::size_t a, std::size_t b) { return (a + b - 1) / b; }

/// Makes all samples a frame's window again.
class WindowScope {
 public:
  explicit WindowScope(shared::FrameParams& p) : p_(p) {}
  ~WindowScope() { set_window(p_, tile_rows_of(p_)); }
  WindowScope(const WindowScope&) = delete;
  WindowScope& operator=(const WindowScope&) = delete;

 private:
  shared::FrameParams& p_;
};

/// Rows of tiles with those around them. As many in all of a view's windows, so that buffers do not grow.
Range window_around(const shared::FrameParams& p, const Range& rows, std::size_t most) {
  Range window = with_rows_around(p, rows, k_around);
  const Range views = with_rows_around(p, rows, p.tiles_y);
  const std::size_t lacking = std::max(most, window.count) - window.count,
                    below = std::min<std::size_t>(lacking, views.last() - window.last()),
                    above = std::min(lacking - below, window.first - views.first);
  return {window.first - above, window.count + below + above};
}

}  // namespace

/// Device memory of a fragment: its share of what a band's stages hold, forward and backward.
std::size_t Renderer::Impl::fragment_bytes() const {
  constexpr std::size_t k_always = Rasterize::k_fragment_bytes + Aggregate::k_fragment_bytes;
  if (geometry->textures.empty()) return k_always;
  return k_always + Rasterize::k_base_bytes + Surface::k_fragment_bytes +
         Texels::fragment_bytes(impl_of(device));
}

/// Memory for fragments: no more of them than kernels can index, or their largest buffer can hold.
std::size_t Renderer::Impl::fragment_budget() const {
  const std::size_t fitting = impl_of(device).info.max_allocation_bytes / Rasterize::k_largest_bytes;
  return std::min(device.memory_budget(), std::min(Rasterize::k_most_fragments, fitting) * fragment_bytes());
}

/// Device memory of a sample, forward and backward.
std::size_t Renderer::Impl::sample_bytes() const {
  const std::size_t starts = 2 * sizeof(cl_uint), gradient = sizeof(cl_float4);
  return starts + gradient + PixelNoise::k_sample_bytes + aggregate.pixel_bytes();
}

std::vector<Range> Renderer::Impl::cut_samples() const {
  if (!pixel_noise || pixel_noise->sampled || aggregate.perturbs_distances() || shown_normals) return {};
  const std::size_t rows = tile_rows_of(frame).count, budget = device.memory_budget();
  if (pixels_of(frame) * sample_bytes() <= budget) return {};
  // Half of the budget is the fragments'.
  const std::size_t row_bytes = std::size_t{frame.width} * DPR_TILE * sample_bytes();
  const std::size_t fitting = budget / 2 / row_bytes;
  const std::size_t most = std::max(k_least_rows, fitting - std::min(fitting, 2 * k_around));
  if (most + 2 * k_around >= rows) return {};
  const std::size_t count = divided_up(rows, most);
  std::vector<Range> cut;
  for (std::size_t band = 0; band < count; ++band) {
    const std::size_t first = rows * band / count;
    cut.emplace_back(first, rows * (band + 1) / count - first);
  }
  return cut;
}

std::size_t Renderer::Impl::fragments_of_band() const {
  return std::min(fragment_budget(), std::max<std::size_t>(device.memory_budget() / 2, 1));
}

/// The samples of a band and of the rows around it, as they are before they are blended.
void Renderer::Impl::render_samples(const Range& rows) {
  std::size_t most = 0;
  for (const Range& band : sample_bands) most = std::max(most, band.count);
  const Range window = window_around(frame, rows, most + 2 * k_around);
  set_window(frame, window);
  rasterize.count_pixels(frame, bin);
  for (const Band& band : rasterize.cut(frame, bin, window, fragments_of_band(), fragment_bytes()))
    render(band);
}

void Renderer::Impl::forward_in_bands() {
  const WindowScope scope(frame);
  bands.clear();
  for (const Range& rows : sample_bands) {
    const std::vector<Band> own = rasterize.cut(frame, bin, rows, fragments_of_band(), fragment_bytes());
    bands.insert(bands.end(), own.begin(), own.end());
  }
  Rasterize::require_fits(bands, fragment_budget(), fragment_bytes());
  pixel_noise->start(contour_inputs(), bin.tile_starts);
  for (const Range& rows : sample_bands) {
    render_samples(rows);
    pixel_noise->add(contour_inputs(), aggregate.image, image_size(), rows);
  }
  pixel_noise->finish(image_size());
}

void Renderer::Impl::differentiate_in_bands(const BufferRef<cl_float4>& grad_images) {
  const WindowScope scope(frame);
  const bool by_scale = scene.gradients.smoothing;
  pixel_noise->start_backward(image_size(), grad_images, by_scale);
  for (const Range& rows : sample_bands) {
    render_samples(rows);
    pixel_noise->backward(contour_inputs(), aggregate.image, image_size(), rows, by_scale,
                          aggregate.scratch(frame));
    const BufferRef<cl_float4> grad_raster = pixel_noise->grad_raster(aggregate.image);
    for (const Band& band : rasterize.cut(frame, bin, rows, fragments_of_band(), fragment_bytes())) {
      render(band);
      differentiate(grad_raster);
    }
    if (sums_pixels()) add_pixel_channels(rows);
  }
  pixel_noise->finish_backward(image_size(), grad_images, by_scale);
}

/// Adds the channels of a band's pixels to the sums of the frame's.
void Renderer::Impl::add_pixel_channels(const Range& rows) {
  const Range lines = lines_of(frame, rows);
  const Range samples(lines.first * frame.width, lines.count * frame.width);
  const std::size_t all = std::size_t{frame.views} * frame.width * frame.height;
  reduce.add_part({pixels_of(frame), aggregate.channel_count(), 1, 1, all_pixels_.of(impl_of(device), all),
                   aggregate.channels, all},
                  samples, samples.first - frame.first_sample, pixel_parts_);
}

}  // namespace dpr
