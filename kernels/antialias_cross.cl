// Contours between samples. Where a contour crosses the step between two neighbouring samples, at the
// fraction t of the way, the sample whose cell it cuts takes the other's colour for the part of the cell
// beyond: the image follows the contour, and dI/dt is the jump across it (Reynolds' transport theorem; Li,
// Aittala, Durand & Lehtinen, "Differentiable Monte Carlo ray tracing through edge sampling", 2018, eq. (5);
// on a raster Laine et al., "Modular primitives for high-performance differentiable rendering", 2020, section
// 3.6). Here every contour walks its own crossings, so that none is missed however small its triangles are.
//
// Steep edges are crossed along rows, flat ones along columns, and those between partly along both, so that
// each piece of a contour counts once. A step belongs to its first sample, the left or the upper one: planes
// [2][view][height][width], to the right and down. Of several contours in a step, one that occludes goes
// before a crease, then the nearest, then the first.
//
// A contour is hidden where the sample on its outer side shows what is nearer. Its inner side is not asked
// for its depth: at a smooth silhouette the surface rises steeply towards the camera there, and what hides
// the contour on that side alone has a contour of its own in the same step, which is nearer.
#include "crossing.h"

/// Depths that differ by less than this part of them are not told apart.
#define DPR_DEPTH_SLACK 1e-5f

/// Depths across a crease follow its faces up to this part of their change within a step.
#define DPR_CREASE_SLACK 0.5f

/// The depth of the front-most fragment of every sample, INFINITY where there is none. One work-item per
/// pixel, up to `last_pixel`. Deterministic.
/// in   starts  uint[pixel + 1]  runs of `list`
/// in   list    uint[...]        fragments, by pixel
/// in   depth   float[fragment]  view depth
/// out  front   float[pixel]
kernel void antialias_front(const uint last_pixel, global const uint* restrict starts,
                            global const uint* restrict list, global const float* restrict depth,
                            global float* restrict front) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= last_pixel) return;
  float nearest = INFINITY;
  for (uint i = starts[pixel]; i < starts[pixel + 1]; ++i) nearest = fmin(nearest, depth[list[i]]);
  front[pixel] = nearest;
}

/// A contour of a tile.
typedef struct {
  float2 a, b;    // its ends, NDC
  float2 depths;  // of its ends
  uint4 record;
  uint view, flags;
  int inner;      // on which side of a -> b its surface lies: inner_side()
  float by_rows;  // how much it counts by rows
} TileContour;

static inline TileContour load_contour(const FrameParams p, const AntialiasParams a, uint contour,
                                       global const uint4* restrict edges, global const uint4* restrict faces,
                                       global const uint* restrict facing, global const float4* restrict ndc,
                                       global const ClippedFace* restrict clipped) {
  TileContour c;
  const uint numbered = contour / DPR_CONTOUR_FLAGS;
  c.flags = contour % DPR_CONTOUR_FLAGS;
  c.view = numbered / a.edges;
  const ViewEdge e = view_edge(edges_of_view(p, c.view, a.mesh_edges, edges, faces, ndc, clipped),
                               numbered - c.view * a.edges);
  c.record = e.record;
  c.a = e.end[0].xy;
  c.b = e.end[1].xy;
  c.depths = (float2)(e.end[0].z, e.end[1].z);
  c.inner = inner_side(edge_sides(c.record, facing + c.view * p.faces));
  c.by_rows = weight_by_rows(c.b - c.a);
  return c;
}

/// What its ends add to a crossing: nothing where they have no corners that count.
static inline CornerArea corner_of(const FrameParams p, const TileContour c, const RasterEdge e,
                                   const Crossing x, int is_second) {
  const CornerArea none = {0.0f, 0.0f, 0.0f, 0.0f};
  const uint flag = is_second ? DPR_CONTOUR_SECOND_END : DPR_CONTOUR_FIRST_END;
  return c.flags & flag ? corner_area(p, e, x, is_second ? e.b : e.a) : none;
}

/// What a crossing takes of a cell, if its lines are all that count.
static inline float line_cut(const FrameParams p, const TileContour c, const RasterEdge e, const Crossing x) {
  return x.t - 0.5f + corner_of(p, c, e, x, 0).area + corner_of(p, c, e, x, 1).area;
}

/// Whether the first sample of a step is on the contour's inner side.
static inline int first_is_inner(const TileContour c, const RasterEdge e) {
  return (c.inner > 0) == e.ascends;
}

static inline float mix_depths(const FrameParams p, float2 depths, float along) {
  return p.perspective_correct ? 1.0f / ((1.0f - along) / depths.x + along / depths.y)
                               : depths.x + along * (depths.y - depths.x);
}

/// The depth of a face's plane at a sample; that of the edge where the face is too thin to say, or does not
/// reach.
static inline float plane_depth(const FrameParams p, const TileContour c, float3 across, float2 sample,
                                float otherwise) {
  const float2 ab = c.b - c.a, ac = across.xy - c.a, as = sample - c.a;
  const float area = ab.x * ac.y - ab.y * ac.x;
  if (!(fabs(area) > DPR_SLIVER_AREA)) return otherwise;
  const float third = (ab.x * as.y - ab.y * as.x) / area, second = (as.x * ac.y - as.y * ac.x) / area;
  const float first = 1.0f - second - third;
  if (!p.perspective_correct) return first * c.depths.x + second * c.depths.y + third * across.z;
  const float inverse = first / c.depths.x + second / c.depths.y + third / across.z;
  return inverse > 0.0f ? 1.0f / inverse : otherwise;
}

/// Whether something hides a crease from one of the step's samples: what lies nearer there than the face on
/// its side.
static inline int hides_crease(const FrameParams p, const TileContour c, global const uint4* restrict faces,
                               global const float4* restrict ndc, int own, float2 sample, float front,
                               float depth, float slack) {
  const uint4 face = faces[own ? own_face(c.record) : other_face(c.record)];
  const float3 across = ndc[c.view * p.vertices + corner_across(face, c.record.x, c.record.y)].xyz;
  const float expected = plane_depth(p, c, across, sample, depth);
  return front < expected - slack - DPR_CREASE_SLACK * fabs(expected - depth);
}

/// The depth of the surface that a sample shows, at a crossing `distance` steps away, as the sample beyond
/// continues it; the sample's own if that is further.
static inline float depth_at_crossing(float front, float beyond, float distance) {
  const float continued = front + distance * (front - beyond);
  return continued > front && continued < INFINITY ? continued : front;
}

/// What the crossings of a tile are found by.
typedef struct {
  global const uint4* faces;
  global const float4* ndc;
  global const float* front;  // of the view
  float reach;                // view depth behind the nearest that may still be seen
} CrossingScene;

/// Whether something hides a contour from the step that it crosses.
static inline int is_hidden(const FrameParams p, const CrossingScene v, const TileContour c,
                            const RasterEdge e, const Crossing x, int is_crease, float depth) {
  const int to_next = e.is_by_rows ? 1 : (int)p.width, first = x.row * (int)p.width + x.column;
  const int inner_first = first_is_inner(c, e);
  const float slack = v.reach + DPR_DEPTH_SLACK * depth;
  if (is_crease) {
    const float2 here = pixel_centre(p, x.column, x.row);
    const float2 next = pixel_centre(p, x.column + e.is_by_rows, x.row + !e.is_by_rows);
    return hides_crease(p, c, v.faces, v.ndc, inner_first, here, v.front[first], depth, slack) ||
           hides_crease(p, c, v.faces, v.ndc, !inner_first, next, v.front[first + to_next], depth, slack);
  }
  const int outer = inner_first ? first + to_next : first, outwards = inner_first ? to_next : -to_next;
  const int place = (e.is_by_rows ? x.column : x.row) + (inner_first ? 2 : -1);
  const int is_inside = place >= 0 && place < (int)(e.is_by_rows ? p.width : p.height);
  const float beyond = is_inside ? v.front[outer + outwards] : INFINITY;
  return depth_at_crossing(v.front[outer], beyond, inner_first ? 1.0f - x.t : x.t) < depth - slack;
}

/// Whether a contour goes before the one that a step has so far.
static inline int goes_before(uint before, float before_depth, uint contour, float depth) {
  const uint is_crease = contour & DPR_CONTOUR_CREASE, before_is_crease = before & DPR_CONTOUR_CREASE;
  return before == DPR_NO_CROSSING || is_crease < before_is_crease ||
         (is_crease == before_is_crease && depth < before_depth);
}

/// Finds what crosses the steps of a tile. One work-item per tile of all views. Deterministic.
/// in   edges         uint4[edge]           of the scene; see DPR_EDGE_FLAG
/// in   faces         uint4[face]           vertex indices
/// in   facing        uint[view][face]
/// in   ndc           float4[view][vertex]
/// in   clipped       ClippedFace[view][face]  read where p.clips is set
/// in   tile_starts   uint[view * tile + 1] runs of pairs
/// in   pair_contour  uint[pair]            see DPR_CONTOUR_FLAGS, ascending within a tile
/// in   front         float[pixel]
/// out  winner        uint[2][pixel]        the contour that crosses a step, or DPR_NO_CROSSING. Not written
///                                          in tiles that are not near a contour: is_near_contour()
/// out  cut           float[2][pixel]       what it takes of a cell: of the first sample's where negative,
///                                          else of the second's. Not written where nothing crosses
kernel void antialias_cross(const FrameParams p, const AntialiasParams a,
                            global const ViewParams* restrict views, global const uint4* restrict edges,
                            global const uint4* restrict faces, global const uint* restrict facing,
                            global const float4* restrict ndc, global const ClippedFace* restrict clipped,
                            global const uint* restrict tile_starts, global const uint* restrict pair_contour,
                            global const float* restrict front, global uint* restrict winner,
                            global float* restrict cut) {
  const uint tile = (uint)get_global_id(0);
  const uint tiles = p.tiles_x * p.tiles_y, view = tile / tiles;
  if (view >= p.views || !is_near_contour(p, tile, tile_starts)) return;
  const uint pixels = p.views * p.width * p.height, first_pixel = view * p.width * p.height;
  const TileSamples s = tile_samples(p, tile);
  for (int row = s.first_row; row < s.last_row; ++row) {
    for (int column = s.first_column; column < s.last_column; ++column) {
      const uint pixel = first_pixel + (uint)row * p.width + (uint)column;
      winner[pixel] = winner[pixels + pixel] = DPR_NO_CROSSING;
    }
  }
  const CrossingScene v = {faces, ndc, front + first_pixel, a.depth_reach / views[view].inverse_range};
  float nearest[2 * DPR_TILE * DPR_TILE];
  for (uint pair = tile_starts[tile]; pair < tile_starts[tile + 1]; ++pair) {
    const uint contour = pair_contour[pair];
    const TileContour c = load_contour(p, a, contour, edges, faces, facing, ndc, clipped);
    for (int by_rows = 0; by_rows < 2; ++by_rows) {
      const float weight = by_rows ? c.by_rows : 1.0f - c.by_rows;
      if (weight == 0.0f) continue;
      const RasterEdge e = raster_edge(c.a, c.b, by_rows);
      const int2 lines = lines_of_edge(p, e, s);
      for (int line = lines.x; line < lines.y; ++line) {
        const Crossing x = cross_line(p, e, line);
        if (!is_step_of(p, e, x, s)) continue;
        const uint plane = by_rows ? 0 : 1;
        const uint step = plane * pixels + first_pixel + (uint)x.row * p.width + (uint)x.column;
        const uint row_in_tile = plane * DPR_TILE + (uint)(x.row - s.first_row);
        const uint in_tile = row_in_tile * DPR_TILE + (uint)(x.column - s.first_column);
        const float depth = mix_depths(p, c.depths, x.along);
        if (!goes_before(winner[step], nearest[in_tile], contour, depth)) continue;
        if (is_hidden(p, v, c, e, x, (int)(contour & DPR_CONTOUR_CREASE), depth)) continue;
        winner[step] = contour;
        cut[step] = weight * line_cut(p, c, e, x);
        nearest[in_tile] = depth;
      }
    }
  }
}

/// The gradients of the ends of contours: each walks its own crossings again, and takes those of the steps
/// that it won. One work-item per pair. Deterministic.
/// in   edges, faces, facing, ndc, clipped, winner, cut  as antialias_cross
/// in   pairs          uint[1]          how many there are
/// in   pair_contour   uint[pair]
/// in   pair_tile      uint[pair]       view * tiles + tile
/// in   grad_cut       float[2][pixel]
/// out  grad_ends      float4[pair]     of x, y of the first end, x, y of the second, NDC
kernel void antialias_cross_backward(const FrameParams p, const AntialiasParams a,
                                     global const uint* restrict pairs, global const uint4* restrict edges,
                                     global const uint4* restrict faces, global const uint* restrict facing,
                                     global const float4* restrict ndc,
                                     global const ClippedFace* restrict clipped,
                                     global const uint* restrict pair_contour,
                                     global const uint* restrict pair_tile,
                                     global const uint* restrict winner, global const float* restrict cut,
                                     global const float* restrict grad_cut,
                                     global float4* restrict grad_ends) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= pairs[0]) return;
  const uint contour = pair_contour[pair];
  const TileContour c = load_contour(p, a, contour, edges, faces, facing, ndc, clipped);
  const TileSamples s = tile_samples(p, pair_tile[pair]);
  float2 grad_a = 0.0f, grad_b = 0.0f;
  float grad_weight = 0.0f;  // of what counts by rows
  for (int by_rows = 0; by_rows < 2; ++by_rows) {
    const float weight = by_rows ? c.by_rows : 1.0f - c.by_rows;
    if (weight == 0.0f) continue;
    const RasterEdge e = raster_edge(c.a, c.b, by_rows);
    const int2 lines = lines_of_edge(p, e, s);
    float at_a = 0.0f, at_b = 0.0f, across_a = 0.0f, across_b = 0.0f, of_weight = 0.0f;
    for (int line = lines.x; line < lines.y; ++line) {
      const Crossing x = cross_line(p, e, line);
      if (!is_step_of(p, e, x, s)) continue;
      const uint step =
          ((by_rows ? 0 : p.views) + c.view) * p.width * p.height + (uint)x.row * p.width + (uint)x.column;
      if (winner[step] != contour || cut[step] == 0.0f) continue;
      const float grad = grad_cut[step];
      const CornerArea first = corner_of(p, c, e, x, 0), second = corner_of(p, c, e, x, 1);
      at_a += grad *
              (1.0f - x.along + first.height * (1.0f - first.along) + second.height * (1.0f - second.along));
      at_b += grad * (x.along + first.height * first.along + second.height * second.along);
      across_a += grad * first.width;
      across_b += grad * second.width;
      of_weight += grad * (x.t - 0.5f + first.area + second.area);
    }
    // Rows count downwards. A crossing stays on its line: where an end moves along the edge, it does not
    // move.
    const float scale = (by_rows ? 1.0f : -1.0f) * weight / p.pixel_size;
    const float2 direction = by_rows ? (float2)(1.0f, -e.slope) : (float2)(-e.slope, 1.0f);
    const float2 across = by_rows ? (float2)(0.0f, -1.0f) : (float2)(-1.0f, 0.0f);
    grad_a += scale * (at_a * direction + across_a * across);
    grad_b += scale * (at_b * direction + across_b * across);
    grad_weight += by_rows ? of_weight : -of_weight;
  }
  const float2 by_direction = grad_weight * weight_by_rows_gradient(c.b - c.a);
  grad_ends[pair] = (float4)(grad_a - by_direction, grad_b + by_direction);
}
