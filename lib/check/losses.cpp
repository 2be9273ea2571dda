// Self-test of the losses: values and gradients against the reference's, or its finite differences.
#include <string>
#include <vector>

#include "check/check_log.hpp"
#include "check/comparison.hpp"
#include "check/scenes.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/mesh_loss.hpp"
#include "loss/image_loss_impl.hpp"
#include "loss/mesh_loss_impl.hpp"
#include "reference/finite_difference.hpp"
#include "reference/ssim.hpp"

namespace dpr::check {
namespace {

constexpr double k_value = 1e-6, k_loss_gradient = 2e-6;

double relative(double found, double expected) { return std::fabs(found / expected - 1); }

/// The gradient that a loss left for the backward pass, [pixel][RGBA].
std::vector<double> grad_image(const ImageLoss& loss) {
  std::vector<double> values;
  for (const cl_float4& pixel : impl_of(loss).grad_image().download())
    values.insert(values.end(), {pixel.s[0], pixel.s[1], pixel.s[2], pixel.s[3]});
  return values;
}

/// All that are sums over pixels, in one.
void log_pixel_losses(const Renderer& renderer, const Image& target, CheckLog& log) {
  const LossWeights weights{.mse = 2, .l1 = 0.5F, .silhouette = 0.7F, .robust = 3};
  ImageLoss loss(renderer.device(), weights, {&target, 1});
  const double found = loss.evaluate(renderer);
  const reference::Image image = to_reference(renderer.image()), wanted = to_reference(target);
  double value = 0;
  Block gradient{"image", grad_image(loss), std::vector<double>(image.rgba.size())};
  for (const ImageLossRow& row : image_losses()) {
    if (row.weight == &LossWeights::ssim) continue;  // of windows
    const auto weight = static_cast<double>(weights.*row.weight);
    const reference::LossResult expected = reference::evaluate_loss(row.name, image, wanted);
    value += weight * expected.value;
    for (std::size_t i = 0; i < gradient.expected.size(); ++i)
      gradient.expected[i] += weight * expected.grad_image.rgba[i];
  }
  log.add("image_loss", "mse, l1, silhouette, robust: value, relative", relative(found, value), k_value);
  log.add("image_loss, backward", "the same: gradient, relative", block_error(gradient, k_loss_gradient),
          k_loss_gradient);
}

void log_ssim(const Renderer& renderer, const Image& target, CheckLog& log) {
  ImageLoss loss(renderer.device(), {.ssim = 1}, {&target, 1});
  const double found = loss.evaluate(renderer);
  reference::Image image = to_reference(renderer.image());
  const reference::Image wanted = to_reference(target),
                         mask = to_reference(Image(target.width, target.height, glm::vec4(1)));
  log.add("ssim", "value, relative", relative(found, 1 - reference::mean_ssim(image, wanted, mask)), k_value);
  constexpr double k_step = 1e-5;
  const std::vector<double> gradient = grad_image(loss);
  Block some{"image", {}, {}};
  for (std::size_t i = 0; i < image.rgba.size(); i += 37) {  // of all channels
    const double value = image.rgba[i];
    image.rgba[i] = value + k_step;
    const double more = reference::mean_ssim(image, wanted, mask);
    image.rgba[i] = value - k_step;
    const double less = reference::mean_ssim(image, wanted, mask);
    image.rgba[i] = value;
    some.found.push_back(gradient[i]);
    some.expected.push_back((less - more) / (2 * k_step));
  }
  log.add("ssim, backward", "gradient, relative", block_error(some, k_loss_gradient), k_loss_gradient);
}

void log_mesh_loss(const Device& device, CheckLog& log) {
  Mesh mesh = make_icosphere(1);
  Random random(5);
  for (glm::vec3& p : mesh.positions) p += random.vector(-0.1F, 0.1F);
  const MeshLossWeights weights{.laplacian = 0.1F, .edge_length = 3, .normal_consistency = 5, .flatness = 7};
  const std::vector<double> at = flat(mesh.positions);
  const auto expected = [&](const std::vector<double>& x) { return reference_loss(mesh, weights, x); };
  std::vector<cl_float4> values;
  for (const glm::vec3& p : mesh.positions) values.push_back({{p.x, p.y, p.z, 0}});
  const Buffer<cl_float4> positions(impl_of(device), std::span<const cl_float4>(values));
  Buffer<cl_float4> grad(impl_of(device), std::span<const cl_float4>(std::vector<cl_float4>(values.size())));
  MeshLoss loss(device, weights, mesh);
  const double found = impl_of(loss).evaluate(positions, 0);
  impl_of(loss).add_gradient(positions, grad);
  std::vector<double> gradient;
  for (const cl_float4& g : grad.download()) gradient.insert(gradient.end(), {g.s[0], g.s[1], g.s[2]});
  log.add("mesh_loss", "value, relative", relative(found, expected(at)), k_value);
  log.add("mesh_loss, backward", "gradient, relative",
          reference::check_gradient(expected, at, gradient, 1e-5, k_loss_gradient).error, k_loss_gradient);
}

}  // namespace

void check_losses(const Device& device, CheckLog& log) {
  const Scene scene = cube_scene(20, 18);
  Renderer renderer(device);
  renderer.set_scene(scene);
  renderer.forward();
  const Image target = random_image(scene.width, scene.height, 0.0F, 1.0F);
  log_pixel_losses(renderer, target, log);
  log_ssim(renderer, target, log);
  log_mesh_loss(device, log);
}

}  // namespace dpr::check
