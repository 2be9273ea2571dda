// Buffers that stay on the device, in the C interface.
#include "c/buffers.hpp"

using namespace dpr::c;

namespace dpr::c {

BufferSpan to_span(const dpr_buffer* given, const char* argument) {
  const auto buffer = versioned<dpr_buffer>(given, DPR_BUFFER_INIT, argument);
  return {buffer.buffer, buffer.byte_offset, buffer.byte_stride};
}

Events to_events(const dpr_events* given) {
  if (!given) return {};
  const auto events = versioned<dpr_events>(given, DPR_EVENTS_INIT, "events");
  if (events.wait_count > 0) deref(events.wait, "events.wait");
  return {{events.wait, events.wait_count}, events.done};
}

void fill(dpr_buffer* given, const BufferView& view) {
  fill<dpr_buffer>(given,
                   {sizeof(dpr_buffer), view.buffer, view.offset, view.stride, view.count, view.components},
                   "view");
}

FrameRoom to_room(const dpr_frame_room* given) {
  const auto room = versioned<dpr_frame_room>(given, DPR_FRAME_ROOM_INIT, "room");
  return {room.pairs, room.fragments, room.contours};
}

void fill_history(std::size_t* emptied, dpr_frame_room* largest, const FrameHistory& history) {
  *emptied = history.emptied;
  const FrameRoom& room = history.largest;
  fill<dpr_frame_room>(largest, {sizeof(dpr_frame_room), room.pairs, room.fragments, room.contours},
                       "largest");
}

}  // namespace dpr::c

dpr_status dpr_renderer_set_shapes_from(dpr_renderer* renderer, const dpr_buffer* positions,
                                        const dpr_buffer* colors, const dpr_events* events) {
  return guarded([&] {
    const auto optional_span = [](const dpr_buffer* given, const char* argument) {
      return given ? to_span(given, argument) : dpr::BufferSpan();
    };
    dpr::set_shapes(renderer_of(renderer), optional_span(positions, "positions"),
                    optional_span(colors, "colors"), to_events(events));
  });
}

dpr_status dpr_renderer_set_view_matrices_from(dpr_renderer* renderer, const dpr_buffer* matrices,
                                               const dpr_events* events) {
  return guarded([&] {
    dpr::set_view_matrices(renderer_of(renderer), to_span(matrices, "matrices"), to_events(events));
  });
}

dpr_status dpr_renderer_set_transforms_from(dpr_renderer* renderer, const dpr_buffer* transforms,
                                            const dpr_events* events) {
  return guarded([&] {
    dpr::set_transforms(renderer_of(renderer), to_span(transforms, "transforms"), to_events(events));
  });
}

dpr_status dpr_renderer_reserve(dpr_renderer* renderer, const dpr_frame_room* room) {
  return guarded([&] {
    const dpr::FrameRoom wanted = to_room(room);
    dpr::reserve(renderer_of(renderer), wanted);
  });
}

dpr_status dpr_renderer_forward_on_device(dpr_renderer* renderer, const dpr_events* events) {
  return guarded(
      [&] { require_none_emptied(dpr::forward_on_device(renderer_of(renderer), to_events(events))); });
}

dpr_status dpr_renderer_frame_history(dpr_renderer* renderer, std::size_t* emptied, dpr_frame_room* largest) {
  return guarded([&] {
    deref(emptied, "emptied");
    versioned<dpr_frame_room>(largest, DPR_FRAME_ROOM_INIT, "largest");
    fill_history(emptied, largest, dpr::frame_history(renderer_of(renderer)));
  });
}

dpr_status dpr_renderer_frame_history_view(dpr_renderer* renderer, dpr_buffer* view) {
  return guarded([&] { fill(view, dpr::frame_history_view(renderer_of(renderer))); });
}

dpr_status dpr_renderer_backward_on_device(dpr_renderer* renderer, const dpr_buffer* grad,
                                           const dpr_events* events) {
  return guarded(
      [&] { dpr::backward_on_device(renderer_of(renderer), to_span(grad, "grad"), to_events(events)); });
}

dpr_status dpr_renderer_image_view(dpr_renderer* renderer, dpr_buffer* view) {
  return guarded([&] { fill(view, dpr::image_view(renderer_of(renderer))); });
}

dpr_status dpr_renderer_gradient_view(dpr_renderer* renderer, const char* name, dpr_buffer* view,
                                      std::size_t* byte_offset) {
  return guarded([&] {
    deref(byte_offset, "byte_offset");
    fill(view, dpr::gradient_view(renderer_of(renderer), &deref(name, "name")));
    *byte_offset = view->byte_offset;
  });
}

dpr_status dpr_renderer_copy_images(dpr_renderer* renderer, const dpr_buffer* images,
                                    const dpr_events* events) {
  return guarded(
      [&] { dpr::copy_images(renderer_of(renderer), to_span(images, "images"), to_events(events)); });
}

dpr_status dpr_renderer_copy_gradient(dpr_renderer* renderer, const char* name, const dpr_buffer* gradient,
                                      const dpr_events* events) {
  return guarded([&] {
    dpr::copy_gradient(renderer_of(renderer), &deref(name, "name"), to_span(gradient, "gradient"),
                       to_events(events));
  });
}
