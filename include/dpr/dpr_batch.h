/* The C interface, continued: scenes that share nothing but the size of their images, as one batch. dpr/dpr.h
 * includes this.
 *
 * Each scene has meshes, lights, cameras and smoothing of its own. For a loss and for buffers their images
 * are the views of one renderer, the first scene's first; every scene has a gradient, in the handles that
 * dpr_gradient_read() and the others take. Images and gradients are those of a renderer for each scene, to
 * the bit. What shares meshes and lights is faster as the views of one renderer. */
#ifndef DPR_DPR_BATCH_H
#define DPR_DPR_BATCH_H

#ifndef DPR_DPR_H
#error "include dpr/dpr.h, which includes this"
#endif

#include "dpr/dpr_on_device.h"

#ifdef __cplusplus
extern "C" {
#endif

DPR_API dpr_status dpr_batch_create(const dpr_device* device, dpr_batch** batch);
/* Checks and uploads `count` scenes as they are now, at least one, in place of those there were; each has the
 * view of its own camera. Errors say which scene it was. */
DPR_API dpr_status dpr_batch_set_scenes(dpr_batch* batch, const dpr_scene* const* scenes, size_t count);
/* The renderer of a scene, for its views and setters, and for losses of its meshes: what it sets is in force
 * with the batch's next forward pass. A handle of its own, to be destroyed like others; calls with it are
 * refused while the batch has no scene of that number. */
DPR_API dpr_status dpr_batch_scene_renderer(const dpr_batch* batch, size_t scene, dpr_renderer** renderer);
/* Renders every view of every scene. */
DPR_API dpr_status dpr_batch_forward(dpr_batch* batch);
/* The floats of all images: views of all scenes * height * width * 4. */
DPR_API dpr_status dpr_batch_image_size(const dpr_batch* batch, size_t* count);
/* All images, [view][height][width][4], row 0 on top, `count` floats. Waits for the device. */
DPR_API dpr_status dpr_batch_read_image(const dpr_batch* batch, float* pixels, size_t count);
/* The same in a buffer, four floats a pixel; valid until the next forward pass. Fills a struct that holds its
 * size. */
DPR_API dpr_status dpr_batch_image_view(dpr_batch* batch, dpr_buffer* view);

/* The loss of the batch's last images, mean over all views; its gradient stays on the device. */
DPR_API dpr_status dpr_loss_evaluate_batch(dpr_loss* loss, const dpr_batch* batch, double* value);
/* One backward pass through all scenes: gradients [count], as many as there are scenes, of which each handle
 * is to be destroyed. Of a loss that was evaluated on the last forward pass. */
DPR_API dpr_status dpr_batch_backward_loss(dpr_batch* batch, const dpr_loss* loss, dpr_gradient** gradients,
                                           size_t count);
/* Gradients of the sum of that loss and meshes' own, [count], each evaluated on its scene's renderer; NULL
 * for a scene without one. */
DPR_API dpr_status dpr_batch_backward_losses(dpr_batch* batch, const dpr_loss* loss,
                                             const dpr_mesh_loss* const* mesh_losses,
                                             dpr_gradient** gradients, size_t count);
/* Gradients of sum <grad, image> over views and pixels: grad is [view][height][width][4], `grad_count`
 * floats. */
DPR_API dpr_status dpr_batch_backward_pixels(dpr_batch* batch, const float* grad, size_t grad_count,
                                             dpr_gradient** gradients, size_t count);
/* The same from a cl_mem of the device's context. */
DPR_API dpr_status dpr_batch_backward_buffer(dpr_batch* batch, struct _cl_mem* grad, dpr_gradient** gradients,
                                             size_t count);
DPR_API void dpr_batch_destroy(dpr_batch* batch);

#ifdef __cplusplus
}
#endif

#endif
