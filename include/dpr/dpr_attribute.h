/* The C interface, continued: what a pixel shows beside its colour. dpr/dpr.h includes this. */
#ifndef DPR_DPR_ATTRIBUTE_H
#define DPR_DPR_ATTRIBUTE_H

#ifndef DPR_DPR_H
#error "include dpr/dpr.h, which includes this"
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Auxiliary outputs of the last forward pass by name: "depth", "normal" (3 floats), "face_id" (exact up to
 * 2^24, -1 for the background), "barycentrics" (3), "uv" (2), "effective_faces"; dpr/aov.hpp says what each
 * is. The floats of one, and its values, [view][height][width] and so on. Waits for the device. */
DPR_API dpr_status dpr_renderer_aov_size(const dpr_renderer* renderer, const char* name, size_t* count);
DPR_API dpr_status dpr_renderer_read_aov(dpr_renderer* renderer, const char* name, float* values,
                                         size_t count);

/* Images of "depth", "position", "normal" or "texcoords", with gradients; dpr/attribute_images.hpp has the
 * formulas. */
DPR_API dpr_status dpr_attribute_create(const dpr_device* device, const char* name,
                                        dpr_attribute** attribute);
/* Images of the caller's values at the vertices, `channels` of them, set by dpr_attribute_set_values(). */
DPR_API dpr_status dpr_attribute_create_values(const dpr_device* device, size_t channels,
                                               dpr_attribute** attribute);
/* [vertex][channel], the vertices of all meshes one after the other, instances' among them, which may have
 * numbers of their own. */
DPR_API dpr_status dpr_attribute_set_values(dpr_attribute* attribute, const float* values, size_t count);
/* Renders what the renderer's last forward pass shows. */
DPR_API dpr_status dpr_attribute_forward(dpr_attribute* attribute, const dpr_renderer* renderer);
/* The floats of the images, and these, [group][view][height][width][4]: three channels a group, and alpha.
 * Waits for the device. */
DPR_API dpr_status dpr_attribute_image_size(const dpr_attribute* attribute, size_t* count);
DPR_API dpr_status dpr_attribute_read_image(const dpr_attribute* attribute, float* pixels, size_t count);
/* Gradients of sum <grad, image>: of what the renderer's scene asked for of its geometry, poses, cameras and
 * smoothing; "values", [vertex][channel], are the caller's numbers'. */
DPR_API dpr_status dpr_attribute_backward_pixels(dpr_attribute* attribute, const float* grad, size_t count,
                                                 dpr_gradient** gradient);
DPR_API void dpr_attribute_destroy(dpr_attribute* attribute);

#ifdef __cplusplus
}
#endif

#endif
