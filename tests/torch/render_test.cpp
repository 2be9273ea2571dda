// The operator against the double-precision reference renderer, and what it does with graphs and wrong input.
#include "torch/render.hpp"

#include <doctest/doctest.h>
#include <torch/torch.h>

#include <functional>
#include <map>

#include "check/comparison.hpp"
#include "pipeline/scenes.hpp"
#include "reference/finite_difference.hpp"
#include "reference/renderer.hpp"
#include "torch/errors.hpp"

namespace dpr::test {
namespace {

using pipeline::Random;

/// The operator's tensors, two shapes seen in two views.
struct Inputs {
  at::Tensor vertices, colors, views, intrinsics, background;

  std::vector<at::Tensor*> all() { return {&vertices, &colors, &views, &intrinsics, &background}; }
};

constexpr int k_width = 14, k_height = 11;
constexpr std::int64_t k_views = 2;

at::Tensor to_tensor(const std::vector<glm::vec3>& values) {
  at::Tensor tensor = torch::empty({1, static_cast<std::int64_t>(values.size()), 3});
  std::memcpy(tensor.data_ptr<float>(), values.data(), values.size() * sizeof(glm::vec3));
  return tensor;
}

at::Tensor random_like(const at::Tensor& tensor, float low, float high, unsigned seed) {
  Random random(seed);
  at::Tensor result = torch::empty_like(tensor);
  float* values = result.data_ptr<float>();
  for (std::int64_t i = 0; i < result.numel(); ++i) values[i] = random(low, high);
  return result;
}

Inputs make_inputs(bool face_colors = false) {
  const Mesh mesh = make_icosphere(0, 0.8F);
  Inputs in;
  in.vertices = to_tensor(mesh.positions).repeat({k_views, 1, 1});
  in.vertices += random_like(in.vertices, -0.1F, 0.1F, 1);
  const auto colors = static_cast<std::int64_t>(face_colors ? mesh.faces.size() : mesh.positions.size());
  in.colors = random_like(torch::empty({k_views, colors, 3}), 0.1F, 0.9F, 2);
  in.views = torch::empty({k_views, 4, 4});
  for (int v = 0; v < k_views; ++v) {
    const glm::mat4 view = orbit_camera(4.3F, 24.0F, 37.0F + 80.0F * static_cast<float>(v)).view;
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) in.views[v][row][column] = view[column][row];
    }
  }
  in.intrinsics = torch::tensor({19.0F, 20.0F, 7.2F, 5.4F}).repeat({k_views, 1});
  in.background = torch::tensor({0.2F, 0.5F, 0.3F});
  return in;
}

Smoothing smoothing_for_tests(const char* preset) {
  Smoothing smoothing = smoothing_preset(preset);
  smoothing.sigma = 2e-3F;
  smoothing.gamma = 3e-2F;
  smoothing.background_depth = 0.6F;
  return smoothing;
}

c10::intrusive_ptr<torch_op::BatchRenderer> make_renderer(const Smoothing& smoothing) {
  auto renderer = c10::make_intrusive<torch_op::BatchRenderer>(make_icosphere(0).faces, k_width, k_height,
                                                               smoothing, open_device());
  renderer->set("zfar", 20);
  return renderer;
}

at::Tensor render(const c10::intrusive_ptr<torch_op::BatchRenderer>& renderer, const Inputs& in) {
  return torch_op::render(renderer, in.vertices, in.colors, in.views, in.intrinsics, in.background);
}

/// The scene of a view, in double precision.
reference::Scene reference_scene(const std::vector<std::vector<double>>& values, const Smoothing& smoothing,
                                 std::size_t view, bool face_colors) {
  const auto vector = [&](std::size_t tensor, std::size_t index) {
    const double* v = values[tensor].data() + 3 * index;
    return reference::Vec3d{v[0], v[1], v[2]};
  };
  reference::Scene scene;
  scene.width = k_width;
  scene.height = k_height;
  scene.smoothing = pipeline::to_reference(smoothing);
  reference::Mesh mesh;
  const std::size_t vertices = values[0].size() / 3 / k_views, colors = values[1].size() / 3 / k_views;
  for (std::size_t i = 0; i < vertices; ++i) mesh.positions.push_back(vector(0, view * vertices + i));
  for (std::size_t i = 0; i < colors; ++i) {
    (face_colors ? mesh.face_colors : mesh.vertex_colors).push_back(vector(1, view * colors + i));
  }
  for (const glm::uvec3& face : make_icosphere(0).faces) mesh.faces.push_back({face.x, face.y, face.z});
  scene.meshes.push_back(mesh);
  for (std::size_t i = 0; i < 16; ++i) scene.camera.view[i / 4][i % 4] = values[2][16 * view + i];
  const std::size_t numbers = values[3].size() / k_views;
  const double* k = values[3].data() + numbers * view;
  if (numbers == 1) {
    scene.camera.orthographic_height = k[0];
  } else {
    scene.camera.intrinsics = {k[0], k[1], k[2], k[3]};
  }
  if (numbers == 9) scene.camera.distortion = {k[4], k[5], k[6], k[7], k[8]};
  scene.camera.znear = 1;
  scene.camera.zfar = 20;
  scene.background = vector(4, 0);
  if (values.size() > 5) {
    scene.lights =
        displaced(zero_like(pipeline::to_reference(pipeline::every_light(Shading::blinn))), values[5]);
  }
  return scene;
}

std::vector<double> to_doubles(const at::Tensor& tensor) {
  const at::Tensor values = tensor.to(torch::kDouble).contiguous();
  return {values.data_ptr<double>(), values.data_ptr<double>() + values.numel()};
}

/// Sum over the pixels of weight times value, of all views.
double reference_loss(const std::vector<std::vector<double>>& values, const std::vector<double>& weights,
                      const Smoothing& smoothing, bool face_colors) {
  double loss = 0;
  auto weight = weights.begin();
  for (std::size_t view = 0; view < k_views; ++view) {
    for (const double value : reference::render(reference_scene(values, smoothing, view, face_colors)).rgba) {
      loss += *weight++ * value;
    }
  }
  return loss;
}

void check_against_finite_differences(const char* preset, bool face_colors,
                                      const std::vector<float>& intrinsics = {}) {
  constexpr double k_step = 1e-5, k_tolerance = 1e-3;
  const Smoothing smoothing = smoothing_for_tests(preset);
  Inputs in = make_inputs(face_colors);
  if (!intrinsics.empty()) in.intrinsics = torch::tensor(intrinsics).repeat({k_views, 1});
  std::vector<std::vector<double>> values;
  for (at::Tensor* tensor : in.all()) {
    values.push_back(to_doubles(*tensor));
    tensor->requires_grad_();
  }
  const at::Tensor image = render(make_renderer(smoothing), in);
  REQUIRE(image.sizes() == at::IntArrayRef({k_views, k_height, k_width, 4}));
  const at::Tensor weights = random_like(image.detach(), -1.0F, 1.0F, 3);
  const double loss = reference_loss(values, to_doubles(weights), smoothing, face_colors);
  CHECK((image * weights).sum().item<float>() == doctest::Approx(loss).epsilon(1e-4));
  (image * weights).sum().backward();
  for (std::size_t t = 0; t < values.size(); ++t) {
    std::vector<double> at = values[t], found = to_doubles(in.all()[t]->grad());
    if (t == 2) {  // the last rows are no parameters
      for (const std::size_t i : {12, 13, 14, 15, 28, 29, 30, 31}) CHECK(found[i] == 0.0);
    }
    const auto f = [&](const std::vector<double>& x) {
      std::vector<std::vector<double>> moved = values;
      moved[t] = x;
      return reference_loss(moved, to_doubles(weights), smoothing, face_colors);
    };
    const reference::GradientCheck check = reference::check_gradient(f, at, found, k_step, k_tolerance);
    CHECK_MESSAGE(check.passed, preset << ", tensor " << t << ", element " << check.worst << ": "
                                       << check.found << ", not " << check.expected);
    // The check can fail.
    found[check.worst] +=
        2 * k_tolerance *
        std::abs(*std::ranges::max_element(found, {}, [](double v) { return std::abs(v); }));
    CHECK_FALSE(reference::check_gradient(f, at, found, k_step, k_tolerance / 4).passed);
  }
}

torch_op::LightTensors to_tensors(Lights lights) {
  torch_op::LightTensors tensors;
  std::map<std::string, std::vector<float>> numbers;
  const auto append = [&](std::string_view key, auto& value) {
    visit_numbers(key, value,
                  [&](std::string_view, float number) { numbers[std::string(key)].push_back(number); });
  };
  append("ambient", lights.ambient);
  for (glm::vec3& color : lights.harmonics) append("harmonics", color);
  for_each_light_kind([&](auto kind) {
    for (auto& light : lights.*kind.lights)
      kind.for_each_member([&](std::string_view, auto member, auto...) { append(kind.key, light.*member); });
  });
  for (const auto& [key, list] : numbers) tensors.insert(key, torch::tensor(list));
  const auto shape = [&](const std::string& key, std::int64_t rows) {
    tensors.insert_or_assign(key, tensors.at(key).reshape({rows, -1}));
  };
  shape("harmonics", k_harmonics);
  for_each_light_kind([&](auto kind) {
    shape(std::string(kind.key), static_cast<std::int64_t>((lights.*kind.lights).size()));
  });
  return tensors;
}

/// With the lights' numbers, in the order of their keys in `order`, as one more tensor. The views are moved
/// rigidly.
void check_lit_against_finite_differences() {
  constexpr double k_step = 1e-5, k_tolerance = 1e-3;
  const Smoothing smoothing = smoothing_for_tests("joint_gaussian");
  const Lights lights = pipeline::every_light(Shading::blinn);
  Inputs in = make_inputs();
  torch_op::LightTensors tensors = to_tensors(lights);
  std::vector<std::vector<double>> values;
  for (at::Tensor* tensor : in.all()) {
    values.push_back(to_doubles(*tensor));
    tensor->requires_grad_();
  }
  values.push_back(pipeline::light_numbers(lights));
  for (const auto& entry : tensors) entry.value().requires_grad_();
  const auto renderer = make_renderer(smoothing);
  renderer->set("shading", "blinn");
  renderer->set("shininess", lights.shininess);
  const at::Tensor image =
      torch_op::render_lit(renderer, in.vertices, in.colors, in.views, in.intrinsics, in.background, tensors);
  const at::Tensor weights = random_like(image.detach(), -1.0F, 1.0F, 3);
  const auto loss_of = [&](const std::vector<std::vector<double>>& at) {
    return reference_loss(at, to_doubles(weights), smoothing, false);
  };
  CHECK((image * weights).sum().item<float>() == doctest::Approx(loss_of(values)).epsilon(1e-4));
  (image * weights).sum().backward();

  std::vector<std::vector<double>> found;
  for (at::Tensor* tensor : in.all()) found.push_back(to_doubles(tensor->grad()));
  found.emplace_back();
  for (const char* key : {"ambient", "harmonics", "point", "directional", "spot"}) {
    for (const double number : to_doubles(tensors.at(key).grad())) found.back().push_back(number);
  }
  for (const std::size_t t :
       {std::size_t{0}, std::size_t{1}, std::size_t{3}, std::size_t{4}, std::size_t{5}}) {
    const auto f = [&](const std::vector<double>& x) {
      std::vector<std::vector<double>> moved = values;
      moved[t] = x;
      return loss_of(moved);
    };
    const reference::GradientCheck check =
        reference::check_gradient(f, values[t], found[t], k_step, k_tolerance);
    CHECK_MESSAGE(check.passed, "lit, tensor " << t << ", element " << check.worst << ": " << check.found
                                               << ", not " << check.expected);
    found[t][check.worst] *= 1.5;
    CHECK_FALSE(reference::check_gradient(f, values[t], found[t], k_step, k_tolerance / 4).passed);
  }
  // A turn about an axis through the camera: M <- exp([r]x) A, and a shift.
  const auto moved_view = [&](const std::vector<double>& x) {
    std::vector<std::vector<double>> moved = values;
    double* m = moved[2].data();
    for (std::size_t column = 0; column < 3; ++column) {
      const reference::Vec3d a{m[column], m[4 + column], m[8 + column]};
      const reference::Vec3d turned = a + cross(reference::Vec3d{x[0], x[1], x[2]}, a);
      for (std::size_t row = 0; row < 3; ++row) m[4 * row + column] = turned[row];
    }
    for (std::size_t row = 0; row < 3; ++row) m[4 * row + 3] += x[3 + row];
    return moved;
  };
  std::vector<double> along(6);
  for (std::size_t k = 0; k < 6; ++k) {
    std::vector<double> unit(6);
    unit[k] = 1;
    const std::vector<double> there = moved_view(unit)[2];
    for (std::size_t i = 0; i < there.size(); ++i) along[k] += found[2][i] * (there[i] - values[2][i]);
  }
  const auto f = [&](const std::vector<double>& x) { return loss_of(moved_view(x)); };
  const reference::GradientCheck check =
      reference::check_gradient(f, std::vector<double>(6), along, k_step, k_tolerance);
  CHECK_MESSAGE(check.passed,
                "lit, views, element " << check.worst << ": " << check.found << ", not " << check.expected);
}

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const c10::Error& error) {
    return error.what_without_backtrace();
  }
  return "no c10::Error";
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_SUITE("gradient") {
  TEST_CASE("operator: all five gradients agree with differences in double precision") {
    check_against_finite_differences("joint_gaussian", /*face_colors*/ false);
    check_against_finite_differences("softras", /*face_colors*/ true);
    check_against_finite_differences("joint_gaussian", /*face_colors*/ false,
                                     {19, 20, 7.2F, 5.4F, -0.2F, 0.05F, 0.01F, -0.02F, 0.03F});
    check_against_finite_differences("joint_gaussian", /*face_colors*/ false, {2.6F});
  }

  TEST_CASE("operator: every number of every kind of light, and shapes and views in their light") {
    check_lit_against_finite_differences();
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("operator: one shape in several views gives the sum of what separate shapes give") {
    const auto renderer = make_renderer(smoothing_for_tests("joint_gaussian"));
    Inputs one = make_inputs();
    one.vertices = one.vertices.slice(0, 0, 1).clone();
    one.colors = one.colors.slice(0, 0, 1).clone();
    Inputs several = one;
    several.vertices = one.vertices.repeat({k_views, 1, 1});
    several.colors = one.colors.repeat({k_views, 1, 1});
    at::Tensor images[2];
    for (Inputs* in : {&one, &several}) {
      in->vertices.requires_grad_();
      in->colors.requires_grad_();
      at::Tensor& image = images[in == &several];
      image = render(renderer, *in);
      (image * random_like(image.detach(), -1, 1, 4)).sum().backward();
    }
    CHECK(images[0].equal(images[1]));
    CHECK(one.vertices.grad().allclose(several.vertices.grad().sum(0, true), 1e-4, 1e-4));
    CHECK(one.colors.grad().allclose(several.colors.grad().sum(0, true), 1e-4, 1e-4));
    // The views' matrices need every view's vertices by themselves; the rest does not change.
    const at::Tensor grad = one.vertices.grad().clone();
    for (Inputs* in : {&one, &several}) {
      in->vertices.mutable_grad() = at::Tensor();
      in->views = in->views.detach().clone().requires_grad_();
      const at::Tensor image = render(renderer, *in);
      (image * random_like(image.detach(), -1, 1, 4)).sum().backward();
    }
    CHECK(one.vertices.grad().allclose(grad, 1e-4, 1e-4));
    CHECK(one.views.grad().allclose(several.views.grad(), 1e-4, 1e-4));
  }

  TEST_CASE("operator: a batch of one view has the gradients of that view in a batch of several") {
    const auto renderer = make_renderer(smoothing_for_tests("joint_gaussian"));
    Inputs several = make_inputs(), one = make_inputs();
    for (at::Tensor* tensor : {&one.vertices, &one.colors, &one.views, &one.intrinsics})
      *tensor = tensor->slice(0, 0, 1).clone();
    for (Inputs* in : {&one, &several}) {
      for (at::Tensor* tensor : in->all()) tensor->requires_grad_();
      const at::Tensor image = render(renderer, *in).select(0, 0);
      (image * random_like(image.detach(), -1, 1, 4)).sum().backward();
    }
    for (std::size_t t = 0; t < 4; ++t) {
      CAPTURE(t);
      CHECK(one.all()[t]->grad()[0].allclose(several.all()[t]->grad()[0], 1e-4, 1e-4));
      CHECK(several.all()[t]->grad()[1].abs().max().item<float>() == 0);
    }
    CHECK(one.background.grad().allclose(several.background.grad(), 1e-4, 1e-4));
  }

  TEST_CASE("operator: graphs in flight do not disturb each other") {
    const auto renderer = make_renderer(smoothing_for_tests("softras"));
    Inputs in = make_inputs(), other = make_inputs();
    other.vertices *= 0.5;
    in.vertices.requires_grad_();
    other.vertices.requires_grad_();
    render(renderer, in).square().sum().backward();
    const at::Tensor alone = in.vertices.grad().clone();
    in.vertices.mutable_grad() = at::Tensor();
    const at::Tensor first = render(renderer, in), second = render(renderer, other);
    second.square().sum().backward();
    first.square().sum().backward({}, /*keep_graph=*/true);
    CHECK(in.vertices.grad().equal(alone));
    first.square().sum().backward();
    CHECK(in.vertices.grad().equal(alone + alone));
    // Another topology with the same renderer is a matter of colours.
    CHECK(render(renderer, make_inputs(/*face_colors=*/true)).isfinite().all().item<bool>());
    CHECK(renderer->seconds() > 0);
  }

  TEST_CASE("operator: a preset's blur radius follows sigma, as in a scene") {
    Smoothing wide = smoothing_preset("softras");
    *wide.blur_radius *= 5;
    wide.sigma *= 5;
    const auto renderer = make_renderer(smoothing_preset("softras"));
    const Inputs in = make_inputs();
    CHECK_FALSE(render(renderer, in).equal(render(make_renderer(wide), in)));
    renderer->set("sigma", wide.sigma);
    CHECK(render(renderer, in).allclose(render(make_renderer(wide), in), 1e-5, 1e-6));
  }

  TEST_CASE("operator: any value of the smoothing, in any order, as a scene file has it") {
    const auto make = [&](const std::vector<std::pair<std::string, at::IValue>>& values) {
      const auto renderer = make_renderer(smoothing_preset("gaussian"));
      for (const auto& [name, value] : values) renderer->set(name, value);
      return render(renderer, make_inputs());
    };
    const Smoothing expected = resolve_smoothing(
        {.preset = "softras", .depth_prior = Prior::gaussian, .sigma = 5e-3F, .blur_radius = 0.02F}, k_width,
        k_height);
    const at::Tensor image = render(make_renderer(expected), make_inputs());
    const std::vector<std::pair<std::string, at::IValue>> values{
        {"blur_radius", 0.02}, {"sigma", 5e-3}, {"depth_prior", "gaussian"}, {"preset", "softras"}};
    CHECK(make(values).equal(image));
    CHECK(make({values.rbegin(), values.rend()}).equal(image));
    CHECK_FALSE(make({{"preset", "softras"}}).equal(image));
  }

  TEST_CASE("operator: what is not contiguous, and what needs no gradient") {
    const auto renderer = make_renderer(smoothing_for_tests("joint_gaussian"));
    const Inputs in = make_inputs();
    const at::Tensor image = render(renderer, in);
    CHECK_FALSE(image.requires_grad());
    Inputs strided = in;
    strided.vertices = in.vertices.transpose(0, 2).contiguous().transpose(0, 2);
    strided.views = in.views.transpose(1, 2).contiguous().transpose(1, 2);
    REQUIRE_FALSE(strided.vertices.is_contiguous());
    CHECK(render(renderer, strided).equal(image));
    // Also for the gradients of the views, which need every view's vertices.
    strided.vertices = strided.vertices.slice(0, 0, 1);
    Inputs plain = strided;
    plain.views = in.views.clone();
    for (Inputs* each : {&strided, &plain}) {
      each->views.requires_grad_();
      render(renderer, *each).square().sum().backward();
    }
    CHECK(strided.views.grad().equal(plain.views.grad()));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("operator: lights of an unknown kind or shape, and none after some") {
    const auto renderer = make_renderer(smoothing_for_tests("joint_gaussian"));
    const Inputs in = make_inputs();
    const at::Tensor unlit = render(renderer, in);
    const auto lit = [&](const char* key, const at::Tensor& tensor) {
      torch_op::LightTensors lights;
      lights.insert(key, tensor);
      return torch_op::render_lit(renderer, in.vertices, in.colors, in.views, in.intrinsics, in.background,
                                  lights);
    };
    const auto message = [&](const char* key, const at::Tensor& tensor) {
      return message_of([&] { lit(key, tensor); });
    };
    CHECK_FALSE(lit("point", torch::ones({1, 9})).equal(unlit));
    CHECK(render(renderer, in).equal(unlit));
    CHECK(lit("ambient", torch::ones({3})).allclose(unlit, 1e-6, 1e-6));
    CHECK(has(message("lamp", torch::ones({1, 9})), "ambient, harmonics, point, directional or spot"));
    CHECK(has(message("spot", torch::ones({1, 9})), "[light, 14]"));
    CHECK(has(message("directional", torch::zeros({1, 9})), "direction (lights.directional[0])"));
    CHECK(has(message_of([&] { renderer->set("shading", "matt"); }), "flat, phong, gouraud or blinn"));
    CHECK(has(message_of([&] { renderer->set("shininess", 0); }), "shininess"));
  }

  TEST_CASE("operator: wrong tensors are torch errors with our words, and the renderer goes on") {
    const auto renderer = make_renderer(smoothing_for_tests("joint_gaussian"));
    const Inputs good = make_inputs();
    const at::Tensor expected = render(renderer, good);
    const auto message = [&](const std::function<void(Inputs&)>& spoil) {
      return message_of([&] {
        Inputs in = good;
        spoil(in);
        render(renderer, in);
      });
    };
    CHECK(has(message([](Inputs& in) { in.vertices = in.vertices.to(torch::kDouble); }),
              "vertices (dpr::render)"));
    CHECK(has(message([](Inputs& in) { in.vertices = in.vertices.squeeze(0)[0]; }), "[12, 3]"));
    CHECK(has(message([](Inputs& in) {
                in.vertices = in.vertices.repeat({2, 1, 1});
              }),
              "1 or 2, one a view"));
    CHECK(has(message([](Inputs& in) { in.vertices = in.vertices.slice(1, 0, 5); }), "colors (dpr::render)"));
    CHECK(has(message([](Inputs& in) {
                in.vertices = in.vertices.slice(1, 0, 5);
                in.colors = in.colors.slice(1, 0, 5);
              }),
              "faces"));
    CHECK(has(message([](Inputs& in) { in.vertices = in.vertices * NAN; }), "finite"));
    CHECK(has(message([](Inputs& in) { in.colors = in.colors.slice(1, 0, 7); }),
              "one a vertex, or 20, one a face"));
    CHECK(has(message([](Inputs& in) { in.views = in.views * 0.0; }), "view"));
    CHECK(has(message([](Inputs& in) { in.views = in.views.slice(0, 0, 0); }), "at least one view"));
    CHECK(has(message([](Inputs& in) { in.intrinsics = in.intrinsics * -1.0; }), "fx"));
    CHECK(has(message([](Inputs& in) { in.intrinsics = in.intrinsics.slice(1, 0, 3); }), "4 numbers a view"));
    CHECK(has(message([](Inputs& in) { in.background = in.background.to(torch::kInt); }), "CPUIntType"));
    CHECK(has(message_of([&] { renderer->set("sigma", -1); }), "sigma"));
    CHECK(has(message_of([&] { renderer->set("samples", 2.5); }), "a whole number"));
    CHECK(has(message_of([&] { renderer->set("nothing", 1); }), "name (dpr::Renderer.set)"));
    CHECK(has(message_of([&] { renderer->set("depth_prior", "normal"); }), "gaussian, cauchy, logistic"));
    CHECK(has(message_of([&] { renderer->set("znear", "close"); }), "a number"));
    CHECK(has(message_of([&] { renderer->set("cull", "both"); }), "none, back or front"));
    CHECK(has(message_of([&] { renderer->set("cull", 1); }), "none, back or front"));
    const at::Tensor faces = torch::tensor({{0, 1, 2}});
    const auto make = [&](const at::Tensor& f, std::int64_t size, const char* preset) {
      return message_of([&] { torch_op::BatchRenderer(f, size, size, preset, ""); });
    };
    CHECK(has(make(faces.to(torch::kFloat), 8, "softras"), "faces (dpr::Renderer)"));
    CHECK(has(make(-faces, 8, "softras"), "indices from 0 on"));
    CHECK(has(make(faces, 0, "softras"), "width (dpr::Renderer)"));
    CHECK(has(make(faces, 8, "hard"), "preset"));
    CHECK(render(renderer, good).equal(expected));
    Inputs twice = good;
    twice.vertices = good.vertices.clone().requires_grad_();
    const at::Tensor loss = render(renderer, twice).square().sum();
    CHECK(has(
        message_of([&] { torch::autograd::grad({loss}, {twice.vertices}, {}, {}, /*create_graph=*/true); }),
        "no second derivatives"));
  }

  TEST_CASE("operator: a torch error holds the library's own") {
    Inputs in = make_inputs();
    in.vertices = in.vertices * NAN;
    try {
      render(make_renderer(smoothing_for_tests("joint_gaussian")), in);
      FAIL("no error");
    } catch (const torch_op::RenderError& error) {
      CHECK_THROWS_AS(std::rethrow_exception(error.original()), InvalidArgument);
    }
  }
}

}  // namespace dpr::test
