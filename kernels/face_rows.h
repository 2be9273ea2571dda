// Where the faces of a view are in the scene's tables: the same rows for all views, or view after view where each has
// faces of its own (FrameParams::own_faces). The corners by vertex, by row * 3 + corner, follow the same way.
#ifndef DPR_FACE_ROWS_H
#define DPR_FACE_ROWS_H

#include "shared_types.h"

/// The row of a view's first face.
static inline uint first_row(const FrameParams p, uint view) { return p.own_faces ? view * p.faces : 0; }

/// The row of a face, view * faces + face.
static inline uint row_of_face(const FrameParams p, uint view_face) {
  return p.own_faces ? view_face : view_face % p.faces;
}

/// Runs of corners by vertex or normal, `count` a view, of a view.
static inline global const uint* starts_of_view(const FrameParams p, uint view, uint count,
                                                global const uint* starts) {
  return starts + (p.own_faces ? view * count : 0);
}

#endif
