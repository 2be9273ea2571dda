// Self-test of a frame's stages, of rough surfaces, of what the near plane cuts, and of the exact aggregation.
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "check/check_log.hpp"
#include "check/comparison.hpp"
#include "check/fragments.hpp"
#include "check/scenes.hpp"
#include "smoothing/priors.hpp"

namespace dpr::check {
namespace {

// Bounds: some eight times what the runtimes for CPUs leave that were tried (bench/results/notes.md), since OpenCL
// allows devices several roundings in a division, a root or an exponential. Within those of the tests.
constexpr double k_ndc = 1e-6, k_distance = 5e-7, k_depth = 1.1e-6, k_barycentric = 4e-6;
constexpr double k_occupancy = 1e-5, k_color = 1e-5, k_image = 2e-5, k_gradient = 5e-4;

/// A scene on the device and in the reference.
struct Twins {
  Twins(const Device& device, const Scene& scene_)
      : scene(scene_), twin(to_reference(scene)), delicate(delicate_pixels(twin)), renderer(device) {
    renderer.set_scene(scene);
    renderer.forward();
  }

  const Scene& scene;
  reference::Scene twin;
  Delicate delicate;
  Renderer renderer;
};

double image_difference(const Twins& t) {
  const Image image = t.renderer.image();
  const reference::Image expected = reference::render(t.twin);
  Largest worst;
  for (std::size_t i = 0; i < expected.rgba.size(); ++i) {
    if (!t.delicate.jump[i / 4])
      worst.add(static_cast<double>(image.pixels[i / 4][static_cast<int>(i % 4)]), expected.rgba[i]);
  }
  return worst.value();
}

/// Gradients of a random sum over the image.
std::vector<Block> gradient_blocks(Twins& t) {
  Image grad_image = random_image(t.scene.width, t.scene.height, -1.0F, 1.0F);
  for (std::size_t i = 0; i < grad_image.pixels.size(); ++i) {
    if (t.delicate.kink[i]) grad_image.pixels[i] = glm::vec4(0);
  }
  const SceneGradient found = t.renderer.backward(std::span(&grad_image, 1));
  return blocks_of(found, reference::gradient(t.twin, to_reference(grad_image)));
}

/// The stages that a block of gradients is the last of.
struct BackwardStage {
  const char* stage;
  const char* compared;
  double bound;
};

BackwardStage stage_of(const Block& block) {
  const std::string& name = block.name;
  if (name == "gamma" || name == "alpha")
    return {"aggregate, backward", "gradients of gamma and alpha, relative", k_gradient};
  if (name == "sigma") return {"occupancy, backward", "gradient of sigma, relative", k_gradient};
  if (name == "colors" || name == "background")
    return {"shade, backward", "gradients of colours, relative", k_gradient};
  if (name == "texcoords" || name == "texels")
    return {"surface, texels, backward", "gradients of textures, relative", k_gradient};
  if (name == "positions")
    return {"rasterize, gather, backward", "gradients of positions, relative", k_gradient};
  if (name == "rotation" || name == "translation" || name.starts_with("camera") || name == "fov" ||
      name == "intrinsics" || name == "orthographic height" || name == "distortion")
    return {"transform, backward", "gradients of poses and camera, relative", k_gradient};
  return {"shade, backward", "gradients of lights, relative", k_gradient};
}

void log_gradients(Twins& t, CheckLog& log) {
  std::vector<BackwardStage> stages;
  std::map<std::string, Largest> worst;  // by what is compared
  for (const Block& block : gradient_blocks(t)) {
    const BackwardStage stage = stage_of(block);
    if (!worst.contains(stage.compared)) stages.push_back(stage);
    worst[stage.compared].add(block_error(block, stage.bound));
  }
  for (const BackwardStage& stage : stages)
    log.add(stage.stage, stage.compared, worst[stage.compared].value(), stage.bound);
}

void log_vertices(const Twins& t, const reference::PreparedScene& prepared, CheckLog& log) {
  const std::vector<cl_float4> ndc = impl_of(t.renderer).transform.ndc.download();
  Largest worst;
  if (ndc.size() != prepared.vertices.size()) worst.add(INFINITY);
  for (std::size_t i = 0; i < std::min(ndc.size(), prepared.vertices.size()); ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      worst.add(static_cast<double>(ndc[i].s[k]), prepared.vertices[i].ndc[k]);
  }
  log.add("transform", "vertices, NDC and depth", worst.value(), k_ndc);
}

struct FragmentDifferences {
  double wrong_pixels = 0;  ///< whose number of fragments differs
  Largest distance, depth, barycentric, color, occupancy;
};

void compare_fragments(const Fragment& found, const reference::Fragment& expected,
                       const reference::FragmentInput& input, FragmentDifferences& d) {
  d.distance.add(found.distance, expected.distance);
  d.depth.add(found.depth / expected.depth, 1);
  for (std::size_t k = 0; k < 2; ++k) d.barycentric.add(found.barycentric[k], expected.barycentric[k + 1]);
  for (std::size_t k = 0; k < 3; ++k) d.color.add(found.color[static_cast<int>(k)], input.color[k]);
  d.occupancy.add(found.occupancy, input.occupancy);
}

FragmentDifferences fragment_differences(const Twins& t, const reference::PreparedScene& prepared) {
  const std::vector<Pixel> pixels = pixels_of(t.renderer);
  FragmentDifferences d;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (t.delicate.jump[i]) continue;
    const auto width = static_cast<std::size_t>(t.scene.width);
    const std::vector<reference::Fragment> expected = reference::pixel_fragments(
        t.twin, prepared, static_cast<int>(i / width), static_cast<int>(i % width));
    const std::vector<reference::FragmentInput> inputs =
        reference::aggregate_inputs(t.twin, prepared, expected);
    if (pixels[i].size() != expected.size()) {
      ++d.wrong_pixels;
      continue;
    }
    for (std::size_t k = 0; k < expected.size(); ++k)
      compare_fragments(pixels[i][k], expected[k], inputs[k], d);
  }
  return d;
}

void log_fragments(const Twins& t, const reference::PreparedScene& prepared, CheckLog& log) {
  const FragmentDifferences d = fragment_differences(t, prepared);
  log.add("setup, bin, rasterize", "pixels with other fragments", d.wrong_pixels, 0);
  log.add("rasterize", "signed distance, NDC^2", d.distance.value(), k_distance);
  log.add("rasterize", "depth, relative", d.depth.value(), k_depth);
  log.add("rasterize", "barycentrics", d.barycentric.value(), k_barycentric);
  log.add("surface, shade", "colours, textured and lit", d.color.value(), k_color);
  log.add("occupancy", "p", d.occupancy.value(), k_occupancy);
}

}  // namespace

void check_frame(const Device& device, CheckLog& log) {
  constexpr int k_width = 22, k_height = 18;  // no multiples of a tile
  Scene scene =
      textured_scene(make_cube(), random_texture(5, 3, Wrap::mirror, Filter::bilinear), k_width, k_height);
  scene.lights = every_light(Shading::phong);
  scene.gradients.lights = true;
  Twins t(device, scene);
  const reference::PreparedScene prepared = reference::prepare(t.twin);
  log_vertices(t, prepared, log);
  log_fragments(t, prepared, log);
  log.add("aggregate", "image, RGBA", image_difference(t), k_image);
  log_gradients(t, log);
}

void check_microfacets(const Device& device, CheckLog& log) {
  Scene scene = scene_of(make_icosphere(1, 1.3F), 18, 18);
  scene.lights = every_light(Shading::microfacet);
  scene.meshes[0].mesh.materials = materials_for(Shading::microfacet);
  scene.gradients.lights = true;
  Twins t(device, scene);
  log.add("shade", "image of a rough metal, RGBA", image_difference(t), k_image);
  Largest worst;
  for (const Block& block : gradient_blocks(t)) worst.add(block_error(block, k_gradient));
  log.add("shade, backward", "all gradients of a rough metal, relative", worst.value(), k_gradient);
}

void check_clipping(const Device& device, CheckLog& log) {
  const Scene scene = scene_cut_open(make_cube(), 18, 18);
  Twins t(device, scene);
  log.add("clip", "image of a cube cut open, RGBA", image_difference(t), k_image);
  Largest worst;
  for (const Block& block : gradient_blocks(t)) worst.add(block_error(block, k_gradient));
  log.add("clip, backward", "all gradients, relative", worst.value(), k_gradient);
}

void check_aggregation(const Device& device, CheckLog& log) {
  for (const Composition composition : {Composition::barrier, Composition::joint}) {
    for (const PriorRow& prior : priors()) {
      Scene scene = cube_scene(12, 12);
      scene.smoothing.composition = composition;
      scene.smoothing.occupancy_prior = scene.smoothing.depth_prior = prior.prior;
      scene.smoothing.blur_radius.reset();
      const std::string name = std::string(to_string(composition)) + ", " + std::string(prior.name) + ": ";
      Twins t(device, scene);
      log.add("aggregate", name + "image, RGBA", image_difference(t), k_image);
      Largest worst;
      for (const Block& block : gradient_blocks(t)) worst.add(block_error(block, k_gradient));
      log.add("aggregate, backward", name + "all gradients, relative", worst.value(), k_gradient);
    }
  }
}

}  // namespace dpr::check
