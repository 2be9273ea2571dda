// Noise on the pixel around the caller's own shading: colours that the caller finds at the samples make the library's
// own image, and its gradients.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "check/comparison.hpp"
#include "gradients/random_scene.hpp"
#include "pipeline/determinism.hpp"
#include "support/messages.hpp"

namespace own_shading_test {

using namespace dpr;
using namespace dpr::test;
using namespace dpr::test::gradients;

namespace {

constexpr std::size_t k_channels =
    6;  // the library's RGBA, then green and alpha again: two groups of channels

/// A random scene with noise on the pixel and colours of vertices alone. The nearest surface hides all others.
Trial plain_trial(unsigned seed) {
  Trial trial = random_trial(seed);
  Scene& scene = trial.scene;
  const Smoothing drawn = scene.smoothing;
  scene.smoothing = smoothing_preset("pixel");
  scene.smoothing.sigma = drawn.sigma;
  scene.smoothing.supersampling = drawn.supersampling;
  scene.smoothing.gamma = 1e-7F;
  scene.lights.reset();
  for (Instance& instance : scene.meshes) {
    Mesh mesh;
    mesh.positions = instance.mesh.positions;
    mesh.faces = instance.mesh.faces;
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      const auto phase = static_cast<float>(i);
      mesh.vertex_colors.push_back(0.5F + 0.5F * glm::sin(glm::vec3(phase, 2 * phase, 3 * phase)));
    }
    instance.mesh = std::move(mesh);
  }
  return trial;
}

/// Colours of the corners of all the scene's faces.
std::vector<std::array<glm::vec3, 3>> corner_colors(const Scene& scene) {
  std::vector<std::array<glm::vec3, 3>> colors;
  for (const Instance& instance : scene.meshes) {
    const Mesh& mesh = instance.instance_of ? scene.meshes[*instance.instance_of].mesh : instance.mesh;
    for (const glm::uvec3& f : mesh.faces)
      colors.push_back({mesh.vertex_colors[f.x], mesh.vertex_colors[f.y], mesh.vertex_colors[f.z]});
  }
  return colors;
}

/// The library's own shading, by the caller.
std::vector<float> shade(const Samples& samples, const Scene& scene) {
  const auto colors = corner_colors(scene);
  std::vector<float> shaded;
  for (std::size_t i = 0; i < samples.faces.size(); ++i) {
    glm::vec4 color(scene.background, 0);
    if (samples.faces[i] >= 0) {
      const auto& c = colors[static_cast<std::size_t>(samples.faces[i])];
      const glm::vec2 b = samples.barycentrics[i];
      color = {c[0] + b.x * (c[1] - c[0]) + b.y * (c[2] - c[0]), 1};
    }
    for (const float number : {color.x, color.y, color.z, color.w, color.y, color.w})
      shaded.push_back(number);
  }
  return shaded;
}

/// From gradients of shaded samples to those of barycentrics.
std::vector<glm::vec2> shade_backward(const Samples& samples, const Scene& scene,
                                      const std::vector<float>& grad) {
  const auto colors = corner_colors(scene);
  std::vector<glm::vec2> result(samples.faces.size());
  for (std::size_t i = 0; i < samples.faces.size(); ++i) {
    if (samples.faces[i] < 0) continue;
    const auto& c = colors[static_cast<std::size_t>(samples.faces[i])];
    const float* const g = grad.data() + k_channels * i;
    const glm::vec3 by_color(g[0], g[1] + g[4], g[2]);
    result[i] = {glm::dot(by_color, c[1] - c[0]), glm::dot(by_color, c[2] - c[0])};
  }
  return result;
}

/// A gradient of images with six channels, and the same of RGBA.
struct Weights {
  std::vector<float> of_channels;
  std::vector<glm::vec4> of_images;
};

Weights random_weights(std::size_t pixels) {
  check::Random random(3);
  Weights weights;
  for (std::size_t i = 0; i < pixels; ++i) {
    std::array<float, k_channels> w{};
    for (float& number : w) number = random(-1, 1);
    weights.of_channels.insert(weights.of_channels.end(), w.begin(), w.end());
    weights.of_images.emplace_back(w[0], w[1] + w[4], w[2], w[3] + w[5]);
  }
  return weights;
}

std::vector<double> geometric_numbers(SceneGradient gradient) {
  std::vector<double> numbers;
  for_each_array(gradient, [&](const GradientRow& row, GradientIndex, const GradientArray& array) {
    using Request = GradientRequest;
    if (row.wanted != &Request::positions && row.wanted != &Request::transform &&
        row.wanted != &Request::camera && row.wanted != &Request::distortion)
      return;
    transform_numbers(array, [&](double number) { return numbers.emplace_back(number); });
  });
  return numbers;
}

double largest(const std::vector<double>& numbers) {
  double most = 0;
  for (const double number : numbers) most = std::max(most, std::abs(number));
  return most;
}

struct Shaded {
  std::vector<float> image;
  ResolveGradient by_contours;
  SceneGradient by_samples;
};

Shaded render_own(Renderer& renderer, const Scene& scene, const Weights& weights) {
  renderer.forward();
  const Samples samples = renderer.samples();
  const std::vector<float> shaded = shade(samples, scene);
  Shaded result{renderer.resolve(shaded, k_channels),
                renderer.resolve_backward(shaded, k_channels, weights.of_channels),
                {}};
  const std::vector<float> no_depths(samples.depths.size());
  result.by_samples =
      renderer.samples_backward(shade_backward(samples, scene, result.by_contours.samples), no_depths);
  return result;
}

/// A square in the plane z, its corners `side` from the axis.
Mesh square(float side, float z) {
  Mesh mesh;
  mesh.positions = {{-side, -side, z}, {side, -side, z}, {side, side, z}, {-side, side, z}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// A frame that a clear square covers, behind it a smaller one, and one that is smaller still: each hides half of what
/// lies behind it. From above, without perspective; 2 world units high.
Scene stacked_squares(int width, int height) {
  Scene scene;
  scene.width = width;
  scene.height = height;
  scene.camera.view = glm::translate(glm::mat4(1), {0, 0, -5});
  scene.camera.orthographic_height = 2;
  scene.smoothing = smoothing_preset("pixel");
  scene.smoothing.sigma = 1e-4F;
  scene.gradients = {.positions = true};
  constexpr std::array<std::array<float, 2>, 3> k_squares = {{{8, 0.5F}, {0.53F, 0}, {0.31F, -0.5F}}};
  for (const auto& [side, z] : k_squares) scene.meshes.push_back({square(side, z)});
  return scene;
}

/// Each layer half seen through, the i-th mesh's brightness i + 1, on black: one channel.
std::vector<float> see_through(const Samples& samples) {
  const std::size_t count = samples.faces.size() / static_cast<std::size_t>(samples.layers);
  std::vector<float> values(count);
  for (std::size_t layer = static_cast<std::size_t>(samples.layers); layer-- > 0;) {
    for (std::size_t i = 0; i < count; ++i) {
      const int face = samples.faces[layer * count + i];
      if (face >= 0) values[i] = 0.5F * values[i] + 0.5F * static_cast<float>(face / 2 + 1);
    }
  }
  return values;
}

struct Surface {
  float depth;
  int face;
};

/// All surfaces of each sample, the nearest first: every face is rendered without the others.
std::vector<std::vector<Surface>> surfaces_of(Renderer& renderer, const Scene& scene) {
  std::vector<std::vector<Surface>> surfaces;
  int number = 0;
  for (const Instance& instance : scene.meshes) {
    for (const glm::uvec3& face : instance.mesh.faces) {
      Scene alone = scene;
      Mesh mesh;
      for (int k = 0; k < 3; ++k) mesh.positions.push_back(instance.mesh.positions[face[k]]);
      mesh.faces = {{0, 1, 2}};
      alone.meshes = {{mesh, instance.transform}};
      renderer.set_scene(alone);
      renderer.forward();
      const Samples samples = renderer.samples();
      surfaces.resize(samples.faces.size());
      for (std::size_t i = 0; i < samples.faces.size(); ++i)
        if (samples.faces[i] == 0) surfaces[i].push_back({samples.depths[i], number});
      ++number;
    }
  }
  for (std::vector<Surface>& at : surfaces) std::ranges::stable_sort(at, {}, &Surface::depth);
  return surfaces;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("layers are all surfaces of the samples, the nearest first") {
    Scene scene = check::scene_of(make_cube(), reduced(24, 8), reduced(20, 8));
    scene.smoothing = smoothing_preset("pixel");
    scene.meshes.push_back({make_icosphere(0), glm::translate(glm::mat4(1), {0.3F, 0.2F, -0.4F})});
    Renderer renderer(open_device());
    const std::vector<std::vector<Surface>> expected = surfaces_of(renderer, scene);
    renderer.set_scene(scene);
    constexpr int k_layers = 5;  // one more than two convex bodies have
    renderer.set_layers(k_layers);
    renderer.forward();
    const Samples samples = renderer.samples();
    CHECK(samples.layers == k_layers);
    REQUIRE(samples.faces.size() == k_layers * expected.size());
    std::size_t wrong = 0, four = 0;
    for (std::size_t i = 0; i < samples.faces.size(); ++i) {
      const std::vector<Surface>& at = expected[i % expected.size()];
      const std::size_t layer = i / expected.size();
      const bool is_there = layer < at.size();
      wrong += samples.faces[i] != (is_there ? at[layer].face : -1);
      wrong += std::abs(samples.depths[i] - (is_there ? at[layer].depth : 0)) > 1e-5F;
      four += layer == 3 && is_there;
    }
    CHECK(wrong == 0);
    CHECK(four > 0);
    renderer.set_layers(1);
    renderer.forward();
    const Samples nearest = renderer.samples();
    CHECK(std::ranges::equal(nearest.faces, std::span(samples.faces).first(expected.size())));
    CHECK(std::ranges::equal(nearest.depths, std::span(samples.depths).first(expected.size())));
  }

  TEST_CASE("gradients reach the surfaces of every layer") {
    const Scene scene = stacked_squares(reduced(20, 10), reduced(16, 8));
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.set_layers(3);
    renderer.forward();
    const Samples samples = renderer.samples();
    const std::size_t count = samples.faces.size() / 3;
    for (std::size_t layer = 0; layer < 3; ++layer) {
      CAPTURE(layer);
      std::vector<float> grad_depths(samples.depths.size());
      std::fill_n(grad_depths.begin() + static_cast<std::ptrdiff_t>(layer * count), count, 1.0F);
      const SceneGradient gradient =
          renderer.samples_backward(std::vector<glm::vec2>(samples.faces.size()), grad_depths);
      for (std::size_t mesh = 0; mesh < 3; ++mesh) {
        // The n-th square is the n-th layer wherever it is: each of its samples gets nearer as much as it is lifted.
        float sum = 0;
        for (const glm::vec3& by_position : gradient.meshes[mesh].positions) sum += by_position.z;
        std::size_t seen = 0;
        for (std::size_t i = 0; i < count; ++i)
          seen += samples.faces[layer * count + i] / 2 == static_cast<int>(mesh) &&
                  samples.faces[layer * count + i] >= 0;
        CHECK((seen > 0) == (mesh == layer));
        CHECK(sum == doctest::Approx(-static_cast<float>(seen)).epsilon(1e-4));
      }
    }
  }

  TEST_CASE("contours behind see-through surfaces: images and gradients by areas") {
    const Scene scene = stacked_squares(reduced(40, 20), reduced(32, 16));
    const auto pixels_a_unit = static_cast<double>(scene.height) / 2;
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    for (const int layers : {3, 2, 1}) {
      CAPTURE(layers);
      renderer.set_layers(layers);
      renderer.forward();
      const std::vector<float> values = see_through(renderer.samples());
      const std::size_t pixels = static_cast<std::size_t>(scene.width * scene.height);
      const std::vector<float> image = renderer.resolve(values, 1);
      const ResolveGradient found = renderer.resolve_backward(values, 1, std::vector<float>(pixels, 1.0F));
      // Behind the first square half of what is there is seen, behind the second a quarter.
      constexpr std::array<double, 3> k_jump = {0, 0.5 * 0.5 * 2, 0.25 * 0.5 * 3};
      double expected = 0.5 * static_cast<double>(pixels);
      for (std::size_t mesh = 1; mesh < 3; ++mesh) {
        const bool is_seen = static_cast<int>(mesh) < layers;
        const std::vector<glm::vec3>& corners = scene.meshes[mesh].mesh.positions;
        const double side = pixels_a_unit * static_cast<double>(corners[2].x - corners[0].x);
        expected += is_seen ? k_jump[mesh] * side * side : 0;
        // To the right goes one side of the square.
        const std::vector<glm::vec3>& by_position = found.scene.meshes[mesh].positions;
        const double by_right = static_cast<double>(by_position[1].x + by_position[2].x);
        CHECK(by_right == doctest::Approx(is_seen ? k_jump[mesh] * side * pixels_a_unit : 0).epsilon(2e-3));
      }
      CHECK(std::accumulate(image.begin(), image.end(), 0.0) == doctest::Approx(expected).epsilon(2e-3));
    }
  }

  TEST_CASE("the library's own shading by the caller: its image and gradients, over random scenes") {
    Renderer renderer(open_device());
    unsigned tried = 0;
    const auto wanted_trials = static_cast<unsigned>(reduced(25, 1));
    for (unsigned seed = 1; tried < wanted_trials; ++seed) {
      REQUIRE(seed < 8 * wanted_trials);
      const Trial trial = plain_trial(seed);
      if (!trial.has("noise of the pixel")) continue;
      CAPTURE(seed);
      CAPTURE(trial.description());
      renderer.set_scene(trial.scene);
      renderer.set_views(trial.views);
      renderer.forward();
      const std::size_t pixels =
          trial.views.size() * static_cast<std::size_t>(trial.scene.width * trial.scene.height);
      std::vector<glm::vec4> image(pixels);
      renderer.read_pixels(image);
      const Weights weights = random_weights(pixels);
      const std::vector<double> wanted = geometric_numbers(renderer.backward_pixels(weights.of_images));
      const Shaded own = render_own(renderer, trial.scene, weights);
      double worst = 0;
      bool repeats = true;
      for (std::size_t i = 0; i < pixels; ++i) {
        const float* const found = own.image.data() + k_channels * i;
        for (int k = 0; k < 4; ++k)
          worst = std::max(worst, std::abs(static_cast<double>(found[k] - image[i][k])));
        repeats = repeats && found[4] == found[1] && found[5] == found[3];
      }
      CHECK(worst < 1e-5);
      CHECK(repeats);
      const std::vector<double> contours = geometric_numbers(own.by_contours.scene),
                                inside = geometric_numbers(own.by_samples);
      REQUIRE(contours.size() == wanted.size());
      REQUIRE(inside.size() == wanted.size());
      std::vector<double> errors;
      for (std::size_t i = 0; i < wanted.size(); ++i) errors.push_back(contours[i] + inside[i] - wanted[i]);
      CHECK(largest(errors) <= 1e-4 * largest(wanted));
      tried += largest(contours) > 0 && largest(inside) > 0;
    }
  }

  TEST_CASE("a background of the caller's own: what lies beside all surfaces counts") {
    for (const float sigma : {1e-6F, 1e-3F, 3e-2F}) {  // by the samples themselves, and by coarse grids
      for (const int supersampling : {1, 4}) {
        if (is_reduced() && (sigma < 1e-3F || supersampling != 1)) continue;
        CAPTURE(sigma);
        CAPTURE(supersampling);
        Scene scene = check::scene_of(make_cube(), reduced(48, 24), reduced(40, 20));
        scene.meshes[0].transform = glm::scale(glm::mat4(1), glm::vec3(0.1F));  // in the middle, and small
        scene.smoothing = smoothing_preset("pixel");
        scene.smoothing.sigma = sigma;
        scene.smoothing.supersampling = supersampling;
        Renderer renderer(open_device());
        renderer.set_scene(scene);
        renderer.forward();
        const Samples samples = renderer.samples();
        REQUIRE(std::ranges::any_of(samples.faces, [](int face) { return face >= 0; }));
        // A ramp, whose blur is itself, but for where the object's contours blend it.
        std::vector<float> values;
        const auto place = [&](int sample) {
          return (static_cast<float>(sample - samples.margin) + 0.5F) /
                 static_cast<float>(samples.supersampling);
        };
        for (int y = 0; y < samples.height; ++y)
          for (int x = 0; x < samples.width; ++x) values.push_back(place(x) - 2 * place(y));
        const std::vector<float> image = renderer.resolve(values, 1);
        double worst = 0;
        for (int y = 0; y < scene.height; ++y) {
          for (int x = 0; x < scene.width; ++x) {
            if (x > scene.width / 4 && x < scene.width * 3 / 4) continue;
            const double expected = x + 0.5 - 2 * (y + 0.5);
            const auto at = static_cast<std::size_t>(y * scene.width + x);
            worst = std::max(worst, std::abs(static_cast<double>(image[at]) - expected));
          }
        }
        CHECK(worst < 1e-3);
      }
    }
  }

  TEST_CASE("depths: the camera steps back") {
    Scene scene = check::scene_of(make_icosphere(static_cast<unsigned>(reduced(2, 1))), reduced(40, 14),
                                  reduced(40, 14));
    scene.smoothing = smoothing_preset("pixel");
    scene.gradients = {.camera = true};
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const Samples samples = renderer.samples();
    const auto seen =
        static_cast<double>(std::ranges::count_if(samples.faces, [](int face) { return face >= 0; }));
    REQUIRE(seen > reduced(100, 10));
    CHECK(samples.faces.size() == static_cast<std::size_t>(samples.width * samples.height));
    CHECK(samples.width == scene.width * samples.supersampling + 2 * samples.margin);
    const SceneGradient gradient = renderer.samples_backward(std::vector<glm::vec2>(samples.faces.size()),
                                                             std::vector<float>(samples.faces.size(), 1.0F));
    // The sum of the depths along the samples' rays, by finite differences.
    const auto sum_at = [&](float step) {
      std::vector<View> views(renderer.views().begin(), renderer.views().end());
      views[0].camera.view[3].z += step;
      renderer.set_views(views);
      renderer.forward();
      const Samples moved = renderer.samples();
      double sum = 0;
      for (std::size_t i = 0; i < moved.faces.size(); ++i)
        if (samples.faces[i] == moved.faces[i]) sum += static_cast<double>(moved.depths[i]);
      views[0].camera.view[3].z -= step;
      renderer.set_views(views);
      return sum;
    };
    const float step = 1e-4F;
    const double measured = (sum_at(step) - sum_at(-step)) / (2.0 * static_cast<double>(step));
    CHECK(gradient.views[0].camera.view.translation.z == doctest::Approx(measured).epsilon(0.03));
  }

  TEST_CASE("bands, and frames before: the same bits") {
    Trial trial = plain_trial(2);
    Device device = open_device();
    Renderer renderer(device);
    renderer.set_scene(trial.scene);
    const Weights weights = random_weights(static_cast<std::size_t>(trial.scene.width * trial.scene.height));
    const Shaded whole = render_own(renderer, trial.scene, weights);
    const std::vector<glm::vec4> ones(weights.of_images.size(), glm::vec4(1));
    renderer.forward();
    renderer.backward_pixels(ones);
    const Shaded after = render_own(renderer, trial.scene, weights);
    CHECK(after.image == whole.image);
    CHECK(pipeline::same_bits(after.by_samples, whole.by_samples));
    CHECK(pipeline::same_bits(after.by_contours.scene, whole.by_contours.scene));
    device.set_memory_budget(std::max<std::size_t>(renderer.statistics().fragments * 60, 28000));
    renderer.set_scene(trial.scene);
    const Shaded in_bands = render_own(renderer, trial.scene, weights);
    CHECK(in_bands.image == whole.image);
    CHECK(in_bands.by_contours.samples == whole.by_contours.samples);
    CHECK(pipeline::same_bits(in_bands.by_samples, whole.by_samples));
  }

  TEST_CASE("the frame's own image and gradient stay") {
    Trial trial = plain_trial(2);
    Renderer renderer(open_device());
    renderer.set_scene(trial.scene);
    const Weights weights = random_weights(static_cast<std::size_t>(trial.scene.width * trial.scene.height));
    for (const int layers : {1, 3}) {
      CAPTURE(layers);
      renderer.set_layers(layers);
      renderer.forward();
      const Image image = renderer.image();
      const SceneGradient gradient = renderer.backward_pixels(weights.of_images);
      const Samples samples = renderer.samples();
      const std::vector<float> values(samples.faces.size() / static_cast<std::size_t>(layers), 1.0F);
      const std::vector<float> pixels = renderer.resolve(values, 1);
      renderer.resolve_backward(values, 1, pixels);
      renderer.samples_backward(samples.barycentrics, samples.depths);
      renderer.resolve_tangent(values, 1, values, std::vector<SceneTangent>(1));
      CHECK(pipeline::same_bits(renderer.image(), image));
      CHECK(pipeline::same_bits(renderer.backward_pixels(weights.of_images), gradient));
    }
  }

  TEST_CASE("what is refused") {
    Scene scene = check::scene_of(make_cube(), 12, 9);
    scene.smoothing = smoothing_preset("pixel");
    Renderer renderer(open_device());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_layers(0), "from 1 to 256");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_layers(257), "from 1 to 256");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.samples(), "Renderer::samples");
    renderer.set_scene(scene);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.samples(), "forward() first");
    renderer.forward();
    const std::size_t count = renderer.samples().faces.size();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.resolve(std::vector<float>(count), 0), "channels");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.resolve({}, std::size_t{1} << 62), "channels");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.resolve(std::vector<float>(count - 1), 1),
                          "samples (resolve)");
    std::vector<float> bad(count);
    bad[3] = NAN;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.resolve(bad, 1), "finite");
    bad[3] = 0;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.resolve_backward(bad, 1, bad), "grad_pixels");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.samples_backward({}, bad), "grad_barycentrics");
    scene.smoothing = smoothing_preset("gaussian");
    renderer.set_scene(scene);
    renderer.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.samples(), "noise on the pixel");
    scene.smoothing = smoothing_preset("pixel");
    scene.lights.emplace();
    renderer.set_scene(scene);
    renderer.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.samples(), "a scene with lights");
  }
}

}  // namespace own_shading_test
