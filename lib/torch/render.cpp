// The operator: tensors in, the renderer's launches, tensors out; and its registration.
#include "torch/render.hpp"

#include <torch/csrc/autograd/custom_function.h>
#include <torch/library.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "scene/light_table.hpp"
#include "torch/errors.hpp"
#include "torch/light_tensors.hpp"

namespace dpr::torch_op {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

/// The memory of a contiguous tensor whose rows are vectors.
template <typename Vector>
std::span<const Vector> rows(const at::Tensor& tensor) {
  static_assert(sizeof(Vector) == Vector::length() * sizeof(float));
  return {reinterpret_cast<const Vector*>(tensor.data_ptr<float>()),
          static_cast<std::size_t>(tensor.numel() / Vector::length())};
}

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

struct Inputs {
  at::Tensor vertices, colors, views, intrinsics, background;
};

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

Inputs check(const Inputs& in, std::int64_t faces) {
  Inputs out;
  out.views = checked(in.views, "views", {-1, 4, 4}, "[view, 4, 4]");
  const std::int64_t count = out.views.size(0);
  if (count == 0) throw InvalidArgument("views (dpr::render)", shape_text(out.views), "at least one view");
  out.vertices = checked(in.vertices, "vertices", {-1, -1, 3}, "[view or 1, vertex, 3]");
  out.colors = checked(in.colors, "colors", {-1, -1, 3}, "[view or 1, vertex or face, 3]");
  out.intrinsics = checked(in.intrinsics, "intrinsics", {count, -1}, "[view, 4, 9 or 1]");
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
  return out;
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

/// The gradients of what set_projection() takes, [view, number].
at::Tensor projection_gradients(const SceneGradient& gradient, std::int64_t numbers) {
  std::vector<float> values;
  for (const ViewGradient& view : gradient.views) {
    const CameraGradient& camera = view.camera;
    const auto add = [&](const auto& list) {
      for (const double k : list) values.push_back(static_cast<float>(k));
    };
    if (numbers == k_orthographic) {
      add(std::array{camera.orthographic_height});
    } else {
      add(camera.intrinsics);
      if (numbers == k_lens) add(camera.distortion);
    }
  }
  return at::tensor(values, at::kFloat).view({-1, numbers});
}

std::vector<View> make_views(const Inputs& in, float znear, float zfar) {
  const auto matrices = rows<glm::vec4>(in.views);
  std::vector<View> views;
  for (std::size_t v = 0; v < static_cast<std::size_t>(in.views.size(0)); ++v) {
    View view{{}, {glm::mat4(1.0F)}};
    for (int row = 0; row < 4; ++row) {
      const glm::vec4& values = matrices[4 * v + static_cast<std::size_t>(row)];
      for (int column = 0; column < 4; ++column) view.camera.view[column][row] = values[column];
    }
    set_projection(view.camera, in.intrinsics.select(0, static_cast<std::int64_t>(v)));
    view.camera.znear = znear;
    view.camera.zfar = zfar;
    views.push_back(view);
  }
  return views;
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

using Clock = std::chrono::steady_clock;

/// Adds the time of its life to a sum.
class Timer {
 public:
  explicit Timer(double& seconds) : seconds_(seconds) {}
  ~Timer() { seconds_ += std::chrono::duration<double>(Clock::now() - start_).count(); }
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

 private:
  double& seconds_;
  Clock::time_point start_ = Clock::now();
};

}  // namespace

/// A renderer for the life of a graph: its buffers hold the frame that the backward pass differentiates.
class Lease : public torch::CustomClassHolder {
 public:
  Lease(c10::intrusive_ptr<BatchRenderer> owner, const BatchRenderer::Topology& topology)
      : renderer(owner->take(topology)), owner_(std::move(owner)), topology_(topology) {}
  ~Lease() override { owner_->put_back(std::move(renderer), topology_); }

  Renderer renderer;

 private:
  c10::intrusive_ptr<BatchRenderer> owner_;
  BatchRenderer::Topology topology_;
};

struct RenderFunction : public torch::autograd::Function<RenderFunction> {
  static at::Tensor forward(AutogradContext* ctx, const c10::intrusive_ptr<BatchRenderer>& batch,
                            const at::Tensor& vertices, const at::Tensor& colors, const at::Tensor& views,
                            const at::Tensor& intrinsics, const at::Tensor& background,
                            const at::Tensor& light_numbers, const std::optional<Lights>& lights) {
    const Timer timer(batch->seconds_);
    return with_torch_errors([&] {
      const Inputs in = check({vertices, colors, views, intrinsics, background},
                              static_cast<std::int64_t>(batch->faces_.size()));
      const bool of_faces = in.colors.size(1) != in.vertices.size(1);
      auto lease = c10::make_intrusive<Lease>(
          batch, BatchRenderer::Topology{static_cast<std::size_t>(in.vertices.size(1)), of_faces});
      GradientRequest wanted{};
      const bool by_vertices = views.requires_grad() && !lights;
      wanted.positions = vertices.requires_grad() || by_vertices;
      wanted.colors = colors.requires_grad();
      wanted.camera = intrinsics.requires_grad() || (views.requires_grad() && lights);
      wanted.distortion = intrinsics.requires_grad();
      wanted.background = background.requires_grad();
      wanted.lights = light_numbers.requires_grad();
      wanted.transform = wanted.smoothing = false;
      lease->renderer.set_gradients(wanted);
      if (lights) {
        lease->renderer.set_lights(unpack(*lights, light_numbers));
      } else if (lease->renderer.scene().lights) {
        lease->renderer.set_lights({});
      }
      upload(*batch, lease->renderer, in, by_vertices);

      lease->renderer.forward();
      at::Tensor image = at::empty({in.views.size(0), batch->height_, batch->width_, 4}, at::kFloat);
      lease->renderer.read_pixels({reinterpret_cast<glm::vec4*>(image.data_ptr<float>()),
                                   static_cast<std::size_t>(image.numel() / 4)});
      ctx->saved_data["batch"] = batch;
      ctx->saved_data["lease"] = c10::IValue::make_capsule(std::move(lease));
      ctx->saved_data["wants_views"] = views.requires_grad();
      ctx->saved_data["projection"] = in.intrinsics.size(1);
      ctx->save_for_backward({in.vertices, in.views});
      return image;
    });
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grad_outputs) {
    TORCH_CHECK(!at::GradMode::is_enabled(),
                "dpr: error: create_graph (dpr::render): got true, expected false: there are no second "
                "derivatives");
    const auto batch = ctx->saved_data["batch"].toCustomClass<BatchRenderer>();
    const Timer timer(batch->seconds_);
    return with_torch_errors([&] {
      auto& lease = static_cast<Lease&>(*ctx->saved_data["lease"].toCapsule());
      const at::Tensor grad_image = grad_outputs[0].contiguous();
      SceneGradient gradient = lease.renderer.backward_pixels(rows<glm::vec4>(grad_image));
      return collect(*ctx, lease.renderer, gradient);
    });
  }

 private:
  /// One shape for all views stays one; but the gradients of the views' matrices need those of every view's
  /// vertices.
  static void upload(const BatchRenderer& batch, Renderer& renderer, const Inputs& in, bool separate) {
    const std::int64_t count = in.views.size(0);
    renderer.set_smoothing(batch.smoothing_);
    renderer.set_cull(batch.cull_);
    renderer.set_background(rows<glm::vec3>(in.background)[0]);
    renderer.set_views(make_views(in, batch.znear_, batch.zfar_));
    const bool own_shapes = count > 1 && (separate || in.vertices.size(0) > 1);
    const bool own_colors = count > 1 && in.colors.size(0) > 1;
    if (!own_shapes) renderer.set_positions(0, rows<glm::vec3>(in.vertices));
    if (!own_colors) renderer.set_colors(0, rows<glm::vec3>(in.colors));
    const at::Tensor shapes =
        own_shapes ? in.vertices.expand({count, -1, -1}).contiguous() : at::empty({0, 3}, at::kFloat);
    const at::Tensor colors = own_colors ? in.colors : at::empty({0, 3}, at::kFloat);
    renderer.set_shapes(rows<glm::vec3>(shapes), rows<glm::vec3>(colors));
  }

  static variable_list collect(AutogradContext& ctx, const Renderer& renderer, SceneGradient& gradient) {
    const GradientRequest& wanted = renderer.scene().gradients;
    const bool wants_views = ctx.saved_data["wants_views"].toBool(),
               is_lit = renderer.scene().lights.has_value();
    const variable_list saved = ctx.get_saved_variables();
    const at::Tensor &vertices = saved[0], &views = saved[1];
    const std::int64_t count = views.size(0);
    variable_list grad(8);  // of the renderer and the lights' structure, which have none, and six tensors
    if (wanted.positions) {
      at::Tensor each = adopt(gradient.shapes.positions, gradient.meshes[0].positions, count);
      if (wants_views && !is_lit) grad[3] = view_gradients(views, vertices, each);
      grad[1] = each.size(0) == vertices.size(0) ? each : each.sum(0, /*keepdim=*/true);
    }
    if (wanted.colors) grad[2] = adopt(gradient.shapes.colors, gradient.meshes[0].colors, count);
    if (wants_views && is_lit) grad[3] = rigid_view_gradients(renderer.views(), gradient);
    if (wanted.camera) grad[4] = projection_gradients(gradient, ctx.saved_data["projection"].toInt());
    if (wanted.background) {
      const glm::dvec3& g = gradient.background;
      grad[5] = at::tensor({g.x, g.y, g.z}, at::kFloat);
    }
    if (wanted.lights) {
      std::vector<float> numbers;
      for_each_light_number(
          gradient, [&](std::string_view, auto number) { numbers.push_back(static_cast<float>(number)); });
      grad[6] = at::tensor(numbers, at::kFloat);
    }
    return grad;
  }
};

at::Tensor render(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                  const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                  const at::Tensor& background) {
  return RenderFunction::apply(renderer, vertices, colors, views, intrinsics, background,
                               at::empty({0}, at::kFloat), std::optional<Lights>());
}

at::Tensor render_lit(const c10::intrusive_ptr<BatchRenderer>& renderer, const at::Tensor& vertices,
                      const at::Tensor& colors, const at::Tensor& views, const at::Tensor& intrinsics,
                      const at::Tensor& background, const LightTensors& lights) {
  const PackedLights packed = with_torch_errors([&] { return pack(lights, renderer->lights()); });
  return RenderFunction::apply(renderer, vertices, colors, views, intrinsics, background, packed.numbers,
                               std::optional<Lights>(packed.lights));
}

TORCH_LIBRARY(dpr, m) {
  m.class_<BatchRenderer>("Renderer")
      .def(torch::init<const at::Tensor&, std::int64_t, std::int64_t, const std::string&,
                       const std::string&>(),
           "Faces, image size, smoothing and device of a batch",
           {torch::arg("faces"), torch::arg("width"), torch::arg("height"),
            torch::arg("preset") = std::string("pixel"), torch::arg("device") = std::string()})
      .def("set", &BatchRenderer::set,
           "Sets a value of the smoothing or the camera, by its key in a scene file",
           {torch::arg("name"), torch::arg("value")})
      .def("seconds", &BatchRenderer::seconds);
  m.def(
      "render(__torch__.torch.classes.dpr.Renderer renderer, Tensor vertices, Tensor colors, Tensor views, "
      "Tensor intrinsics, Tensor background) -> Tensor",
      &render);
  m.def(
      "render_lit(__torch__.torch.classes.dpr.Renderer renderer, Tensor vertices, Tensor colors, Tensor "
      "views, "
      "Tensor intrinsics, Tensor background, Dict(str, Tensor) lights) -> Tensor",
      &render_lit);
}

}  // namespace dpr::torch_op
