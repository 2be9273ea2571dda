// Gradients of a batch's arrays from those of the renderer, and faces cut for the lenses of one.
#include <numeric>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "batch/batch.hpp"
#include "batch/inputs.hpp"
#include "dpr/error.hpp"
#include "dpr/subdivision.hpp"
#include "scene/light_table.hpp"

namespace dpr::batch {
namespace {

/// Adds the vectors to an array of as many, or of as many as one of the views has: their sum over the views
/// then.
template <typename Vector>
void add_to(const NamedArray& array, const std::vector<Vector>& vectors, std::size_t views = 1) {
  if (vectors.empty()) return;
  const std::span<Vector> sums = array.rows<Vector>();
  if (sums.size() != vectors.size() && sums.size() * views != vectors.size())
    throw InvalidArgument(argument(array), text_of(array.shape), std::to_string(vectors.size()) + " vectors");
  for (std::size_t i = 0; i < vectors.size(); ++i) sums[i % sums.size()] += vectors[i];
}

/// Numbers of the library's gradients, which are double where they are sums; none of what was not asked for.
void add_to(const NamedArray& array, const std::vector<double>& numbers) {
  if (numbers.empty()) return;
  const std::span<float> sums = array.rows<float>();
  if (sums.size() != numbers.size())
    throw InvalidArgument(argument(array), text_of(array.shape), std::to_string(numbers.size()) + " numbers");
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += static_cast<float>(numbers[i]);
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

/// The gradients of what a view's projection was set from, [view][number].
std::vector<double> projection_gradients(const Camera& model, const SceneGradient& gradient) {
  std::vector<double> all;
  for (const ViewGradient& view : gradient.views) {
    const CameraGradient& camera = view.camera;
    if (model.orthographic_height) {
      all.push_back(camera.orthographic_height);
      continue;
    }
    all.insert(all.end(), camera.intrinsics.begin(), camera.intrinsics.end());
    if (model.distortion) all.insert(all.end(), camera.distortion.begin(), camera.distortion.end());
  }
  return all;
}

/// Those of the lights of an array's kind, or of ambient light or harmonics.
std::vector<double> light_gradients(SceneGradient& gradient, std::string_view key) {
  std::vector<double> all;
  const auto push = [&](std::string_view, auto number) { all.push_back(static_cast<double>(number)); };
  if (key == "ambient") visit_numbers(key, gradient.ambient, push);
  if (key == "harmonics") {
    for (const glm::vec3& c : gradient.harmonics) visit_numbers(key, c, push);
  }
  for_each_light_kind([&](auto kind) {
    if (kind.key != key) return;
    for (auto& light : gradient.*kind.gradients) {
      kind.for_each_member([&](std::string_view name, auto, auto member, auto...) {
        visit_numbers(name, light.*member, push);
      });
    }
  });
  return all;
}

}  // namespace

void Batch::add_gradients(SceneGradient& found, bool is_affine, NamedArrays gradients) {
  for (const NamedArray& gradient : gradients) add_gradient(found, is_affine, gradient);
}

void Batch::add_gradient(SceneGradient& found, bool is_affine, const NamedArray& gradient) {
  const Renderer& renderer = frame_.renderer();
  const std::span<const View> views = renderer.views();
  MeshGradient& mesh = found.meshes[0];
  const std::string_view name = gradient.name;
  const auto own_or_shared = [](const auto& own, const auto& shared) -> const auto& {
    return own.empty() ? shared : own;
  };
  const auto& positions = own_or_shared(found.shapes.positions, mesh.positions);
  if (name == "vertices") add_to(gradient, positions, views.size());
  if (name == "colors" || name == "face_colors")
    add_to(gradient, own_or_shared(found.shapes.colors, mesh.colors));
  if (name == "views")
    add_to(gradient,
           is_affine ? affine_gradients(views, vertices_, positions) : rigid_gradients(views, found));
  if (name == "intrinsics") add_to(gradient, projection_gradients(views.front().camera, found));
  const glm::dvec3& background = found.background;
  if (name == "background") add_to(gradient, std::vector{background.x, background.y, background.z});
  if (name.starts_with("lights.")) add_to(gradient, light_gradients(found, name.substr(name.find('.') + 1)));
  if (name == "sigma") add_to(gradient, std::vector{found.sigma});
  if (name == "gamma") add_to(gradient, std::vector{found.gamma});
  if (name == "alpha") add_to(gradient, std::vector{found.alpha});
  if (name == "texcoords") add_to(gradient, mesh.texcoords);
  if (name == "materials.specular") add_to(gradient, mesh.specular);
  if (name == "materials.shininess") add_to(gradient, mesh.shininess);
  for (std::size_t i = 0; i < mesh.textures.size(); ++i)
    if (name == texture_name(i)) add_to(gradient, mesh.textures[i]);
}

CutFaces cut_for_lens(NamedArrays arrays, const RenderSettings& settings, float tolerance) {
  check_sizes(arrays);
  const NamedArray& vertices = require(arrays, "vertices");
  require_floats(vertices, {k_any, 3}, "[V, 3], one mesh");
  const auto positions = vertices.rows<const glm::vec3>();
  const std::vector<View> views = make_views(arrays, settings);
  Scene scene;
  scene.width = settings.width();
  scene.height = settings.height();
  scene.camera = views.front().camera;
  Mesh& mesh = scene.meshes.emplace_back().mesh;
  mesh.positions.assign(positions.begin(), positions.end());
  mesh.faces = read_triples(require(arrays, "faces"));
  SubdividedScene cut = subdivide_for_lens(scene, {.tolerance = tolerance}, views);
  MeshSubdivision& how = cut.meshes.front();
  const bool is_cut = how.is_cut();
  CutFaces pieces{std::move(cut.scene.meshes.front().mesh.faces), std::move(how.face_of),
                  std::move(how.vertices.of), std::move(how.vertices.weights)};
  if (!is_cut) {  // everything is a piece of itself
    pieces.face_of.resize(pieces.faces.size());
    std::iota(pieces.face_of.begin(), pieces.face_of.end(), 0U);
    for (std::uint32_t i = 0; i < positions.size(); ++i) pieces.vertices_of.emplace_back(i);
    pieces.vertex_weights.assign(positions.size(), glm::vec3(1.0F, 0.0F, 0.0F));
  }
  return pieces;
}

}  // namespace dpr::batch
