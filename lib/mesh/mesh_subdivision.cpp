// Meshes cut into pieces, and their gradients.
#include "mesh/mesh_subdivision.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <type_traits>
#include <utility>

#include "base/checks.hpp"
#include "mesh/vertex_normals.hpp"

namespace dpr {
namespace {

/// Gathers what corners of pieces have, each combination once.
class CombinationList {
 public:
  CombinationList(std::size_t old_count, Combinations& list) : list_(list) {
    for (std::uint32_t i = 0; i < old_count; ++i) append(glm::uvec3(i), {1, 0, 0});
  }

  std::uint32_t index_of(const glm::uvec3& values, const glm::vec3& weights) {
    const Key key = sorted(values, weights);
    if (key[1].second == 0) return key[0].first;
    const auto [place, is_new] = indices_.emplace(key, static_cast<std::uint32_t>(list_.of.size()));
    if (is_new) {
      append({key[0].first, key[1].first, key[2].first}, {key[0].second, key[1].second, key[2].second});
    }
    return place->second;
  }

 private:
  using Key =
      std::array<std::pair<std::uint32_t, float>, 3>;  // values ascending, then those that do not count

  /// Equal values are one.
  static Key sorted(const glm::uvec3& values, const glm::vec3& weights) {
    constexpr std::uint32_t k_none = std::numeric_limits<std::uint32_t>::max();
    Key key;
    key.fill({k_none, 0.0F});
    for (std::size_t i = 0; i < 3; ++i) {
      const int corner = static_cast<int>(i);
      const std::uint32_t value = weights[corner] > 0 ? values[corner] : k_none;
      std::size_t place = i;  // the first with that value, or its own
      for (std::size_t earlier = i; earlier-- > 0;)
        if (key[earlier].first == value) place = earlier;
      key[place].first = value;
      key[place].second += weights[corner];
    }
    const auto order = [&](std::size_t a, std::size_t b) {
      if (key[b] < key[a]) std::swap(key[a], key[b]);
    };
    order(0, 1);
    order(1, 2);
    order(0, 1);
    for (auto& [value, weight] : key)
      if (weight == 0) value = key[0].first;
    return key;
  }

  void append(const glm::uvec3& of, const glm::vec3& weights) {
    list_.of.push_back(of);
    list_.weights.push_back(weights);
  }

  Combinations& list_;
  std::map<Key, std::uint32_t> indices_;
};

/// Indices of the pieces' corners; `corners` are those of the faces.
std::vector<glm::uvec3> combine_corners(const MeshSubdivision& pieces, std::span<const glm::uvec3> corners,
                                        std::size_t values, Combinations& list) {
  std::vector<glm::uvec3> result;
  if (corners.empty()) return result;
  list = {};
  CombinationList combinations(values, list);
  result.reserve(pieces.face_of.size());
  for (std::size_t i = 0; i < pieces.face_of.size(); ++i) {
    const glm::uvec3& old = corners[pieces.face_of[i]];
    const auto& b = pieces.barycentrics[i];
    const std::uint32_t first = combinations.index_of(old, b[0]), second = combinations.index_of(old, b[1]);
    result.emplace_back(first, second, combinations.index_of(old, b[2]));
  }
  return result;
}

template <typename Vector>
inline constexpr std::size_t k_channels_of = sizeof(Vector) / sizeof(float);

template <typename Vector>
std::vector<Vector> vectors_of(const std::vector<float>& numbers) {
  const auto* const first = reinterpret_cast<const Vector*>(numbers.data());
  return {first, first + numbers.size() / k_channels_of<Vector>};
}

template <typename Vector>
std::vector<Vector> combined(const Combinations& list, const std::vector<Vector>& values) {
  if (values.empty()) return values;
  return vectors_of<Vector>(list.combine(checks::floats_of(std::span(values)), k_channels_of<Vector>));
}

template <typename Vector>
std::vector<Vector> pulled_back(const Combinations& list, const std::vector<Vector>& gradient,
                                std::size_t old_count) {
  if (gradient.empty() || list.of.empty()) return gradient;
  return vectors_of<Vector>(
      list.pull_back(checks::floats_of(std::span(gradient)), old_count, k_channels_of<Vector>));
}

template <typename T>
std::vector<T> of_pieces(const std::vector<std::uint32_t>& face_of, const std::vector<T>& of_faces) {
  if (of_faces.empty()) return {};
  std::vector<T> result;
  result.reserve(face_of.size());
  for (const std::uint32_t face : face_of) result.push_back(of_faces[face]);
  return result;
}

void require_at_least(std::size_t least, std::size_t found, const std::string& what) {
  if (found >= least) return;
  throw InvalidArgument(what + " (subdivided mesh)", std::to_string(found),
                        "at least " + std::to_string(least) + ", as the mesh has that was cut");
}

void require_count(std::size_t expected, std::size_t found, const std::string& what) {
  if (found == expected) return;
  throw InvalidArgument(what + " (subdivided mesh)", std::to_string(found),
                        std::to_string(expected) + ", as the mesh has that was cut");
}

template <typename Value>
std::vector<Value> sum_over_pieces(const std::vector<std::uint32_t>& face_of,
                                   const std::vector<Value>& gradient, std::size_t faces) {
  using Total = std::conditional_t<std::is_same_v<Value, float>, double, glm::dvec3>;
  require_at_least(face_of.size(), gradient.size(), "gradient of what faces have");
  std::vector<Total> sums(faces, Total(0));
  for (std::size_t i = 0; i < face_of.size(); ++i) sums[face_of[i]] += Total(gradient[i]);
  return {sums.begin(), sums.end()};
}

/// The gradient of an array of vertices, or of faces.
template <typename Value>
std::vector<Value> of_whole(const MeshSubdivision& subdivision, const std::vector<Value>& of_pieces,
                            bool is_of_faces) {
  if (of_pieces.empty()) return {};
  return is_of_faces ? sum_over_pieces(subdivision.face_of, of_pieces, subdivision.old_faces)
                     : pulled_back(subdivision.vertices, of_pieces, subdivision.old_positions);
}

/// The normals that are combined, of any length.
std::vector<glm::dvec3> old_normals(const Mesh& mesh, const MeshSubdivision& subdivision) {
  if (subdivision.computed_normals == 0) return {mesh.normals.begin(), mesh.normals.end()};
  std::vector<glm::dvec3> normals = normal_sums(mesh.positions, mesh.faces);
  for (glm::dvec3& normal : normals) normal *= subdivision.computed_normals;
  return normals;
}

std::vector<glm::vec3> directions_of(const std::vector<glm::dvec3>& normals) {
  std::vector<glm::vec3> directions;
  for (const glm::dvec3& normal : normals) directions.emplace_back(direction_of(normal));
  return directions;
}

/// One more than the last index.
std::size_t old_count_of(const std::vector<glm::uvec3>& of) {
  std::size_t count = 0;
  for (const glm::uvec3& i : of) count = std::max(count, std::size_t{std::max({i.x, i.y, i.z})} + 1);
  return count;
}

void require_same_counts(const Mesh& mesh, const MeshSubdivision& subdivision) {
  require_count(subdivision.old_faces, mesh.faces.size(), "faces");
  require_count(subdivision.old_positions, mesh.positions.size(), "positions");
  require_at_least(old_count_of(subdivision.texcoords.of), mesh.texcoords.size(), "texcoords");
  if (subdivision.computed_normals == 0)
    require_at_least(old_count_of(subdivision.normals.of), mesh.normals.size(), "normals");
}

}  // namespace

std::vector<float> Combinations::combine(std::span<const float> values, std::size_t channels) const {
  require_at_least(old_count_of(of) * channels, values.size(), "values");
  if (of.empty()) return {values.begin(), values.end()};
  require_at_least(of.size(), weights.size(), "weights");
  std::vector<float> result;
  result.reserve(of.size() * channels);
  for (std::size_t i = 0; i < of.size(); ++i) {
    for (std::size_t c = 0; c < channels; ++c) {
      // Products are exact in double precision: two faces that share an edge get the same sum.
      double sum = 0;
      for (int k = 0; k < 3; ++k) sum += double{weights[i][k]} * double{values[of[i][k] * channels + c]};
      result.push_back(static_cast<float>(sum));
    }
  }
  return result;
}

std::vector<float> Combinations::pull_back(std::span<const float> gradient, std::size_t old_count,
                                           std::size_t channels) const {
  require_at_least(old_count_of(of), old_count, "old_count");
  require_at_least((of.empty() ? old_count : of.size()) * channels, gradient.size(), "gradient");
  if (of.empty())
    return {gradient.begin(), gradient.begin() + static_cast<std::ptrdiff_t>(old_count * channels)};
  require_at_least(of.size(), weights.size(), "weights");
  std::vector<double> sums(old_count * channels, 0.0);
  for (std::size_t i = 0; i < of.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      for (std::size_t c = 0; c < channels; ++c)
        sums[of[i][k] * channels + c] += double{weights[i][k]} * double{gradient[i * channels + c]};
    }
  }
  return {sums.begin(), sums.end()};
}

MeshSubdivision make_subdivision(const Mesh& mesh, std::span<const FacePiece> pieces, int computed_normals) {
  MeshSubdivision result;
  result.old_positions = mesh.positions.size();
  result.old_faces = mesh.faces.size();
  for (const FacePiece& piece : pieces) {
    result.face_of.push_back(piece.face);
    result.barycentrics.push_back(piece.barycentrics);
  }
  combine_corners(result, mesh.faces, mesh.positions.size(), result.vertices);
  combine_corners(result, mesh.face_texcoords, mesh.texcoords.size(), result.texcoords);
  result.computed_normals = computed_normals;
  if (computed_normals != 0) {
    result.normals = result.vertices;
  } else {
    combine_corners(result, mesh.face_normals, mesh.normals.size(), result.normals);
  }
  return result;
}

Mesh subdivide(const Mesh& mesh, const MeshSubdivision& subdivision) {
  if (!subdivision.is_cut()) return mesh;
  require_same_counts(mesh, subdivision);
  Mesh result = mesh;
  Combinations list;
  result.positions = combined(subdivision.vertices, mesh.positions);
  result.vertex_colors = combined(subdivision.vertices, mesh.vertex_colors);
  result.vertex_opacities = combined(subdivision.vertices, mesh.vertex_opacities);
  result.faces = combine_corners(subdivision, mesh.faces, mesh.positions.size(), list);
  result.texcoords = combined(subdivision.texcoords, mesh.texcoords);
  result.face_texcoords = combine_corners(subdivision, mesh.face_texcoords, mesh.texcoords.size(), list);
  result.face_colors = of_pieces(subdivision.face_of, mesh.face_colors);
  result.face_opacities = of_pieces(subdivision.face_of, mesh.face_opacities);
  result.face_textures = of_pieces(subdivision.face_of, mesh.face_textures);
  result.face_materials = of_pieces(subdivision.face_of, mesh.face_materials);
  result.normals = combined(subdivision.normals, directions_of(old_normals(mesh, subdivision)));
  result.face_normals = subdivision.computed_normals != 0
                            ? result.faces
                            : combine_corners(subdivision, mesh.face_normals, mesh.normals.size(), list);
  return result;
}

MeshGradient pull_back(const Mesh& mesh, const MeshSubdivision& subdivision, const MeshGradient& of_pieces) {
  if (!subdivision.is_cut()) return of_pieces;
  require_same_counts(mesh, subdivision);
  MeshGradient result = of_pieces;
  result.positions = pulled_back(subdivision.vertices, of_pieces.positions, mesh.positions.size());
  result.colors = of_whole(subdivision, of_pieces.colors, !mesh.face_colors.empty());
  result.opacities = of_whole(subdivision, of_pieces.opacities, !mesh.face_opacities.empty());
  result.texcoords = pulled_back(subdivision.texcoords, of_pieces.texcoords, mesh.texcoords.size());
  if (of_pieces.normals.empty() || subdivision.normals.of.empty()) return result;
  const std::vector<glm::dvec3> normals = old_normals(mesh, subdivision);
  const std::vector<glm::vec3> grad_directions =
      pulled_back(subdivision.normals, of_pieces.normals, normals.size());
  std::vector<glm::dvec3> grad_normals(normals.size());
  for (std::size_t i = 0; i < normals.size(); ++i)
    grad_normals[i] = direction_backward(normals[i], glm::dvec3(grad_directions[i]));
  if (subdivision.computed_normals == 0) {
    result.normals.assign(grad_normals.begin(), grad_normals.end());
  } else {
    result.normals.clear();
    if (result.positions.empty()) return result;
    for (glm::dvec3& grad : grad_normals) grad *= subdivision.computed_normals;
    const std::vector<glm::dvec3> added = normal_sums_backward(mesh.positions, mesh.faces, grad_normals);
    for (std::size_t i = 0; i < added.size(); ++i) result.positions[i] += glm::vec3(added[i]);
  }
  return result;
}

}  // namespace dpr
