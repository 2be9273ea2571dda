// Normals of vertices, from named arrays, in the C interface.
#include "dpr/vertex_normals.hpp"

#include <algorithm>
#include <vector>

#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"

namespace dpr::batch {
namespace {

/// Vertices of one shape or several, and faces that these share.
struct Shapes {
  explicit Shapes(NamedArrays arrays) : vertices(require(arrays, "vertices")) {
    for (const NamedArray& array : arrays)
      if (array.name != "vertices" && array.name != "faces")
        throw InvalidArgument("name (vertex_normals)", "'" + array.name + "'", "vertices or faces");
    require_form(vertices, Element::float32, {{k_any, 3}, {k_any, k_any, 3}}, "[V, 3] or [N, V, 3]");
    faces = read_triples(require(arrays, "faces"));
  }

  /// The rows of a shape of an array like the vertices.
  template <class Vector>
  std::span<Vector> rows(const NamedArray& array, std::size_t shape) const {
    const std::size_t count = vertices.shape[vertices.shape.size() - 2];
    return array.rows<Vector>().subspan(shape * count, count);
  }
  std::size_t count() const { return vertices.shape.size() == 3 ? vertices.shape[0] : 1; }

  const NamedArray& vertices;
  std::vector<uvec3> faces;
};

void vertex_normals_to(NamedArrays arrays, const NamedArray& normals) {
  const Shapes shapes(arrays);
  require_like(normals, shapes.vertices);
  for (std::size_t i = 0; i < shapes.count(); ++i)
    std::ranges::copy(vertex_normals(shapes.rows<const vec3>(shapes.vertices, i), shapes.faces),
                      shapes.rows<vec3>(normals, i).begin());
}

void backward(NamedArrays arrays, const NamedArray& grad_normals, const NamedArray& grad_vertices) {
  const Shapes shapes(arrays);
  require_like(grad_normals, shapes.vertices);
  require_like(grad_vertices, shapes.vertices);
  for (std::size_t i = 0; i < shapes.count(); ++i)
    std::ranges::copy(vertex_normals_backward(shapes.rows<const vec3>(shapes.vertices, i), shapes.faces,
                                              shapes.rows<const vec3>(grad_normals, i)),
                      shapes.rows<vec3>(grad_vertices, i).begin());
}

}  // namespace
}  // namespace dpr::batch

using namespace dpr::c;
using dpr::batch::to_arrays;

dpr_status dpr_vertex_normals(const dpr_array* arrays, std::size_t count, const dpr_array* normals) {
  return guarded([&] {
    dpr::batch::vertex_normals_to(to_arrays(arrays, count, "arrays"), to_arrays(normals, 1, "normals")[0]);
  });
}

dpr_status dpr_vertex_normals_backward(const dpr_array* arrays, std::size_t count,
                                       const dpr_array* grad_normals, const dpr_array* grad_vertices) {
  return guarded([&] {
    dpr::batch::backward(to_arrays(arrays, count, "arrays"), to_arrays(grad_normals, 1, "grad_normals")[0],
                         to_arrays(grad_vertices, 1, "grad_vertices")[0]);
  });
}
