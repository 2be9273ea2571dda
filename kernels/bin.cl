// (tile, triangle) pairs: counted (setup.cl), then listed in face order, sorted by tile (sort.cl), then
// linked. Pairs are numbered by tile, so that what belongs to a tile lies together; faces list theirs, so
// that gradients are gathered in order. The host launches for the capacity of the buffers; only the device
// knows how many pairs there are. Pairs that exceed the capacity are all left out, and the host, which reads
// the count later, starts over.
#include "tiles.h"

/// Lists the tiles of every triangle, each at a place of its own. One work-item per (view, face).
/// in   triangles   Triangle[view][face]  of those that have tiles
/// in   capacity    places that there are
/// in   offsets     uint[view * face + 1]  exclusive scan of the counts
/// out  pairs       uint[1]               how many there are; 0 where they do not fit
/// out  place_face  uint[place]           view * faces + face
/// out  place_tile  uint[place]           view * tiles + tile
/// out  places      uint[place]           the place itself: what sorting permutes
kernel void bin_fill(const FrameParams p, const uint capacity, global const Triangle* restrict triangles,
                     global const uint* restrict offsets, global uint* restrict pairs,
                     global uint* restrict place_face, global uint* restrict place_tile,
                     global uint* restrict places) {
  const uint i = (uint)get_global_id(0);
  if (i >= p.views * p.faces) return;
  const uint total = offsets[p.views * p.faces];
  if (i == 0) pairs[0] = total > capacity ? 0 : total;
  if (total > capacity) return;
  const uint count = offsets[i + 1] - offsets[i];
  if (count == 0) return;
  const Triangle t = triangles[i];
  const uint2 columns = columns_of(t) / DPR_TILE, rows = rows_of(t) / DPR_TILE;
  const int are_all = count == (columns.y - columns.x + 1) * (rows.y - rows.x + 1);
  const uint first_tile = i / p.faces * p.tiles_x * p.tiles_y;
  uint place = offsets[i];
  for (uint y = rows.x; y <= rows.y; ++y) {
    for (uint x = columns.x; x <= columns.y; ++x) {
      if (!are_all && !is_listed(p, t, x, y)) continue;
      place_face[place] = i;
      place_tile[place] = first_tile + y * p.tiles_x + x;
      places[place] = place;
      ++place;
    }
  }
}

/// Links pairs, numbered by tile, and the places where owners list theirs: faces, or contours. One work-item
/// for every pair within the capacity.
/// in   pairs        uint[1]
/// in   places       uint[pair]      where the pair's owner lists it
/// in   place_owner  uint[place]     view * faces + face, or the contour
/// out  pair_owner   uint[capacity]  0 where there is no pair
/// out  owner_pairs  uint[place]     the pairs of every owner, by tile
kernel void bin_link(const uint capacity, global const uint* restrict pairs,
                     global const uint* restrict places, global const uint* restrict place_owner,
                     global uint* restrict pair_owner, global uint* restrict owner_pairs) {
  const uint pair = (uint)get_global_id(0);
  if (pair >= capacity) return;
  if (pair >= pairs[0]) {
    pair_owner[pair] = 0;
    return;
  }
  pair_owner[pair] = place_owner[places[pair]];
  owner_pairs[places[pair]] = pair;
}
