// Images of attributes: values against the reference's weights, gradients against differences of the double
// precision reference, or, with noise on the pixel, of the images themselves.
#include "dpr/attribute_images.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "dpr/aov.hpp"
#include "dpr/dpr.hpp"
#include "pipeline/scenes.hpp"
#include "renderer/renderer_impl.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace attribute_images_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::reduced;
using reference::Vec3d;

namespace {

constexpr Attribute k_all[] = {Attribute::depth, Attribute::position, Attribute::normal,
                               Attribute::texcoords};

/// Three triangles of their own vertices, with texture coordinates that no two corners share.
Scene soup_scene(int width, int height, Composition composition) {
  Scene scene = scene_of(random_soup(3, 23), width, height);
  Mesh& mesh = scene.meshes[0].mesh;
  Random random(31);
  for (unsigned corner = 0; corner < 9; ++corner) {
    mesh.texcoords.emplace_back(random(0.0F, 1.0F), random(0.0F, 2.0F));
    if (corner % 3 == 0) mesh.face_texcoords.emplace_back(corner, corner + 1, corner + 2);
  }
  scene.smoothing.composition = composition;
  scene.gradients.texcoords = true;
  return scene;
}

/// Value that a corner of a face shows.
using CornerValue =
    std::function<Vec3d(const reference::Scene& scene, const reference::PreparedScene& prepared,
                        std::size_t face, std::size_t corner)>;

Vec3d world_normal(const reference::PreparedScene& prepared, std::size_t face) {
  const reference::Face& f = prepared.shade.faces[face];
  const Vec3d a = prepared.vertices[f[0]].world;
  return reference::unit(
      reference::cross(prepared.vertices[f[1]].world - a, prepared.vertices[f[2]].world - a));
}

/// Values of scenes with one mesh.
CornerValue corner_value(Attribute attribute) {
  return [=](const reference::Scene& scene, const reference::PreparedScene& prepared, std::size_t face,
             std::size_t corner) -> Vec3d {
    const reference::TransformedVertex& vertex = prepared.vertices[prepared.shade.faces[face][corner]];
    if (attribute == Attribute::position) return vertex.world;
    if (attribute == Attribute::normal) return world_normal(prepared, face);
    if (attribute == Attribute::depth) return {vertex.ndc.z, vertex.ndc.z, vertex.ndc.z};
    const reference::Mesh& mesh = scene.meshes[0];
    const reference::Vec2d uv = mesh.texcoords[mesh.face_texcoords[face][corner]];
    return {uv.x, uv.y, 0.0};
  };
}

/// RGB = sum w a, A = sum w.
reference::Image reference_image(const reference::Scene& scene, const CornerValue& value) {
  const reference::PreparedScene prepared = reference::prepare(scene);
  reference::Image image = reference::make_image(scene.width, scene.height);
  for (int row = 0; row < scene.height; ++row) {
    for (int column = 0; column < scene.width; ++column) {
      const auto fragments = reference::pixel_fragments(scene, prepared, row, column);
      const reference::AggregateResult pixel = reference::aggregate_forward(
          reference::aggregate_inputs(scene, prepared, fragments), prepared.aggregate);
      double* rgba = &image.rgba[4 * static_cast<std::size_t>(row * scene.width + column)];
      for (std::size_t k = 0; k < fragments.size(); ++k) {
        Vec3d shown;
        for (std::size_t corner = 0; corner < 3; ++corner)
          shown += fragments[k].barycentric[corner] * value(scene, prepared, fragments[k].face, corner);
        for (std::size_t c = 0; c < 3; ++c) rgba[c] += pixel.weights[k] * shown[c];
        rgba[3] += pixel.weights[k];
      }
    }
  }
  return image;
}

using Change = std::function<void(reference::Scene&, double)>;

/// A <- exp([r]x) A about an axis, to first order.
void turn(reference::Mat4d& m, std::size_t axis, double angle) {
  const std::size_t j = (axis + 1) % 3, k = (axis + 2) % 3;
  for (std::size_t column = 0; column < 3; ++column) {
    const double a = m[j][column], b = m[k][column];
    m[j][column] = std::cos(angle) * a - std::sin(angle) * b;
    m[k][column] = std::sin(angle) * a + std::cos(angle) * b;
  }
}

/// The numbers of a block of blocks_of(), as changes of the reference's scene.
std::vector<Change> changes(const reference::Scene& scene, const std::string& name) {
  std::vector<Change> list;
  for (std::size_t i = 0; i < 3 * scene.meshes[0].positions.size() && name == "positions"; ++i)
    list.emplace_back([=](reference::Scene& s, double x) { s.meshes[0].positions[i / 3][i % 3] += x; });
  for (std::size_t i = 0; i < 2 * scene.meshes[0].texcoords.size() && name == "texcoords"; ++i) {
    list.emplace_back([=](reference::Scene& s, double x) {
      reference::Vec2d& uv = s.meshes[0].texcoords[i / 2];
      (i % 2 == 0 ? uv.x : uv.y) += x;
    });
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (name == "rotation")
      list.emplace_back([=](reference::Scene& s, double x) { turn(s.meshes[0].transform, axis, x); });
    if (name == "translation")
      list.emplace_back([=](reference::Scene& s, double x) { s.meshes[0].transform[axis][3] += x; });
    if (name == "camera rotation")
      list.emplace_back([=](reference::Scene& s, double x) { turn(s.camera.view, axis, x); });
    if (name == "camera translation")
      list.emplace_back([=](reference::Scene& s, double x) { s.camera.view[axis][3] += x; });
  }
  if (name == "fov") list.emplace_back([](reference::Scene& s, double x) { s.camera.fov_y_degrees += x; });
  if (name == "sigma") list.emplace_back([](reference::Scene& s, double x) { s.smoothing.sigma += x; });
  if (name == "gamma") list.emplace_back([](reference::Scene& s, double x) { s.smoothing.gamma += x; });
  if (name == "alpha") list.emplace_back([](reference::Scene& s, double x) { s.smoothing.alpha += x; });
  return list;
}

double weighed(const reference::Image& image, const Image& grad) {
  double sum = 0;
  for (std::size_t i = 0; i < image.rgba.size(); ++i)
    sum += image.rgba[i] * static_cast<double>(grad.pixels[i / 4][static_cast<int>(i % 4)]);
  return sum;
}

/// Nothing where the image has a kink: there a difference is no derivative.
Image grad_off_kinks(const reference::Scene& scene) {
  Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
  const Delicate delicate = delicate_pixels(scene, 1e-4);
  for (std::size_t i = 0; i < grad.pixels.size(); ++i) {
    if (delicate.kink[i]) grad.pixels[i] = glm::vec4(0);
  }
  return grad;
}

void check_against_reference(Attribute attribute, const Scene& scene) {
  CAPTURE(to_string(attribute));
  CAPTURE(to_string(scene.smoothing.composition));
  constexpr double k_tolerance = 1e-3, k_step = 1e-5;
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  renderer.forward();
  AttributeImages images(renderer.device(), attribute);
  images.forward(renderer);
  const reference::Scene exact = to_reference(scene);
  const CornerValue value = corner_value(attribute);
  const reference::Image expected = reference_image(exact, value), found = to_reference(images.image());
  double worst = 0;
  for (std::size_t i = 0; i < expected.rgba.size(); ++i)
    worst = std::max(worst, std::abs(found.rgba[i] - expected.rgba[i]));
  CHECK(worst < 1e-4);

  const Image grad = grad_off_kinks(exact);
  int compared = 0;
  for (Block block : blocks_of(images.backward(std::span(&grad, 1)))) {
    const std::vector<Change> list = changes(exact, block.name);
    for (const Change& change : list) {
      reference::Scene more = exact, less = exact;
      const double step = is_sensitivity(block.name) ? 0.1 * k_step : k_step;
      change(more, step);
      change(less, -step);
      block.expected.push_back(
          (weighed(reference_image(more, value), grad) - weighed(reference_image(less, value), grad)) /
          (2 * step));
    }
    if (list.empty()) continue;
    ++compared;
    const double error = block_error(block, k_tolerance);
    CHECK_MESSAGE(error < (is_sensitivity(block.name) ? 10 : 1) * k_tolerance, block.name << ": " << error);
    if (block.name == "positions") CHECK(norm(block.expected) > 1e-2);
  }
  CHECK(compared >= 8);
}

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("attribute images: values and gradients of the reference, noise on triangles") {
    for (const Attribute attribute : k_all) {
      for (const Composition composition : {Composition::barrier, Composition::joint}) {
        if (test::is_reduced() && (attribute != Attribute::depth || composition == Composition::joint))
          continue;
        check_against_reference(attribute, soup_scene(reduced(13, 7), reduced(11, 6), composition));
      }
    }
  }

  TEST_CASE("attribute images: through the near plane, and of a camera without perspective") {
    if (test::is_reduced()) return;
    for (const Attribute attribute : {Attribute::depth, Attribute::normal}) {
      const Scene soup = soup_scene(13, 11, Composition::joint);
      Scene cut = scene_cut_open(soup.meshes[0].mesh, 13, 11);
      cut.smoothing = soup.smoothing;
      Renderer renderer(open_device());
      renderer.set_scene(cut);
      renderer.forward();
      CHECK(impl_of(renderer).frame.clips == 1);
      check_against_reference(attribute, cut);
      Scene orthographic = soup;
      orthographic.camera.orthographic_height = 3.5F;
      check_against_reference(attribute, orthographic);
    }
  }
}

namespace {

/// A cube of eight vertices, no two faces in one plane, blurred by pixels.
Scene blurred_cube(int size) {
  Scene scene = scene_of(welded_cube(), size, size - 3);
  Random random(41);
  for (glm::vec3& p : scene.meshes[0].mesh.positions) p += random.vector(-0.1F, 0.1F);
  scene.smoothing = smoothing_preset("pixel");
  const double scale = 1.5 * 2 / size;
  scene.smoothing.sigma = static_cast<float>(scale * scale);
  return scene;
}

/// Smooth numbers, as of a loss whose target is an image.
Image smooth_grad(int width, int height) {
  Image grad(width, height);
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const float x = static_cast<float>(column) / static_cast<float>(width),
                  y = static_cast<float>(row) / static_cast<float>(height);
      grad.at(column, row) = {std::sin(5 * x + 3 * y), std::cos(4 * x - 6 * y), std::sin(7 * x * y + 1),
                              std::cos(5 * y + 2 * x)};
    }
  }
  return grad;
}

double weighed_image(Renderer& renderer, AttributeImages& images, const Scene& scene, const Image& grad) {
  renderer.set_scene(scene);
  renderer.forward();
  images.forward(renderer);
  return weighed(to_reference(images.image()), grad);
}

using SceneChange = std::function<void(Scene&, float)>;

glm::mat4 turned(const glm::mat4& m, int axis, float angle) {
  glm::vec3 about(0);
  about[axis] = 1;
  glm::mat4 result = glm::rotate(glm::mat4(1), angle, about) * glm::mat4(glm::mat3(m));
  result[3] = m[3];
  return result;
}

/// The numbers of a block of blocks_of(), as changes of a scene by a step of 1.
std::vector<SceneChange> scene_changes(const Scene& scene, const std::string& name) {
  std::vector<SceneChange> list;
  const auto count = static_cast<int>(3 * scene.meshes[0].mesh.positions.size());
  for (int i = 0; i < count && name == "positions"; ++i) {
    list.emplace_back(
        [=](Scene& s, float x) { s.meshes[0].mesh.positions[static_cast<std::size_t>(i / 3)][i % 3] += x; });
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (name == "rotation")
      list.emplace_back(
          [=](Scene& s, float x) { s.meshes[0].transform = turned(s.meshes[0].transform, axis, x); });
    if (name == "translation")
      list.emplace_back([=](Scene& s, float x) { s.meshes[0].transform[3][axis] += x; });
    if (name == "camera rotation")
      list.emplace_back([=](Scene& s, float x) { s.camera.view = turned(s.camera.view, axis, x); });
    if (name == "camera translation")
      list.emplace_back([=](Scene& s, float x) { s.camera.view[3][axis] += x; });
  }
  if (name == "sigma") list.emplace_back([](Scene& s, float x) { s.smoothing.sigma *= 1 + 50 * x; });
  return list;
}

void check_by_differences(Attribute attribute, const Scene& scene, float step, double tolerance) {
  CAPTURE(to_string(attribute));
  Renderer renderer(open_device());
  AttributeImages images(renderer.device(), attribute);
  const Image grad = smooth_grad(scene.width, scene.height);
  weighed_image(renderer, images, scene, grad);
  for (Block block : blocks_of(images.backward(std::span(&grad, 1)))) {
    const std::vector<SceneChange> list = scene_changes(scene, block.name);
    for (const SceneChange& change : list) {
      Scene more = scene, less = scene;
      change(more, step);
      change(less, -step);
      const double width = block.name == "sigma" ? more.smoothing.sigma - less.smoothing.sigma : 2 * step;
      block.expected.push_back(
          (weighed_image(renderer, images, more, grad) - weighed_image(renderer, images, less, grad)) /
          width);
    }
    if (list.empty()) continue;
    CHECK(norm(block.expected) > 0);
    const double error = block_error(block, tolerance);
    CHECK_MESSAGE(error < (is_sensitivity(block.name) ? 10 : 1) * tolerance, block.name << ": " << error);
  }
}

}  // namespace

// Hundreds of frames: the simulator sees the kernels in the other cases.
TEST_SUITE("gradient") {
  TEST_CASE("attribute images: every gradient against differences, noise on the pixel") {
    if (test::is_reduced()) return;
    for (const Attribute attribute : {Attribute::depth, Attribute::position, Attribute::normal}) {
      Scene scene = blurred_cube(96);
      scene.smoothing.gamma = 1e-8F;
      check_by_differences(attribute, scene, 1e-4F, 2.5e-3);  // of which rounding makes the most
      scene.smoothing.gamma = 3e-2F;                          // depths mix
      check_by_differences(attribute, scene, 5e-5F, 5e-3);
    }
  }
}

namespace {

/// Two views of two meshes, the second of them with faces in another order.
Renderer two_views(const Device& device, const Smoothing& smoothing) {
  Scene scene = cube_scene(reduced(21, 9), reduced(17, 8));
  scene.meshes.push_back({make_icosphere(0, 0.9F), placed(50.0F, 1.0F, {0.7F, 0.5F, 0.6F})});
  scene.smoothing = smoothing;
  Renderer renderer(device);
  renderer.set_scene(scene);
  const View first = renderer.views().front();
  View second = first;
  second.transforms[0] = placed(80.0F, 0.8F, {0.2F, 0.1F, 0.0F});
  second.camera = orbit_camera(6, 10, 200);
  renderer.set_views(std::vector{first, second});
  renderer.forward();
  return renderer;
}

std::vector<Smoothing> all_smoothings() {
  return {smoothing_preset("pixel"), smoothing_preset("joint_gaussian"), smoothing_preset("gaussian")};
}

double dot_product(const Image& a, const Image& b) { return weighed(to_reference(a), b); }

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("attribute images: depth and normal are those of the auxiliary outputs") {
    const Device device = open_device();
    // With noise on the pixel these are blended where colours jump, not where they do themselves.
    for (const char* preset : {"joint_gaussian", "gaussian"}) {
      Renderer renderer = two_views(device, smoothing_preset(preset));
      AttributeImages depth(device, Attribute::depth), normal(device, Attribute::normal);
      depth.forward(renderer);
      normal.forward(renderer);
      for (std::size_t view = 0; view < 2; ++view) {
        const AuxiliaryOutputs outputs = auxiliary_outputs(renderer, view);
        const Image depths = depth.image(view), normals = normal.image(view);
        int compared = 0;
        for (std::size_t i = 0; i < outputs.depth.size(); ++i) {
          const float seen = depths.pixels[i].w;
          CHECK(seen == doctest::Approx(normals.pixels[i].w).epsilon(1e-5));
          if (seen < 1e-2F) continue;
          ++compared;
          CHECK(depths.pixels[i].x / seen == doctest::Approx(outputs.depth[i]).epsilon(1e-4));
          CHECK(glm::length(glm::normalize(glm::vec3(normals.pixels[i])) - outputs.normal[i]) < 2e-3F);
        }
        CHECK(compared > reduced(20, 4));
      }
    }
  }

  TEST_CASE("attribute images: numbers of the caller's are colours, with their gradients") {
    constexpr std::size_t k_channels = 5;
    const Device device = open_device();
    for (const Smoothing& smoothing : all_smoothings()) {
      Scene scene = scene_of(make_icosphere(0), reduced(21, 9), reduced(17, 8));
      scene.smoothing = smoothing;
      scene.background = glm::vec3(0);
      const std::size_t vertices = scene.meshes[0].mesh.positions.size();
      Random random(7);
      std::vector<float> values;
      for (std::size_t i = 0; i < vertices * k_channels; ++i) values.push_back(random(-2.0F, 3.0F));
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.forward();
      AttributeImages images(device, k_channels, values);
      REQUIRE(images.groups() == 2);
      images.forward(renderer);
      const std::vector<Image> grads{random_image(scene.width, scene.height, -1.0F, 1.0F, 1),
                                     random_image(scene.width, scene.height, -1.0F, 1.0F, 2)};
      const SceneGradient gradient = images.backward(grads);
      double linear = 0, of_weights = 0, seen = 0;
      for (std::size_t i = 0; i < values.size(); ++i)
        linear += static_cast<double>(values[i]) * static_cast<double>(images.grad_values()[i]);
      for (std::size_t group = 0; group < 2; ++group) {
        const Image image = images.image(0, group);
        seen += dot_product(image, grads[group]);
        for (std::size_t i = 0; i < image.pixels.size(); ++i)
          of_weights += static_cast<double>(image.pixels[i].w * grads[group].pixels[i].w);
        for (glm::vec3& color : scene.meshes[0].mesh.vertex_colors) {
          const auto vertex = static_cast<std::size_t>(&color - scene.meshes[0].mesh.vertex_colors.data());
          color = glm::vec3(0);
          for (std::size_t c = 3 * group; c < std::min(k_channels, 3 * group + 3); ++c)
            color[static_cast<int>(c % 3)] = values[vertex * k_channels + c];
        }
        Renderer colors(device);
        colors.set_scene(scene);
        colors.forward();
        const Image expected = colors.image();
        for (std::size_t i = 0; i < expected.pixels.size(); ++i)
          CHECK(glm::vec3(image.pixels[i]) == glm::vec3(expected.pixels[i]));
      }
      CHECK(linear == doctest::Approx(seen - of_weights).epsilon(1e-4));
      CHECK(gradient.meshes[0].positions.size() == vertices);
      CHECK(gradient.meshes[0].colors.empty());
    }
  }

  TEST_CASE("attribute images: views with shapes of their own, and what the renderer moves") {
    const Device device = open_device();
    for (const Attribute attribute : k_all) {
      CAPTURE(to_string(attribute));
      Scene scene = soup_scene(reduced(21, 9), reduced(17, 8), Composition::barrier);
      std::vector<glm::vec3> shapes = scene.meshes[0].mesh.positions, other;
      for (const glm::vec3& p : shapes) other.push_back(0.7F * p + glm::vec3(0.1F, 0, 0));
      shapes.insert(shapes.end(), other.begin(), other.end());
      Renderer renderer(device);
      renderer.set_scene(scene);
      renderer.set_views(std::vector<View>(2, renderer.views().front()));
      renderer.set_shapes(shapes, {});
      renderer.forward();
      AttributeImages images(device, attribute);
      images.forward(renderer);
      const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
      const SceneGradient both = images.backward(std::vector<Image>(2, grad));
      REQUIRE(both.shapes.positions.size() == shapes.size());
      const std::vector<Image> together{images.image(0), images.image(1)};

      renderer.set_views(std::vector{renderer.views().front()});
      for (const std::size_t view : {1U, 0U}) {
        renderer.set_positions(0, std::span(shapes).subspan(view * other.size(), other.size()));
        renderer.forward();
        images.forward(renderer);
        CHECK(images.image().pixels == together[view].pixels);
        const SceneGradient alone = images.backward(std::span(&grad, 1));
        const std::vector<glm::vec3>& expected = alone.meshes[0].positions;
        CHECK(norm(flat(expected)) > 0);
        for (std::size_t i = 0; i < expected.size(); ++i) {
          const glm::vec3 found = both.shapes.positions[view * expected.size() + i];
          CHECK(glm::length(found - expected[i]) < 1e-5F * (1 + glm::length(expected[i])));
        }
        CHECK(both.views[view].transforms[0].rotation == alone.views[0].transforms[0].rotation);
      }
    }
  }

  TEST_CASE("attribute images: the barrier's silhouettes have gradients as far as weights fade") {
    Scene scene = scene_of(make_cube(), reduced(48, 16), reduced(32, 12));
    scene.camera = orbit_camera(5, 20, 30);
    scene.smoothing = smoothing_preset("gaussian");
    scene.smoothing.sigma = 1e-2F;
    const Image weights(scene.width, scene.height, glm::vec4(1, 0, 0, 0));
    Renderer renderer(open_device());
    AttributeImages depths(renderer.device(), Attribute::depth);
    /// The gradient of the sum of depths by the cube's place, against differences over a step of that size.
    const auto error = [&](float step) {
      renderer.set_scene(scene);
      const auto sum = [&](const glm::vec3& place) {
        const View view{scene.camera, {glm::translate(glm::mat4(1), place)}};
        renderer.set_views({&view, 1});
        renderer.forward();
        depths.forward(renderer);
        double total = 0;
        for (const glm::vec4& pixel : depths.image().pixels) total += static_cast<double>(pixel.x);
        return total;
      };
      const glm::vec3 place(0.1F, 0.05F, -0.2F);
      sum(place);
      const glm::dvec3 gradient = depths.backward({&weights, 1}).views[0].transforms[0].translation;
      glm::dvec3 difference;
      for (int axis = 0; axis < 3; ++axis) {
        glm::vec3 there = place, back = place;
        there[axis] += step;
        back[axis] -= step;
        difference[axis] = (sum(there) - sum(back)) / static_cast<double>(there[axis] - back[axis]);
      }
      return glm::length(gradient - difference) / glm::length(difference);
    };
    const double cut = error(0.1F);
    scene.smoothing.blur_radius = 0.5F;  // as far as the background has no weight
    const double faded = error(1e-3F);
    MESSAGE("off by " << cut << " where a step is left at the blur radius, by " << faded << " without");
    CHECK(cut > 1);
    CHECK(faded < 0.05);
  }

  TEST_CASE("attribute images: the same bits again, and nothing that was not asked for") {
    const Device device = open_device();
    Renderer renderer = two_views(device, smoothing_preset("pixel"));
    AttributeImages first(device, Attribute::normal), second(device, Attribute::normal);
    const std::vector<Image> grads(2, random_image(renderer.scene().width, renderer.scene().height, -1, 1));
    first.forward(renderer);
    second.forward(renderer);
    const SceneGradient a = first.backward(grads), b = second.backward(grads);
    CHECK(a.meshes[1].positions == b.meshes[1].positions);
    CHECK(a.views[1].transforms[0].rotation == b.views[1].transforms[0].rotation);
    GradientRequest request{.positions = false, .transform = false, .camera = false};
    renderer.set_gradients(request);
    first.forward(renderer);
    const SceneGradient none = first.backward(grads);
    CHECK(none.meshes[0].positions.empty());
    CHECK(none.views[0].transforms[0].rotation == glm::dvec3(0));
    CHECK(none.sigma == a.sigma);
  }

  TEST_CASE("attribute images: views and smoothing that go together only with each other") {
    const Device device = open_device();
    Renderer renderer(device);
    AttributeImages images(device, Attribute::depth);
    Scene near = soup_scene(8, 6, Composition::barrier), far = near, joint = near, of_pixel = near;
    near.smoothing.gamma = 1e-20F;  // too small for planes as far away as the other's
    far.camera.znear = 1e10F;
    far.camera.zfar = 2e10F;
    joint.smoothing.composition = Composition::joint;
    of_pixel.smoothing = smoothing_preset("pixel", 8, 6);
    for (const Scene* scene : {&near, &far, &near, &joint, &near, &of_pixel, &far, &of_pixel, &joint}) {
      renderer.set_scene(*scene);
      renderer.forward();
      images.forward(renderer);
      AttributeImages fresh(device, Attribute::depth);
      fresh.forward(renderer);
      CHECK(images.image().pixels == fresh.image().pixels);
    }
  }

  TEST_CASE("attribute images: gradients add up") {
    const Device device = open_device();
    Renderer renderer = two_views(device, smoothing_preset("pixel"));
    const std::vector<Image> grads(2, random_image(renderer.scene().width, renderer.scene().height, -1, 1));
    AttributeImages images(device, Attribute::depth);
    images.forward(renderer);
    const SceneGradient of_image = renderer.backward(grads), of_depth = images.backward(grads);
    SceneGradient sum = of_image;
    add(sum, of_depth);
    const glm::vec3 expected = of_image.meshes[1].positions[3] + of_depth.meshes[1].positions[3];
    CHECK(glm::length(sum.meshes[1].positions[3] - expected) <= 1e-6F * glm::length(expected));
    CHECK(sum.meshes[0].colors == of_image.meshes[0].colors);
    CHECK(sum.views[1].camera.view.translation ==
          of_image.views[1].camera.view.translation + of_depth.views[1].camera.view.translation);
    sum = of_depth;
    add(sum, of_image);
    CHECK(sum.meshes[0].colors == of_image.meshes[0].colors);
    sum.views.pop_back();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, add(sum, of_image), "gradient (add)");
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("attribute images: what is not there is said") {
    const Device device = open_device();
    Renderer renderer(device);
    AttributeImages images(device, Attribute::texcoords), numbers(device, 2, {});
    const Image grad(5, 4);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, images.forward(renderer), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, images.image(), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, images.backward(std::span(&grad, 1)), "forward() first");
    renderer.set_scene(cube_scene(5, 4));
    renderer.forward();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, images.forward(renderer), "no texture coordinates");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, numbers.forward(renderer), "got 0, expected 48");
    const std::vector<float> bad{0, NAN};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, numbers.set_values(bad), "values[1]");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, images.set_values(bad), "texcoords");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, AttributeImages(device, 0, {}), "channels");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, AttributeImages(device, std::size_t{1} << 61, {}), "channels");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, AttributeImages(device, static_cast<Attribute>(9)), "got 9");
    AttributeImages depth(device, Attribute::depth);
    depth.forward(renderer);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, depth.image(1), "below 1");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, depth.image(0, 1), "below 1");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, depth.backward({}), "groups x views");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, depth.forward(Renderer(open_device())), "device");
    for (const Attribute attribute : k_all) CHECK(parse_attribute(to_string(attribute), "x") == attribute);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, parse_attribute("deep", "x"), "depth, position");
  }
}

}  // namespace attribute_images_test
