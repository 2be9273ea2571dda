// Checks of arguments that the functions of the C interface share.
#include "base/checks.hpp"
#include "c/handles.hpp"

namespace dpr::c {
namespace {

constexpr std::size_t k_pixel = 4;  // floats
/// More views than any device has memory for: a count beyond is a mistake.
constexpr std::size_t k_most_views = 1U << 24U;

template <class Handle>
auto& held_by(Handle* renderer) {
  auto* const own = std::get_if<Renderer>(&deref(renderer, "renderer").held);
  if (own) return *own;
  const auto& of_batch = std::get<dpr_renderer::OfBatch>(renderer->held);
  return static_cast<decltype(*own)>(of_batch.batch->renderer(of_batch.scene));
}

}  // namespace

Renderer& renderer_of(dpr_renderer* renderer) { return held_by(renderer); }
const Renderer& renderer_of(const dpr_renderer* renderer) { return held_by(renderer); }

SceneBatch& batch_of(const dpr_batch* batch) { return *deref(batch, "batch").batch; }

void require_count(std::size_t count, std::size_t expected, const char* argument) {
  if (count == expected) return;
  throw InvalidArgument(std::string("count (") + argument + ")", std::to_string(count) + " floats",
                        std::to_string(expected));
}

void require_views(std::size_t views) {
  if (views > 0 && views <= k_most_views) return;
  throw InvalidArgument("views", std::to_string(views), "1 to " + std::to_string(k_most_views));
}

void require_size(int width, int height, const char* argument) {
  constexpr int k_most = checks::k_largest_side;
  if (width >= 1 && height >= 1 && width <= k_most && height <= k_most) return;
  throw InvalidArgument(argument, checks::size(width, height),
                        "1 to " + std::to_string(k_most) + " pixels on a side");
}

std::size_t image_floats(std::size_t views, int width, int height) {
  return views * static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * k_pixel;
}

std::span<const glm::vec4> to_pixels(const float* values, std::size_t count, const char* argument) {
  return {reinterpret_cast<const glm::vec4*>(numbers(values, count, k_pixel, argument).data()),
          count / k_pixel};
}

std::span<glm::vec4> to_pixels(float* values, std::size_t count, std::size_t expected) {
  deref(values, "pixels");
  require_count(count, expected, "pixels");
  return {reinterpret_cast<glm::vec4*>(values), count / k_pixel};
}

}  // namespace dpr::c
