// Gradients of a batch's arrays from those of the renderer, and the renderer's directions from the arrays'.
#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "base/checks.hpp"
#include "batch/batch.hpp"
#include "batch/inputs.hpp"
#include "dpr/error.hpp"
#include "renderer/renderer_impl.hpp"
#include "renderer/tangents.hpp"

namespace dpr::batch {
namespace {

/// Of a list of row-major ones.
glm::dmat4 matrix_of(std::span<const float> numbers, std::size_t index) {
  glm::dmat4 matrix;
  for (int i = 0; i < 16; ++i) matrix[i % 4][i / 4] = numbers[16 * index + i];
  return matrix;
}

/// d loss / d M of x_camera = A x_world + t, M = [A t; 0 1]: the sum over the vertices of g_camera x_world^T,
/// where g_camera = A^-T g_world. [view][16]
std::vector<double> affine_gradients(std::span<const View> views, std::span<const glm::vec3> vertices,
                                     std::span<const glm::vec3> gradients) {
  const std::size_t of_mesh = vertices.size() / views.size();
  std::vector<double> all;
  for (std::size_t v = 0; v < views.size(); ++v) {
    glm::dmat4x3 sum(0.0);  // columns of g_world x_world^T, and of g_world
    for (std::size_t i = v * of_mesh; i < (v + 1) * of_mesh; ++i) {
      const glm::dvec3 g(gradients[i]), x(vertices[i]);
      for (int column = 0; column < 3; ++column) sum[column] += g * x[column];
      sum[3] += g;
    }
    const glm::dmat3 inverse = glm::transpose(glm::inverse(glm::dmat3(glm::dmat4(views[v].camera.view))));
    const glm::dmat4x3 grad = inverse * sum;
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column) all.push_back(row < 3 ? grad[column][row] : 0.0);
  }
  return all;
}

/// d loss / d M for rigid motions of M = [A t; 0 1]: G with <G, [r]x A> = g . r for the gradient g of every
/// rotation r, which is 1/2 [g]x A^-T, and the translation's gradient. [view][16]
std::vector<double> rigid_gradients(std::span<const View> views, const SceneGradient& gradient) {
  std::vector<double> all;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const PoseGradient& pose = gradient.views[v].camera.view;
    const glm::dmat3 inverse = glm::transpose(glm::inverse(glm::dmat3(glm::dmat4(views[v].camera.view))));
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) {
        const glm::dvec3 values =
            column < 3 ? 0.5 * glm::cross(pose.rotation, inverse[column]) : pose.translation;
        all.push_back(row < 3 ? values[row] : 0.0);
      }
    }
  }
  return all;
}

/// Adds what the vertices are moved by as seen from a camera of M = [A t; 0 1] that dM [16] moves: A^-1 (dA x + dt).
void move_vertices(std::span<const View> views, std::span<const glm::vec3> vertices,
                   std::span<const float> motions, std::vector<glm::vec3>& tangents) {
  const std::size_t of_mesh = vertices.size() / views.size();
  for (std::size_t v = 0; v < views.size(); ++v) {
    const glm::dmat3 inverse = glm::inverse(glm::dmat3(glm::dmat4(views[v].camera.view)));
    const glm::dmat4 motion = matrix_of(motions, v);
    for (std::size_t i = v * of_mesh; i < (v + 1) * of_mesh; ++i)
      tangents[i] += glm::vec3(inverse * glm::dvec3(motion * glm::dvec4(glm::dvec3(vertices[i]), 1)));
  }
}

/// Adds the rigid motion that is in dM [16] of M = [A t; 0 1], the transpose of rigid_gradients(): the rotation r of
/// the antisymmetric part [r]x of dA A^-1, and dt.
void move_cameras(std::span<const View> views, std::span<const float> motions, SceneTangent& direction) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    const glm::dmat4 motion = matrix_of(motions, v);
    const glm::dmat3 turn = glm::dmat3(motion) * glm::inverse(glm::dmat3(glm::dmat4(views[v].camera.view)));
    PoseGradient& pose = direction.views[v].camera.view;
    pose.rotation +=
        0.5 * glm::dvec3(turn[1][2] - turn[2][1], turn[2][0] - turn[0][2], turn[0][1] - turn[1][0]);
    pose.translation += glm::dvec3(motion[3]);
  }
}

/// visit(row, index, array) for the arrays whose numbers, one after the other, are an input's gradient: a light's
/// or a view's together.
template <class Visit>
void for_each_array_of(const std::string& name, SceneGradient& gradient, const Visit& visit) {
  const std::vector<const GradientRow*> rows = gradient_rows_of(name);
  if (rows.empty()) return;
  const GradientIndex count = count_arrays(*rows.front(), gradient);
  for (GradientIndex i; i.view < count.view; ++i.view) {
    for (i.item = 0; i.item < count.item; ++i.item) {
      for (const GradientRow* const row : rows) {
        const GradientArray array = row->array(gradient, i);
        const auto visit_texture = [&](auto* textures) {
          for (std::size_t k = 0; k < textures->size(); ++k)
            if (name == texture_name(k)) visit(*row, i, &(*textures)[k]);
        };
        if (const auto* const texels = std::get_if<std::vector<std::vector<glm::vec3>>*>(&array)) {
          visit_texture(*texels);
        } else if (const auto* const opacities = std::get_if<std::vector<std::vector<float>>*>(&array)) {
          visit_texture(*opacities);
        } else {
          visit(*row, i, array);
        }
      }
    }
  }
}

/// Adds a texture's texels, or their opacities, to channels of [H, W, 4] from `first` on.
void add_channels(std::span<const float> numbers, std::size_t channels, std::size_t first,
                  std::span<float> sums) {
  for (std::size_t i = 0; i < numbers.size(); ++i)
    sums[4 * (i / channels) + first + i % channels] += numbers[i];
}

std::string argument_of_tangent(const NamedArray& tangent) { return "tangent of " + argument(tangent); }

/// Throws InvalidArgument for a tangent that images do not follow, and one of another form.
void require_tangent(const NamedArray& tangent, std::size_t directions, std::span<const std::string> wanted) {
  const auto fail = [&](const std::string& got, const std::string& expected) {
    throw InvalidArgument(argument_of_tangent(tangent), got, expected);
  };
  const std::vector<const GradientRow*> rows = gradient_rows_of(tangent.name);
  const auto is_known = [](const GradientRow* row) { return has_tangent(*row); };
  if (tangent.name != "views" && (rows.empty() || !std::ranges::all_of(rows, is_known)))
    fail("an array along which images have none",
         "one of vertices, colors, face_colors, opacities, face_opacities, views, intrinsics, background, "
         "sigma, gamma and alpha");
  if (std::ranges::find(wanted, tangent.name) == wanted.end())
    fail("an array that was not named when it was rendered",
         "one of those in `gradients` of the frame's options");
  if (tangent.element != Element::float32 || tangent.shape.empty() || tangent.shape[0] != directions)
    fail(text_of(tangent.shape), "float32 [" + std::to_string(directions) + ", ...], a row a direction");
  const auto is_finite = [](float number) { return std::isfinite(number); };
  if (!std::ranges::all_of(tangent.rows<const float>(), is_finite)) fail("not finite", "finite numbers");
}

}  // namespace

void Batch::add_gradients(SceneGradient& found, bool is_affine, NamedArrays gradients) {
  for (const NamedArray& gradient : gradients) add_gradient(found, is_affine, gradient);
  impl_of(frame_.renderer()).grad_lights.clear();  // those of other outputs have none
}

void Batch::add_gradient(SceneGradient& found, bool is_affine, const NamedArray& gradient) {
  const Renderer& renderer = frame_.renderer();
  const std::span<const View> views = renderer.views();
  const std::span<float> sums = gradient.rows<float>();
  std::size_t count = 0, next = 0;
  const auto add = [&](double number) {
    if (next == sums.size()) next = 0;
    if (!sums.empty()) sums[next++] += static_cast<float>(number);
    ++count;
    return number;
  };
  if (gradient.name == "views") {
    const auto& own = found.shapes.positions;
    const auto& positions = own.empty() ? found.meshes[0].positions : own;
    std::ranges::for_each(
        is_affine ? affine_gradients(views, vertices_, positions) : rigid_gradients(views, found), add);
  }
  const auto add_array = [&](const GradientRow& row, GradientIndex i, GradientArray array) {
    if (!exists(row, i, renderer.scene(), views)) return;
    const auto* const* vectors = std::get_if<std::vector<glm::vec3>*>(&array);
    const auto* const* opacities = std::get_if<std::vector<float>*>(&array);
    const bool is_texture = gradient.name.starts_with("textures[");
    if (is_texture && vectors && sums.size() == 4 * (*vectors)->size()) {
      add_channels(checks::floats_of(std::span<const glm::vec3>(**vectors)), 3, 0, sums);
      count += 3 * (*vectors)->size();
    } else if (is_texture && opacities && sums.size() == 4 * (*opacities)->size()) {
      add_channels(**opacities, 1, 3, sums);
      count += (*opacities)->size();
    } else if (vectors && next == 0 && sums.size() == 3 * (*vectors)->size()) {  // millions, perhaps
      const std::span<const float> floats = checks::floats_of(std::span<const glm::vec3>(**vectors));
      std::ranges::transform(sums, floats, sums.begin(), std::plus());
      count += floats.size();
    } else {
      transform_numbers(array, add);
    }
  };
  const bool is_light = gradient.name.starts_with("lights.");
  Renderer::Impl& m = impl_of(renderer);
  if (is_light && !m.shade.lights_of_views().empty()) {
    for (SceneGradient& of_view : m.grad_lights) for_each_array_of(gradient.name, of_view, add_array);
  } else {
    for_each_array_of(gradient.name, found, add_array);
  }
  // Vertices and lights that the views share have the sum over the views.
  const bool may_be_shared = is_light || gradient.name == "vertices";
  if (count != 0 && count != sums.size() && !(may_be_shared && count == sums.size() * views.size()))
    throw InvalidArgument(argument(gradient), text_of(gradient.shape), std::to_string(count) + " numbers");
}

SceneTangent Batch::resting(NamedArrays tangents) {
  const Renderer& renderer = frame_.renderer();
  const Renderer::Impl& m = impl_of(renderer);
  const std::size_t views = renderer.views().size();
  SceneTangent direction;
  direction.meshes.resize(1);
  direction.views.resize(views);
  const auto make_room = [](bool is_own, std::size_t count, std::size_t its_views,
                            std::vector<glm::vec3>& shared, std::vector<glm::vec3>& own) {
    (is_own ? own : shared).resize(is_own ? its_views * count : count);
  };
  if (find(tangents, "vertices") || (find(tangents, "views") && !renderer.scene().lights))
    make_room(m.frame.position_stride != 0, m.geometry->position_count, views, direction.meshes[0].positions,
              direction.shapes.positions);
  if (const NamedArray* const opacities = find_opacities(tangents))
    direction.meshes[0].opacities.resize(opacities->shape.back());
  if (find_colors(tangents))
    make_room(m.frame.color_stride != 0, m.geometry->colors, views, direction.meshes[0].colors,
              direction.shapes.colors);
  return direction;
}

void Batch::add_tangent(const NamedArray& tangent, std::span<const float> numbers, SceneTangent& direction) {
  const Renderer& renderer = frame_.renderer();
  const std::span<const View> views = renderer.views();
  const auto require_count = [&](std::size_t count) {
    if (count != numbers.size())
      throw InvalidArgument(argument_of_tangent(tangent), text_of(tangent.shape),
                            std::to_string(count) + " numbers a direction");
  };
  if (tangent.name == "views") {
    require_count(16 * views.size());
    auto& own = direction.shapes.positions;
    if (renderer.scene().lights) {
      move_cameras(views, numbers, direction);
    } else {
      move_vertices(views, vertices_, numbers, own.empty() ? direction.meshes[0].positions : own);
    }
    return;
  }
  std::size_t count = 0;
  for_each_array_of(tangent.name, direction,
                    [&](const GradientRow& row, GradientIndex i, GradientArray array) {
                      if (!exists(row, i, renderer.scene(), views)) return;
                      transform_numbers(array, [&](double number) {
                        return number + (numbers.empty() ? 0.0 : double{numbers[count++ % numbers.size()]});
                      });
                    });
  // Vertices that the views share move in every view.
  if (tangent.name != "vertices" || count != numbers.size() * views.size()) require_count(count);
}

std::vector<SceneTangent> Batch::moving(std::size_t directions, NamedArrays tangents) {
  for (const NamedArray& tangent : tangents) require_tangent(tangent, directions, wanted_);
  std::vector<SceneTangent> moved(directions, resting(tangents));
  for (const NamedArray& tangent : tangents) {
    const std::size_t count = tangent.count() / directions;
    for (std::size_t d = 0; d < directions; ++d)
      add_tangent(tangent, tangent.rows<const float>().subspan(d * count, count), moved[d]);
  }
  return moved;
}

void Batch::tangent(std::size_t directions, NamedArrays tangents, std::span<glm::vec4> images) {
  impl_of(frame_.renderer()).require_image();
  glm::vec4* next = images.data();
  for (const Image& image : frame_.renderer().tangent(moving(directions, tangents)))
    next = std::ranges::copy(image.pixels, next).out;
}

}  // namespace dpr::batch
