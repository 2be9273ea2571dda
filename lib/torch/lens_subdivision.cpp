// Faces cut for the lenses of a batch, for the Python package.
#include <ATen/Functions.h>
#include <torch/library.h>

#include <string>
#include <tuple>
#include <vector>

#include "dpr/subdivision.hpp"
#include "torch/batch.hpp"
#include "torch/errors.hpp"
#include "torch/index_tensors.hpp"

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

/// What subdivide_for_lens() finds for one mesh, as tensors: float32 weights, int64 else.
struct CutFaces {
  at::Tensor faces;           ///< [face, 3] the pieces
  at::Tensor face_of;         ///< [face] the face that each is a piece of
  at::Tensor vertices_of;     ///< [vertex, 3] old vertices that each new one is a combination of
  at::Tensor vertex_weights;  ///< [vertex, 3]
};

/// For checked inputs with one shape for all views.
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

/// Of dpr::_subdivide: the pieces, their faces, and the combinations of vertices with their weights.
std::tuple<at::Tensor, at::Tensor, at::Tensor, at::Tensor> subdivide_mesh(
    std::int64_t width, std::int64_t height, std::vector<std::string> texts, double tolerance,
    const at::Tensor& faces, const at::Tensor& vertices, const at::Tensor& views,
    const at::Tensor& intrinsics) {
  return with_torch_errors([&] {
    const RenderSettings settings = settings_from_texts(width, height, texts);
    const Faces read = read_faces(faces, "faces (dpr.subdivide)");
    const Inputs in = checked({vertices, at::zeros_like(vertices), views, intrinsics, at::zeros({3})},
                              static_cast<std::int64_t>(read.size()));
    const CutFaces cut = cut_for_lens(in, read, settings, tolerance);
    return std::tuple(cut.faces, cut.face_of, cut.vertices_of, cut.vertex_weights);
  });
}

}  // namespace

TORCH_LIBRARY_FRAGMENT(dpr, m) {
  m.def(
      "_subdivide(int width, int height, str[] settings, float tolerance, Tensor faces, Tensor vertices, "
      "Tensor views, Tensor intrinsics) -> (Tensor, Tensor, Tensor, Tensor)",
      &subdivide_mesh);
}

}  // namespace dpr::torch_op
