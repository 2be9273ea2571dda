// A scene whose faces are cut for the lenses of its views.
#include <algorithm>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "dpr/subdivision.hpp"
#include "mesh/mesh_subdivision.hpp"
#include "scene/lens_sides.hpp"
#include "scene/scene_parts.hpp"

namespace dpr {
namespace {

void validate(const LensSubdivisionOptions& options) {
  if (options.tolerance > 0) return;
  throw InvalidArgument("tolerance (subdivision for a lens)", checks::text(options.tolerance),
                        "a number of pixels > 0");
}

void validate(std::span<const View> views, std::size_t meshes) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    const std::string name = checks::element("views", v);
    validate(views[v].camera, checks::in("camera", name));
    if (views[v].transforms.size() != meshes) {
      throw InvalidArgument(checks::in("transforms", name), std::to_string(views[v].transforms.size()),
                            std::to_string(meshes) + ", one for each of the meshes");
    }
    for (const glm::mat4& transform : views[v].transforms)
      checks::require_affine(transform, checks::in("transform", name));
  }
}

/// Every place of a mesh before every lens.
std::vector<LensSides> lenses_before(std::size_t mesh, const Scene& scene, std::span<const View> views,
                                     double tolerance) {
  std::vector<LensSides> lenses;
  for (const View& view : views) {
    if (!view.camera.distortion) continue;
    for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
      if (scene.meshes[i].instance_of.value_or(i) != mesh) continue;
      lenses.emplace_back(view.camera, view.transforms[i], scene.width, scene.height, tolerance);
    }
  }
  return lenses;
}

/// Nonzero if the mesh is lit by normals computed from the faces around its vertices, which pieces would
/// change; -1 if its transform mirrors: given normals keep their side there, computed ones do not.
int computed_normals(const Scene& scene, const Instance& entry) {
  if (!scene.lights || scene.lights->shading == Shading::flat || !entry.mesh.face_normals.empty()) return 0;
  return glm::determinant(glm::dmat3(entry.transform)) < 0 ? -1 : 1;
}

MeshSubdivision cut(const Scene& scene, const Instance& entry, std::span<const LensSides> lenses,
                    std::size_t most_new) {
  const auto find_long_sides = [&](const std::array<glm::dvec3, 3>& corners, std::array<bool, 3>& is_off) {
    for (const LensSides& lens : lenses) lens.find(corners, is_off);
  };
  const Mesh& mesh = entry.mesh;
  const std::vector<FacePiece> pieces = cut_faces(mesh.positions, mesh.faces, find_long_sides, most_new);
  if (pieces.size() == mesh.faces.size()) return {};
  return make_subdivision(mesh, pieces, computed_normals(scene, entry));
}

void require_same_meshes(const Scene& scene, const SubdividedScene& subdivided) {
  if (scene.meshes.size() == subdivided.meshes.size()) return;
  throw InvalidArgument("meshes (subdivided scene)", std::to_string(scene.meshes.size()),
                        std::to_string(subdivided.meshes.size()) + ", as the scene has that was cut");
}

/// Origin of a face of the cut scene.
struct OldFace {
  std::size_t face;                              ///< counted through the meshes of the scene
  const std::array<glm::vec3, 3>* barycentrics;  ///< none: it was not cut
};

std::vector<OldFace> old_faces(const Scene& scene, const SubdividedScene& subdivided) {
  std::vector<OldFace> result;
  std::size_t first = 0;
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    const MeshSubdivision& mesh = subdivided.meshes[scene.meshes[i].instance_of.value_or(i)];
    const std::size_t faces = mesh_of(scene, i).faces.size();
    for (std::size_t f = 0; !mesh.is_cut() && f < faces; ++f) result.push_back({first + f, nullptr});
    for (std::size_t p = 0; p < mesh.face_of.size(); ++p)
      result.push_back({first + mesh.face_of[p], &mesh.barycentrics[p]});
    first += faces;
  }
  return result;
}

}  // namespace

SubdividedScene subdivide_for_lens(const Scene& scene, const LensSubdivisionOptions& options,
                                   std::span<const View> views) {
  validate(scene);
  validate(options);
  validate(views, scene.meshes.size());
  const View own = own_view(scene);
  if (views.empty()) views = std::span(&own, 1);
  SubdividedScene result{scene, std::vector<MeshSubdivision>(scene.meshes.size())};
  std::size_t most_new = options.most_new_faces;
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    if (scene.meshes[i].instance_of) continue;
    const auto lenses = lenses_before(i, scene, views, static_cast<double>(options.tolerance));
    if (lenses.empty()) continue;
    const Instance& entry = scene.meshes[i];
    MeshSubdivision& mesh = result.meshes[i] = cut(scene, entry, lenses, most_new);
    if (!mesh.is_cut()) continue;
    most_new -= mesh.face_of.size() - entry.mesh.faces.size();
    result.scene.meshes[i].mesh = subdivide(entry.mesh, mesh);
    if (mesh.computed_normals != 0 && scene.gradients.positions) result.scene.gradients.normals = true;
  }
  return result;
}

SceneGradient pull_back(const Scene& scene, const SubdividedScene& subdivided, SceneGradient of_pieces) {
  require_same_meshes(scene, subdivided);
  const bool is_cut = std::ranges::any_of(subdivided.meshes, &MeshSubdivision::is_cut);
  if (is_cut && !(of_pieces.shapes.positions.empty() && of_pieces.shapes.colors.empty())) {
    throw InvalidArgument("shapes (gradient of a subdivided scene)", "views with shapes of their own",
                          "views that share the scene's");
  }
  for (std::size_t i = 0; i < of_pieces.meshes.size(); ++i) {
    MeshGradient& mesh = of_pieces.meshes[i];
    mesh = pull_back(scene.meshes[i].mesh, subdivided.meshes[i], mesh);
    if (!scene.gradients.normals) mesh.normals.clear();
  }
  return of_pieces;
}

void name_old_faces(const Scene& scene, const SubdividedScene& subdivided, AuxiliaryOutputs& outputs) {
  require_same_meshes(scene, subdivided);
  const std::vector<OldFace> faces = old_faces(scene, subdivided);
  for (std::size_t i = 0; i < outputs.face_id.size(); ++i) {
    std::int32_t& id = outputs.face_id[i];
    if (id < 0) continue;
    if (static_cast<std::size_t>(id) >= faces.size()) {
      throw InvalidArgument("face_id (subdivided scene)", std::to_string(id),
                            "one of its " + std::to_string(faces.size()) + " faces");
    }
    const OldFace& old = faces[static_cast<std::size_t>(id)];
    id = static_cast<std::int32_t>(old.face);
    if (old.barycentrics == nullptr) continue;
    const auto& [a, b, c] = *old.barycentrics;
    const glm::vec3 in_piece = outputs.barycentrics[i];
    outputs.barycentrics[i] = in_piece.x * a + in_piece.y * b + in_piece.z * c;
  }
}

}  // namespace dpr
