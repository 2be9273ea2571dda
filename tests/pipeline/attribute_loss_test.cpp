// Losses of depth and normals beside that of the images: values on the host, gradients as the sum of those of
// each.
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace attribute_loss_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;

namespace {

Renderer rendered(const Device& device, const glm::vec3& shift, const Smoothing& smoothing) {
  Scene scene = scene_of(make_icosphere(1), reduced(22, 9), reduced(18, 8));
  scene.smoothing = smoothing;
  Renderer renderer(device);
  renderer.set_scene(scene);
  const std::vector<View> views{{scene.camera, {placed(23.0F, 1.0F, shift)}},
                                {orbit_camera(6, 10, 200), {placed(80.0F, 0.8F, shift)}}};
  renderer.set_views(views);
  renderer.forward();
  return renderer;
}

std::vector<Image> shown(Renderer& renderer, Aov aov) {
  std::vector<Image> images;
  for (std::size_t view = 0; view < 2; ++view)
    images.push_back(aov_image(auxiliary_outputs(renderer, view), aov));
  return images;
}

/// The mean squared difference RGB - A target of a view, and `weight` times its gradient.
struct HostLoss {
  double value = 0;
  Image grad;
};

HostLoss host_loss(const Image& image, const Image& target, float weight) {
  HostLoss loss{0, Image(image.width, image.height)};
  double counted = 0;
  for (const glm::vec4& t : target.pixels) counted += 3 * static_cast<double>(t.w);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const glm::vec4 &p = image.pixels[i], &t = target.pixels[i];
    const glm::vec3 difference = glm::vec3(p) - p.w * glm::vec3(t);
    loss.value += static_cast<double>(t.w * glm::dot(difference, difference)) / counted;
    const glm::vec3 g = 2 * weight * t.w * difference / static_cast<float>(counted);
    loss.grad.pixels[i] = glm::vec4(g, -glm::dot(g, glm::vec3(t)));
  }
  return loss;
}

void check_equal(const SceneGradient& found, const SceneGradient& expected) {
  for (std::size_t view = 0; view < 2; ++view) {
    const PoseGradient &a = found.views[view].transforms[0], &b = expected.views[view].transforms[0];
    CHECK(glm::length(a.translation - b.translation) < 1e-5 * (1 + glm::length(b.translation)));
    CHECK(glm::length(a.rotation - b.rotation) < 1e-5 * (1 + glm::length(b.rotation)));
  }
  std::vector<double> difference = flat(found.meshes[0].positions);
  const std::vector<double> wanted = flat(expected.meshes[0].positions);
  for (std::size_t i = 0; i < wanted.size(); ++i) difference.at(i) -= wanted[i];
  CHECK(norm(difference) < 1e-5 * norm(wanted));
  CHECK(found.sigma == doctest::Approx(expected.sigma).epsilon(1e-4));
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("losses of depth and normals: values, and one gradient with that of the images") {
    const Device device = open_device();
    for (const char* preset : {"pixel", "gaussian"}) {
      const Smoothing smoothing = smoothing_preset(preset);
      Renderer wanted = rendered(device, glm::vec3(0.1F, 0.05F, -0.1F), smoothing);
      const std::vector<Image> colors{wanted.image(0), wanted.image(1)};
      const std::vector<Image> depths = shown(wanted, Aov::depth), normals = shown(wanted, Aov::normal);
      Renderer renderer = rendered(device, glm::vec3(0), smoothing);
      const std::vector<AttributeTarget> attributes{{Attribute::depth, {.mse = 2}, depths},
                                                    {Attribute::normal, {.mse = 0.5F}, normals}};
      ImageLoss loss(device, LossOptions{.weights = {.mse = 1}, .attributes = attributes}, colors);
      ImageLoss of_colors(device, {.mse = 1}, colors);
      const double total = loss.evaluate(renderer);
      double expected = of_colors.evaluate(renderer);
      SceneGradient gradient = renderer.backward(of_colors);
      for (const AttributeTarget& target : attributes) {
        AttributeImages images(device, target.attribute);
        images.forward(renderer);
        std::vector<Image> grads;
        for (std::size_t view = 0; view < 2; ++view) {
          HostLoss host =
              host_loss(images.image(view), target.targets[view], target.weights.mse / 2 /* views */);
          expected += static_cast<double>(target.weights.mse) / 2 * host.value;
          grads.push_back(std::move(host.grad));
        }
        add(gradient, images.backward(grads));
      }
      CHECK(total == doctest::Approx(expected).epsilon(1e-4));
      CHECK((loss.per_view()[0] + loss.per_view()[1]) / 2 == doctest::Approx(total).epsilon(1e-6));
      check_equal(renderer.backward(loss), gradient);
      CHECK_FALSE(renderer.backward(loss).sigma == doctest::Approx(renderer.backward(of_colors).sigma));

      MeshLoss smooth(device, {.laplacian = 0.1F}, renderer.scene().meshes[0].mesh);
      smooth.evaluate(renderer);
      CHECK(renderer.backward(loss, smooth).sigma == doctest::Approx(gradient.sigma).epsilon(1e-4));
    }
  }

  TEST_CASE("losses of depth: where a surface is as deep as it ought to be there is none") {
    const Device device = open_device();
    Renderer renderer = rendered(device, glm::vec3(0), smoothing_preset("rigid"));
    const std::vector<Image> depths = shown(renderer, Aov::depth), none(2, renderer.image(0));
    const AttributeTarget target{Attribute::depth, {.l1 = 1}, depths};
    ImageLoss loss(device, LossOptions{.attributes = std::span(&target, 1)}, none);
    CHECK(loss.evaluate(renderer) < 1e-6);
    Renderer deeper = rendered(device, glm::vec3(0.2F, 0, 0), smoothing_preset("rigid"));
    CHECK(loss.evaluate(deeper) > 1e-2);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("losses of attributes that make no sense are refused") {
    const Device device = open_device();
    const std::vector<Image> colors(1, Image(16, 14, glm::vec4(1))), large(1, Image(17, 14, glm::vec4(1))),
        uncounted(1, Image(16, 14, glm::vec4(0)));
    const auto refuses = [&](const AttributeTarget& target, const char* part) {
      DPR_CHECK_MESSAGE_HAS(
          InvalidArgument, ImageLoss(device, LossOptions{.attributes = std::span(&target, 1)}, colors), part);
    };
    refuses({Attribute::depth, {.mse = 1}, {}}, "0 images");
    refuses({Attribute::depth, {.mse = 1}, large}, "17x14");
    refuses({Attribute::depth, {.silhouette = 1}, colors}, "silhouette");
    refuses({Attribute::depth, {.ssim = 1}, colors}, "ssim");
    refuses({Attribute::depth, {.mse = 1}, uncounted}, "above 0");
    refuses({Attribute::depth, {}, colors}, "weights");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, ImageLoss(device, LossOptions{}, colors), "weights");
  }
}

}  // namespace attribute_loss_test
