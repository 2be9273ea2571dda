// Every struct that host and kernels share. 32-bit scalars and their vectors of two and four
// only, so that the layout is the same on every compiler; tests/device/layout_test.cpp compares sizes and
// offsets.
#ifndef DPR_SHARED_TYPES_H
#define DPR_SHARED_TYPES_H

#include "shared_constants.h"

#ifndef __OPENCL_C_VERSION__
#include <CL/cl_platform.h>

namespace dpr::shared {
using uint = cl_uint;
using float4 = cl_float4;
#endif

/// Sizes and settings of a frame that the geometry stages need.
typedef struct FrameParams {
  uint views, meshes, vertices, faces;
  uint position_stride;  /* from one view's positions to the next where views have shapes, else 0 */
  uint color_stride;     /* the same for colours */
  uint own_faces;        /* every view has faces of its own: face_rows.h. Then positions have a stride too */
  uint first_view;       /* of a larger batch, which names the noise; 0 otherwise */
  uint width, height;    /* pixels */
  uint tiles_x, tiles_y; /* tiles of one view */
  float pixel_size;      /* NDC: 2 / min(width, height) */
  float blur_distance;   /* NDC: triangles further than this from a pixel are not in its list */
  uint euclidean;        /* distances are NDC, not NDC^2 */
  uint perspective_correct;
  uint sharp;   /* distances have no noise: triangles cover what they own, and distances are not needed */
  float culled; /* the orientation of faces that are left out, +1 or -1; 0: none are */
  uint clips;   /* some face may cross the near plane: ClippedFace says which; 0: none is read */
  uint orthographic; /* the views are; then perspective_correct is 0 */
  uint distorts;     /* some view does */
  uint normals;      /* of a view: those of the vertices, then those that meshes give */
  /* Where corners' indices of these begin among those of their vertices, which come first; 0: the same. */
  uint color_faces, normal_faces, texcoord_faces, opacity_faces;
  uint texels, levels;            /* of all textures; of a pyramid, how many a fragment sees: 1 or 2 */
  uint has_base;                  /* fragments have base colours: the light falls on textures */
  uint fragments, grad_fragments; /* from one of their planes to the next */
  uint pairs, last_pair;          /* of the frame, or their capacity; where the band's end */
  uint mesh_edges,
      edges;    /* of the scene, or of a view's own faces; of a view: cuts of clipped faces are edges too */
  uint shading; /* DPR_UNLIT, DPR_FLAT, ...: whose creases are contours */
  float depth_reach; /* normalised depth: surfaces that much behind the nearest may still be seen */
  /* The window of samples that buffers hold (window.h): where it begins, how many of the frame's are not in
     it, and its first tile. All 0: the whole frame. */
  uint first_sample, absent_samples, first_tile;
  uint begin_tile, last_tile; /* of a launch by tiles: [begin_tile, last_tile) */
} FrameParams;

/// A mesh or an instance of it in the frame. Each has vertices and given normals of its own in the
/// frame; the positions and values of an instance's are its mesh's.
typedef struct MeshPlace {
  uint vertex_shift; /* the number of a vertex less that of its position */
  uint normal_shift; /* the number of a given normal less that of its value */
  uint is_instance;
  uint next; /* instance of the same mesh; the number of meshes after the last */
} MeshPlace;

/// A camera, ready for the kernels.
typedef struct ViewParams {
  float4 row[3];     /* world to camera, affine */
  float4 projection; /* NDC = (x, y) * projection.xy / depth + projection.zw; orthographic: depth is 1 */
  float4 eye;        /* camera centre, world; w = 1, or 0: the direction to a camera infinitely far away */
  float znear, zfar;
  float inverse_range;   /* 1 / (zfar - znear) */
  uint distorts;         /* DPR_BROWN or DPR_FISHEYE; 0: the lens is perfect, and the rest not read */
  float radial[4];       /* k1, k2, k3, k4: of powers 1 to 4 of the squared tangent, of a fisheye angle */
  float largest_radius2; /* squared tangent from which on points are held: the image folds over there */
  float tangential[2];   /* OpenCV's p2, -p1: its y axis points down; 0 of a fisheye */
  uint unused;
} ViewParams;

/// A triangle of a view after projection, if it is not dropped.
typedef struct Triangle {
  float x0, y0, x1, y1, x2, y2;   /* NDC */
  float z0, z1, z2;               /* view depth, positive in front */
  float orientation;              /* +1 counter-clockwise, -1 clockwise */
  uint first_sample, last_sample; /* column | row << 16, inclusive; of the blurred bounding box */
} Triangle;

/// Rest of a face that crosses the near plane: a triangle or a quadrilateral. Its corners are those
/// of the face that are not nearer than the plane, from `first` on, then the two cuts: of four the first cut
/// lies between the face's corners first + 1 and first + 2, the second between first and first + 2; of three
/// between first and first + 1, and first and first + 2 (all modulo 3).
typedef struct ClippedFace {
  float4 corner[3];  /* of the face, by a perfect lens: x, y in NDC times w, depth, w: depth, or 1 */
  float4 cut[2];     /* x, y in NDC; the plane's depth; the part of the way to the corner that is lost */
  float orientation; /* +1 counter-clockwise, -1 clockwise */
  uint corners;      /* 3 or 4; 0: the face is not clipped, and the rest not written */
  uint first, unused;
} ClippedFace;

/// The lights that all shading models share.
typedef struct LightingParams {
  uint lights, light; /* how many a view has; whose gradient is asked for */
  uint stride;        /* rows of a view in the list of lights, where each has its own; 0: they share them */
  float shininess;
} LightingParams;

/// A light of any kind.
typedef struct Light {
  float4 position; /* world; w = 1, or 0: the direction to a light infinitely far away */
  float4 diffuse, specular;
  float4 axis; /* of the cone, unit, away from the light; w = 1 / length of the axis given */
  float cos_outer;
  float inverse_edge; /* 1 / (cos_inner - cos_outer) */
  uint unused0, unused1;
} Light;

/// Light from all around. In the list of lights it has the place of DPR_ENVIRONMENT_ROWS of them, in front of a view's.
typedef struct Environment {
  float4 ambient;
  float4 harmonics[DPR_HARMONICS]; /* RGB, times the constants of the basis and of the cosine lobe */
} Environment;
#define DPR_ENVIRONMENT_ROWS 2

/// Gradients that shading's backward pass leaves per pair of its corners' colours, and, in scenes with
/// textures, of their texture coordinates and what levels of detail depend on: [pair][9] each; then, in lit
/// scenes, those of DPR_PAIR_LIT. They follow each other in one buffer, by this many elements a pair.
#define DPR_PAIR_COLORS 0
#define DPR_PAIR_TEXCOORDS 9
#define DPR_PAIR_STEPS 18
#define DPR_PAIR_LIT(is_textured) ((is_textured) ? 27 : 9)
#define DPR_PAIR_POSITIONS 0    /* [pair][9] in world space */
#define DPR_PAIR_NORMALS 9      /* [pair][9] */
#define DPR_PAIR_MATERIAL 18    /* [pair][DPR_MATERIAL_CHANNELS] */
#define DPR_MATERIAL_CHANNELS 4 /* RGB of the specular coefficient, shininess */
#define DPR_PAIR_EYE 22         /* [3][pair] of the camera centre */
#define DPR_PAIR_LIT_END 25

/// A texture, and where its texels lie among those of all.
typedef struct Texture {
  uint first;         /* texel of its largest level; the smaller ones follow */
  uint width, height; /* of that level */
  uint levels;        /* 1 unless the filter is trilinear */
  uint wrap, filter, unused0, unused1;
} Texture;

/// What a fragment sees of a level of its texture.
typedef struct SeenTexels {
  float red, green, blue; /* gradient of the mixture of four texels */
  uint tile;              /* view * tiles + tile */
  float right, below;     /* parts of the neighbours */
} SeenTexels;

/// Sampling of the Monte Carlo estimators; part of the structs below.
typedef struct Sampling {
  uint samples;
  uint draws;      /* DPR_INDEPENDENT, DPR_ANTITHETIC or DPR_STRATIFIED */
  float baseline;  /* 1: the rigid solution is subtracted from every sample (14); 0: it is not */
  float leave_out; /* 1 / (samples outside a group) for the leave-one-out baseline (noise.h); 0: none */
  uint seed_low, seed_high;
} Sampling;

/// The perturbation of distances.
typedef struct OccupancyParams {
  float sigma;
  uint noise_width; /* DPR_FIXED_WIDTH, DPR_VARIABLE_WIDTH or DPR_ZERO_WIDTH */
  Sampling sampling;
  uint width;                     /* pixels, to name a pixel's noise */
  uint faces;                     /* of one view */
  uint first_view;                /* of the batch that names the noise */
  uint fragments, grad_fragments; /* as in FrameParams */
} OccupancyParams;

/// Opacities in force.
typedef struct OpacityParams {
  float least, largest; /* of 0 there is no logarithm, and behind a surface of 1 nothing is looked at */
  uint is_sampled;      /* 1: occupancies are, and their backward pass divides by what the fragments hold */
  uint is_textured;     /* 1: textures have some */
} OpacityParams;

/// The perturbation of depths, and what a pixel's colour is made of.
typedef struct AggregateParams {
  float4 background;
  float sigma, gamma, alpha, background_depth;
  Sampling sampling;
  uint pixels_per_view;
  uint first_pixel, pixels;       /* of the window: its first, of all views', and how many it has */
  uint faces;                     /* of one view */
  uint first_view;                /* of the batch that names the noise */
  uint last_pixel;                /* where those of the launch end */
  uint channels;                  /* DPR_PIXEL_CHANNELS, or those before alpha's; or 0: none are written */
  uint fragments, grad_fragments; /* as in FrameParams */
  uint unused;
} AggregateParams;

/// One term of a pixel's perturbed arg-max, which exact aggregation's forward pass leaves for its backward
/// pass.
typedef struct Slot {
  float beta;      /* relative to the largest of its pixel (barrier) or its cluster's nearest (joint) */
  float occupancy; /* joint; barrier: of a pixel's first where its integral begins, of up to DPR_TRIPLE in
                      closed form their weights */
  float grad;      /* joint: transparency in front of a cluster's first, -1 for the others; then dL/dweight */
  uint fragment;   /* or DPR_BACKGROUND_SLOT */
} Slot;

/// An edge whose face is alone with its vertices: what has to be known of two before they are joined.
typedef struct OpenEdge {
  uint side;        /* 3 * face + the corner at which it begins */
  uint texture;     /* of the mesh's, or DPR_NO_TEXTURE */
  uint material;    /* of the mesh's */
  uint is_periodic; /* places a whole number apart are one */
  float4 places;    /* of its two ends in the texture, in periods */
} OpenEdge;

/// A crossing of a step that another contour has won. Planes of steps as antialias_cross.cl has them.
typedef struct SecondCrossing {
  uint step, contour;
  uint reference;    /* what shows the jump across it: see reference_of() in antialias_second.cl */
  float cut, slope2; /* of the contour: Cut of crossing.h */
} SecondCrossing;

/// Motion of a camera in a direction of tangents.
typedef struct ViewTangent {
  float4 rotation;    /* a rotation vector on the left of the view matrix */
  float4 translation; /* of the view matrix */
  float4 projection;  /* scale x, y, offset x, y */
  float4 lens[2];     /* coefficients in the lens' order, then zeros */
  float4 eye;         /* of the camera centre, or of the direction to it */
} ViewTangent;

/// Motion of a mesh: a rotation vector on the left of its matrix, and the matrix' translation.
typedef struct ModelTangent {
  float4 rotation, translation;
} ModelTangent;

/// Changes of what a frame has one of.
typedef struct FrameTangent {
  float4 background;
  float sigma, gamma, alpha;
  uint unused;
} FrameTangent;

/// What stages are told of tangents.
typedef struct TangentParams {
  uint directions;
  uint planes; /* of a direction's fragments; what is the same for all follows the last direction's */
  uint positions, colors; /* how many there are of a direction; 0: none changes, and none is read */
  uint lit;               /* tangents of the world are found, for light and attributes */
  uint base_plane;        /* of base colours where light falls on them, else of colours */
  uint first;             /* of the directions, among the images' */
} TangentParams;

/// Weights of the terms of a mesh's own loss, each with the number it is averaged over divided out, and its
/// sizes.
typedef struct MeshLossParams {
  float laplacian, edge_length, normal_consistency, flatness;
  float edge_target; /* object space */
  uint first_vertex; /* of the mesh, in the joined buffers */
  uint vertices, hinges;
} MeshLossParams;

/// A pass of the blur: out[a] = sum over b of weights[a * out_step - b * in_step + offset] * in[b], for taps
/// that there are. With the steps exchanged and symmetric weights it is its own transpose.
typedef struct BlurPass {
  uint lines;                 /* along rows: rows of all images; along columns: images */
  uint width;                 /* along columns: pixels of a row */
  uint out_length, in_length; /* pixels along the pass */
  int out_step, in_step, offset, taps;
  uint tile_rows;   /* of an image's samples, whose extents are known; 0: they are not */
  uint views;       /* the rest is read where they are. Image i has the extents of view i % views */
  uint image_lines; /* along rows: rows of an image */
  /* Input i along the pass, and across it, is made of samples i * step + first to i * step + end - 1. */
  int along_step, along_first, along_end, across_step, across_first, across_end;
  /* Along columns: where the launch's work-items end; the rows of inputs that there are, the others are added
     by other launches; and how many pixels lie before those that the buffers hold. */
  uint items;
  int first_row, last_row;
  uint in_shift, out_shift;
  uint has_sums; /* of blur_columns_scale: its input are the sums */
} BlurPass;

/// The blur by samples of the noise.
typedef struct ShiftParams {
  Sampling sampling;
  uint views, first_view;     /* first of the batch that names the noise */
  uint width, height;         /* pixels of an image */
  uint supersampling, margin; /* of the raster around it */
  uint radius;                /* samples: of the largest shift */
  uint unused;
} ShiftParams;

#ifndef __OPENCL_C_VERSION__
}  // namespace dpr::shared
#endif

#endif
