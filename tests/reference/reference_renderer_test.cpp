/// The whole reference renderer: every gradient against finite differences of the image, over priors,
/// compositions, metrics, lighting models, cameras and image shapes.
#include "test_support.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace reference_renderer_test {

using namespace dpr::reference;

namespace {

Mesh tetrahedron(Random& random) {
  Mesh mesh;
  mesh.positions = {{0.0, 0.9, 0.1}, {-0.8, -0.5, 0.4}, {0.9, -0.4, 0.3}, {0.1, 0.0, -0.9}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  for (int i = 0; i < 4; ++i) mesh.face_colors.push_back(random.vector(0.0, 1.0));
  mesh.transform = moved(scaled({1.1, 0.9, 1.0}), {0.3, -0.5, 0.2}, {0.1, -0.1, 0.2});
  return mesh;
}

Mesh quadrilateral(Random& random) {
  Mesh mesh;
  mesh.positions = {{-1.0, -0.7, 0.0}, {0.6, -0.9, 0.2}, {0.7, 0.5, -0.1}, {-0.9, 0.8, 0.1}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  for (int i = 0; i < 4; ++i) mesh.vertex_colors.push_back(random.vector(0.0, 1.0));
  mesh.transform = moved(k_identity, {-0.4, 0.3, 0.1}, {-0.2, 0.15, -0.3});
  return mesh;
}

/// Two intersecting meshes, one with face colours and one with vertex colours, on a few pixels. The blur is
/// wide enough for gradients at most pixels, and gamma for the depths to mix.
Scene small_scene() {
  Random random(11);
  Scene scene;
  scene.width = 7;
  scene.height = 5;
  scene.camera.view = moved(k_identity, {0.15, 0.2, -0.1}, {0.05, -0.1, -3.2});
  scene.camera.fov_y_degrees = 55.0;
  scene.camera.zfar = 20.0;
  scene.background = {0.2, 0.5, 0.3};
  scene.meshes = {tetrahedron(random), quadrilateral(random)};
  scene.smoothing.sigma = 0.02;
  scene.smoothing.gamma = 0.03;
  scene.smoothing.alpha = 0.8;
  scene.smoothing.blur_radius = 0.3;
  scene.smoothing.background_depth = 0.8;
  return scene;
}

Lights two_lights(Shading shading) {
  Lights lights;
  lights.ambient = {0.4, 0.3, 0.5};
  lights.point = {{{1.0, 1.5, 3.0}, {0.4, 0.5, 0.3}, {0.5, 0.3, 0.6}},
                  {{-2.0, 0.5, 2.0}, {0.3, 0.2, 0.6}, {0.3, 0.6, 0.2}}};
  lights.shininess = 6.0;
  lights.shading = shading;
  return lights;
}

/// A group of parameters: how a displacement changes the scene, and the gradient of the displacement at zero.
struct Block {
  std::string name;
  std::vector<double> gradient;
  std::function<void(Scene&, const std::vector<double>&)> displace;
};

void displace_all(std::vector<Vec3d>& values, const std::vector<double>& v) {
  for (std::size_t i = 0; i < values.size(); ++i) values[i] += take(v, 3 * i);
}

std::vector<double> flat(const std::vector<Vec3d>& values) {
  std::vector<double> list;
  for (const Vec3d& v : values) append(list, v);
  return list;
}

void displace_all(std::vector<Vec2d>& values, const std::vector<double>& v) {
  for (std::size_t i = 0; i < values.size(); ++i) values[i] += Vec2d{v[2 * i], v[2 * i + 1]};
}

std::vector<double> flat(const std::vector<Vec2d>& values) {
  std::vector<double> list;
  for (const Vec2d& v : values) list.insert(list.end(), {v.x, v.y});
  return list;
}

/// Coordinates that go beyond the texture on all sides.
void add_texture(Mesh& mesh, Wrap wrap, Random& random) {
  Texture texture{3, 2, {}, wrap, Filter::bilinear};
  for (int i = 0; i < 6; ++i) texture.texels.push_back(random.vector(0.0, 1.0));
  mesh.textures.push_back(texture);
  for (std::size_t i = 0; i < 3 * mesh.faces.size(); ++i) {
    const double u = random(-1.2, 2.1);
    mesh.texcoords.push_back({u, random(-1.2, 2.1)});
  }
  for (std::size_t i = 0; i < mesh.texcoords.size(); i += 3) mesh.face_texcoords.push_back({i, i + 1, i + 2});
}

void append_mesh_blocks(const Gradients& g, std::size_t m, std::vector<Block>& blocks) {
  const std::string name = "mesh " + std::to_string(m);
  const MeshGradient& mesh = g.meshes[m];
  blocks.push_back({name + " positions", flat(mesh.positions),
                    [m](Scene& s, const std::vector<double>& v) { displace_all(s.meshes[m].positions, v); }});
  blocks.push_back({name + " colors", flat(mesh.colors), [m](Scene& s, const std::vector<double>& v) {
                      displace_all(s.meshes[m].vertex_colors.empty() ? s.meshes[m].face_colors
                                                                     : s.meshes[m].vertex_colors,
                                   v);
                    }});
  if (!mesh.texcoords.empty()) {
    blocks.push_back({name + " texcoords", flat(mesh.texcoords), [m](Scene& s, const std::vector<double>& v) {
                        displace_all(s.meshes[m].texcoords, v);
                      }});
  }
  for (std::size_t t = 0; t < mesh.textures.size(); ++t) {
    blocks.push_back(
        {name + " texels", flat(mesh.textures[t]), [m, t](Scene& s, const std::vector<double>& v) {
           displace_all(s.meshes[m].textures[t].texels, v);
         }});
  }
  blocks.push_back({name + " transform", flat({mesh.rotation, mesh.translation}),
                    [m](Scene& s, const std::vector<double>& v) {
                      s.meshes[m].transform = moved(s.meshes[m].transform, take(v, 0), take(v, 3));
                    }});
}

void append_light_blocks(const Gradients& g, std::vector<Block>& blocks) {
  blocks.push_back({"lights", numbers_of(g.lights),
                    [](Scene& s, const std::vector<double>& v) { s.lights = displaced(*s.lights, v); }});
}

std::vector<Block> blocks_of(const Scene& scene, const Gradients& g) {
  std::vector<Block> blocks;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) append_mesh_blocks(g, m, blocks);
  blocks.push_back(
      {"camera", flat({g.camera.rotation, g.camera.translation}), [](Scene& s, const std::vector<double>& v) {
         s.camera.view = moved(s.camera.view, take(v, 0), take(v, 3));
       }});
  blocks.push_back({"fov", {g.camera.fov_y_degrees}, [](Scene& s, const std::vector<double>& v) {
                      s.camera.fov_y_degrees += v[0];
                    }});
  const Intrinsics& k = g.camera.intrinsics;
  blocks.push_back({"intrinsics", {k.fx, k.fy, k.cx, k.cy}, [](Scene& s, const std::vector<double>& v) {
                      if (!s.camera.intrinsics) return;
                      Intrinsics& i = *s.camera.intrinsics;
                      i = {i.fx + v[0], i.fy + v[1], i.cx + v[2], i.cy + v[3]};
                    }});
  blocks.push_back(
      {"sigma", {g.sigma}, [](Scene& s, const std::vector<double>& v) { s.smoothing.sigma += v[0]; }});
  blocks.push_back(
      {"gamma", {g.gamma}, [](Scene& s, const std::vector<double>& v) { s.smoothing.gamma += v[0]; }});
  blocks.push_back(
      {"alpha", {g.alpha}, [](Scene& s, const std::vector<double>& v) { s.smoothing.alpha += v[0]; }});
  blocks.push_back({"background", flat({g.background}),
                    [](Scene& s, const std::vector<double>& v) { s.background += take(v, 0); }});
  if (scene.lights) append_light_blocks(g, blocks);
  return blocks;
}

/// Weights of the scalar that is differentiated: all channels, alpha too.
Image random_weights(const Scene& scene) {
  Random random(12);
  Image weights = make_image(scene.width, scene.height);
  for (double& w : weights.rgba) w = random(-1.0, 1.0);
  return weights;
}

double weighted_sum(const Image& image, const Image& weights) {
  double sum = 0.0;
  for (std::size_t i = 0; i < image.rgba.size(); ++i) sum += image.rgba[i] * weights.rgba[i];
  return sum;
}

/// Finite differences in every parameter of a block, or, much faster, in one random direction.
enum class Directions { all, one };

GradientCheck check_block(const Scene& scene, const Image& weights, const Block& block, Directions directions,
                          double tolerance) {
  const auto value = [&](const std::vector<double>& displacement) {
    Scene displaced = scene;
    block.displace(displaced, displacement);
    return weighted_sum(render(displaced), weights);
  };
  constexpr double k_step = 1e-6;
  constexpr double k_floor = 1e-7;
  if (directions == Directions::all) {
    return check_gradient(value, std::vector<double>(block.gradient.size()), block.gradient, k_step,
                          tolerance, k_floor);
  }
  Random random(13);
  std::vector<double> direction;
  double slope = 0.0;
  for (const double g : block.gradient) {
    direction.push_back(random(-1.0, 1.0));
    slope += direction.back() * g;
  }
  const ScalarFunction along = [&](const std::vector<double>& t) {
    std::vector<double> displacement;
    for (const double d : direction) displacement.push_back(t[0] * d);
    return value(displacement);
  };
  return check_gradient(along, {0.0}, {slope}, k_step, tolerance, k_floor);
}

void check_scene(const Scene& scene, Directions directions, double tolerance) {
  const Image weights = random_weights(scene);
  for (const Block& block : blocks_of(scene, gradient(scene, weights))) {
    const GradientCheck check = check_block(scene, weights, block, directions, tolerance);
    CAPTURE(block.name);
    CAPTURE(check.error);
    CAPTURE(check.expected);
    CAPTURE(check.found);
    CHECK(check.passed);
  }
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("renderer: nothing to see, hidden and degenerate triangles") {
    Scene scene = small_scene();
    scene.meshes[0].faces.push_back({0, 0, 1});
    scene.meshes[1].transform =
        moved(scene.meshes[1].transform, {}, {0.0, 0.0, 3.2});  // through the camera's plane
    scene.lights = two_lights(Shading::phong);
    const Image weights = random_weights(scene);
    for (const double v : render(scene).rgba) CHECK(std::isfinite(v));
    for (const Block& block : blocks_of(scene, gradient(scene, weights))) {
      for (const double g : block.gradient) CHECK(std::isfinite(g));
    }
    scene.meshes.clear();
    const Image empty = render(scene);
    CHECK(empty.rgba[1] == 0.5);
    CHECK(empty.rgba[3] == 0.0);
    CHECK(gradient(scene, weights).meshes.empty());
  }
}

TEST_SUITE("gradient") {
  TEST_CASE("renderer: every single gradient, and a wrong one in every block is rejected") {
    Scene scene = small_scene();
    scene.lights = two_lights(Shading::phong);
    scene.smoothing.occupancy_prior = Prior::logistic;
    scene.smoothing.depth_prior = Prior::gumbel;
    check_scene(scene, Directions::all, 1e-6);
    const Image weights = random_weights(scene);
    for (Block& block : blocks_of(scene, gradient(scene, weights))) {
      CAPTURE(block.name);
      block.gradient[0] += 1e-3;
      CHECK_FALSE(check_block(scene, weights, block, Directions::all, 1e-6).passed);
      CHECK_FALSE(check_block(scene, weights, block, Directions::one, 1e-6).passed);
    }
  }

  TEST_CASE("renderer: gradients of textures with every wrap mode") {
    for (const Wrap wrap : {Wrap::repeat, Wrap::mirror, Wrap::clamp}) {
      Scene scene = small_scene();
      Random random(14);
      for (Mesh& mesh : scene.meshes) add_texture(mesh, wrap, random);
      scene.lights = two_lights(Shading::phong);
      CAPTURE(static_cast<int>(wrap));
      check_scene(scene, Directions::all, 1e-6);
    }
  }

  TEST_CASE("renderer: gradients with every prior in both compositions") {
    for (const Composition composition : k_compositions) {
      for (const Prior prior : k_priors) {
        Scene scene = small_scene();
        scene.width = 4;
        scene.height = 5;
        scene.smoothing.composition = composition;
        scene.smoothing.occupancy_prior = prior;
        scene.smoothing.depth_prior = prior;
        if (prior == Prior::uniform) scene.smoothing.sigma = 0.3;
        CAPTURE(static_cast<int>(composition));
        CAPTURE(static_cast<int>(prior));
        check_scene(scene, Directions::one, prior == Prior::uniform ? 1e-4 : 1e-5);
      }
    }
  }

  TEST_CASE("renderer: gradients with every lighting model, metric and interpolation") {
    for (const Shading shading : k_shadings) {
      for (const DistanceMetric metric : {DistanceMetric::squared, DistanceMetric::euclidean}) {
        for (const bool perspective : {true, false}) {
          Scene scene = small_scene();
          scene.lights = two_lights(shading);
          scene.smoothing.distance = metric;
          scene.smoothing.composition = perspective ? Composition::joint : Composition::barrier;
          scene.smoothing.depth_prior = perspective ? Prior::gaussian : Prior::gumbel;
          if (metric == DistanceMetric::euclidean) {
            scene.smoothing.sigma = 0.1;
            scene.smoothing.blur_radius = 0.5;
          }
          scene.perspective_correct = perspective;
          CAPTURE(static_cast<int>(shading));
          CAPTURE(static_cast<int>(metric));
          CAPTURE(perspective);
          check_scene(scene, Directions::one, 1e-5);
        }
      }
    }
  }

  TEST_CASE("renderer: gradients of intrinsics, on images of different shapes") {
    for (const ImageSize size : {ImageSize{6, 6}, ImageSize{9, 4}, ImageSize{4, 9}}) {
      Scene scene = small_scene();
      scene.width = size.width;
      scene.height = size.height;
      const double focal = short_side(size);
      scene.camera.intrinsics = Intrinsics{focal, 0.9 * focal, 0.52 * size.width, 0.47 * size.height};
      scene.smoothing.depth_prior = Prior::gumbel;
      CAPTURE(size.width);
      check_scene(scene, Directions::all, 1e-5);
    }
  }

  TEST_CASE("renderer: the gradient of a loss is the gradient of its image") {
    Scene scene = small_scene();
    scene.smoothing.depth_prior = Prior::gumbel;
    Scene other = scene;
    other.meshes[0].transform = moved(other.meshes[0].transform, {0.1, 0.2, 0.3}, {0.1, 0.0, 0.0});
    const Image target = render(other);
    for (const auto& [loss, name] : k_losses) {
      CAPTURE(name);
      const ScalarFunction f = [&](const std::vector<double>& v) {
        Scene displaced = scene;
        displaced.meshes[0].transform = moved(displaced.meshes[0].transform, take(v, 0), take(v, 3));
        return evaluate_loss(loss, render(displaced), target).value;
      };
      const MeshGradient g = gradient(scene, evaluate_loss(loss, render(scene), target).grad_image).meshes[0];
      std::vector<double> expected = flat({g.rotation, g.translation});
      CHECK_GRADIENT(f, std::vector<double>(6), expected, 1e-6, 1e-5);
      expected[0] *= -1.0;
      CHECK_FALSE(check_gradient(f, std::vector<double>(6), expected, 1e-6, 1e-5).passed);
    }
  }
}

}  // namespace reference_renderer_test
