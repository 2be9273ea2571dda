/* The C interface, continued: shading of the caller's own, with noise on the pixel around it. dpr/dpr_frame.h includes
 * this. What is shaded on the host needs no device: dpr_interpolate(), dpr_vertex_normals() and dpr_texture_map(). */
#ifndef DPR_DPR_OWN_SHADING_H
#define DPR_DPR_OWN_SHADING_H

#ifndef DPR_DPR_FRAME_H
#error "include dpr/dpr.h, which includes this"
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Of frames with the preset "pixel" and without lights: what the samples of the rigid image show, and images of the
 * values that the caller finds for them; colours have no part in it, but that values may jump between faces whose
 * face_colors differ, as at contours: elsewhere within a surface such a jump has no gradient. The samples of a view are
 * a raster from the top left, `supersampling` a pixel and axis, with a margin around the image. They show the nearest
 * surface alone, or by the setting "layers=L" the nearest L, for values that blend these as see-through: contours count
 * then unless L surfaces hide them. */
typedef struct dpr_raster {
  int width, height, supersampling, margin; /* samples */
  int layers;
} dpr_raster;

DPR_API dpr_status dpr_frame_raster(dpr_frame* frame, dpr_raster* raster);
/* Fills those that are named: DPR_INT64 "face_id" [L N, h, w], -1 where nothing is; "barycentrics" [L N, h, w, 3], of
 * the face's corners, and "depth" [L N, h, w] along the view direction, world units, both 0 where nothing is;
 * "barycentric_steps" [L N, h, w, 4], how fast the barycentrics change from sample to sample, of corner 1 to the right
 * and down, then of corner 2. The N views of the nearest layer come first. Waits for the device. */
DPR_API dpr_status dpr_frame_samples(dpr_frame* frame, const dpr_array* samples, size_t count);
/* The gradients of sum <grads, samples>, of "barycentrics" and "depth", into `gradients` as dpr_frame_backward() has
 * them: of vertices, views and intrinsics. Where samples jump from face to face dpr_frame_resolve_backward() has the
 * rest. */
DPR_API dpr_status dpr_frame_samples_backward(dpr_frame* frame, const dpr_array* grads, size_t grad_count,
                                              const dpr_array* gradients, size_t gradient_count);
/* The samples of the nearest layer that show a face, for a shader that works on no others: how many there are, M. They
 * are in the order of "face_id". */
DPR_API dpr_status dpr_frame_covered(dpr_frame* frame, size_t* count);
/* Numbers of vertices at these M samples. Arrays: attributes [V, C] or [N, V, C]; and faces [F, 3] or [N, F, 3], indices
 * of the attributes for the corners of the frame's faces, or none for its own. values: [M, C]. */
DPR_API dpr_status dpr_frame_interpolate(dpr_frame* frame, const dpr_array* arrays, size_t count,
                                         const dpr_array* values);
/* The gradients of sum <grad_values, values>: of the attributes, and into `gradients` of vertices, views and intrinsics
 * by way of the samples' places on their faces, as dpr_frame_samples_backward() has them. */
DPR_API dpr_status dpr_frame_interpolate_backward(dpr_frame* frame, const dpr_array* arrays, size_t count,
                                                  const dpr_array* grad_values,
                                                  const dpr_array* grad_attributes,
                                                  const dpr_array* gradients, size_t gradient_count);
/* From values of the samples, [N, h, w, C] with any number of channels, to images [N, height, width, C]: blended across
 * contours and blurred. Linear in the values, which samples without a face need too: of values [M, C] of the samples of
 * dpr_frame_covered() these are 0. */
DPR_API dpr_status dpr_frame_resolve(dpr_frame* frame, const dpr_array* values, const dpr_array* images);
/* The gradients of sum <grad_images, images>: of the values, and into `gradients` of vertices, views and intrinsics by
 * way of the contours. That of sigma is refused. values: NULL for those of the frame's last dpr_frame_resolve(), of at
 * most 4 channels; another call that resolves values makes this an error. */
DPR_API dpr_status dpr_frame_resolve_backward(dpr_frame* frame, const dpr_array* values,
                                              const dpr_array* grad_images, const dpr_array* grad_values,
                                              const dpr_array* gradients, size_t gradient_count);
/* Forward mode of dpr_frame_samples(), along directions as dpr_frame_tangent() takes them: "barycentrics"
 * [directions L N, h, w, 3] and "depth" [directions L N, h, w]. */
DPR_API dpr_status dpr_frame_samples_tangent(dpr_frame* frame, size_t directions, const dpr_array* tangents,
                                             size_t tangent_count, const dpr_array* samples,
                                             size_t sample_count);
/* Forward mode of dpr_frame_resolve(), along directions in which values change by value_tangents
 * [directions N, h, w, C] as well: images [directions N, height, width, C]. */
DPR_API dpr_status dpr_frame_resolve_tangent(dpr_frame* frame, size_t directions, const dpr_array* tangents,
                                             size_t tangent_count, const dpr_array* values,
                                             const dpr_array* value_tangents, const dpr_array* images);

/* What nvdiffrast's rasterize() returns, of the last layer of a frame with one sample a pixel and the camera of a
 * dpr_clip_space. Arrays: its positions [N, V, 4]; faces [F, 3], or [N, F, 3] of each shape; and, if the faces' numbers
 * are to start elsewhere, DPR_INT64 "firsts" [N], which are added to them. Outputs: "rast" [N, H, W, 4], weights of the
 * corners 0 and 1, z/w, and the face's number plus 1, and "rast_db" [N, H, W, 4], how fast the first weight changes from
 * pixel to pixel along x and y, then the second. All are 0 where nothing is, and where z/w is not from -1 to 1. Rows are
 * the frame's: where its views are turned as OpenGL's images are, row 0 is at the bottom. */
DPR_API dpr_status dpr_clip_space_rast(dpr_frame* frame, const dpr_array* arrays, size_t count,
                                       const dpr_array* outputs, size_t output_count);

/* Numbers of vertices at samples (dpr/interpolate.hpp). Of the arrays face_id [L N, h, w], barycentrics [L N, h, w, 3]
 * and barycentric_steps as dpr_frame_samples() fills them, attributes [V, C] or [N, V, C], and faces [F, 3] or
 * [N, F, 3], indices of the attributes for the corners of the frame's faces. Outputs: "values" [L N, h, w, C], 0 where
 * nothing is, and "steps" [L N, h, w, 2 C], which need barycentric_steps: how fast each channel changes from sample to
 * sample to the right and down. In place of the frame's arrays there may be rast and rast_db of dpr_clip_space_rast(),
 * whose gradients have these names. */
DPR_API dpr_status dpr_interpolate(const dpr_array* arrays, size_t count, const dpr_array* outputs,
                                   size_t output_count);
/* The gradients of sum <grads, outputs>, of "attributes", "barycentric_steps" and "barycentrics", which are those of
 * corners 1 and 2: corner 0 has the rest, and gradient 0. Or of "rast", whose u and v are of corners 0 and 1, and
 * "rast_db". Grads at samples without a face have no part, and may be anything. */
DPR_API dpr_status dpr_interpolate_backward(const dpr_array* arrays, size_t count, const dpr_array* grads,
                                            size_t grad_count, const dpr_array* gradients,
                                            size_t gradient_count);
/* Forward mode along one direction, in which "attributes" and "barycentrics" change; of those left out, none. */
DPR_API dpr_status dpr_interpolate_tangent(const dpr_array* arrays, size_t count, const dpr_array* tangents,
                                           size_t tangent_count, const dpr_array* values);

/* Unit normals of vertices, as lights have them (dpr/vertex_normals.hpp): of float32 vertices [V, 3] or [N, V, 3] and
 * faces [F, 3], normals of the vertices' shape. */
DPR_API dpr_status dpr_vertex_normals(const dpr_array* arrays, size_t count, const dpr_array* normals);
/* The gradient of sum <grad_normals, normals> by the vertices. */
DPR_API dpr_status dpr_vertex_normals_backward(const dpr_array* arrays, size_t count,
                                               const dpr_array* grad_normals,
                                               const dpr_array* grad_vertices);

/* Texels at places, filtered (dpr/texture_map.hpp): values [N, h, w, C]. Of float32 arrays
 *
 *   texels[0]            [1, H, W, C]  of all images, or [N, H, W, C] of each
 *   texcoords            [N, h, w, 2]  u and v, v up: row 0 is on top
 *   or places            [N, h, w, 2]  the same with v down: row 0 is at 0
 *   or directions        [N, h, w, 3]  of cube maps, whose texels are [6, S, S, C] or [6 N, S, S, C]
 *   steps                [N, h, w, 2 C']  of these C' coordinates from pixel to pixel along x and y
 *   levels               [N, h, w]     added to the level, the logarithm to base 2 of texels a pixel; without steps the
 *                                      level
 *   texels[1], ...       instead of smaller versions that are made here: each half as large, rounded down
 *
 * filter: "nearest", "bilinear" (NULL), "trilinear", which blends two smaller versions by steps and levels, or
 * "mipmap", which reads the one next to the level. wrap: "repeat" (NULL), "mirror", "clamp" or "zero"; cube maps go on
 * beyond the borders of their faces. */
DPR_API dpr_status dpr_texture_map(const dpr_array* arrays, size_t count, const char* wrap,
                                   const char* filter, const dpr_array* values);
/* The gradients of sum <grad_values, values>, of the arrays that `gradients` names. */
DPR_API dpr_status dpr_texture_map_backward(const dpr_array* arrays, size_t count, const char* wrap,
                                            const char* filter, const dpr_array* grad_values,
                                            const dpr_array* gradients, size_t gradient_count);
/* Forward mode along one direction, in which the arrays that `tangents` name change. */
DPR_API dpr_status dpr_texture_map_tangent(const dpr_array* arrays, size_t count, const char* wrap,
                                           const char* filter, const dpr_array* tangents,
                                           size_t tangent_count, const dpr_array* values);

#ifdef __cplusplus
}
#endif

#endif
