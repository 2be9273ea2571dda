// Faces cut smaller where a lens bends their edges.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dpr/aov.hpp"
#include "dpr/export.h"
#include "dpr/mesh.hpp"
#include "dpr/renderer.hpp"
#include "dpr/scene.hpp"
#include "dpr/vectors.hpp"

namespace dpr {

/// When an edge is halved, and how many faces that may make.
struct LensSubdivisionOptions {
  /// > 0, pixels: how far a point of an edge may be drawn from where the lens shows it.
  float tolerance = 0.25F;
  std::size_t most_new_faces = std::size_t{1} << 22U;
};

/// New values as linear combinations of old ones: those that there were, in their order, then new ones. Empty
/// where nothing was cut: the new values are the old ones.
struct DPR_API Combinations {
  std::vector<uvec3> of;      ///< [new] indices of old values
  std::vector<vec3> weights;  ///< [new] theirs: multiples of 2^-24, >= 0, sum 1

  /// The new values from [old][channel]. Both throw InvalidArgument for lists that are too short.
  std::vector<float> combine(std::span<const float> values, std::size_t channels) const;
  /// The gradient of `old_count` old values, [old][channel], from that of the new ones. Deterministic.
  std::vector<float> pull_back(std::span<const float> gradient, std::size_t old_count,
                               std::size_t channels) const;
};

/// Cuts of a mesh's faces. All empty where none was cut.
struct MeshSubdivision {
  std::size_t old_positions = 0, old_faces = 0;  ///< of the mesh that was cut
  std::vector<std::uint32_t> face_of;            ///< [new face] the old face that it is a piece of, ascending
  std::vector<std::array<vec3, 3>> barycentrics;  ///< [new face][corner] in the old face
  Combinations vertices, texcoords;
  Combinations normals;  ///< of normals of length one
  /// Not 0: the old mesh gives no normals, and those combined are of its vertices, as the faces around them
  /// make them, times this sign.
  int computed_normals = 0;

  bool is_cut() const { return !face_of.empty(); }
};

/// The pieces of a mesh. It may have moved since it was cut, and have other colours, texture coordinates and
/// normals; faces and counts are those that it was cut with.
DPR_API Mesh subdivide(const Mesh& mesh, const MeshSubdivision& subdivision);
/// The mesh's gradient from that of its pieces. `mesh` is what they were made of.
DPR_API MeshGradient pull_back(const Mesh& mesh, const MeshSubdivision& subdivision,
                               const MeshGradient& of_pieces);

/// A scene whose faces were cut, and how.
struct SubdividedScene {
  Scene scene;  ///< entries of meshes, and instances, are those of the old one
  /// [entry of Scene::meshes] Of an instance: uncut, since it has its mesh's.
  std::vector<MeshSubdivision> meshes;
};

/// Halves edges until the lens of no view shows a point of one further from where it is drawn than the
/// tolerance: off the straight line, or elsewhere on it. What is on the faces is then within 4/3 of it. An
/// edge that is halved is so for every face at it, also between vertices that only coincide, so that no
/// cracks open. Counted are the faces that may be in an image and their edges as far as they are beyond
/// znear; an edge is halved 24 times at most. Colours, textures, materials and texture coordinates follow.
/// So do normals, unless there are no lights or shading is flat: a mesh without any gets those that it
/// shows, and scene.gradients asks for them where it asks for positions. Without a lens, and where nothing is
/// off, a mesh is the same to the bit.
///
/// `views`: of which it is to be right; none: the scene's own camera and transforms. With noise of the
/// triangles every piece has noise of its own. Light of flat and gouraud shading is that of the pieces, and
/// the cut at znear stays straight.
///
/// Throws InvalidArgument for a scene or views that cannot be rendered, a tolerance that is none, and where
/// more new faces were needed than `options` allows. O(views * faces) while nothing is cut.
DPR_API SubdividedScene subdivide_for_lens(const Scene& scene, const LensSubdivisionOptions& options = {},
                                           std::span<const View> views = {});

/// The gradient of the old scene from that of the cut one: of vertices, colours, texture coordinates and
/// normals; all else is the same. `scene` is the old one with the positions, colours, texture coordinates and
/// normals that were rendered. Throws InvalidArgument where a mesh was cut and views have shapes of their
/// own.
DPR_API SceneGradient pull_back(const Scene& scene, const SubdividedScene& subdivided,
                                SceneGradient of_pieces);

/// Faces and barycentrics of the old scene in place of those of the cut one.
DPR_API void name_old_faces(const Scene& scene, const SubdividedScene& subdivided, AuxiliaryOutputs& outputs);

}  // namespace dpr
