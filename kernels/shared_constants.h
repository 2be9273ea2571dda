// Every number that host and kernels share: sizes, limits, flags, and places in arrays.
#ifndef DPR_SHARED_CONSTANTS_H
#define DPR_SHARED_CONSTANTS_H

/// Tiles are 8x8 pixels: a tile's coverage by a triangle is one 64-bit mask.
#define DPR_TILE 8

/// Work-items of a group that works together (group.h). On devices or for kernels with smaller groups the
/// host asks for fewer: a power of two, no less than DPR_LEAST_GROUP.
#ifndef DPR_GROUP
#define DPR_GROUP 64
#endif
#define DPR_LEAST_GROUP 16

/// Counts of a prefix sum, and elements of a sort, that one work-item handles in order, or one group.
#ifndef DPR_SCAN_CHUNK
#define DPR_SCAN_CHUNK 1024
#endif
#ifndef DPR_SORT_BLOCK
#define DPR_SORT_BLOCK 1024
#endif

/// Elements of a run of a sorted list that one work-item sums in order (runs.h), and slots for the sums of
/// chunks of a list.
#define DPR_RUN_CHUNK 512
#define DPR_RUN_SLOTS(count) (2 * ((count) / DPR_RUN_CHUNK + 1))

/// Sums over the fragments of a texel on GPUs (texels.cl). Fragments of a tile in a cell beyond which they have
/// their sum in a table, those beyond which a texel is a whole group's, and sorted places that a group looks at.
#define DPR_TEXEL_RUN 4
#define DPR_SHARED_TEXEL 128
#define DPR_TEXEL_BLOCK 256

/// Bits by which a pass of a sort orders, at most.
#define DPR_SORT_BITS 8

/// Pairs that a work-item handles in order, on devices whose lanes are vector registers (tile_lanes.h).
#define DPR_PAIR_GROUP 8

/// Faces, or corners, whose data a work-item fetches before it works on them, on such devices: they wait for memory
/// together, which matters where neighbours in the mesh are none in its lists.
#define DPR_FACE_GROUP 8

/// Faces of a work-item that measures volumes.
#define DPR_VOLUME_FACES 32

/// The logarithm of an occupancy of zero: far below any other, yet finite, so that nothing turns into a NaN.
#define DPR_LOG_ZERO (-1e30f)

/// Triangles whose doubled projected area is at most this, NDC^2, are slivers (is_sliver() in geometry.h): a
/// few millionths of a pixel at 4096x4096.
#define DPR_SLIVER_AREA 1e-12f

/// In place of a pair of which nothing is seen, where faces list theirs.
#define DPR_NO_PAIR 0xffffffffu

/// The fragment of a slot that is the background.
#define DPR_BACKGROUND_SLOT 0xffffffffu

/// Ways to draw noise, in the order of dpr::Draws.
#define DPR_INDEPENDENT 0
#define DPR_ANTITHETIC 1
#define DPR_STRATIFIED 2

/// Widths of the distance noise, in the order of dpr::OccupancyWidth.
#define DPR_FIXED_WIDTH 0
#define DPR_VARIABLE_WIDTH 1
#define DPR_ZERO_WIDTH 2

/// Shading models, in the order of dpr::Shading after the unlit one.
#define DPR_UNLIT 0
#define DPR_FLAT 1
#define DPR_PHONG 2
#define DPR_GOURAUD 3
#define DPR_BLINN 4
#define DPR_MICROFACET 5

/// In their place, in frames that show normals beside unlit colours: while contours are found, and crossings for the
/// colours; and while they are found for the normals.
#define DPR_BESIDE_NORMALS 6
#define DPR_NORMALS 7

/// Kinds of lights beyond points that kernels are built for: bits of DPR_LIGHTS.
#define DPR_LIGHTS_DISTANT 1   /* infinitely far away: position.w is 0 */
#define DPR_LIGHTS_CONES 2     /* within a cone about an axis */
#define DPR_LIGHTS_HARMONICS 4 /* an environment */

/// Coefficients of the environment: spherical harmonics up to the second order.
#define DPR_HARMONICS 9

/// Channels that shading's backward pass leaves per pair: of the environment (ambient light, harmonics), then
/// of each light (position, diffuse, specular; with cones the axis, and the cosines of the inner and outer
/// angle). RGB or x, y, z each.
#define DPR_ENVIRONMENT_CHANNELS(lights) ((lights)&DPR_LIGHTS_HARMONICS ? 3 + 3 * DPR_HARMONICS : 3)
#define DPR_LIGHT_CHANNELS(lights) ((lights)&DPR_LIGHTS_CONES ? 14 : 9)
#define DPR_CHANNEL_POSITION 0
#define DPR_CHANNEL_DIFFUSE 3
#define DPR_CHANNEL_SPECULAR 6
#define DPR_CHANNEL_AXIS 9
#define DPR_CHANNEL_COS_INNER 12
#define DPR_CHANNEL_COS_OUTER 13

/// Planes of fragments, FrameParams.fragments elements each, and of their gradients, grad_fragments each; all
/// indexed by 32 bits. Base colours have planes of their own where light falls on textures.
#define DPR_PLANE_DEPTH 0 /* view depth by the clipped barycentrics */
#define DPR_PLANE_BARY 1  /* clipped barycentrics of corners 1 and 2; gradients: relative to corner 0's */
#define DPR_PLANE_COLOR 3 /* linear RGB: 3 */
#define DPR_PLANE_LOG_OCCUPANCY 6 /* ln p, DPR_LOG_ZERO for p = 0 */
#define DPR_PLANE_DISTANCE 7      /* signed, positive inside, in the unit of sigma */
#define DPR_PLANE_OCCUPANCY 8     /* p, in [0, 1]; has no gradient */
#define DPR_PLANE_BASE 9          /* linear RGB: 3 */
#define DPR_GRAD_PLANE_BASE 8
/// Tangents of fragments have the planes before DISTANCE's, which turn into those of ln p, and those of base
/// colours after them.
#define DPR_TANGENT_PLANES DPR_PLANE_DISTANCE
#define DPR_TANGENT_PLANE_BASE DPR_TANGENT_PLANES
/// Rows of fragments: derivatives of their pixels' colour, in place of gradients; of alpha by ln p.
#define DPR_ROW_WEIGHT 0        /* by the fragment's own colour, of each channel */
#define DPR_ROW_DEPTH 1         /* RGB */
#define DPR_ROW_LOG_OCCUPANCY 4 /* RGB */
#define DPR_ROW_COVERAGE 7
#define DPR_FRAGMENT_ROWS DPR_GRAD_PLANE_BASE
#define DPR_PLANE(p, name) (DPR_PLANE_##name * (p).fragments)
#define DPR_GRAD_PLANE(p, name) (DPR_PLANE_##name * (p).grad_fragments)

/// Place of a fragment's base colour for the light: its triangle's corners, or planes of fragments.
#define DPR_BASE_OF_CORNERS 0
#define DPR_BASE_OF_FRAGMENTS 1

/// Values of dpr::Wrap (lib/image/texture_words.hpp has the names) and of dpr::Filter, in their order; and
/// the texture of a face that has none.
#define DPR_REPEAT 0
#define DPR_MIRROR 1
#define DPR_CLAMP 2
#define DPR_NEAREST 0
#define DPR_BILINEAR 1
#define DPR_TRILINEAR 2
#define DPR_NO_TEXTURE 0xffffffffu

/// Lenses of ViewParams.distorts.
#define DPR_BROWN 1
#define DPR_FISHEYE 2

/// Channels that the transform's backward pass leaves per vertex, to be summed over a view's meshes.
#define DPR_CHANNEL_MODEL 0       /* rotation vector, translation of the model matrix: 6 */
#define DPR_CHANNEL_VIEW 6        /* rotation vector, translation of the view matrix: 6 */
#define DPR_CHANNEL_PROJECTION 12 /* scale x, y, offset x, y of the projection: 4 */
#define DPR_POSE_CHANNELS 16
#define DPR_CHANNEL_DISTORTION 16 /* coefficients of the lens, in its order, where some view distorts: 5 */
#define DPR_LENS_CHANNELS 21
#define DPR_CUT_CHANNELS 9 /* of the projection and the distortion, what cuts add where some view distorts */

/// Channels that aggregation's backward pass leaves per pixel, at most: the joint composition has no alpha.
#define DPR_CHANNEL_BACKGROUND 0 /* 3 */
#define DPR_CHANNEL_GAMMA 3
#define DPR_CHANNEL_ALPHA 4
#define DPR_PIXEL_CHANNELS 5

/// Channels of the auxiliary outputs, and the face of a pixel that shows none.
#define DPR_AUXILIARY_DEPTH 0
#define DPR_AUXILIARY_NORMAL 1       /* 3 */
#define DPR_AUXILIARY_BARYCENTRICS 4 /* of corners 1 and 2: 2 */
#define DPR_AUXILIARY_EFFECTIVE_FACES 6
#define DPR_AUXILIARY_CHANNELS 7
#define DPR_NO_FACE 0xffffffffu

/// Facing of a face: the sense in which its corners wind in NDC. A dropped one is culled, has no area or
/// reaches nearer than the near plane, if the plane leaves nothing of it.
#define DPR_FACE_DROPPED 0
#define DPR_FACE_FRONT 1 /* counter-clockwise */
#define DPR_FACE_BACK 2

/// An edge is uint2(side of the own face, other face or DPR_NO_FACE); a side is 3 * face + the corner at
/// which it begins. DPR_EDGE_FLAG is set in the side where colours or normals may jump there, in the other
/// face where it goes through the edge in the same direction. DPR_EDGE_SEAM is set in the side where the
/// texture jumps, in the other face where, in the light, materials or given normals do.
#define DPR_EDGE_FLAG 0x80000000u
#define DPR_EDGE_SEAM 0x40000000u

/// In place of an open edge where a list of them ends; and of its side where a view has fewer than others.
#define DPR_NO_OPEN_EDGE 0xffffffffu
#define DPR_NO_SIDE 0xffffffffu

/// Edges are numbered in the order of their sides. Every face has the number of its first edge times
/// DPR_FACE_SIDES, and bit k set where side k is an edge's; DPR_NO_MESH_EDGE in place of the number of one.
#define DPR_FACE_SIDES 8
#define DPR_NO_MESH_EDGE 0xffffffffu

/// A contour's number is DPR_CONTOUR_FLAGS * (view * edges + edge), and: whether it is a crease; which of its
/// ends have corners that count (CornerArea in crossing.h); whether the surface that it bounds, or its own
/// face of a crease, lies to the left of first -> second end. DPR_CONTOUR_ONE, where normals are beside colours, is set
/// of a crease of colours alone; and, without DPR_CONTOUR_CREASE, of one of normals alone.
#define DPR_CONTOUR_CREASE 1u
#define DPR_CONTOUR_FIRST_END 2u
#define DPR_CONTOUR_SECOND_END 4u
#define DPR_CONTOUR_LEFT 8u
#define DPR_CONTOUR_ONE 16u
#define DPR_CONTOUR_FLAGS 32u

/// The contour of a step between samples that none crosses.
#define DPR_NO_CROSSING 0xffffffffu

/// Crossings that two lines of a tile have room for beside those that won their steps.
#define DPR_SECOND_CROSSINGS 8

/// Terms of a mesh's own loss by vertex: squared Laplacian, and half the squared excess of edge
/// lengths; and its hinges: 1 - cos, and that squared.
#define DPR_MESH_LOSS_CHANNELS 2

#endif
