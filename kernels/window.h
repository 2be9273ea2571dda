// The window of a frame's samples that buffers of samples hold: whole rows of tiles, of one view after the
// other. All of them, unless the memory budget says otherwise.
#ifndef DPR_WINDOW_H
#define DPR_WINDOW_H

#include "shared_types.h"

static inline uint samples_of_window(const FrameParams p) {
  return p.views * p.width * p.height - p.absent_samples;
}

/// Place of a sample in the window.
static inline uint place_of_sample(const FrameParams p, uint view, uint column, uint row) {
  return (view * p.height + row) * p.width + column - p.first_sample;
}

/// The line of a place in the window, among those of all views.
static inline uint line_of_place(const FrameParams p, uint place) {
  return (place + p.first_sample) / p.width;
}

#endif
