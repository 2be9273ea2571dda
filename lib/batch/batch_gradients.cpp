// Gradients of a batch's arrays from those of the renderer.
#include <algorithm>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "batch/batch.hpp"
#include "batch/inputs.hpp"
#include "dpr/error.hpp"

namespace dpr::batch {
namespace {

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
        const auto* const textures = std::get_if<std::vector<std::vector<glm::vec3>>*>(&array);
        if (!textures) visit(*row, i, array);
        for (std::size_t k = 0; textures && k < (*textures)->size(); ++k)
          if (name == texture_name(k)) visit(*row, i, &(**textures)[k]);
      }
    }
  }
}

}  // namespace

void Batch::add_gradients(SceneGradient& found, bool is_affine, NamedArrays gradients) {
  for (const NamedArray& gradient : gradients) add_gradient(found, is_affine, gradient);
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
  for_each_array_of(gradient.name, found, [&](const GradientRow& row, GradientIndex i, GradientArray array) {
    if (exists(row, i, renderer.scene(), views)) transform_numbers(array, add);
  });
  // Vertices that the views share have the sum over the views.
  if (count != 0 && count != sums.size() &&
      (gradient.name != "vertices" || count != sums.size() * views.size()))
    throw InvalidArgument(argument(gradient), text_of(gradient.shape), std::to_string(count) + " numbers");
}

}  // namespace dpr::batch
