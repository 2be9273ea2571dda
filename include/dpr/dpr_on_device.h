/* The C interface, continued: everything on the device. dpr/dpr.h includes this.
 *
 * Positions, colours, texels, texture coordinates, normals, materials and transforms come from the caller's
 * buffers, images and gradients stay in buffers, and no call waits for the device or moves a byte to or from
 * it, except dpr_renderer_frame_history() and those frames and backward passes of which
 * dpr/opencl_handles.hpp says so: it says all of this. */
#ifndef DPR_DPR_ON_DEVICE_H
#define DPR_DPR_ON_DEVICE_H

#ifndef DPR_DPR_H
#error "include dpr/dpr.h, which includes this"
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Vectors of floats in a cl_mem of the device's context. One that a call fills is the library's, not
 * retained. */
typedef struct dpr_buffer {
  size_t size;
  struct _cl_mem* buffer;
  size_t byte_offset; /* before the first vector */
  size_t byte_stride; /* from one vector to the next; 0: they are packed */
  size_t count;       /* filled in by the library: vectors, and floats of each */
  size_t components;
} dpr_buffer;

#define DPR_BUFFER_INIT \
  { sizeof(dpr_buffer), NULL, 0, 0, 0, 0 }

/* Events that a call's work waits for, and the call's own event, which the caller releases. NULL: none. */
typedef struct dpr_events {
  size_t size;
  struct _cl_event* const* wait; /* [wait_count]; NULL if that is 0 */
  size_t wait_count;
  struct _cl_event** done; /* or NULL */
} dpr_events;

#define DPR_EVENTS_INIT \
  { sizeof(dpr_events), NULL, 0, NULL }

/* Room of frames; with noise on the pixel, contours need some too. */
typedef struct dpr_frame_room {
  size_t size;
  size_t pairs, fragments, contours;
} dpr_frame_room;

#define DPR_FRAME_ROOM_INIT \
  { sizeof(dpr_frame_room), 0, 0, 0 }

/* Vectors of three floats, as those of the calls without "_from"; texture coordinates are two. */
DPR_API dpr_status dpr_renderer_set_positions_from(dpr_renderer* renderer, size_t mesh,
                                                   const dpr_buffer* positions, const dpr_events* events);
DPR_API dpr_status dpr_renderer_set_colors_from(dpr_renderer* renderer, size_t mesh, const dpr_buffer* colors,
                                                const dpr_events* events);
DPR_API dpr_status dpr_renderer_set_texels_from(dpr_renderer* renderer, size_t mesh, size_t texture,
                                                const dpr_buffer* texels, const dpr_events* events);
DPR_API dpr_status dpr_renderer_set_texcoords_from(dpr_renderer* renderer, size_t mesh,
                                                   const dpr_buffer* texcoords, const dpr_events* events);
DPR_API dpr_status dpr_renderer_set_normals_from(dpr_renderer* renderer, size_t mesh,
                                                 const dpr_buffer* normals, const dpr_events* events);
/* Four floats: `specular`, and `shininess`; one below 1 is the lights'. */
DPR_API dpr_status dpr_renderer_set_materials_from(dpr_renderer* renderer, size_t mesh,
                                                   const dpr_buffer* materials, const dpr_events* events);
/* From 0 to 1, which is not checked. */
DPR_API dpr_status dpr_renderer_set_opacities_from(dpr_renderer* renderer, size_t mesh,
                                                   const dpr_buffer* opacities, const dpr_events* events);
DPR_API dpr_status dpr_renderer_set_texel_opacities_from(dpr_renderer* renderer, size_t mesh, size_t texture,
                                                         const dpr_buffer* opacities,
                                                         const dpr_events* events);
/* As dpr_renderer_set_shapes(); one that is NULL is the scene's. */
DPR_API dpr_status dpr_renderer_set_shapes_from(dpr_renderer* renderer, const dpr_buffer* positions,
                                                const dpr_buffer* colors, const dpr_events* events);
/* World to camera, [view] of twelve floats: the upper three rows of a matrix. */
DPR_API dpr_status dpr_renderer_set_view_matrices_from(dpr_renderer* renderer, const dpr_buffer* matrices,
                                                       const dpr_events* events);
/* Object to world, [view][mesh] of twelve floats: the upper three rows of a matrix. */
DPR_API dpr_status dpr_renderer_set_transforms_from(dpr_renderer* renderer, const dpr_buffer* transforms,
                                                    const dpr_events* events);
/* Frames that need no more than this are whole; until the next scene. Each count is at most 3435973832. */
DPR_API dpr_status dpr_renderer_reserve(dpr_renderer* renderer, const dpr_frame_room* room);
/* A frame that exceeds its room is emptied. The first call that knows of such frames waits for the device to
 * count its own, which is whole, and returns DPR_FRAME_EMPTIED: images and gradients of the emptied ones show
 * nothing. */
DPR_API dpr_status dpr_renderer_forward_on_device(dpr_renderer* renderer, const dpr_events* events);
/* Frames that were emptied since the last call, and what the largest needed. Waits for the device. */
DPR_API dpr_status dpr_renderer_frame_history(dpr_renderer* renderer, size_t* emptied,
                                              dpr_frame_room* largest);
/* The same for the caller's kernels: uint32_t pairs, fragments, contours and frames emptied, as one vector.
 */
DPR_API dpr_status dpr_renderer_frame_history_view(dpr_renderer* renderer, dpr_buffer* view);
/* From d loss / d image, [view][height][width] of four floats. */
DPR_API dpr_status dpr_renderer_backward_on_device(dpr_renderer* renderer, const dpr_buffer* grad,
                                                   const dpr_events* events);
/* The images, [view][height][width] of four floats; or a gradient of the last backward pass on the device, by
 * its name. Fills a struct that holds its size; valid as dpr/opencl_handles.hpp says. Gradients share
 * buffers: `byte_offset` receives where in its buffer a gradient begins, as the struct's member says too. */
DPR_API dpr_status dpr_renderer_image_view(dpr_renderer* renderer, dpr_buffer* view);
DPR_API dpr_status dpr_renderer_gradient_view(dpr_renderer* renderer, const char* name, dpr_buffer* view,
                                              size_t* byte_offset);
/* Copies of them, to the caller's buffers. */
DPR_API dpr_status dpr_renderer_copy_images(dpr_renderer* renderer, const dpr_buffer* images,
                                            const dpr_events* events);
DPR_API dpr_status dpr_renderer_copy_gradient(dpr_renderer* renderer, const char* name,
                                              const dpr_buffer* gradient, const dpr_events* events);
/* Auxiliary outputs by name, in a buffer of the library's or to the caller's; "face_id" are int32. */
DPR_API dpr_status dpr_renderer_aov_view(dpr_renderer* renderer, const char* name, dpr_buffer* view,
                                         const dpr_events* events);
DPR_API dpr_status dpr_renderer_copy_aov(dpr_renderer* renderer, const char* name, const dpr_buffer* outputs,
                                         const dpr_events* events);
/* The same calls for images of attributes. Values are [vertex] of as many floats as channels. */
DPR_API dpr_status dpr_attribute_set_values_from(dpr_attribute* attribute, const dpr_buffer* values,
                                                 size_t vertices, const dpr_events* events);
DPR_API dpr_status dpr_attribute_reserve(dpr_attribute* attribute, const dpr_frame_room* room);
DPR_API dpr_status dpr_attribute_forward_on_device(dpr_attribute* attribute, const dpr_renderer* renderer,
                                                   const dpr_events* events);
DPR_API dpr_status dpr_attribute_frame_history(dpr_attribute* attribute, size_t* emptied,
                                               dpr_frame_room* largest);
DPR_API dpr_status dpr_attribute_backward_on_device(dpr_attribute* attribute, const dpr_buffer* grad,
                                                    const dpr_events* events);
DPR_API dpr_status dpr_attribute_image_view(dpr_attribute* attribute, dpr_buffer* view);
DPR_API dpr_status dpr_attribute_gradient_view(dpr_attribute* attribute, const char* name, dpr_buffer* view,
                                               size_t* byte_offset);
DPR_API dpr_status dpr_attribute_copy_images(dpr_attribute* attribute, const dpr_buffer* images,
                                             const dpr_events* events);
DPR_API dpr_status dpr_attribute_copy_gradient(dpr_attribute* attribute, const char* name,
                                               const dpr_buffer* gradient, const dpr_events* events);

#ifdef __cplusplus
}
#endif

#endif
