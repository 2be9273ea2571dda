// Contours between samples. Where a contour crosses the step between two neighbouring samples, at the fraction t of the
// way, the sample whose cell it cuts takes the other's colour for the part of the cell beyond: the image follows the
// contour, and dI/dt is the jump across it (Reynolds' transport theorem; Li, Aittala, Durand & Lehtinen, "Differentiable
// Monte Carlo ray tracing through edge sampling", 2018, eq. (5); on a raster Laine et al., "Modular primitives for
// high-performance differentiable rendering", 2020, section 3.6). Here every contour walks its own crossings, so that
// none is missed however small its triangles are.
//
// Steep edges are crossed along rows, flat ones along columns, and those between partly along both, so that each piece of a
// contour counts once. A step belongs to its first sample, the left or the upper one: planes [2][view][height][width], to
// the right and down. Of several contours in a step, one that occludes goes before a crease, then the nearest, then the
// first.
//
// A contour is hidden where the sample on its outer side shows what is nearer. Its inner side is not asked for its depth:
// at a smooth silhouette the surface rises steeply towards the camera there, and what hides the contour on that side alone
// has a contour of its own in the same step, which is nearer.
#include "contour.h"

/// Depths that differ by less than this part of them are not told apart.
#define DPR_DEPTH_SLACK 1e-5f

/// Depths across a crease follow its faces up to this part of their change within a step.
#define DPR_CREASE_SLACK 0.5f

/// The depth of the front-most fragment of every sample, INFINITY where there is none. One work-item per pixel.
/// in   starts  uint[pixel + 1]  runs of `list`
/// in   list    uint[...]        fragments, by pixel
/// in   depth   float[fragment]  view depth
/// out  front   float[pixel]
kernel void antialias_front(const uint last_pixel, global const uint* restrict starts, global const uint* restrict list,
                            global const float* restrict depth, global float* restrict front) {
  const uint pixel = (uint)get_global_id(0);
  if (pixel >= last_pixel) return;
  float nearest = INFINITY;
  for (uint i = starts[pixel]; i < starts[pixel + 1]; ++i) nearest = fmin(nearest, depth[list[i]]);
  front[pixel] = nearest;
}

/// NDC of a sample's centre, the same as pixel_centre() where there is a pixel.
static inline float2 sample_centre(const FrameParams p, int column, int row) {
#pragma OPENCL FP_CONTRACT OFF
  return (float2)((float)column + 0.5f - 0.5f * (float)p.width, 0.5f * (float)p.height - 0.5f - (float)row) *
         p.pixel_size;
}

/// A crossing of an edge with a line of samples, a row or a column.
typedef struct {
  int exists;
  int column, row;  // of the step's first sample
  float t;          // from it to the next, in [0, 1]
  float along;      // from the edge's first end to its second, in [0, 1]
} Crossing;

/// Whether a sample lies behind the edge: to the right of it, or below. One on the edge does if the triangles agree: see
/// is_owned_at().
static inline int is_behind(const RasterEdge e, float2 sample) {
  int side = side_of_line(e.a, e.b, sample);
  if (side == 0) side = e.b.y < e.a.y || (e.b.y == e.a.y && e.b.x < e.a.x) ? 1 : -1;
  return (side < 0) == e.ascends;
}

/// Where an edge crosses a line. The step is the one whose samples lie on different sides of it, as the triangles have
/// them. An end on the line belongs to its upper or right side, so that a chain of edges crosses it once.
static inline Crossing cross_line(const FrameParams p, const RasterEdge e, int line) {
  Crossing c;
  const float2 at = sample_centre(p, line, line);
  const float2 crossing = e.is_by_rows ? (float2)(e.a.x + (at.y - e.a.y) * e.slope, at.y)
                                  : (float2)(at.x, e.a.y + (at.x - e.a.x) * e.slope);
  const float2 in_samples = to_samples(p, crossing);
  const float position = e.is_by_rows ? in_samples.x : in_samples.y;
  c.exists = e.is_by_rows ? (e.a.y >= at.y) != (e.b.y >= at.y) : (e.a.x <= at.x) != (e.b.x <= at.x);
  c.along = clamp((e.is_by_rows ? at.y - e.a.y : at.x - e.a.x) * e.inverse, 0.0f, 1.0f);
  const float size = (float)(e.is_by_rows ? p.width : p.height);
  int first = (int)floor(clamp(position, -2.0f, size));
  if (c.exists) {
    if (is_behind(e, e.is_by_rows ? sample_centre(p, first, line) : sample_centre(p, line, first))) {
      --first;
    } else if (!is_behind(e, e.is_by_rows ? sample_centre(p, first + 1, line) : sample_centre(p, line, first + 1))) {
      ++first;
    }
  }
  c.column = e.is_by_rows ? first : line;
  c.row = e.is_by_rows ? line : first;
  c.t = clamp(position - (float)first, 0.0f, 1.0f);
  return c;
}

/// The part of a tile that lies on the raster, [first, last) columns and rows.
typedef struct {
  int first_column, last_column, first_row, last_row;
} TileSamples;

static inline TileSamples tile_samples(const FrameParams p, uint tile) {
  const uint in_view = tile % (p.tiles_x * p.tiles_y);
  TileSamples s;
  s.first_column = (int)(in_view % p.tiles_x * DPR_TILE);
  s.first_row = (int)(in_view / p.tiles_x * DPR_TILE);
  s.last_column = min(s.first_column + DPR_TILE, (int)p.width);
  s.last_row = min(s.first_row + DPR_TILE, (int)p.height);
  return s;
}

/// The lines [x, y) of a tile that an edge may cross.
static inline int2 lines_of_edge(const FrameParams p, const RasterEdge e, const TileSamples s) {
  const float2 a = to_samples(p, e.a), b = to_samples(p, e.b);
  const float low = e.is_by_rows ? fmin(a.y, b.y) : fmin(a.x, b.x), high = e.is_by_rows ? fmax(a.y, b.y) : fmax(a.x, b.x);
  const float first = (float)(e.is_by_rows ? s.first_row : s.first_column), last = (float)(e.is_by_rows ? s.last_row : s.last_column);
  return (int2)((int)clamp(floor(low), first, last), (int)clamp(ceil(high) + 1.0f, first, last));
}

/// Whether the tile owns the crossing's step, and the step has a second sample.
static inline int is_step_of(const FrameParams p, const RasterEdge e, const Crossing c, const TileSamples s) {
  return c.exists && c.column >= s.first_column && c.column < s.last_column && c.row >= s.first_row &&
         c.row < s.last_row && (e.is_by_rows ? c.column + 1 < (int)p.width : c.row + 1 < (int)p.height);
}

/// A contour of a tile.
typedef struct {
  float2 a, b;    // its ends, NDC
  float2 depths;  // of its ends
  uint4 record;
  uint view;
  int inner;      // on which side of a -> b its surface lies: inner_side()
  float by_rows;  // how much it counts by rows
} TileContour;

static inline TileContour load_contour(const FrameParams p, uint edges_of_view, uint contour,
                                       global const uint4* restrict edges, global const uint* restrict facing,
                                       global const float4* restrict ndc) {
  TileContour c;
  c.view = contour / 2 / edges_of_view;
  c.record = edges[contour / 2 - c.view * edges_of_view];
  const float3 a = ndc[c.view * p.vertices + c.record.x].xyz, b = ndc[c.view * p.vertices + c.record.y].xyz;
  c.a = a.xy;
  c.b = b.xy;
  c.depths = (float2)(a.z, b.z);
  c.inner = inner_side(edge_sides(c.record, facing + c.view * p.faces));
  c.by_rows = weight_by_rows(c.b - c.a);
  return c;
}

/// Whether the first sample of a step is on the contour's inner side.
static inline int first_is_inner(const TileContour c, const RasterEdge e) { return (c.inner > 0) == e.ascends; }

static inline float mix_depths(const FrameParams p, float2 depths, float along) {
  return p.perspective_correct ? 1.0f / ((1.0f - along) / depths.x + along / depths.y)
                               : depths.x + along * (depths.y - depths.x);
}

/// The depth of a face's plane at a sample; that of the edge where the face is too thin to say, or does not reach.
static inline float plane_depth(const FrameParams p, const TileContour c, float3 across, float2 sample, float otherwise) {
  const float2 ab = c.b - c.a, ac = across.xy - c.a, as = sample - c.a;
  const float area = ab.x * ac.y - ab.y * ac.x;
  if (!(fabs(area) > DPR_SLIVER_AREA)) return otherwise;
  const float third = (ab.x * as.y - ab.y * as.x) / area, second = (as.x * ac.y - as.y * ac.x) / area;
  const float first = 1.0f - second - third;
  if (!p.perspective_correct) return first * c.depths.x + second * c.depths.y + third * across.z;
  const float inverse = first / c.depths.x + second / c.depths.y + third / across.z;
  return inverse > 0.0f ? 1.0f / inverse : otherwise;
}

/// Whether something hides a crease from one of the step's samples: what lies nearer there than the face on its side.
static inline int hides_crease(const FrameParams p, const TileContour c, global const uint4* restrict faces,
                               global const float4* restrict ndc, int own, float2 sample, float front, float depth,
                               float slack) {
  const uint4 face = faces[own ? own_face(c.record) : other_face(c.record)];
  const float3 across = ndc[c.view * p.vertices + corner_across(face, c.record.x, c.record.y)].xyz;
  const float expected = plane_depth(p, c, across, sample, depth);
  return front < expected - slack - DPR_CREASE_SLACK * fabs(expected - depth);
}

/// The depth of the surface that a sample shows, at a crossing `distance` steps away, as the sample beyond continues it;
/// the sample's own if that is further.
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
static inline int is_hidden(const FrameParams p, const CrossingScene v, const TileContour c, const RasterEdge e,
                            const Crossing x, int is_crease, float depth) {
  const int to_next = e.is_by_rows ? 1 : (int)p.width, first = x.row * (int)p.width + x.column;
  const int inner_first = first_is_inner(c, e);
  const float slack = v.reach + DPR_DEPTH_SLACK * depth;
  if (is_crease) {
    const float2 here = sample_centre(p, x.column, x.row);
    const float2 next = sample_centre(p, x.column + e.is_by_rows, x.row + !e.is_by_rows);
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
  const uint is_crease = contour & 1u, before_is_crease = before & 1u;
  return before == DPR_NO_CROSSING || is_crease < before_is_crease ||
         (is_crease == before_is_crease && depth < before_depth);
}

/// Finds what crosses the steps of a tile. One work-item per tile of all views. Deterministic.
/// in   edges         uint4[edge]           see DPR_EDGE_FLAG
/// in   faces         uint4[face]           vertex indices
/// in   facing        uint[view][face]
/// in   ndc           float4[view][vertex]
/// in   tile_starts   uint[view * tile + 1] runs of pairs
/// in   pair_contour  uint[pair]            contour_number(), ascending within a tile
/// in   front         float[pixel]
/// out  winner        uint[2][pixel]        the contour that crosses a step, or DPR_NO_CROSSING
/// out  cut           float[2][pixel]       what it takes of a cell: of the first sample's where negative, else of the
///                                          second's; at most 1/2. Not written where nothing crosses
kernel void antialias_cross(const FrameParams p, const AntialiasParams a, global const ViewParams* restrict views,
                            global const uint4* restrict edges, global const uint4* restrict faces,
                            global const uint* restrict facing, global const float4* restrict ndc,
                            global const uint* restrict tile_starts, global const uint* restrict pair_contour,
                            global const float* restrict front, global uint* restrict winner,
                            global float* restrict cut) {
  const uint tile = (uint)get_global_id(0);
  const uint tiles = p.tiles_x * p.tiles_y, view = tile / tiles;
  if (view >= p.views) return;
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
    const TileContour c = load_contour(p, a.edges, contour, edges, facing, ndc);
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
        const uint in_tile = (plane * DPR_TILE + (uint)(x.row - s.first_row)) * DPR_TILE + (uint)(x.column - s.first_column);
        const float depth = mix_depths(p, c.depths, x.along);
        if (!goes_before(winner[step], nearest[in_tile], contour, depth)) continue;
        if (is_hidden(p, v, c, e, x, (int)(contour & 1u), depth)) continue;
        winner[step] = contour;
        cut[step] = weight * (x.t - 0.5f);
        nearest[in_tile] = depth;
      }
    }
  }
}

/// The steps that cut a sample's cell: to the right, down, from the left, from above.
#define DPR_STEPS 4

typedef struct {
  uint step[DPR_STEPS], other[DPR_STEPS];  // the step, and the sample at its other end
  float weight[DPR_STEPS];                 // of that sample; 0 where the contour, if any, cuts the other cell
  float turn[DPR_STEPS];                   // d weight / d cut
  int cuts_other[DPR_STEPS];               // whether a contour cuts the other cell
  float total;                             // of the weights, or 1 if that is less
} Cell;

static inline Cell load_cell(const FrameParams p, uint pixel, uint pixels, global const uint* restrict winner,
                             global const float* restrict cut) {
  const int has[DPR_STEPS] = {1, 1, pixel % p.width > 0, pixel / p.width % p.height > 0};
  const uint first[DPR_STEPS] = {pixel, pixels + pixel, pixel - 1, pixels + pixel - p.width};
  const uint other[DPR_STEPS] = {pixel + 1, pixel + p.width, pixel - 1, pixel - p.width};
  Cell c;
  float sum = 0.0f;
  for (int k = 0; k < DPR_STEPS; ++k) {
    c.step[k] = first[k];
    c.other[k] = other[k];
    c.turn[k] = k < 2 ? -1.0f : 1.0f;
    c.weight[k] = 0.0f;
    c.cuts_other[k] = 0;
    if (!has[k] || winner[first[k]] == DPR_NO_CROSSING) continue;
    const float own_cut = cut[first[k]] * c.turn[k];
    c.weight[k] = fmax(own_cut, 0.0f);
    c.cuts_other[k] = own_cut < 0.0f;
    sum += c.weight[k];
  }
  c.total = fmax(sum, 1.0f);
  return c;
}

/// Blends the samples. What crosses a cell on all sides may leave nothing of it: then the others share it. One work-item
/// per pixel. Deterministic.
/// in   winner, cut       [2][pixel]
/// in   raster            float4[pixel]
/// out  blended           float4[pixel]
kernel void antialias_forward(const FrameParams p, global const uint* restrict winner,
                              global const float* restrict cut, global const float4* restrict raster,
                              global float4* restrict blended) {
  const uint pixel = (uint)get_global_id(0), pixels = p.views * p.width * p.height;
  if (pixel >= pixels) return;
  const Cell c = load_cell(p, pixel, pixels, winner, cut);
  const float4 own = raster[pixel];
  float4 sum = own;
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (c.weight[k] > 0.0f) sum += c.weight[k] / c.total * (raster[c.other[k]] - own);
  }
  blended[pixel] = sum;
}

/// The gradients of the cuts, and every sample's part in its neighbour's cell. One work-item per pixel; each step
/// cuts one cell, so no two write the same place.
/// in   grad_blended   float4[pixel]
/// out  share          float[2][pixel]  of the step's other sample in the cell that it cuts; not written where nothing
///                                      crosses
/// out  grad_cut       float[2][pixel]  the same
kernel void antialias_backward(const FrameParams p, global const uint* restrict winner,
                               global const float* restrict cut, global const float4* restrict raster,
                               global const float4* restrict grad_blended, global float* restrict share,
                               global float* restrict grad_cut) {
  const uint pixel = (uint)get_global_id(0), pixels = p.views * p.width * p.height;
  if (pixel >= pixels) return;
  const Cell c = load_cell(p, pixel, pixels, winner, cut);
  const float4 own = raster[pixel], grad = grad_blended[pixel];
  float4 mixed = own;
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (c.weight[k] > 0.0f) mixed += c.weight[k] / c.total * (raster[c.other[k]] - own);
  }
  // Where the weights are scaled to add up to 1, so is what one of them changes.
  const float4 from = c.total > 1.0f ? mixed : own;
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (!(c.weight[k] > 0.0f)) continue;
    share[c.step[k]] = c.weight[k] / c.total;
    grad_cut[c.step[k]] = c.turn[k] * dot(grad, raster[c.other[k]] - from) / c.total;
  }
}

/// The gradients of the samples: each gathers what it gave to its neighbours. One work-item per pixel. Deterministic.
/// in   share        float[2][pixel]
/// out  grad_raster  float4[pixel]
kernel void antialias_backward_samples(const FrameParams p, global const uint* restrict winner,
                                       global const float* restrict cut, global const float* restrict share,
                                       global const float4* restrict grad_blended,
                                       global float4* restrict grad_raster) {
  const uint pixel = (uint)get_global_id(0), pixels = p.views * p.width * p.height;
  if (pixel >= pixels) return;
  const Cell c = load_cell(p, pixel, pixels, winner, cut);
  float kept = 1.0f;
  float4 sum = 0.0f;
  for (int k = 0; k < DPR_STEPS; ++k) {
    if (c.weight[k] > 0.0f) kept -= c.weight[k] / c.total;
    if (c.cuts_other[k]) sum += share[c.step[k]] * grad_blended[c.other[k]];
  }
  grad_raster[pixel] = sum + kept * grad_blended[pixel];
}

/// The gradients of the ends of contours: each walks its own crossings again, and takes those of the steps that it won.
/// One work-item per pair. Deterministic.
/// in   pairs, pair_contour, pair_tile  as in the forward pass
/// in   grad_cut       float[2][pixel]
/// out  grad_ends      float4[pair]     of x, y of the first end, x, y of the second, NDC
kernel void antialias_backward_edges(const FrameParams p, const AntialiasParams a, const uint pairs,
                                     global const uint4* restrict edges, global const uint* restrict facing,
                                     global const float4* restrict ndc, global const uint* restrict pair_contour,
                                     global const uint* restrict pair_tile, global const uint* restrict winner,
                                     global const float* restrict cut,
                                     global const float* restrict grad_cut, global float4* restrict grad_ends) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= pairs) return;
  const uint contour = pair_contour[pair];
  const TileContour c = load_contour(p, a.edges, contour, edges, facing, ndc);
  const TileSamples s = tile_samples(p, pair_tile[pair]);
  float2 grad_a = 0.0f, grad_b = 0.0f;
  float grad_weight = 0.0f;  // of what counts by rows
  for (int by_rows = 0; by_rows < 2; ++by_rows) {
    const float weight = by_rows ? c.by_rows : 1.0f - c.by_rows;
    if (weight == 0.0f) continue;
    const RasterEdge e = raster_edge(c.a, c.b, by_rows);
    const int2 lines = lines_of_edge(p, e, s);
    float at_a = 0.0f, at_b = 0.0f, of_weight = 0.0f;
    for (int line = lines.x; line < lines.y; ++line) {
      const Crossing x = cross_line(p, e, line);
      if (!is_step_of(p, e, x, s)) continue;
      const uint step = ((by_rows ? 0 : p.views) + c.view) * p.width * p.height + (uint)x.row * p.width + (uint)x.column;
      if (winner[step] != contour || cut[step] == 0.0f) continue;
      at_a += (1.0f - x.along) * grad_cut[step];
      at_b += x.along * grad_cut[step];
      of_weight += (x.t - 0.5f) * grad_cut[step];
    }
    // Rows count downwards. A crossing stays on its line: where an end moves along the edge, it does not move.
    const float scale = (by_rows ? 1.0f : -1.0f) * weight / p.pixel_size;
    const float2 direction = by_rows ? (float2)(1.0f, -e.slope) : (float2)(-e.slope, 1.0f);
    grad_a += at_a * scale * direction;
    grad_b += at_b * scale * direction;
    grad_weight += by_rows ? of_weight : -of_weight;
  }
  const float2 by_direction = grad_weight * weight_by_rows_gradient(c.b - c.a);
  grad_ends[pair] = (float4)(grad_a - by_direction, grad_b + by_direction);
}
