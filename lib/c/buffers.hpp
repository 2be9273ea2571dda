// OpenCL objects of the caller's in the C interface.
#pragma once

#include "c/handles.hpp"
#include "dpr/opencl_handles.hpp"

namespace dpr::c {

BufferSpan to_span(const dpr_buffer* given, const char* argument);
Events to_events(const dpr_events* given);
/// Fills a versioned struct of the caller's.
void fill(dpr_buffer* given, const BufferView& view);
FrameRoom to_room(const dpr_frame_room* given);
void fill_history(std::size_t* emptied, dpr_frame_room* largest, const FrameHistory& history);

}  // namespace dpr::c
