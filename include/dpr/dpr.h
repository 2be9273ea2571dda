/* The C interface: the same renderer for programs in C99 and for languages that call C.
 *
 * Every function that can fail returns a dpr_status, and dpr_last_error() says what was wrong, one sentence,
 * of the calling thread's last call that failed. A call that fails changes nothing and gives no handle.
 * Handles are freed by their dpr_..._destroy(), which takes NULL; what was made from a handle may outlive it.
 * Threads may work at the same time on handles that nothing connects: each thread has a device, and what is
 * made from it, of its own.
 *
 * dpr/dpr_attribute.h, what a pixel shows beside its colour, dpr/dpr_frame.h, views rendered from named
 * arrays, dpr/dpr_batch.h, batches of scenes, and dpr/dpr_on_device.h, buffers of the caller's, come with this
 * header.
 *
 * Arrays are copied. Matrices are row-major and act on column vectors; a colour is linear RGB, a pixel is
 * linear RGBA. Structs begin with their size: fill them by their DPR_..._INIT, so that a program which was
 * compiled with an earlier version of this header works with a later library. */
#ifndef DPR_DPR_H
#define DPR_DPR_H

#include <stddef.h>
#include <stdint.h>

#include "dpr/export.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum dpr_status {
  DPR_SUCCESS = 0,
  DPR_INVALID_ARGUMENT = 1, /* an argument or the content of a file has a value that cannot be used */
  DPR_IO_ERROR = 2,         /* a file cannot be read */
  DPR_DEVICE_ERROR = 3,     /* an OpenCL call failed */
  DPR_BUILD_ERROR = 4,      /* a kernel did not compile */
  DPR_OUT_OF_MEMORY = 5,    /* of the host */
  DPR_INTERNAL_ERROR = 6,
  DPR_FRAME_EMPTIED = 7 /* the call's work is enqueued, but frames before it on the device were emptied */
} dpr_status;

/* Message of the thread's last call that failed; "" before. Valid until the thread's next call that fails. */
DPR_API const char* dpr_last_error(void);

/* "0.3.0": of the library that runs. */
DPR_API const char* dpr_version(void);

/* OpenCL's own, whose header need not be included. */
struct _cl_context;
struct _cl_command_queue;
struct _cl_mem;
struct _cl_event;

typedef struct dpr_device dpr_device;
typedef struct dpr_scene dpr_scene;
typedef struct dpr_renderer dpr_renderer;
typedef struct dpr_batch dpr_batch;
typedef struct dpr_loss dpr_loss;
typedef struct dpr_mesh_loss dpr_mesh_loss;
typedef struct dpr_attribute dpr_attribute;
typedef struct dpr_gradient dpr_gradient;

/* ---- Device ---- */

/* Opens a device: "" or NULL takes the best that can be used; "cpu", "gpu", an index as `dpr devices` lists
 * them, or a part of its name. */
DPR_API dpr_status dpr_device_open(const char* selector, dpr_device** device);

/* A device as `dpr devices` lists it. */
typedef struct dpr_device_info {
  size_t size;
  const char *platform, *name, *vendor, *version, *driver;
  const char* type; /* "cpu", "gpu" or "accelerator" */
  size_t memory_bytes;
  unsigned compute_units, lanes; /* lanes: width of the vectors that kernels are built with */
  int is_default;                /* not 0: what "" takes, if it can be used */
} dpr_device_info;

/* Number of devices; none is no error. */
DPR_API dpr_status dpr_device_count(size_t* count);
/* Fills a struct that holds its size. Texts are valid until the thread's next call of this. */
DPR_API dpr_status dpr_device_describe(size_t index, dpr_device_info* info);

/* Uses the caller's cl_context and in-order cl_command_queue, which are retained. Of an out-of-order queue it
 * takes the device alone, and makes an in-order queue beside it. */
DPR_API dpr_status dpr_device_adopt(struct _cl_context* context, struct _cl_command_queue* queue,
                                    dpr_device** device);

/* The device's name; valid as long as the handle. */
DPR_API dpr_status dpr_device_name(const dpr_device* device, const char** name);

DPR_API void dpr_device_destroy(dpr_device* device);

/* ---- Scene ---- */

/* An OpenGL camera: right-handed, looks down -z, y up. */
typedef struct dpr_camera {
  size_t size;
  float view[16];       /* world to camera */
  float fov_y_degrees;  /* full vertical field of view, in (0, 180); ignored if fx is not 0 */
  float fx, fy, cx, cy; /* intrinsics, pixels; the origin is the corner of the top-left pixel */
  float znear, zfar;    /* 0 < znear < zfar, along the view direction */
  /* OpenCV's k1, k2, p1, p2, k3 of the lens; NULL: it does not distort. Read during the call. Vertices are
   * moved and edges stay straight, so faces should be small. */
  const float* distortion;
  /* Not 0: orthographic, so many world units from lower to upper edge; fx is 0 then, distortion and fisheye NULL. */
  float orthographic_height;
  const float* fisheye; /* k1, k2, k3, k4 of a lens of cv::fisheye, instead of distortion; NULL: none */
} dpr_camera;

#define DPR_CAMERA_INIT                                                                                    \
  {                                                                                                        \
    sizeof(dpr_camera), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, 60.0f, 0, 0, 0, 0, 1.0f, 100.0f, \
        NULL, 0, NULL                                                                                      \
  }

/* Texture beyond [0, 1]: the image again, the image mirrored at every border, or its border's texels. */
typedef enum dpr_wrap { DPR_WRAP_REPEAT = 0, DPR_WRAP_MIRROR = 1, DPR_WRAP_CLAMP = 2 } dpr_wrap;

/* Between the centres of texels: the nearest, the four around, or those of two levels of a pyramid. */
typedef enum dpr_filter { DPR_FILTER_NEAREST, DPR_FILTER_BILINEAR, DPR_FILTER_TRILINEAR } dpr_filter;

/* Texture coordinates (u, v) have v up: (0, 0) is the lower left corner of the image. */
typedef struct dpr_texture {
  int width, height;   /* 1 to 16384 */
  const float* texels; /* [height][width][3], row 0 on top */
  int wrap;            /* a dpr_wrap */
  int filter;          /* a dpr_filter */
} dpr_texture;

/* The texture of a face that has none. */
#define DPR_TEXTURE_NONE UINT32_MAX

/* Highlights of a surface: those of the lights are multiplied by `specular` (microfacet: its F0). */
typedef struct dpr_material {
  float specular[3];
  float shininess; /* >= 1; 0: that of the lights */
} dpr_material;

/* At most one of the two colour arrays is given; with neither the mesh is white. Textures are multiplied by
 * the colours, and need texcoords and face_texcoords. */
typedef struct dpr_mesh {
  size_t size;
  const float* positions; /* [vertex][3], object space */
  size_t vertices;
  const uint32_t* faces; /* [face][3], indices of vertices */
  size_t face_count;
  const float* vertex_colors; /* [vertex][3], or NULL */
  const float* face_colors;   /* [face][3], or NULL */
  const float* transform;     /* [16], object to world; NULL: the identity */
  const float* texcoords;     /* [texcoord][2], or NULL */
  size_t texcoord_count;
  const uint32_t* face_texcoords; /* [face][3], indices of texcoords, or NULL */
  const dpr_texture* textures;    /* [texture_count], or NULL */
  size_t texture_count;
  const uint32_t* face_textures; /* [face], indices of textures or DPR_TEXTURE_NONE; NULL: all the first */
  const float* normals;          /* [normal][3], object space, of any length; NULL: those of the faces */
  size_t normal_count;
  const uint32_t* face_normals;  /* [face][3], indices of normals, or NULL */
  const dpr_material* materials; /* [material_count], or NULL */
  size_t material_count;
  const uint32_t* face_materials;      /* [face], indices of materials; NULL: all the first */
  const float* vertex_opacities;       /* [vertex], from 0 to 1, or NULL */
  const float* face_opacities;         /* [face], or NULL; at most one of the two */
  const float* const* texel_opacities; /* [texture_count] of [height][width], from 0 to 1, or NULL */
} dpr_mesh;

#define DPR_MESH_INIT                                                                                        \
  {                                                                                                          \
    sizeof(dpr_mesh), NULL, 0, NULL, 0, NULL, NULL, NULL, NULL, 0, NULL, NULL, 0, NULL, NULL, 0, NULL, NULL, \
        0, NULL, NULL, NULL, NULL                                                                            \
  }

typedef enum dpr_shading {
  DPR_SHADING_FLAT = 0,
  DPR_SHADING_PHONG = 1,
  DPR_SHADING_GOURAUD = 2,
  DPR_SHADING_BLINN = 3,
  DPR_SHADING_MICROFACET = 4 /* glTF's reflection: dpr/light.hpp */
} dpr_shading;

/* World space, without attenuation. */
typedef struct dpr_point_light {
  float position[3], diffuse[3], specular[3];
} dpr_point_light;

/* Directions point away from the light; their length does not matter. */
typedef struct dpr_directional_light {
  float direction[3], diffuse[3], specular[3];
} dpr_directional_light;

/* A point light that fades from the inner angle to the angle, both from the axis; at least 0.1 apart. */
typedef struct dpr_spot_light {
  float position[3], direction[3];
  float angle_degrees, inner_angle_degrees;
  float diffuse[3], specular[3];
} dpr_spot_light;

typedef struct dpr_lights {
  size_t size;
  float ambient[3];
  const dpr_point_light* point; /* [point_count]; NULL if that is 0 */
  size_t point_count;
  float shininess;                          /* >= 1 */
  int shading;                              /* a dpr_shading */
  const dpr_directional_light* directional; /* [directional_count] */
  size_t directional_count;
  const dpr_spot_light* spot; /* [spot_count] */
  size_t spot_count;
  const float* harmonics; /* [9][3], the environment's as in the scene format; or NULL */
} dpr_lights;

#define DPR_LIGHTS_INIT \
  { sizeof(dpr_lights), {0.5f, 0.5f, 0.5f}, NULL, 0, 64.0f, DPR_SHADING_PHONG, NULL, 0, NULL, 0, NULL }

/* A scene without meshes, for images of that many pixels (1 to 16384 a side). */
DPR_API dpr_status dpr_scene_create(int width, int height, dpr_scene** scene);
/* Reads the scene format of lib/cli/README.md. */
DPR_API dpr_status dpr_scene_read(const char* file, dpr_scene** scene);
/* Meshes are counted from 0 in the order in which they are added. */
DPR_API dpr_status dpr_scene_add_mesh(dpr_scene* scene, const dpr_mesh* mesh);
/* Another place of a mesh that was added before, and is no instance itself. Instances are counted as meshes:
 * they have transforms, [16] as dpr_mesh has them, and gradients of these. All else is their mesh's: calls
 * that set positions, colours and so on take the mesh alone, and refuse an instance. */
DPR_API dpr_status dpr_scene_add_instance(dpr_scene* scene, size_t mesh, const float* transform);
DPR_API dpr_status dpr_scene_set_camera(dpr_scene* scene, const dpr_camera* camera);
DPR_API dpr_status dpr_scene_set_background(dpr_scene* scene, const float color[3]);
/* Leaves out faces that wind clockwise in the image, "back", or the others, "front". "none" unless called. */
DPR_API dpr_status dpr_scene_set_cull(dpr_scene* scene, const char* word);
/* NULL: no lights, colours as they are. */
DPR_API dpr_status dpr_scene_set_lights(dpr_scene* scene, const dpr_lights* lights);
/* Sets a member of "smoothing" in the scene format that is a word: "preset", "occupancy_prior", ... */
DPR_API dpr_status dpr_scene_set_smoothing_word(dpr_scene* scene, const char* key, const char* word);
/* The same for a number: "sigma", "gamma", "samples", ... A renderer that takes the scene checks all. */
DPR_API dpr_status dpr_scene_set_smoothing_number(dpr_scene* scene, const char* key, double number);
/* Gradients that backward passes compute: "positions", "colors", "transform", "camera", "lights",
 * "smoothing", "background", "texture" (the texels), "texcoords", "distortion" (of lenses), "normals",
 * "materials", "opacities", "texel_opacities". Without this call all but "lights" and the last seven. */
DPR_API dpr_status dpr_scene_set_gradients(dpr_scene* scene, const char* const* names, size_t count);
DPR_API void dpr_scene_destroy(dpr_scene* scene);

/* ---- Renderer ---- */

DPR_API dpr_status dpr_renderer_create(const dpr_device* device, dpr_renderer** renderer);
/* Checks and uploads the scene as it is now; its camera and transforms become the only view. */
DPR_API dpr_status dpr_renderer_set_scene(dpr_renderer* renderer, const dpr_scene* scene);
/* Replaces the views, all rendered by the same launches. cameras: [views]. transforms: [view][mesh][16],
 * object to world, `transform_count` floats; NULL and 0: the scene's. Instances are meshes here. */
DPR_API dpr_status dpr_renderer_set_views(dpr_renderer* renderer, const dpr_camera* cameras, size_t views,
                                          const float* transforms, size_t transform_count);
/* New positions of a mesh, [vertex][3], `count` floats: as many as it has. */
DPR_API dpr_status dpr_renderer_set_positions(dpr_renderer* renderer, size_t mesh, const float* positions,
                                              size_t count);
/* New colours of a mesh, [vertex][3] or [face][3] as it has them, `count` floats. */
DPR_API dpr_status dpr_renderer_set_colors(dpr_renderer* renderer, size_t mesh, const float* colors,
                                           size_t count);
/* New texels of a texture of a mesh, [height][width][3], `count` floats. */
DPR_API dpr_status dpr_renderer_set_texels(dpr_renderer* renderer, size_t mesh, size_t texture,
                                           const float* texels, size_t count);
/* New texture coordinates of a mesh that has textures, [texcoord][2], `count` floats: as many as it has. */
DPR_API dpr_status dpr_renderer_set_texcoords(dpr_renderer* renderer, size_t mesh, const float* texcoords,
                                              size_t count);
/* New normals of a mesh that gives some, [normal][3], `count` floats: as many as it has. */
DPR_API dpr_status dpr_renderer_set_normals(dpr_renderer* renderer, size_t mesh, const float* normals,
                                            size_t count);
/* New materials of a mesh that has some, `count` of them: as many as it has. */
DPR_API dpr_status dpr_renderer_set_materials(dpr_renderer* renderer, size_t mesh,
                                              const dpr_material* materials, size_t count);
/* New opacities of a mesh that has some, [vertex] or [face], `count` floats: as many as it has. */
DPR_API dpr_status dpr_renderer_set_opacities(dpr_renderer* renderer, size_t mesh, const float* opacities,
                                              size_t count);
/* New opacities of a texture that has some, [height][width], `count` floats. */
DPR_API dpr_status dpr_renderer_set_texel_opacities(dpr_renderer* renderer, size_t mesh, size_t texture,
                                                    const float* opacities, size_t count);
/* Gives every view a shape of its own: [view][vertex][3] and [view][color][3], each of all meshes one after
 * the other without instances, so many floats. NULL and 0: the scene's. */
DPR_API dpr_status dpr_renderer_set_shapes(dpr_renderer* renderer, const float* positions,
                                           size_t position_count, const float* colors, size_t color_count);
/* New lights; NULL: none. */
DPR_API dpr_status dpr_renderer_set_lights(dpr_renderer* renderer, const dpr_lights* lights);
/* The smoothing that the scene has now, and nothing else of it. */
DPR_API dpr_status dpr_renderer_set_smoothing(dpr_renderer* renderer, const dpr_scene* scene);
/* These as those of a scene. */
DPR_API dpr_status dpr_renderer_set_background(dpr_renderer* renderer, const float color[3]);
DPR_API dpr_status dpr_renderer_set_cull(dpr_renderer* renderer, const char* word);
DPR_API dpr_status dpr_renderer_set_gradients(dpr_renderer* renderer, const char* const* names, size_t count);
/* Renders every view; enqueues the work, and seldom waits for it. A dpr_renderer_set_*() but that of
 * gradients ends the frame: what reads it fails until the next forward pass. */
DPR_API dpr_status dpr_renderer_forward(dpr_renderer* renderer);
/* The floats of all images: views * height * width * 4. */
DPR_API dpr_status dpr_renderer_image_size(const dpr_renderer* renderer, size_t* count);
/* All images, [view][height][width][4], row 0 on top, `count` floats. Waits for the device. */
DPR_API dpr_status dpr_renderer_read_image(const dpr_renderer* renderer, float* pixels, size_t count);
/* The images as a cl_mem on the device, of the same layout; not retained, valid until the next forward pass
 * that needs a larger one. What is enqueued on the device's queue after dpr_renderer_forward() sees them
 * finished. */
DPR_API dpr_status dpr_renderer_image_buffer(const dpr_renderer* renderer, struct _cl_mem** buffer);
DPR_API void dpr_renderer_destroy(dpr_renderer* renderer);

/* ---- Losses ---- */

/* Weight of each loss: means over pixels and colour channels, 1 - IoU of the alpha channels, robust
 * (mse in which pixels of quite another colour hardly count), and 1 - the mean structural similarity, of
 * images of at least 11x11 pixels. dpr/image_loss.hpp has the formulas. */
typedef struct dpr_loss_weights {
  size_t size;
  float mse, l1, silhouette;
  float robust;
  float robust_scale; /* of robust: at least 1e-6, a colour difference */
  float ssim;
} dpr_loss_weights;

#define DPR_LOSS_WEIGHTS_INIT \
  { sizeof(dpr_loss_weights), 0, 0, 0, 0, 0.1f, 0 }

/* Against a target for each view, [view][height][width][4], `count` floats. */
DPR_API dpr_status dpr_loss_create(const dpr_device* device, const dpr_loss_weights* weights,
                                   const float* targets, size_t count, size_t views, int width, int height,
                                   dpr_loss** loss);
/* An attribute of the surfaces, compared with a target: dpr/image_loss.hpp. */
typedef struct dpr_attribute_target {
  const char* name;                /* "depth", "position", "normal" or "texcoords" */
  const dpr_loss_weights* weights; /* no silhouette, no ssim */
  const float* targets; /* [view][height][width][4]: RGB as attribute images have it where a surface fills
                         * the pixel, alpha how much the pixel counts */
} dpr_attribute_target;

typedef struct dpr_loss_options {
  size_t size;
  const dpr_loss_weights* weights; /* of the images; NULL: none, if there are attributes */
  const uint8_t* has_alpha;        /* [view], 0: the target has no silhouette; NULL: all have one */
  const float* masks;              /* [view][height][width], how much each pixel counts; NULL: all the same */
  unsigned levels;                 /* of a pyramid, 1 to 16: the mean of the loss over ever smaller images */
  const dpr_attribute_target* attributes; /* [attribute_count]; NULL if that is 0 */
  size_t attribute_count;
} dpr_loss_options;

#define DPR_LOSS_OPTIONS_INIT \
  { sizeof(dpr_loss_options), NULL, NULL, NULL, 1, NULL, 0 }

/* The same with more to say of what counts. */
DPR_API dpr_status dpr_loss_create_with(const dpr_device* device, const dpr_loss_options* options,
                                        const float* targets, size_t count, size_t views, int width,
                                        int height, dpr_loss** loss);
/* The loss of the renderer's last images, mean over the views; its gradient stays on the device. */
DPR_API dpr_status dpr_loss_evaluate(dpr_loss* loss, const dpr_renderer* renderer, double* value);
DPR_API void dpr_loss_destroy(dpr_loss* loss);

/* A loss of a mesh's shape alone: terms of dpr/mesh_loss.hpp, which has the formulas. */
typedef struct dpr_mesh_loss_weights {
  size_t size;
  float laplacian, edge_length, normal_consistency, flatness;
  float edge_target; /* >= 0, of edge_length */
} dpr_mesh_loss_weights;

#define DPR_MESH_LOSS_WEIGHTS_INIT \
  { sizeof(dpr_mesh_loss_weights), 0, 0, 0, 0, 0 }

/* A loss for meshes with the faces of this one. */
DPR_API dpr_status dpr_mesh_loss_create(const dpr_device* device, const dpr_mesh_loss_weights* weights,
                                        const dpr_mesh* mesh, dpr_mesh_loss** loss);
/* The loss of a mesh of the renderer's scene at the last forward pass. Waits for the device. */
DPR_API dpr_status dpr_mesh_loss_evaluate(dpr_mesh_loss* loss, const dpr_renderer* renderer, size_t mesh,
                                          double* value);
DPR_API void dpr_mesh_loss_destroy(dpr_mesh_loss* loss);

/* ---- Gradients ---- */

/* Gradients of a loss that was evaluated on the last forward pass. */
DPR_API dpr_status dpr_backward_loss(dpr_renderer* renderer, const dpr_loss* loss, dpr_gradient** gradient);
/* Gradients of the sum of that loss and a mesh's own, both evaluated on the last forward pass. */
DPR_API dpr_status dpr_backward_losses(dpr_renderer* renderer, const dpr_loss* loss,
                                       const dpr_mesh_loss* mesh_loss, dpr_gradient** gradient);
/* Gradients of sum <grad, image> over views and pixels: grad is [view][height][width][4], `count` floats. */
DPR_API dpr_status dpr_backward_pixels(dpr_renderer* renderer, const float* grad, size_t count,
                                       dpr_gradient** gradient);
/* The same from a cl_mem of the device's context. */
DPR_API dpr_status dpr_backward_buffer(dpr_renderer* renderer, struct _cl_mem* grad, dpr_gradient** gradient);

/* The arrays that the scene asked for, by names such as "meshes[0].positions", "views[0].camera.rotation" or
 * "sigma". Those of a mesh's textures are one, "meshes[0].textures" or "meshes[0].texel_opacities": one texture after
 * the other. A mesh's arrays are summed over its instances; of an instance itself, mesh 1 say, there are no
 * "meshes[1]. ...", but "views[0].meshes[1].rotation" and "views[0].meshes[1].translation". */
DPR_API dpr_status dpr_gradient_count(const dpr_gradient* gradient, size_t* count);
/* Valid as long as the handle. */
DPR_API dpr_status dpr_gradient_name(const dpr_gradient* gradient, size_t index, const char** name);
/* Number of an array's values. */
DPR_API dpr_status dpr_gradient_size(const dpr_gradient* gradient, const char* name, size_t* count);
/* Copies an array, [vertex][3] and so on, `count` numbers. */
DPR_API dpr_status dpr_gradient_read(const dpr_gradient* gradient, const char* name, double* values,
                                     size_t count);
DPR_API void dpr_gradient_destroy(dpr_gradient* gradient);

#ifdef __cplusplus
}
#endif

#include "dpr/dpr_attribute.h"
#include "dpr/dpr_batch.h"
#include "dpr/dpr_frame.h"
#include "dpr/dpr_on_device.h"

#endif
