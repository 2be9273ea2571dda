// Tensors in, the renderer's launches, tensors out.
#include "torch/batch.hpp"

#include <ATen/ATen.h>
#include <c10/core/GradMode.h>
#include <c10/util/Exception.h>

#include <array>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "scene/light_table.hpp"
#include "torch/errors.hpp"
#include "torch/tensor_rows.hpp"

namespace dpr::torch_op {
namespace {

/// The gradients of the views' own vectors, [view, n, 3], or, if there are none, of those they share, [1, n,
/// 3]: a tensor that owns them, no copy.
at::Tensor adopt(std::vector<glm::vec3>& own, std::vector<glm::vec3>& shared, std::int64_t views) {
  const std::int64_t batch = own.empty() ? 1 : views;
  auto* vectors = new std::vector<glm::vec3>(std::move(own.empty() ? shared : own));
  const auto count = static_cast<std::int64_t>(vectors->size());
  return at::from_blob(
      vectors->data(), {batch, count / batch, 3}, [vectors](void*) { delete vectors; },
      at::TensorOptions(at::kFloat));
}

void require_batch(const at::Tensor& tensor, const char* name, std::int64_t views) {
  if (tensor.size(0) == 1 || tensor.size(0) == views) return;
  throw InvalidArgument(std::string(name) + " (dpr::render)", shape_text(tensor),
                        "1 or " + std::to_string(views) + ", one a view, in the first dimension");
}

// Numbers of a view's projection: the height of an orthographic one, the intrinsics, or these and the
// coefficients of the lens.
constexpr std::int64_t k_orthographic = 1, k_pinhole = 4, k_lens = 9;

void require_projection(const at::Tensor& intrinsics) {
  const std::int64_t numbers = intrinsics.size(1);
  if (numbers == k_orthographic || numbers == k_pinhole || numbers == k_lens) return;
  throw InvalidArgument("intrinsics (dpr::render)", shape_text(intrinsics),
                        "4 numbers a view, 9 with distortion, or 1 of an orthographic one");
}

void set_projection(Camera& camera, const at::Tensor& numbers) {
  const float* const k = numbers.data_ptr<float>();
  if (numbers.size(0) == k_orthographic) {
    camera.orthographic_height = k[0];
    return;
  }
  camera.intrinsics = Intrinsics{k[0], k[1], k[2], k[3]};
  if (numbers.size(0) == k_lens) camera.distortion = Distortion{k[4], k[5], k[6], k[7], k[8]};
}

/// The gradients of what set_projection() took, [view, number].
at::Tensor projection_gradients(const Camera& model, const SceneGradient& gradient) {
  std::vector<float> values;
  for (const ViewGradient& view : gradient.views) {
    const CameraGradient& camera = view.camera;
    const auto add = [&](const auto& list) {
      for (const double k : list) values.push_back(static_cast<float>(k));
    };
    if (model.orthographic_height) {
      add(std::array{camera.orthographic_height});
    } else {
      add(camera.intrinsics);
      if (model.distortion) add(camera.distortion);
    }
  }
  return at::tensor(values, at::kFloat).view({static_cast<std::int64_t>(gradient.views.size()), -1});
}

/// The positions of a view's vertices.
std::span<const glm::vec3> vertices_of_view(const Inputs& in, std::size_t view) {
  const auto all = rows<glm::vec3>(in.vertices);
  const auto count = static_cast<std::size_t>(in.vertices.size(1));
  return in.vertices.size(0) == 1 ? all : all.subspan(view * count, count);
}

/// d loss / d M of x_camera = A x_world + t, M = [A t; 0 1]: the sum over the vertices of g_camera x_world^T,
/// where g_camera = A^-T g_world.
at::Tensor view_gradients(const at::Tensor& views, const at::Tensor& vertices,
                          const at::Tensor& grad_vertices) {
  const at::Tensor linear = views.slice(1, 0, 3).slice(2, 0, 3).to(at::kDouble);
  const at::Tensor grad_world = grad_vertices.to(at::kDouble).transpose(1, 2);  // [view, 3, vertex]
  const at::Tensor world = at::constant_pad_nd(vertices.to(at::kDouble), {0, 1}, 1.0);
  const at::Tensor grad = linear.transpose(1, 2).inverse().matmul(grad_world.matmul(world));  // [view, 3, 4]
  return at::constant_pad_nd(grad, {0, 0, 0, 1}).to(at::kFloat);
}

/// d loss / d M for rigid motions of M = [A t; 0 1]: G with <G, [r]x A> = g . r for the gradient g of every
/// rotation r, which is 1/2 [g]x A^-T, and the translation's gradient.
at::Tensor rigid_view_gradients(std::span<const View> views, const SceneGradient& gradient) {
  at::Tensor grad = at::zeros({static_cast<std::int64_t>(views.size()), 4, 4}, at::kFloat);
  float* out = grad.data_ptr<float>();
  for (std::size_t v = 0; v < views.size(); ++v, out += 16) {
    const PoseGradient& pose = gradient.views[v].camera.view;
    const glm::dmat3 inverse = glm::transpose(glm::inverse(glm::dmat3(glm::dmat4(views[v].camera.view))));
    for (int column = 0; column < 4; ++column) {
      const glm::dvec3 values =
          column < 3 ? 0.5 * glm::cross(pose.rotation, inverse[column]) : pose.translation;
      for (int row = 0; row < 3; ++row) out[4 * row + column] = static_cast<float>(values[row]);
    }
  }
  return grad;
}

/// One view that every valid smoothing goes with, and all lights.
View neutral_view() {
  constexpr float k_longest = 1e36F;  // of the lengths that renderer/finite.hpp lets pass, for any gamma
  View view{{}, {glm::mat4(1.0F)}};
  view.camera.znear = 1;
  view.camera.zfar = k_longest;
  return view;
}

/// Smoothing, lights and views, each of which its setter checks against the others. Until all are set some
/// are those of the renderer's last batch, which need not go with these.
void upload_settings(Renderer& renderer, std::span<const View> views, const BatchOptions& options) {
  const auto set = [&] {
    renderer.set_smoothing(options.settings.smoothing());
    if (options.lights || renderer.scene().lights) renderer.set_lights(options.lights);
    renderer.set_views(views, options.first_view);
  };
  try {
    set();
  } catch (const InvalidArgument&) {
    renderer.set_views(std::array{neutral_view()});
    set();
  }
}

/// One shape for all views stays one unless separate ones are asked for.
void upload(Renderer& renderer, const Inputs& in, const BatchOptions& options) {
  const std::int64_t count = in.views.size(0);
  upload_settings(renderer, make_views(in, options.settings), options);
  renderer.set_cull(options.settings.cull());
  renderer.set_background(rows<glm::vec3>(in.background)[0]);
  upload_surface(renderer, in.surface);
  const bool own_shapes = count > 1 && (options.separate_shapes || in.vertices.size(0) > 1);
  const bool own_colors = count > 1 && in.colors.size(0) > 1;
  if (!own_shapes) renderer.set_positions(0, rows<glm::vec3>(in.vertices));
  if (!own_colors) renderer.set_colors(0, rows<glm::vec3>(in.colors));
  const at::Tensor shapes =
      own_shapes ? in.vertices.expand({count, -1, -1}).contiguous() : at::empty({0, 3}, at::kFloat);
  const at::Tensor colors = own_colors ? in.colors : at::empty({0, 3}, at::kFloat);
  renderer.set_shapes(rows<glm::vec3>(shapes), rows<glm::vec3>(colors));
}

at::Tensor light_gradients(SceneGradient& gradient) {
  std::vector<float> numbers;
  for_each_light_number(
      gradient, [&](std::string_view, auto number) { numbers.push_back(static_cast<float>(number)); });
  return at::tensor(numbers, at::kFloat);
}

}  // namespace

Inputs checked(const Inputs& in, std::int64_t faces) {
  Inputs out;
  out.views = checked(in.views, "views", {-1, 4, 4}, "[view, 4, 4]");
  const std::int64_t count = out.views.size(0);
  if (count == 0) throw InvalidArgument("views (dpr::render)", shape_text(out.views), "at least one view");
  out.vertices = checked(in.vertices, "vertices", {-1, -1, 3}, "[view or 1, vertex, 3]");
  out.colors = checked(in.colors, "colors", {-1, -1, 3}, "[view or 1, vertex or face, 3]");
  out.intrinsics = checked(in.intrinsics, "intrinsics", {count, -1},
                           "[" + std::to_string(count) + ", 4, 9 or 1], a row for each view");
  require_projection(out.intrinsics);
  out.background = checked(in.background, "background", {3}, "[3]");
  require_batch(out.vertices, "vertices", count);
  require_batch(out.colors, "colors", count);
  const std::int64_t colors = out.colors.size(1), vertices = out.vertices.size(1);
  if (colors != vertices && colors != faces) {
    throw InvalidArgument("colors (dpr::render)", shape_text(out.colors),
                          std::to_string(vertices) + ", one a vertex, or " + std::to_string(faces) +
                              ", one a face, in the second dimension");
  }
  out.surface = checked(in.surface);
  return out;
}

Topology topology_of(const Inputs& in, MeshForm form, const RenderSettings& settings) {
  const std::int64_t vertices = in.vertices.size(1);
  Surface surface = make_surface(form.surface, in.surface, *form.faces, vertices);
  return {std::move(form.faces), static_cast<std::size_t>(vertices),
          form.face_colors,      settings.width(),
          settings.height(),     std::move(surface)};
}

std::vector<View> make_views(const Inputs& in, const RenderSettings& settings) {
  const auto matrices = rows<glm::vec4>(in.views);
  std::vector<View> views;
  for (std::size_t v = 0; v < static_cast<std::size_t>(in.views.size(0)); ++v) {
    View view{{}, {glm::mat4(1.0F)}};
    for (int row = 0; row < 4; ++row) {
      const glm::vec4& values = matrices[4 * v + static_cast<std::size_t>(row)];
      for (int column = 0; column < 4; ++column) view.camera.view[column][row] = values[column];
    }
    set_projection(view.camera, in.intrinsics.select(0, static_cast<std::int64_t>(v)));
    settings.set_clipping(view.camera, vertices_of_view(in, v));
    views.push_back(view);
  }
  return views;
}

at::Tensor render_batch(Renderer& renderer, const Inputs& in, const BatchOptions& options) {
  upload(renderer, in, options);
  renderer.forward();
  at::Tensor image =
      at::empty({in.views.size(0), options.settings.height(), options.settings.width(), 4}, at::kFloat);
  renderer.read_pixels(
      {reinterpret_cast<glm::vec4*>(image.data_ptr<float>()), static_cast<std::size_t>(image.numel() / 4)});
  return image;
}

GradientRequest request_of(const Wanted& wanted, ViewMotion motion) {
  GradientRequest request{};
  request.positions = wanted.vertices || (wanted.views && motion == ViewMotion::affine);
  request.colors = wanted.colors;
  request.camera = wanted.intrinsics || (wanted.views && motion == ViewMotion::rigid);
  request.distortion = wanted.intrinsics;
  request.background = wanted.background;
  request.lights = wanted.lights;
  request.smoothing = wanted.smoothing;
  request.transform = false;
  request.texture = wanted.surface.texels;
  request.texcoords = wanted.surface.texcoords;
  request.materials = wanted.surface.specular || wanted.surface.shininess;
  return request;
}

Gradients gather_gradients(const Renderer& renderer, SceneGradient& gradient, const at::Tensor& vertices,
                           const at::Tensor& views, const Wanted& wanted, ViewMotion motion) {
  const std::int64_t count = views.size(0);
  const bool is_affine = wanted.views && motion == ViewMotion::affine;
  Gradients grad;
  if (wanted.vertices || is_affine) {
    const at::Tensor each = adopt(gradient.shapes.positions, gradient.meshes[0].positions, count);
    if (is_affine) grad.views = view_gradients(views, vertices, each);
    if (wanted.vertices)
      grad.vertices = each.size(0) == vertices.size(0) ? each : each.sum(0, /*keepdim=*/true);
  }
  if (wanted.colors) grad.colors = adopt(gradient.shapes.colors, gradient.meshes[0].colors, count);
  if (wanted.views && !is_affine) grad.views = rigid_view_gradients(renderer.views(), gradient);
  if (wanted.intrinsics) grad.intrinsics = projection_gradients(renderer.views().front().camera, gradient);
  const glm::dvec3& background = gradient.background;
  if (wanted.background) grad.background = at::tensor({background.x, background.y, background.z}, at::kFloat);
  if (wanted.lights) grad.lights = light_gradients(gradient);
  if (wanted.smoothing)
    grad.smoothing = at::tensor({gradient.sigma, gradient.gamma, gradient.alpha}, at::kFloat);
  grad.surface = surface_gradients(renderer.scene().meshes[0].mesh, gradient.meshes[0], wanted.surface);
  return grad;
}

Gradients backward_batch(Renderer& renderer, const at::Tensor& vertices, const at::Tensor& views,
                         const Wanted& wanted, const at::Tensor& grad_image) {
  const ViewMotion motion = renderer.scene().lights ? ViewMotion::rigid : ViewMotion::affine;
  renderer.set_gradients(request_of(wanted, motion));
  const at::Tensor pixels = grad_image.contiguous();
  SceneGradient gradient = renderer.backward_pixels(rows<glm::vec4>(pixels));
  return gather_gradients(renderer, gradient, vertices, views, wanted, motion);
}

void require_first_derivative() {
  TORCH_CHECK(
      !c10::GradMode::is_enabled(),
      "dpr: error: create_graph (dpr::render): got true, expected false: there are no second derivatives");
}

}  // namespace dpr::torch_op
