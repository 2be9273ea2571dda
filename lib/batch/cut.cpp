// Faces cut for lenses, from named arrays, in the C interface.
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"
#include "dpr/subdivision.hpp"

namespace dpr::batch {

/// Result of subdivide_for_lens() for one mesh.
struct CutFaces {
  Faces faces;                            ///< the pieces
  std::vector<std::uint32_t> face_of;     ///< [piece] the face that each is a piece of
  Faces vertices_of;                      ///< [new vertex] old vertices that each is a combination of
  std::vector<glm::vec3> vertex_weights;  ///< [new vertex]
};

namespace {

/// Takes the arrays vertices [V, 3], faces, views and intrinsics.
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

/// Vectors or numbers as an array's whole numbers, or as its floats.
template <typename Value, typename Number>
void copy_to(const NamedArray& array, Element element, const std::vector<Value>& values, const Number*) {
  constexpr std::size_t k_numbers = sizeof(Value) / sizeof(std::uint32_t);
  if constexpr (k_numbers == 1) {
    require_form(array, element, {{values.size()}}, std::to_string(values.size()));
  } else {
    require_form(array, element, {{values.size(), k_numbers}},
                 "[" + std::to_string(values.size()) + ", " + std::to_string(k_numbers) + "]");
  }
  auto* out = static_cast<Number*>(array.data);
  for (const Value& value : values) {
    if constexpr (k_numbers == 1) {
      *out++ = static_cast<Number>(value);
    } else {
      for (int k = 0; k < static_cast<int>(k_numbers); ++k) *out++ = static_cast<Number>(value[k]);
    }
  }
}

void read_cut(const CutFaces& cut, const NamedArray& array) {
  constexpr const std::int64_t* k_whole = nullptr;
  constexpr const float* k_float = nullptr;
  if (array.name == "faces") return copy_to(array, Element::int64, cut.faces, k_whole);
  if (array.name == "face_of") return copy_to(array, Element::int64, cut.face_of, k_whole);
  if (array.name == "vertices_of") return copy_to(array, Element::int64, cut.vertices_of, k_whole);
  if (array.name == "vertex_weights") return copy_to(array, Element::float32, cut.vertex_weights, k_float);
  throw InvalidArgument("name (cut)", "\"" + array.name + "\"",
                        "faces, face_of, vertices_of or vertex_weights");
}

}  // namespace
}  // namespace dpr::batch

using namespace dpr::c;

struct dpr_cut {
  static constexpr const char* k_handle = "dpr_cut";
  dpr::batch::CutFaces faces;
};

dpr_status dpr_cut_create(const dpr_frame_options* options, const dpr_array* arrays, std::size_t count,
                          float tolerance, dpr_cut** cut) {
  return guarded([&] {
    deref(cut, "cut");
    const dpr::batch::RenderSettings settings = dpr::batch::to_settings(dpr::batch::to_options(options));
    give(cut, dpr::batch::cut_for_lens(dpr::batch::to_arrays(arrays, count, "arrays"), settings, tolerance));
  });
}

dpr_status dpr_cut_size(const dpr_cut* cut, std::size_t* faces, std::size_t* vertices) {
  return guarded([&] {
    const dpr::batch::CutFaces& pieces = deref(cut, "cut").faces;
    deref(faces, "faces");
    deref(vertices, "vertices") = pieces.vertices_of.size();
    *faces = pieces.faces.size();
  });
}

dpr_status dpr_cut_read(const dpr_cut* cut, const dpr_array* arrays, std::size_t count) {
  return guarded([&] {
    for (const dpr::batch::NamedArray& array : dpr::batch::to_arrays(arrays, count, "arrays"))
      dpr::batch::read_cut(deref(cut, "cut").faces, array);
  });
}

void dpr_cut_destroy(dpr_cut* cut) { destroy(cut); }
