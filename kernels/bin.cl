// (tile, triangle) pairs: counted (setup.cl), then listed in face order, sorted by tile (sort.cl), then
// linked. Pairs are numbered by tile, so that what belongs to a tile lies together; faces list theirs, so
// that gradients are gathered in order. The host launches for the capacity of the buffers; only the device
// knows how many pairs there are. Pairs that exceed the capacity are all left out, and the host, which reads
// the count later, starts over.
#include "group.h"
#include "tiles.h"

/// Lists of the pairs of tiles and triangles.
typedef struct {
  global uint *face, *tile;
} Places;

/// Lists a triangle's tiles in rows [x, y], all of its bounds' or those that it overlaps, from `place` on.
static inline void list_tiles(const FrameParams p, const Triangle t, uint face, uint2 rows, int are_all,
                              uint place, const Places out) {
  const uint2 columns = columns_of(t) / DPR_TILE;
  const uint first_tile = face / p.faces * p.tiles_x * p.tiles_y;
  for (uint y = rows.x; y <= rows.y; ++y) {
    for (uint x = columns.x; x <= columns.y; ++x) {
      if (!are_all && !is_listed(p, t, x, y)) continue;
      out.face[place] = face;
      out.tile[place] = first_tile + y * p.tiles_x + x;
      ++place;
    }
  }
}

/// Lists the tiles of every triangle, each at a place of its own. One work-item per (view, face); on GPUs the
/// large ones are a group's.
/// in   triangles   Triangle[view][face]  of those that have tiles
/// in   capacity    places that there are
/// in   offsets     uint[view * face + 1]  exclusive scan of the counts
/// out  pairs       uint[1]               how many there are; 0 where they do not fit
/// out  place_face  uint[place]           view * faces + face
/// out  place_tile  uint[place]           view * tiles + tile
DPR_SHARING_KERNEL kernel void bin_fill(const FrameParams p, const uint capacity,
                                        global const Triangle* restrict triangles,
                                        global const uint* restrict offsets, global uint* restrict pairs,
                                        global uint* restrict place_face, global uint* restrict place_tile) {
  const uint i = (uint)get_global_id(0), total = offsets[p.views * p.faces];
  const Places out = {place_face, place_tile};
  if (i == 0) pairs[0] = total > capacity ? 0 : total;
  const int has_places = i < p.views * p.faces && total <= capacity && offsets[i + 1] > offsets[i];
#if DPR_LANES == 1
  local uint shared[DPR_GROUP], sums[DPR_GROUP];
  const int shares = has_places && is_shared(triangles[i]);
  const uint last = group_collect(shares, i, shared, sums);
  for (uint k = 0; k < last; ++k) {
    const uint face = shared[k], first = offsets[face];
    const Triangle large = triangles[face];
    const uint2 rows = shared_rows(large);
    const int are_all = offsets[face + 1] - first == tiles_of_bounds(large);
    const uint place =
        first + group_scan(are_all ? tiles_of_rows(large, rows) : count_tiles(p, large, rows), sums);
    list_tiles(p, large, face, rows, are_all, place, out);
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  if (shares) return;
#endif
  if (!has_places) return;
  const Triangle t = triangles[i];
  const int are_all = offsets[i + 1] - offsets[i] == tiles_of_bounds(t);
  list_tiles(p, t, i, rows_of(t) / DPR_TILE, are_all, offsets[i], out);
}

/// Links pairs, numbered by tile, and the places where owners list theirs: faces, or contours. Any number of
/// work-items.
/// in   pairs        uint[1]
/// in   places       uint[pair]      where the pair's owner lists it
/// in   place_owner  uint[place]     view * faces + face, or the contour
/// out  pair_owner   uint[pair]
/// out  owner_pairs  uint[place]     the pairs of every owner, by tile
kernel void bin_link(global const uint* restrict pairs, global const uint* restrict places,
                     global const uint* restrict place_owner, global uint* restrict pair_owner,
                     global uint* restrict owner_pairs) {
  for (uint pair = (uint)get_global_id(0); pair < pairs[0]; pair += (uint)get_global_size(0)) {
    pair_owner[pair] = place_owner[places[pair]];
    owner_pairs[places[pair]] = pair;
  }
}
