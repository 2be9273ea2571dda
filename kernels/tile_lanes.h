// Lanes no wider than a row of a tile, to which the runs of fragments are padded.
#ifndef DPR_TILE_LANES_H
#define DPR_TILE_LANES_H

#ifdef DPR_LANES
#if DPR_LANES == 16
#define DPR_WIDTH 8
#endif
#endif
#include "lanes.h"

#endif
