// Textures in whole renders: trilinear filtering against finite differences of the reference, new texels and
// coordinates, the same bits whatever the bands, places beyond single precision, and seams under noise of the
// pixel.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/directions.hpp"
#include "pipeline/scenes.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace texture_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::is_reduced;
using dpr::test::reduced;

namespace {

SceneGradient gradient_of(Renderer& renderer) {
  const Scene& scene = renderer.scene();
  const Image weights = random_image(scene.width, scene.height, -1, 1);
  return renderer.backward(std::span(&weights, 1));
}

std::vector<double> numbers_of(SceneGradient gradient) {
  std::vector<double> numbers;
  for (const Block& block : blocks_of(gradient))
    numbers.insert(numbers.end(), block.found.begin(), block.found.end());
  return numbers;
}

/// A square on which every point shows several texels of several levels.
Scene tilted_square(int size) {
  Mesh square;
  square.positions = {{-1.4F, -1.3F, 0.1F}, {1.5F, -1.2F, -0.2F}, {1.3F, 1.4F, 0.2F}, {-1.2F, 1.5F, -0.1F}};
  square.faces = {{0, 1, 2}, {0, 2, 3}};
  Random random(3);
  for (int i = 0; i < 4; ++i) square.vertex_colors.push_back(random.vector(0.3F, 1));
  square.texcoords = {{-0.3F, -0.2F}, {1.9F, 0.1F}, {2.3F, 1.8F}, {0.1F, 1.4F}};
  square.face_texcoords = square.faces;
  square.textures = {random_texture(23, 14, Wrap::repeat, Filter::trilinear)};
  Scene scene = scene_of(square, size, size);
  scene.meshes[0].transform = placed(61.0F, 1.0F, {0.1F, 0.2F, 0.4F});
  scene.gradients.texture = scene.gradients.texcoords = true;
  return scene;
}

/// In perspective and not; with a part of it nearer than the near plane; orthographic, and that too, large
/// enough that no corner shows the centre of a texel of a level.
std::vector<Scene> tilted_squares(int size) {
  std::vector<Scene> scenes(5, tilted_square(size));
  scenes[1].perspective_correct = false;
  scenes[2].camera.znear = scenes[4].camera.znear = 5.2F;
  scenes[3].camera.orthographic_height = scenes[4].camera.orthographic_height = 3.1F;
  return scenes;
}

std::vector<Direction> directions(const SceneGradient& g) {
  const PoseGradient& pose = g.views[0].transforms[0];
  return {{"positions", flat(g.meshes[0].positions),
           [](reference::Scene& s, const std::vector<double>& d) {
             for (std::size_t i = 0; i < d.size(); ++i) s.meshes[0].positions[i / 3][i % 3] += d[i];
           }},
          {"texcoords", flat(g.meshes[0].texcoords),
           [](reference::Scene& s, const std::vector<double>& d) {
             for (std::size_t i = 0; i < d.size(); ++i)
               (i % 2 == 0 ? s.meshes[0].texcoords[i / 2].x : s.meshes[0].texcoords[i / 2].y) += d[i];
           }},
          {"texels", flat(g.meshes[0].textures[0]),
           [](reference::Scene& s, const std::vector<double>& d) {
             for (std::size_t i = 0; i < d.size(); ++i) s.meshes[0].textures[0].texels[i / 3][i % 3] += d[i];
           }},
          {"translation", flat<glm::dvec3>({pose.translation}),
           [](reference::Scene& s, const std::vector<double>& d) {
             for (std::size_t i = 0; i < 3; ++i) s.meshes[0].transform[i][3] += d[i];
           }},
          // By hundreds of degrees: what a step changes is well above rounding then.
          {"projection",
           {100 * g.views[0].camera.fov_y_degrees, g.views[0].camera.orthographic_height},
           [](reference::Scene& s, const std::vector<double>& d) {
             s.camera.fov_y_degrees += 100 * d[0];
             if (s.camera.orthographic_height) *s.camera.orthographic_height += d[1];
           }}};
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("trilinear: images are the reference's") {
    const int size = reduced(20, 7);
    for (Scene& scene : tilted_squares(size)) {
      const Image image = rendered(scene);
      const reference::Image expected = reference::render(to_reference(scene));
      scene.meshes[0].mesh.textures[0].filter = Filter::bilinear;
      const Image sharp = rendered(scene);
      double error = 0, effect = 0;
      for (std::size_t i = 0; i < expected.rgba.size(); ++i) {
        const auto at = [&](const Image& of) {
          return static_cast<double>(of.pixels[i / 4][static_cast<int>(i % 4)]);
        };
        error = std::max(error, std::abs(at(image) - expected.rgba[i]));
        effect = std::max(effect, std::abs(at(sharp) - expected.rgba[i]));
      }
      CHECK(error < 1e-4);
      CHECK(effect > 0.05);
    }
  }

  TEST_CASE("textures: new texels and coordinates are those of a new scene") {
    for (const Filter filter : {Filter::bilinear, Filter::trilinear}) {
      const int size = reduced(16, 7);
      Scene scene = textured_scene(make_cube(), random_texture(5, 3, Wrap::repeat, filter), size, size);
      scene.meshes.push_back({make_icosphere(1), placed(-31.0F, 0.5F, {0.6F, -0.1F, 0.3F})});
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      Mesh& mesh = scene.meshes[0].mesh;
      mesh.textures[0].texels = random_texture(5, 3, Wrap::repeat, filter, 21).texels;
      for (glm::vec2& uv : mesh.texcoords) uv = 0.7F * uv + glm::vec2(0.1F, 0.2F);
      renderer.set_texels(0, 0, mesh.textures[0].texels);
      renderer.set_texcoords(0, mesh.texcoords);
      renderer.forward();
      CHECK(renderer.image().pixels == rendered(scene).pixels);
      CHECK(renderer.scene().meshes[0].mesh.texcoords == mesh.texcoords);
      CHECK_THROWS_AS(renderer.set_texels(0, 1, mesh.textures[0].texels), InvalidArgument);
      CHECK_THROWS_AS(renderer.set_texels(1, 0, mesh.textures[0].texels), InvalidArgument);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument,
                            renderer.set_texels(0, 0, std::span(mesh.textures[0].texels).first(2)),
                            "texels: got 2 vectors, expected 15");
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_texcoords(1, mesh.texcoords),
                            "a mesh without textures");
      mesh.texcoords[1].x = std::numeric_limits<float>::quiet_NaN();
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_texcoords(0, mesh.texcoords), "texcoords[1]");
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, renderer.set_scene(scene), "texcoords[1]");
    }
  }

  TEST_CASE("textures: gradients have the same bits from run to run, in bands and on several devices") {
    const int size = reduced(40, 17);
    for (const Filter filter : {Filter::bilinear, Filter::trilinear}) {
      if (is_reduced() && filter == Filter::bilinear) continue;
      Scene scene = textured_scene(make_cube(), random_texture(6, 7, Wrap::mirror, filter), size, size);
      scene.lights = two_lights(Shading::phong);
      const Device device = open_device();
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      const std::vector<double> numbers = numbers_of(gradient_of(renderer));
      renderer.forward();
      CHECK(numbers_of(gradient_of(renderer)) == numbers);
      Device small = open_device();
      small.set_memory_budget(reduced(400000, 40000));
      Renderer banded(small);
      banded.set_scene(scene);
      banded.forward();
      CHECK(banded.statistics().bands > 1);
      CHECK(numbers_of(gradient_of(banded)) == numbers);
      MultiDeviceRenderer several({device, open_device()});
      several.set_scene(scene);
      const Image weights = random_image(size, size, -1, 1);
      CHECK(numbers_of(several.gradient(std::span(&weights, 1))) == numbers);
      several.set_texels(0, 0, random_texture(6, 7, Wrap::mirror, filter, 3).texels);
      CHECK(numbers_of(several.gradient(std::span(&weights, 1))) != numbers);
    }
  }

  TEST_CASE("textures: a texel that the whole image shows has the sum of what many would have") {
    const int size = reduced(96, 20);
    const auto rendered = [&](std::size_t side, std::size_t budget) {
      Texture texture = random_texture(1, 1, Wrap::repeat, Filter::bilinear);
      texture.width = texture.height = static_cast<int>(side);
      texture.texels.resize(side * side, texture.texels[0]);
      Scene scene = textured_scene(make_cube(), texture, size, size);
      Device device = open_device();
      if (budget > 0) device.set_memory_budget(budget);
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      CHECK((renderer.statistics().bands > 1) == (budget > 0));
      return gradient_of(renderer).meshes[0].textures[0];
    };
    const std::vector<glm::vec3> one = rendered(1, 0), many = rendered(8, 0);
    REQUIRE(one.size() == 1);
    CHECK(one == rendered(1, reduced(400000, 60000)));  // whose bands are parts of rows of tiles, too
    glm::dvec3 sum(0.0), magnitude(0.0);
    for (const glm::vec3& texel : many) {
      sum += glm::dvec3(texel);
      magnitude += glm::abs(glm::dvec3(texel));
    }
    CHECK(glm::length(glm::dvec3(one[0]) - sum) < 1e-5 * glm::length(magnitude));
    CHECK(glm::length(sum) > 1e-3 * glm::length(magnitude));
  }

  TEST_CASE("textures: coordinates far from the origin show something finite, whole periods nothing new") {
    const int size = reduced(16, 7);
    for (const Wrap wrap : {Wrap::repeat, Wrap::mirror, Wrap::clamp}) {
      Scene scene = textured_scene(make_cube(), random_texture(5, 3, wrap, Filter::bilinear), size, size);
      Mesh& mesh = scene.meshes[0].mesh;
      for (glm::vec2& uv : mesh.texcoords) uv = glm::round(64.0F * uv) / 64.0F;  // exact when moved
      const Image near = rendered(scene);
      for (glm::vec2& uv : mesh.texcoords) uv += 1000.0F;
      if (wrap != Wrap::clamp) CHECK(rendered(scene).pixels == near.pixels);
      for (const float scale : {1e9F, 3e38F}) {
        for (std::size_t i = 0; i < mesh.texcoords.size(); ++i)
          mesh.texcoords[i] = scale * glm::vec2(i % 2 == 0 ? 1 : -1, i % 3 == 0 ? 0.5F : -0.5F);
        for (const glm::vec4& pixel : rendered(scene).pixels)
          CHECK(std::isfinite(pixel.x + pixel.y + pixel.z));
      }
    }
  }

  TEST_CASE("pixel noise: contours are where the texture jumps") {
    // The cube's sides have one colour, and each a whole texture: of the 18 edges only the 12 between sides
    // differ.
    const auto contours = [](Mesh mesh) {
      const int size = reduced(32, 12);
      Scene scene = scene_of(std::move(mesh), size, size);
      scene.smoothing = smoothing_preset("pixel", size, size);
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      renderer.image();
      return impl_of(renderer).pixel_noise->contour.pairs;
    };
    Mesh mesh = welded_cube();
    mesh.face_colors.clear();
    const std::size_t silhouette = contours(mesh);
    Mesh same = mesh, shifted = mesh, apart = mesh;
    for (Mesh* m : {&same, &shifted, &apart})
      m->textures = {random_texture(4, 4, Wrap::repeat, Filter::bilinear)};
    for (const glm::uvec3& face : mesh.faces) {
      const auto first = static_cast<std::uint32_t>(shifted.texcoords.size());
      for (int k = 0; k < 3; ++k) {
        const glm::vec2 uv(mesh.positions[face[k]]);
        same.texcoords.push_back(uv);
        shifted.texcoords.push_back(uv + static_cast<float>(first));  // whole periods
        apart.texcoords.push_back(uv + 0.01F * static_cast<float>(first));
      }
      for (Mesh* m : {&same, &shifted, &apart}) m->face_texcoords.emplace_back(first, first + 1, first + 2);
    }
    CHECK(contours(same) == silhouette);
    CHECK(contours(shifted) == silhouette);
    CHECK(contours(apart) > silhouette);
    shifted.textures[0].wrap = Wrap::clamp;
    CHECK(contours(shifted) == contours(apart));
    same.textures.push_back(same.textures[0]);
    for (std::uint32_t face = 0; face < same.faces.size(); ++face) same.face_textures.push_back(face % 2);
    CHECK(contours(same) > silhouette);
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("trilinear: gradients are differences of the reference") {
    const int size = reduced(20, 7);
    for (const Scene& scene : tilted_squares(size)) {
      Renderer renderer(open_device());
      renderer.set_scene(scene);
      renderer.forward();
      const Image weights = random_image(size, size, -1, 1);
      for (const Direction& block : directions(renderer.backward(std::span(&weights, 1)))) {
        for (unsigned seed = 0; seed < 4; ++seed) {
          const double error = error_along(scene, block, weights, seed);
          CHECK_MESSAGE(error < 1e-3, block.name << ": " << error);
        }
        Direction wrong = block;
        for (double& g : wrong.found) g *= 1.01;
        CHECK(error_along(scene, wrong, weights, 0) > error_along(scene, block, weights, 0));
      }
    }
  }

  TEST_CASE("pixel noise: gradients of texels and coordinates are differences of the image") {
    const int size = reduced(24, 8);
    Scene scene =
        textured_scene(welded_cube(), random_texture(2, 2, Wrap::clamp, Filter::bilinear), size, size);
    // Between the four texels' centres, so that nothing kinks.
    for (glm::vec2& uv : scene.meshes[0].mesh.texcoords) uv = 0.13F * uv + 0.44F;
    scene.smoothing = smoothing_preset("pixel", size, size);
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const Image weights = random_image(size, size, -1, 1);
    const SceneGradient gradient = renderer.backward(std::span(&weights, 1));
    // Both change nothing but the samples' colours, by which the image is linear in the texels.
    const auto value = [&](const Mesh& mesh) {
      renderer.set_texels(0, 0, mesh.textures[0].texels);
      renderer.set_texcoords(0, mesh.texcoords);
      renderer.forward();
      const Image image = renderer.image();
      double sum = 0;
      for (std::size_t i = 0; i < image.pixels.size(); ++i)
        sum += glm::dot(glm::dvec4(image.pixels[i]), glm::dvec4(weights.pixels[i]));
      return sum;
    };
    const Mesh& mesh = scene.meshes[0].mesh;
    Random random(4);
    const auto check = [&](const auto& gradients, auto values_of, float step, double tolerance) {
      Mesh above = mesh, below = mesh;
      double found = 0, squares = 0;
      for (std::size_t i = 0; i < gradients.size(); ++i) {
        const auto direction = std::decay_t<decltype(gradients[i])>(random.vector(-1, 1));
        found += static_cast<double>(glm::dot(gradients[i], direction));
        squares += static_cast<double>(glm::dot(direction, direction));
        values_of(above)[i] += step * direction;
        values_of(below)[i] -= step * direction;
      }
      const double expected = (value(above) - value(below)) / (2 * static_cast<double>(step));
      const double size_of =
          norm(flat(gradients)) * std::sqrt(squares / static_cast<double>(flat(gradients).size()));
      CHECK(size_of > 0);
      CHECK(std::abs(found - expected) < tolerance * size_of);
    };
    check(
        gradient.meshes[0].textures[0], [](Mesh & m) -> auto& { return m.textures[0].texels; }, 0.5F, 1e-3);
    check(
        gradient.meshes[0].texcoords, [](Mesh & m) -> auto& { return m.texcoords; }, 1e-3F, 5e-3);
  }
  TEST_CASE("texture: the gradient is finite where a face is seen edge-on") {
    Mesh mesh;
    mesh.positions = {{-1, -0.5F, 3}, {-0.5F, 1, 0}, {0, 2.5F, 1}};  // on one line, as the camera sees them
    mesh.faces = {{0, 1, 2}};
    mesh.texcoords = {{0.1F, 0.2F}, {2.5F, 0.4F}, {1, 2}};
    mesh.face_texcoords = mesh.faces;
    mesh.textures = {check::random_texture(8, 8, Wrap::repeat, Filter::trilinear)};
    Scene scene;
    scene.width = 20;
    scene.height = 16;
    scene.meshes = {{mesh}};
    scene.camera.view[3] = glm::vec4(0, 0, -4, 1);
    scene.camera.orthographic_height = 6.0F;
    scene.smoothing = smoothing_preset("gaussian");
    Renderer renderer(open_device());
    renderer.set_scene(scene);
    renderer.forward();
    const SceneGradient gradient = renderer.backward(std::vector{Image(20, 16, glm::vec4(1))});
    for (const glm::vec3& g : gradient.meshes[0].positions) CHECK(std::isfinite(g.x + g.y + g.z));
  }
}

}  // namespace texture_test
