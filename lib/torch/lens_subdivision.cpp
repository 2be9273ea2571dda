#include "torch/lens_subdivision.hpp"

#include <ATen/Functions.h>

#include <vector>

#include "dpr/subdivision.hpp"

namespace dpr::torch_op {
namespace {

/// [vector, axis]
template <typename Vector>
at::Tensor tensor_of_vectors(const std::vector<Vector>& vectors, at::ScalarType type) {
  at::Tensor tensor = at::empty({static_cast<std::int64_t>(vectors.size()), Vector::length()}, at::kDouble);
  double* out = tensor.data_ptr<double>();
  for (const Vector& vector : vectors)
    for (int axis = 0; axis < Vector::length(); ++axis) *out++ = static_cast<double>(vector[axis]);
  return tensor.to(type);
}

}  // namespace

CutFaces cut_for_lens(const Inputs& in, const Faces& faces, const RenderSettings& settings,
                      double tolerance) {
  if (in.vertices.size(0) != 1) {
    throw InvalidArgument("vertices (dpr.subdivide)", shape_text(in.vertices), "[vertex, 3], one mesh");
  }
  const auto count = static_cast<std::size_t>(in.vertices.size(1));
  const auto* const first = reinterpret_cast<const glm::vec3*>(in.vertices.data_ptr<float>());
  const std::vector<View> views = make_views(in, settings);
  Scene scene;
  scene.width = settings.width();
  scene.height = settings.height();
  scene.camera = views.front().camera;
  scene.meshes.emplace_back();
  scene.meshes.front().mesh.positions.assign(first, first + count);
  scene.meshes.front().mesh.faces = faces;
  const SubdividedScene cut = subdivide_for_lens(scene, {.tolerance = static_cast<float>(tolerance)}, views);
  const MeshSubdivision& mesh = cut.meshes.front();
  const at::Tensor pieces = tensor_of_vectors(cut.scene.meshes.front().mesh.faces, at::kLong);
  if (!mesh.is_cut()) {
    const at::Tensor vertices = at::arange(static_cast<std::int64_t>(count), at::kLong);
    const at::Tensor one = at::tensor({1.0F, 0.0F, 0.0F});
    return {pieces, at::arange(pieces.size(0), at::kLong), vertices.view({-1, 1}).repeat({1, 3}),
            one.repeat({vertices.size(0), 1})};
  }
  return {pieces, at::tensor(std::vector<std::int64_t>(mesh.face_of.begin(), mesh.face_of.end()), at::kLong),
          tensor_of_vectors(mesh.vertices.of, at::kLong),
          tensor_of_vectors(mesh.vertices.weights, at::kFloat)};
}

}  // namespace dpr::torch_op
