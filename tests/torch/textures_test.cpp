// The operator's textures, materials and lights of views: the images and gradients of the library's renderer.
#include <doctest/doctest.h>
#include <torch/torch.h>

#include <cstring>
#include <vector>

#include "pipeline/scenes.hpp"
#include "torch/render.hpp"

namespace dpr::test {
namespace {

constexpr int k_side = 18;
constexpr std::int64_t k_batch = 2;

template <typename Vector>
at::Tensor tensor_of(const std::vector<Vector>& values, at::IntArrayRef shape = {}) {
  at::Tensor tensor = torch::empty({static_cast<std::int64_t>(values.size()), Vector::length()});
  std::memcpy(tensor.data_ptr<float>(), values.data(), values.size() * sizeof(Vector));
  return (shape.empty() ? tensor : tensor.view(shape)).requires_grad_();
}

at::Tensor tensor_of(const std::vector<glm::uvec3>& indices) {
  at::Tensor tensor = torch::empty({static_cast<std::int64_t>(indices.size()), 3}, torch::kLong);
  std::int64_t* next = tensor.data_ptr<std::int64_t>();
  for (const glm::uvec3& face : indices)
    for (int corner = 0; corner < 3; ++corner) *next++ = face[corner];
  return tensor;
}

at::Tensor tensor_of(const std::vector<std::uint32_t>& indices) {
  std::vector<std::int64_t> values;
  for (const std::uint32_t index : indices)
    values.push_back(index == k_no_texture ? std::int64_t{-1} : std::int64_t{index});
  return torch::tensor(values, torch::kLong);
}

/// Two textures, faces without one, two materials, and two lights.
Scene scene_with_surface(Filter first, Filter second, bool is_lit) {
  using namespace pipeline;
  Scene scene =
      textured_scene(make_icosphere(0, 1.2F), random_texture(7, 5, Wrap::mirror, first), k_side, k_side);
  Mesh& mesh = scene.meshes[0].mesh;
  mesh.textures.push_back(random_texture(3, 9, Wrap::clamp, second, 11));
  for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
    mesh.face_textures.push_back(f % 3 == 2 ? k_no_texture : f % 3);
    mesh.face_materials.push_back(f / 3 % 2);
  }
  mesh.materials = {{{0.9F, 0.4F, 0.2F}, 5.0F}, {{0.3F, 0.8F, 0.6F}, 9.0F}};
  scene.meshes[0].transform = glm::mat4(1.0F);
  scene.camera.intrinsics = Intrinsics{24, 25, 9.2F, 8.7F};
  scene.background = {0.2F, 0.1F, 0.4F};
  if (is_lit) scene.lights = two_lights(Shading::blinn);
  scene.gradients.lights = is_lit;
  scene.gradients.materials = true;
  return scene;
}

std::vector<View> views_of(const Scene& scene) {
  std::vector<View> views(k_batch, {scene.camera, {glm::mat4(1.0F)}});
  views[1].camera.view = glm::translate(views[1].camera.view, glm::vec3(0.1F, -0.2F, 0.3F));
  return views;
}

/// What the operator takes of a scene, each a leaf that needs a gradient.
struct Leaves {
  at::Tensor positions, colors, specular, shininess, texcoords;
  torch_op::TextureTensors textures;
};

Leaves leaves_of(const Scene& scene) {
  const Mesh& mesh = scene.meshes[0].mesh;
  Leaves leaves;
  leaves.positions = tensor_of(mesh.positions);
  leaves.colors = tensor_of(mesh.vertex_colors);
  leaves.texcoords = tensor_of(mesh.texcoords);
  std::vector<glm::vec3> specular;
  std::vector<float> shininess;
  for (const Material& material : mesh.materials) {
    specular.push_back(material.specular);
    shininess.push_back(*material.shininess);
  }
  leaves.specular = tensor_of(specular);
  leaves.shininess = torch::tensor(shininess).requires_grad_();
  torch_op::TextureTensors& t = leaves.textures;
  for (const Texture& texture : mesh.textures) {
    t.textures.push_back(tensor_of(texture.texels, {texture.height, texture.width, 3}));
    t.wraps.push_back(texture.wrap == Wrap::mirror ? "mirror" : "clamp");
    t.filters.push_back(texture.filter == Filter::nearest    ? "nearest"
                        : texture.filter == Filter::bilinear ? "bilinear"
                                                             : "trilinear");
  }
  const std::pair<const char*, at::Tensor> surface[]{{"texcoords", leaves.texcoords},
                                                     {"face_texcoords", tensor_of(mesh.face_texcoords)},
                                                     {"face_textures", tensor_of(mesh.face_textures)},
                                                     {"specular", leaves.specular},
                                                     {"shininess", leaves.shininess},
                                                     {"face_materials", tensor_of(mesh.face_materials)}};
  for (const auto& [name, tensor] : surface) t.surface.insert(name, tensor);
  return leaves;
}

/// [light, 9]
at::Tensor point_tensor(const Lights& lights) {
  std::vector<glm::vec3> numbers;
  for (const PointLight& light : lights.point)
    numbers.insert(numbers.end(), {light.position, light.diffuse, light.specular});
  return tensor_of(numbers, {static_cast<std::int64_t>(lights.point.size()), 9});
}

torch_op::LightTensors lights_of(const Scene& scene) {
  torch_op::LightTensors tensors;
  if (!scene.lights) return tensors;
  tensors.insert("ambient", tensor_of(std::vector{scene.lights->ambient}, {3}));
  tensors.insert("point", point_tensor(*scene.lights));
  return tensors;
}

c10::intrusive_ptr<torch_op::BatchRenderer> renderer_of(const Scene& scene) {
  auto renderer = c10::make_intrusive<torch_op::BatchRenderer>(scene.meshes[0].mesh.faces, k_side, k_side,
                                                               scene.smoothing, open_device());
  renderer->set("znear", scene.camera.znear);
  renderer->set("zfar", scene.camera.zfar);
  renderer->set("shading", "blinn");
  if (scene.lights) renderer->set("shininess", scene.lights->shininess);
  return renderer;
}

/// [view, 4, 4] and [view, 4]
std::pair<at::Tensor, at::Tensor> cameras_of(const std::vector<View>& views) {
  const auto count = static_cast<std::int64_t>(views.size());
  at::Tensor matrices = torch::empty({count, 4, 4}), intrinsics = torch::empty({count, 4});
  for (std::int64_t v = 0; v < count; ++v) {
    const Camera& camera = views[static_cast<std::size_t>(v)].camera;
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column) matrices[v][row][column] = camera.view[column][row];
    const Intrinsics& k = *camera.intrinsics;
    intrinsics[v] = torch::tensor({k.fx, k.fy, k.cx, k.cy});
  }
  return {matrices, intrinsics};
}

at::Tensor render_leaves(const Scene& scene, const std::vector<View>& views, const Leaves& leaves,
                         const torch_op::LightTensors& lights) {
  const auto [matrices, intrinsics] = cameras_of(views);
  return torch_op::render_textured(renderer_of(scene), leaves.positions.unsqueeze(0),
                                   leaves.colors.unsqueeze(0), matrices, intrinsics,
                                   tensor_of(std::vector{scene.background}, {3}), lights, leaves.textures);
}

/// The images of the library's renderer, and the gradients of their sum weighed by `weights`.
std::pair<at::Tensor, SceneGradient> by_library(const Scene& scene, const std::vector<View>& views,
                                                const at::Tensor& weights) {
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  renderer.set_views(views);
  renderer.forward();
  const auto count = static_cast<std::int64_t>(views.size());
  std::vector<glm::vec4> pixels(static_cast<std::size_t>(count * k_side * k_side));
  renderer.read_pixels(pixels);
  std::vector<glm::vec4> grad(pixels.size());
  std::memcpy(grad.data(), weights.data_ptr<float>(), grad.size() * sizeof(glm::vec4));
  return {tensor_of(pixels, {count, k_side, k_side, 4}).detach(), renderer.backward_pixels(grad)};
}

at::Tensor random_weights() {
  torch::manual_seed(3);
  return torch::rand({k_batch, k_side, k_side, 4}) - 0.5;
}

template <typename Vector>
void check_equal(const at::Tensor& found, const std::vector<Vector>& expected) {
  const at::Tensor tensor = tensor_of(expected).detach();
  CHECK(found.reshape(tensor.sizes()).equal(tensor));
  CHECK(tensor.abs().max().item<float>() > 0);
}

void check_is_library(const Scene& scene) {
  const std::vector<View> views = views_of(scene);
  const at::Tensor weights = random_weights();
  const auto [image, gradient] = by_library(scene, views, weights);
  const Leaves leaves = leaves_of(scene);
  const torch_op::LightTensors lights = lights_of(scene);
  const at::Tensor found = render_leaves(scene, views, leaves, lights);
  CHECK(found.equal(image));
  (found * weights).sum().backward();
  const MeshGradient& expected = gradient.meshes[0];
  check_equal(leaves.positions.grad(), expected.positions);
  check_equal(leaves.colors.grad(), expected.colors);
  check_equal(leaves.texcoords.grad(), expected.texcoords);
  for (std::size_t i = 0; i < expected.textures.size(); ++i)
    check_equal(leaves.textures.textures[i].grad(), expected.textures[i]);
  if (!scene.lights) return;
  check_equal(leaves.specular.grad(), expected.specular);
  CHECK(leaves.shininess.grad().allclose(torch::tensor(expected.shininess, torch::kFloat), 1e-6, 0));
  CHECK(lights.at("ambient").grad().abs().sum().item<float>() > 0);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("operator: textures and materials have the library's images and gradients") {
    check_is_library(scene_with_surface(Filter::trilinear, Filter::nearest, /*is_lit=*/true));
    check_is_library(scene_with_surface(Filter::bilinear, Filter::trilinear, /*is_lit=*/false));
  }

  TEST_CASE("operator: lights of each view are those of a renderer for each") {
    const Scene scene = scene_with_surface(Filter::bilinear, Filter::bilinear, /*is_lit=*/true);
    const std::vector<View> views = views_of(scene);
    std::vector<Scene> scenes(k_batch, scene);
    scenes[1].lights->ambient = {0.1F, 0.6F, 0.2F};
    for (PointLight& light : scenes[1].lights->point) light.position += glm::vec3(-1.5F, 0.5F, 1.0F);
    torch_op::LightTensors lights;
    std::vector<at::Tensor> ambient, point;
    for (const Scene& of_view : scenes) {
      ambient.push_back(tensor_of(std::vector{of_view.lights->ambient}, {3}).detach());
      point.push_back(point_tensor(*of_view.lights).detach());
    }
    lights.insert("ambient", torch::stack(ambient).requires_grad_());
    lights.insert("point", torch::stack(point).requires_grad_());
    const at::Tensor weights = random_weights();
    const Leaves leaves = leaves_of(scene);
    const at::Tensor found = render_leaves(scene, views, leaves, lights);
    (found * weights).sum().backward();
    at::Tensor positions = torch::zeros_like(leaves.positions);
    for (std::int64_t v = 0; v < k_batch; ++v) {
      CAPTURE(v);
      const auto i = static_cast<std::size_t>(v);
      const auto [image, gradient] = by_library(scenes[i], {views[i]}, weights[v].contiguous());
      CHECK(found[v].equal(image[0]));
      const glm::vec3 of_ambient(gradient.ambient), of_position(gradient.lights[1].position);
      check_equal(lights.at("ambient").grad()[v], std::vector{of_ambient});
      check_equal(lights.at("point").grad()[v][1].slice(0, 0, 3), std::vector{of_position});
      positions = positions + tensor_of(gradient.meshes[0].positions).detach();
    }
    CHECK(leaves.positions.grad().allclose(positions, 1e-5, 1e-6));
    CHECK_FALSE(lights.at("ambient").grad()[0].equal(lights.at("ambient").grad()[1]));
  }
}

}  // namespace dpr::test
