/* The C interface, continued: views of a mesh rendered by one call from arrays that have names, and gradients
 * by the same names. What binds a language with arrays of its own needs nothing else; the Python package is
 * made of it. dpr/dpr.h includes this.
 *
 *   vertices             [V, 3] or [N, V, 3]  world space, of every view by itself or the same in all
 *   faces                [F, 3] or [N, F, 3]  whole numbers: indices of vertices
 *   views                [N, 4, 4]            world to camera, OpenGL axes, acting on column vectors; affine
 *   intrinsics           [N, 4]               fx, fy, cx, cy in pixels from the corner of the top-left pixel
 *                     or [N, 9]               the same, and OpenCV's k1, k2, p1, p2, k3 of the lens
 *                     or [N, 8]               the same, and k1, k2, k3, k4 of a lens of cv::fisheye
 *                     or [N, 1]               orthographic: world units from the lower to the upper edge
 *   colors               [V, 3] or [N, V, 3]  linear RGB
 *   or face_colors       [F, 3] or [N, F, 3]  white without either
 *   background           [3]                  linear RGB; black without
 *   texcoords            [V, 2]               of vertices
 *                     or [F, 3, 2]            of the faces' corners
 *                     or [T, 2]               with face_texcoords
 *   face_texcoords       [F, 3]               whole numbers
 *   textures[0], ...     [H, W, 3]            linear RGB, row 0 on top; they need texcoords
 *                     or [H, W, 4]            the fourth channel is opacity, from 0 to 1
 *   face_textures        [F]                  whole numbers, -1 for none; all have the first without
 *   materials.specular   [M, 3]               1 without
 *   materials.shininess  [M]                  those of the lights without
 *   face_materials       [F]                  whole numbers; all have the first without
 *   opacities            [V]                  from 0 to 1
 *   or face_opacities    [F]                  opaque without either
 *   lights.ambient       [3]                  0.5 without
 *   lights.harmonics     [9, 3]
 *   lights.point         [L, 9]               position, diffuse, specular
 *   lights.directional   [L, 9]               direction, away from the light, diffuse, specular
 *   lights.spot          [L, 14]              position, direction, angle and inner angle in degrees, diffuse,
 *                                             specular
 *   sigma, gamma, alpha  [] or [1]            instead of the settings'
 *
 * Textures may have a leading dimension of 1. So may lights, or one of N: then they are each view's own, as many of
 * a kind as in the others. With faces [N, F, 3] each view shows a mesh of its own, at the launches of one. Of fewer
 * faces than others the last are (0, 0, 0), of fewer vertices the last lie where another does. Then vertices are
 * [N, V, 3], colours [N, V, 3] or [N, F, 3], opacities [N, V] or [N, F], texture coordinates [T, 2] with
 * face_texcoords; those, face_textures and face_materials have N in front, and refer to lists of all meshes.
 *
 * Outputs, and their gradients:
 *
 *   image                [N, height, width, 4]  linear RGB over the background, and alpha, the silhouette
 *   depth, position,     [N, height, width, 4]  as dpr_attribute_create() has them: sums over faces, weight
 *   normal, texcoords                           times value, and in the last channel of the weights
 *   face_id              [N, height, width]     DPR_INT64: the face that weighs most, -1 on the background
 *   barycentrics         [N, height, width, 3]  of that face
 *   uv                   [N, height, width, 2]  of that face
 *   effective_faces      [N, height, width]     how many faces share a pixel
 *
 * The last four have no gradients. Errors name the array. All calls may come from several threads at once,
 * those with one frame one after the other. OpenCL does not survive fork(): in a process forked from one that
 * had opened a device they fail. */
#ifndef DPR_DPR_FRAME_H
#define DPR_DPR_FRAME_H

#ifndef DPR_DPR_H
#error "include dpr/dpr.h, which includes this"
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Type of an array's elements; of whole numbers either. */
typedef enum dpr_element { DPR_FLOAT32 = 0, DPR_INT32 = 1, DPR_INT64 = 2 } dpr_element;

/* Packed and row-major. */
typedef struct dpr_array {
  const char* name;
  void* data;     /* read or filled during the call */
  int element;    /* a dpr_element */
  int dimensions; /* 0 to 4 */
  size_t shape[4];
} dpr_array;

typedef struct dpr_frame dpr_frame;

typedef struct dpr_frame_options {
  size_t size;
  const char* device; /* as dpr_device_open() takes it; opened once in a process */
  int width, height;  /* pixels, 1 to 16384 */
  /* "sigma=1e-3", by the names of dpr_frame_settings(), in any order. Without "znear" and "zfar" every view
   * has powers of two around the depths of its vertices. */
  const char* const* settings; /* [setting_count] */
  size_t setting_count;
  int is_lit;        /* not 0: lights, also where no array gives one */
  size_t first_view; /* views of a larger batch that come before these: sampled noise is that of the batch */
  const char* const*
      gradients; /* [gradient_count], names of the arrays that backward passes may be asked for */
  size_t gradient_count;
  int defers_image; /* not 0: the image is rendered when it is asked for; samples are there without */
} dpr_frame_options;

#define DPR_FRAME_OPTIONS_INIT \
  { sizeof(dpr_frame_options), NULL, 128, 128, NULL, 0, 0, 0, NULL, 0, 0 }

/* "preset, sigma, ...": the keys of "smoothing" in the scene format; "znear", "zfar" and "cull"; "shading"
 * and "shininess" of lights; "wrap" and "filter" of textures, one word or one for each: "repeat,clamp"; "layers" of
 * samples, 1 to 256. */
DPR_API const char* dpr_frame_settings(void);
/* Refuses size and settings that cannot be rendered with, and settings that the smoothing does not use, such
 * as "sigma" of the preset "rigid". Opens no device. */
DPR_API dpr_status dpr_frame_check(const dpr_frame_options* options);
/* Renders, and seldom waits for the device. The frame holds buffers there, which the backward pass reads,
 * until it is destroyed; then they are kept for later calls with the same faces and size. */
DPR_API dpr_status dpr_frame_render(const dpr_frame_options* options, const dpr_array* arrays, size_t count,
                                    dpr_frame** frame);
/* Fills the arrays with the outputs that they name. Waits for the device. */
DPR_API dpr_status dpr_frame_read(dpr_frame* frame, const dpr_array* outputs, size_t count);
/* The gradients of sum <grads, outputs>. `grads` name outputs that were read before; `gradients` name arrays,
 * have their shapes and are filled, with 0 where nothing depends on them. Those of views are of any affine
 * matrices, with lights and of other outputs than the image of rigid motions. */
DPR_API dpr_status dpr_frame_backward(dpr_frame* frame, const dpr_array* grads, size_t grad_count,
                                      const dpr_array* gradients, size_t gradient_count);
/* Forward mode: derivatives of the images along `directions` directions at once, at least one. `tangents` name
 * arrays of which `gradients` of the options names as well, and are float32 [directions, ...], a row how fast
 * each number of the array changes; other arrays stay. Fills pixels, RGBA [direction][view][height][width][4],
 * `pixel_count` floats. The transpose of dpr_frame_backward(), views included. Directions share most of the
 * work: one costs up to two frames, six up to five. Waits for the device. Images have tangents along vertices, colors,
 * face_colors, opacities, face_opacities, views, intrinsics, background, sigma, gamma and alpha, other outputs none:
 * textures, texcoords, materials and lights are refused, and so are Monte Carlo and, with noise on the pixel
 * (preset "pixel"), a sigma that changes. */
DPR_API dpr_status dpr_frame_tangent(dpr_frame* frame, size_t directions, const dpr_array* tangents,
                                     size_t tangent_count, float* pixels, size_t pixel_count);

/* Not 0: no triangle of any view was rendered. */
DPR_API dpr_status dpr_frame_is_empty(dpr_frame* frame, int* is_empty);
DPR_API void dpr_frame_destroy(dpr_frame* frame);
/* Waits for what devices are doing, and frees what is kept there for later calls; what frames hold stays. To be called
 * before the process ends where work may be under way that nothing has read. */
DPR_API dpr_status dpr_frames_release(void);

/* Faces cut smaller where lenses bend their edges (dpr/subdivision.hpp), until no view shows a point further
 * than `tolerance` pixels from where it is drawn. Of the arrays vertices [V, 3], faces, views and intrinsics.
 */
typedef struct dpr_cut dpr_cut;
DPR_API dpr_status dpr_cut_create(const dpr_frame_options* options, const dpr_array* arrays, size_t count,
                                  float tolerance, dpr_cut** cut);
/* Numbers of pieces and vertices after the cut. */
DPR_API dpr_status dpr_cut_size(const dpr_cut* cut, size_t* faces, size_t* vertices);
/* Fills the arrays that are named: DPR_INT64 "faces" [face, 3], "face_of" [face], the face that each is a
 * piece of, and "vertices_of" [vertex, 3], old vertices that each is a sum of, by DPR_FLOAT32
 * "vertex_weights" [vertex, 3]. */
DPR_API dpr_status dpr_cut_read(const dpr_cut* cut, const dpr_array* arrays, size_t count);
DPR_API void dpr_cut_destroy(dpr_cut* cut);

/* Positions in OpenGL's clip space as vertices in front of a camera, for frames with noise on the pixel and without
 * lights: dpr/clip_space.hpp. Of the arrays positions [V, 4] or [N, V, 4], and faces [F, 3]: other vertices than
 * theirs may lie anywhere; without faces all count. */
typedef struct dpr_clip_space dpr_clip_space;
DPR_API dpr_status dpr_clip_space_create(int width, int height, const dpr_array* arrays, size_t count,
                                         dpr_clip_space** clip_space);
/* How many shapes there are, and numbers in a row of intrinsics: 4 of a pinhole, 1 of an orthographic camera. */
DPR_API dpr_status dpr_clip_space_size(const dpr_clip_space* clip_space, size_t* shapes, size_t* intrinsics);
/* Fills the float32 arrays that are named: vertices [N, V, 3], views [N, 4, 4] and intrinsics [N, ...], which frames
 * take, planes [2], their settings znear and zfar, and scales [N]. */
DPR_API dpr_status dpr_clip_space_read(const dpr_clip_space* clip_space, const dpr_array* arrays, size_t count);
/* From the gradients of vertices, [N, V, 3], to those of positions, [N, V, 4]. */
DPR_API dpr_status dpr_clip_space_backward(const dpr_clip_space* clip_space, const dpr_array* grad_vertices,
                                           const dpr_array* grad_positions);
DPR_API void dpr_clip_space_destroy(dpr_clip_space* clip_space);

/* A mesh of a file: dpr/mesh.hpp has the formats and their errors. */
typedef struct dpr_mesh_file dpr_mesh_file;

/* What dpr_frame_render() takes of it; whole numbers are DPR_INT32. */
typedef struct dpr_mesh_contents {
  size_t size;
  const dpr_array* arrays; /* [array_count] vertices, faces, and what else of a surface the file has */
  size_t array_count;
  const char* const* settings; /* [setting_count] "wrap" and "filter" of textures */
  size_t setting_count;
  const char* const* notes; /* [note_count] sentences: of what the file has, what is left out */
  size_t note_count;
} dpr_mesh_contents;

#define DPR_MESH_CONTENTS_INIT \
  { sizeof(dpr_mesh_contents), NULL, 0, NULL, 0, NULL, 0 }

DPR_API dpr_status dpr_mesh_file_read(const char* path, dpr_mesh_file** file);
/* Valid until the file is destroyed, and not to be written to. */
DPR_API dpr_status dpr_mesh_file_contents(const dpr_mesh_file* file, dpr_mesh_contents* contents);
DPR_API void dpr_mesh_file_destroy(dpr_mesh_file* file);
/* Writes OBJ, PLY or GLB, by the extension: vertices [V, 3], faces, colors [V, 3] or face_colors [F, 3], into OBJ and
 * GLB texture coordinates, and into GLB textures. */
DPR_API dpr_status dpr_mesh_file_write(const char* path, const dpr_array* arrays, size_t count,
                                       const char* const* settings, size_t setting_count);

/* An image of a file: dpr/image.hpp has the formats and their errors. `encoding` of files of 8 or 16 bits: "srgb"
 * (NULL), which becomes linear, or "linear", which is taken as it is. */
typedef struct dpr_image_file dpr_image_file;
DPR_API dpr_status dpr_image_file_read(const char* path, const char* encoding, dpr_image_file** file);
/* DPR_FLOAT32 [height, width, 4], linear RGB and alpha, row 0 on top. Valid until the file is destroyed, and not to be
 * written to. */
DPR_API dpr_status dpr_image_file_pixels(const dpr_image_file* file, dpr_array* pixels);
DPR_API void dpr_image_file_destroy(dpr_image_file* file);
DPR_API dpr_status dpr_image_file_write(const char* path, const char* encoding, const dpr_array* pixels);

#ifdef __cplusplus
}
#endif

#include "dpr/dpr_own_shading.h"

#endif
