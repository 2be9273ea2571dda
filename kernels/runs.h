// Long runs of a sorted list are summed in chunks of fixed size, then the sums of the chunks: a fixed tree,
// so that no work-item walks a list as long as an image, and sums are the same from run to run. Chunks count
// from the run's first element. Their sums have slots: of a run's first chunk the odd one of the block of
// the list, as long as a chunk, that it begins in, of its other chunks the even one. No block has two of a
// kind: chunks of a run begin a block's length apart, and only the last of them is shorter.
#ifndef DPR_RUNS_H
#define DPR_RUNS_H

#include "shared_types.h"

/// True if a run [x, y) has sums of chunks.
static inline int has_chunks(uint2 run) { return run.y - run.x > DPR_RUN_CHUNK; }

static inline uint slot_of_chunk(uint2 run, uint begin) {
  return 2 * (begin / DPR_RUN_CHUNK) + (begin == run.x);
}

/// The elements [x, y) of the chunk whose sum has a slot; none where no long run has a chunk there.
/// in   count      of elements
/// in   list_keys  uint[count]      ascending
/// in   keys       runs that count: from 0 on
/// in   starts     uint[keys + 1]   runs of the list
static inline uint2 chunk_of_slot(uint slot, uint count, global const uint* list_keys, uint keys,
                                  global const uint* starts) {
  const uint first = slot / 2 * DPR_RUN_CHUNK, is_first = slot % 2;
  if (first >= count) return (uint2)(0);
  const uint key = list_keys[is_first ? min(count - first, (uint)DPR_RUN_CHUNK) - 1 + first : first];
  if (key >= keys) return (uint2)(0);
  const uint2 run = (uint2)(starts[key], starts[key + 1]);
  const uint before = first > run.x ? (first - run.x + DPR_RUN_CHUNK - 1) / DPR_RUN_CHUNK : 0;
  const uint begin = run.x + before * DPR_RUN_CHUNK;
  if (!has_chunks(run) || begin >= run.y || (begin == run.x) != is_first || begin < first) return (uint2)(0);
  return (uint2)(begin, min(begin + DPR_RUN_CHUNK, run.y));
}

#endif
