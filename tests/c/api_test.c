/* The C interface from C99: an image, its gradients, the caller's OpenCL objects, and every argument that is
 * wrong. */
#include <dpr/dpr.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

enum { SIDE = 16, FLOATS = SIDE * SIDE * 4 };

static int failures = 0;

static void expect(int condition, const char* what, int line) {
  if (condition) return;
  ++failures;
  printf("line %d: not so: %s (last error: %s)\n", line, what, dpr_last_error());
}

#define EXPECT(condition) expect(condition, #condition, __LINE__)
#define OK(call) expect((call) == DPR_SUCCESS, #call, __LINE__)

/* The call is refused as an invalid argument, with one sentence that has these words. */
#define REFUSED(call, words)                                                          \
  expect((call) == DPR_INVALID_ARGUMENT && strstr(dpr_last_error(), words) != NULL && \
             strchr(dpr_last_error(), '\n') == NULL,                                  \
         #call " is refused with \"" words "\"", __LINE__)

static const float positions[] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
static const uint32_t faces[] = {0, 1, 2};
static const float colors[] = {1, 0.5f, 0.25f};

static dpr_mesh triangle(void) {
  dpr_mesh mesh = DPR_MESH_INIT;
  mesh.positions = positions;
  mesh.vertices = 3;
  mesh.faces = faces;
  mesh.face_count = 1;
  mesh.face_colors = colors;
  return mesh;
}

static dpr_camera three_units_away(void) {
  dpr_camera camera = DPR_CAMERA_INIT;
  camera.view[11] = -3; /* row 2, column 3 */
  return camera;
}

static dpr_scene* make_scene(void) {
  const dpr_mesh mesh = triangle();
  const dpr_camera camera = three_units_away();
  const char* const wanted[] = {"positions", "smoothing"};
  dpr_scene* scene = NULL;
  OK(dpr_scene_create(SIDE, SIDE, &scene));
  OK(dpr_scene_add_mesh(scene, &mesh));
  OK(dpr_scene_set_camera(scene, &camera));
  OK(dpr_scene_set_cull(scene, "none"));
  OK(dpr_scene_set_smoothing_word(scene, "preset", "joint_gaussian"));
  OK(dpr_scene_set_smoothing_number(scene, "sigma", 0.01));
  OK(dpr_scene_set_gradients(scene, wanted, 2));
  return scene;
}

static dpr_loss* make_loss(const dpr_device* device, const float* targets) {
  dpr_loss_weights weights = DPR_LOSS_WEIGHTS_INIT;
  dpr_loss* loss = NULL;
  weights.mse = 1;
  OK(dpr_loss_create(device, &weights, targets, FLOATS, 1, SIDE, SIDE, &loss));
  return loss;
}

/* A step against the gradient lowers the loss by what the gradient says of it. */
static void test_descent(const dpr_device* device, dpr_scene* scene) {
  const float step = 1e-3f;
  float target[FLOATS], moved[9];
  double before = 0, after = 0, grad[9], squared = 0, sigma = 0;
  size_t count = 0, i;
  const char* name = NULL;
  dpr_renderer* renderer = NULL;
  dpr_gradient* gradient = NULL;
  dpr_loss* loss;
  for (i = 0; i < FLOATS; ++i) target[i] = 0;
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  OK(dpr_renderer_forward(renderer));
  loss = make_loss(device, target);
  OK(dpr_loss_evaluate(loss, renderer, &before));
  OK(dpr_backward_loss(renderer, loss, &gradient));
  OK(dpr_gradient_count(gradient, &count));
  EXPECT(count == 4); /* the positions; sigma, gamma and alpha */
  OK(dpr_gradient_name(gradient, 0, &name));
  EXPECT(strcmp(name, "meshes[0].positions") == 0);
  OK(dpr_gradient_size(gradient, name, &count));
  EXPECT(count == 9);
  OK(dpr_gradient_read(gradient, name, grad, 9));
  OK(dpr_gradient_read(gradient, "sigma", &sigma, 1));
  EXPECT(sigma != 0);
  for (i = 0; i < 9; ++i) {
    squared += grad[i] * grad[i];
    moved[i] = positions[i] - step * (float)grad[i];
  }
  OK(dpr_renderer_set_positions(renderer, 0, moved, 9));
  OK(dpr_renderer_forward(renderer));
  OK(dpr_loss_evaluate(loss, renderer, &after));
  EXPECT(squared > 0 && fabs((before - after) / (step * squared) - 1) < 0.05);
  REFUSED(dpr_gradient_read(gradient, name, grad, 8), "got 8, expected 9");
  REFUSED(dpr_gradient_read(gradient, "sigmas", grad, 1), "\"sigmas\"");
  REFUSED(dpr_gradient_size(gradient, NULL, &count), "name");
  REFUSED(dpr_gradient_name(gradient, 4, &name), "below 4");
  dpr_gradient_destroy(gradient);
  dpr_loss_destroy(loss);
  dpr_renderer_destroy(renderer);
}

/* Views of one scene are images of one frame; a gradient of pixels counts them all. */
static void test_views(const dpr_device* device, const dpr_scene* scene) {
  dpr_camera cameras[2];
  float pixels[2 * FLOATS];
  double both[9];
  size_t count = 0, i;
  dpr_renderer* renderer = NULL;
  dpr_gradient* gradient = NULL;
  cameras[0] = cameras[1] = three_units_away();
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  OK(dpr_renderer_set_views(renderer, cameras, 2, NULL, 0));
  OK(dpr_renderer_forward(renderer));
  OK(dpr_renderer_image_size(renderer, &count));
  EXPECT(count == 2 * FLOATS);
  OK(dpr_renderer_read_image(renderer, pixels, count));
  EXPECT(memcmp(pixels, pixels + FLOATS, sizeof pixels / 2) == 0);
  EXPECT(pixels[4 * (SIDE * SIDE / 2 + SIDE / 2)] > 0.9f);
  for (i = 0; i < count; ++i) pixels[i] = i < FLOATS ? 0 : 1; /* of the second view alone */
  OK(dpr_backward_pixels(renderer, pixels, count, &gradient));
  OK(dpr_gradient_read(gradient, "meshes[0].positions", both, 9));
  EXPECT(both[7] > 0); /* the top vertex: moved up, more is seen of the triangle */
  REFUSED(dpr_backward_pixels(renderer, pixels, count - 4, &gradient), "pixels");
  REFUSED(dpr_backward_pixels(renderer, pixels, 3, &gradient), "multiple of 4");
  REFUSED(dpr_renderer_read_image(renderer, pixels, FLOATS), "count");
  REFUSED(dpr_renderer_set_views(renderer, cameras, 0, NULL, 0), "views");
  REFUSED(dpr_renderer_set_views(renderer, cameras, (size_t)-1, NULL, 0), "views");
  REFUSED(dpr_renderer_set_views(renderer, NULL, 1, NULL, 0), "cameras");
  REFUSED(dpr_renderer_set_views(renderer, cameras, 2, pixels, 16), "expected 32");
  cameras[1].zfar = NAN;
  REFUSED(dpr_renderer_set_views(renderer, cameras, 2, NULL, 0), "zfar");
  dpr_gradient_destroy(gradient);
  dpr_renderer_destroy(renderer);
}

static const float texcoords[] = {0, 0, 1, 0, 0.5f, 1};
static const float texels[] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1}; /* red, green; blue, white */

static dpr_texture four_texels(void) {
  dpr_texture texture = {2, 2, NULL, DPR_WRAP_CLAMP, DPR_FILTER_BILINEAR};
  texture.texels = texels;
  return texture;
}

static dpr_mesh textured_triangle(const dpr_texture* texture) {
  dpr_mesh mesh = triangle();
  mesh.face_colors = NULL;
  mesh.texcoords = texcoords, mesh.texcoord_count = 3;
  mesh.face_texcoords = faces;
  mesh.textures = texture, mesh.texture_count = 1;
  return mesh;
}

/* The sum over pixels of a fixed weight times the image. */
static double weighted(const dpr_renderer* renderer, const float* weights) {
  float pixels[FLOATS];
  double sum = 0;
  size_t i;
  OK(dpr_renderer_read_image(renderer, pixels, FLOATS));
  for (i = 0; i < FLOATS; ++i) sum += (double)weights[i] * pixels[i];
  return sum;
}

/* Gradients of every texel and coordinate against central differences. */
static void test_textures(const dpr_device* device) {
  const char* const wanted[] = {"texture", "texcoords"};
  const dpr_texture texture = four_texels();
  const dpr_mesh mesh = textured_triangle(&texture);
  const dpr_camera camera = three_units_away();
  const float step = 1.0f / 256;
  float weights[FLOATS], moved[12];
  double of_texels[12], of_texcoords[6], numeric;
  size_t i, count = 0;
  dpr_scene* scene = NULL;
  dpr_renderer* renderer = NULL;
  dpr_gradient* gradient = NULL;
  for (i = 0; i < FLOATS; ++i) weights[i] = (float)(i % 7) - (float)(i / 64 % 5);
  OK(dpr_scene_create(SIDE, SIDE, &scene));
  OK(dpr_scene_add_mesh(scene, &mesh));
  OK(dpr_scene_set_camera(scene, &camera));
  OK(dpr_scene_set_gradients(scene, wanted, 2));
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  OK(dpr_renderer_forward(renderer));
  OK(dpr_backward_pixels(renderer, weights, FLOATS, &gradient));
  OK(dpr_gradient_size(gradient, "meshes[0].textures", &count));
  EXPECT(count == 12);
  OK(dpr_gradient_read(gradient, "meshes[0].textures", of_texels, 12));
  OK(dpr_gradient_read(gradient, "meshes[0].texcoords", of_texcoords, 6));
  for (i = 0; i < 12; ++i) {
    memcpy(moved, texels, sizeof texels);
    moved[i] += step;
    OK(dpr_renderer_set_texels(renderer, 0, 0, moved, 12));
    OK(dpr_renderer_forward(renderer));
    numeric = weighted(renderer, weights);
    moved[i] -= 2 * step;
    OK(dpr_renderer_set_texels(renderer, 0, 0, moved, 12));
    OK(dpr_renderer_forward(renderer));
    numeric = (numeric - weighted(renderer, weights)) / (2 * step);
    EXPECT(fabs(numeric - of_texels[i]) < 2e-2 * (1 + fabs(numeric)));
  }
  OK(dpr_renderer_set_texels(renderer, 0, 0, texels, 12));
  for (i = 0; i < 6; ++i) {
    memcpy(moved, texcoords, sizeof texcoords);
    moved[i] += step;
    OK(dpr_renderer_set_texcoords(renderer, 0, moved, 6));
    OK(dpr_renderer_forward(renderer));
    numeric = weighted(renderer, weights);
    moved[i] -= 2 * step;
    OK(dpr_renderer_set_texcoords(renderer, 0, moved, 6));
    OK(dpr_renderer_forward(renderer));
    numeric = (numeric - weighted(renderer, weights)) / (2 * step);
    EXPECT(fabs(numeric - of_texcoords[i]) < 2e-2 * (1 + fabs(numeric)));
  }
  REFUSED(dpr_renderer_set_texels(renderer, 0, 1, texels, 12), "texture");
  REFUSED(dpr_renderer_set_texels(renderer, 0, 0, texels, 9), "expected 4");
  REFUSED(dpr_renderer_set_texels(renderer, 0, 0, NULL, 12), "texels");
  REFUSED(dpr_renderer_set_texcoords(renderer, 0, texcoords, 5), "multiple of 2");
  REFUSED(dpr_renderer_set_texcoords(renderer, 0, texcoords, 4), "expected 3");
  dpr_gradient_destroy(gradient);
  dpr_renderer_destroy(renderer);
  dpr_scene_destroy(scene);
}

/* Wrapping and filters are the texture's: what a corner beyond the image shows. */
static void test_wrap_and_filter(const dpr_device* device) {
  const float beyond[] = {1.25f, 0.75f, 1.25f, 0.75f, 1.25f, 0.75f}; /* every pixel shows this point */
  const float quarter[] = {0.5f, 0.75f, 0.5f, 0.75f, 0.5f, 0.75f};   /* between red and green */
  const int wraps[] = {DPR_WRAP_REPEAT, DPR_WRAP_MIRROR, DPR_WRAP_CLAMP};
  const float red[] = {1, 0, 0};
  const dpr_camera camera = three_units_away();
  const size_t middle = 4 * (SIDE * SIDE / 2 + SIDE / 2);
  float pixels[FLOATS];
  size_t i;
  for (i = 0; i < 4; ++i) {
    dpr_texture texture = four_texels();
    dpr_mesh mesh = textured_triangle(&texture);
    dpr_scene* scene = NULL;
    dpr_renderer* renderer = NULL;
    mesh.texcoords = i < 3 ? beyond : quarter;
    if (i < 3) texture.wrap = wraps[i], texture.filter = DPR_FILTER_NEAREST;
    OK(dpr_scene_create(SIDE, SIDE, &scene));
    OK(dpr_scene_add_mesh(scene, &mesh));
    OK(dpr_scene_set_camera(scene, &camera));
    OK(dpr_renderer_create(device, &renderer));
    OK(dpr_renderer_set_scene(renderer, scene));
    OK(dpr_renderer_forward(renderer));
    OK(dpr_renderer_read_image(renderer, pixels, FLOATS));
    EXPECT(fabsf(pixels[middle] - (i < 3 ? red[i] : 0.5f)) < 1e-3f);
    dpr_renderer_destroy(renderer);
    dpr_scene_destroy(scene);
  }
}

static void test_wrong_textures(dpr_scene* scene) {
  const float not_finite[] = {0, 0, 1, NAN, 0.5f, 1};
  const uint32_t beyond[] = {0, 1, 3}, second[] = {1}, none[] = {DPR_TEXTURE_NONE};
  dpr_texture texture = four_texels();
  dpr_mesh mesh = textured_triangle(&texture);
  mesh.face_textures = second;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "face_textures[0]");
  mesh.face_textures = none;
  OK(dpr_scene_add_mesh(scene, &mesh));
  mesh.face_texcoords = beyond;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "texture coordinate 3");
  mesh.face_texcoords = NULL;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "face_texcoords");
  mesh = textured_triangle(&texture);
  mesh.texcoords = not_finite;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "texcoords[1]");
  mesh = textured_triangle(&texture);
  mesh.texcoord_count = (size_t)-1;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.texcoord_count");
  mesh = textured_triangle(&texture);
  mesh.texture_count = (size_t)-1;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.textures");
  mesh.texture_count = 1, mesh.textures = NULL;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.textures");
  mesh.textures = &texture;
  texture.width = 1 << 30;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "texels a side");
  texture = four_texels();
  texture.wrap = 3;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "repeat, mirror or clamp");
  texture = four_texels();
  texture.filter = -1;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "trilinear");
  texture = four_texels();
  texture.texels = NULL;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.textures[0].texels");
}

/* A loss of the renderer's images against black. */
static double loss_of(const dpr_device* device, const dpr_renderer* renderer,
                      const dpr_loss_weights* weights) {
  float black[FLOATS];
  double value = -1;
  size_t i;
  dpr_loss* loss = NULL;
  for (i = 0; i < FLOATS; ++i) black[i] = 0;
  OK(dpr_loss_create(device, weights, black, FLOATS, 1, SIDE, SIDE, &loss));
  OK(dpr_loss_evaluate(loss, renderer, &value));
  dpr_loss_destroy(loss);
  return value;
}

/* Every weight counts, and a program compiled before there were the later ones has none of them. */
static void test_losses(const dpr_device* device, const dpr_scene* scene) {
  struct {
    size_t size;
    float mse, l1, silhouette;
  } older;
  dpr_loss_weights weights = DPR_LOSS_WEIGHTS_INIT, as_older;
  float* const each[] = {&weights.mse, &weights.l1, &weights.silhouette, &weights.robust, &weights.ssim};
  double mse, robust, value = 0;
  float unused[FLOATS], huge[FLOATS];
  size_t i;
  dpr_renderer* renderer = NULL;
  dpr_loss *none = NULL, *loss = NULL;
  for (i = 0; i < FLOATS; ++i) unused[i] = 0;
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  OK(dpr_renderer_forward(renderer));
  EXPECT(weights.robust == 0 && weights.robust_scale == 0.1f && weights.ssim == 0);
  weights.mse = 1;
  mse = loss_of(device, renderer, &weights);
  EXPECT(mse > 0);
  /* As long as in the first version, whose padding may hold anything. */
  memset(&as_older, 0xff, sizeof as_older);
  memset(&older, 0xff, sizeof older);
  older.size = sizeof older;
  older.mse = 1, older.l1 = 0, older.silhouette = 0;
  memcpy(&as_older, &older, sizeof older);
  EXPECT(loss_of(device, renderer, &as_older) == mse);
  weights.mse = 0, weights.robust = 1;
  robust = loss_of(device, renderer, &weights);
  EXPECT(robust > 0 && robust < 0.5 * mse); /* the triangle is far from black */
  weights.robust_scale = 1e3f;
  EXPECT(fabs(loss_of(device, renderer, &weights) / mse - 1) < 1e-4);
  weights.robust_scale = 0;
  REFUSED(dpr_loss_create(device, &weights, unused, FLOATS, 1, SIDE, SIDE, &none), "robust_scale");
  weights.robust = 0, weights.robust_scale = 0.1f, weights.ssim = 1;
  EXPECT(loss_of(device, renderer, &weights) > 0.01);
  weights.ssim = 0;
  for (i = 0; i < FLOATS; ++i) huge[i] = 1e38f;
  for (i = 0; i < sizeof each / sizeof each[0]; ++i) { /* finite, but not their sums */
    *each[i] = 1;
    OK(dpr_loss_create(device, &weights, huge, FLOATS, 1, SIDE, SIDE, &loss));
    REFUSED(dpr_loss_evaluate(loss, renderer, &value), "single precision");
    dpr_loss_destroy(loss);
    *each[i] = 0;
  }
  weights.ssim = -1;
  REFUSED(dpr_loss_create(device, &weights, unused, FLOATS, 1, SIDE, SIDE, &none), "weight");
  weights.size = sizeof weights + 1;
  REFUSED(dpr_loss_create(device, &weights, unused, FLOATS, 1, SIDE, SIDE, &none), "weights.size");
  dpr_renderer_destroy(renderer);
}

/* Masks, targets without a silhouette, pyramids and depths: each says something of the loss. */
static void test_loss_options(const dpr_device* device, const dpr_scene* scene) {
  const uint8_t none[1] = {0};
  float black[FLOATS], mask[SIDE * SIDE], deep[FLOATS];
  double of_all, of_half, value, at_depth[9], before;
  size_t i;
  dpr_loss_weights weights = DPR_LOSS_WEIGHTS_INIT, of_depth = DPR_LOSS_WEIGHTS_INIT;
  dpr_loss_options options = DPR_LOSS_OPTIONS_INIT;
  dpr_attribute_target depth = {"depth", NULL, NULL};
  dpr_renderer* renderer = NULL;
  dpr_gradient* gradient = NULL;
  dpr_loss *loss = NULL, *refused = NULL;
  for (i = 0; i < FLOATS; ++i) black[i] = 0, deep[i] = i % 4 == 3 ? 1.0f : 2.5f; /* nearer than it is */
  for (i = 0; i < SIDE * SIDE; ++i) mask[i] = i % SIDE < SIDE / 4 ? 1.0f : 0.0f; /* little of the triangle */
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  OK(dpr_renderer_forward(renderer));
  weights.mse = 1;
  of_all = loss_of(device, renderer, &weights);
  options.weights = &weights;
  OK(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &loss));
  OK(dpr_loss_evaluate(loss, renderer, &value));
  EXPECT(value == of_all); /* nothing said: the same loss */
  dpr_loss_destroy(loss);
  options.masks = mask;
  OK(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &loss));
  OK(dpr_loss_evaluate(loss, renderer, &of_half));
  EXPECT(of_half < 0.5 * of_all);
  dpr_loss_destroy(loss);
  options.masks = NULL, options.levels = 3;
  OK(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &loss));
  OK(dpr_loss_evaluate(loss, renderer, &value));
  EXPECT(value > 0 && value < of_all); /* means of blocks are nearer to black */
  dpr_loss_destroy(loss);
  options.levels = 1, options.has_alpha = none;
  weights.silhouette = 1;
  OK(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &loss));
  OK(dpr_loss_evaluate(loss, renderer, &value));
  EXPECT(value == of_all); /* without a silhouette there is no loss of it */
  dpr_loss_destroy(loss);

  of_depth.l1 = 1;
  depth.weights = &of_depth, depth.targets = deep;
  options = (dpr_loss_options)DPR_LOSS_OPTIONS_INIT;
  options.attributes = &depth, options.attribute_count = 1;
  OK(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &loss));
  OK(dpr_loss_evaluate(loss, renderer, &before));
  OK(dpr_backward_loss(renderer, loss, &gradient));
  OK(dpr_gradient_read(gradient, "meshes[0].positions", at_depth, 9));
  EXPECT(before > 0 && at_depth[2] < 0 && at_depth[5] < 0 && at_depth[8] < 0); /* towards the camera */
  dpr_gradient_destroy(gradient);
  dpr_loss_destroy(loss);
  depth.name = "deep";
  REFUSED(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &refused), "texcoords");
  depth.name = "depth", depth.targets = NULL;
  REFUSED(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &refused),
          "attributes.targets");
  depth.targets = deep, depth.weights = NULL;
  REFUSED(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &refused), "weights");
  options.attribute_count = (size_t)-1;
  REFUSED(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &refused), "attribute_count");
  options.attributes = NULL;
  REFUSED(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &refused),
          "options.attributes");
  options.attribute_count = 0, options.levels = 17, options.weights = &weights;
  REFUSED(dpr_loss_create_with(device, &options, black, FLOATS, 1, SIDE, SIDE, &refused), "levels");
  REFUSED(dpr_loss_create_with(device, NULL, black, FLOATS, 1, SIDE, SIDE, &refused), "options");
  dpr_renderer_destroy(renderer);
}

/* The same image and gradient without the host: positions from a buffer, the gradient into one. */
static void test_on_device(cl_context context, cl_command_queue queue, dpr_renderer* renderer,
                           const float* image, const double* expected) {
  dpr_buffer from = DPR_BUFFER_INIT, view = DPR_BUFFER_INIT, to = DPR_BUFFER_INIT;
  dpr_events first = DPR_EVENTS_INIT, second = DPR_EVENTS_INIT;
  dpr_frame_room room = DPR_FRAME_ROOM_INIT;
  float read[FLOATS], gradient[9];
  cl_event set = NULL, copied = NULL;
  size_t emptied = 1, offset = 1;
  int i;
  cl_mem vertices = clCreateBuffer(context, CL_MEM_READ_ONLY, sizeof positions, NULL, NULL);
  cl_mem gradients = clCreateBuffer(context, CL_MEM_WRITE_ONLY, sizeof gradient, NULL, NULL);
  clEnqueueWriteBuffer(queue, vertices, CL_TRUE, 0, sizeof positions, positions, 0, NULL, NULL);
  from.buffer = vertices;
  first.done = &set;
  OK(dpr_renderer_set_positions_from(renderer, 0, &from, &first));
  second.wait = &set;
  second.wait_count = 1;
  OK(dpr_renderer_forward_on_device(renderer, &second));
  OK(dpr_renderer_image_view(renderer, &view));
  EXPECT(view.count == SIDE * SIDE && view.components == 4 && view.byte_stride == 16);
  OK(dpr_renderer_backward_on_device(renderer, &view, NULL));
  to.buffer = gradients;
  first.done = &copied;
  OK(dpr_renderer_copy_gradient(renderer, "meshes[0].positions", &to, &first));
  EXPECT(clEnqueueReadBuffer(queue, gradients, CL_TRUE, 0, sizeof gradient, gradient, 1, &copied, NULL) ==
         CL_SUCCESS);
  for (i = 0; i < 9; ++i) EXPECT((double)gradient[i] == expected[i]);
  EXPECT(clEnqueueReadBuffer(queue, view.buffer, CL_TRUE, 0, sizeof read, read, 0, NULL, NULL) == CL_SUCCESS);
  EXPECT(memcmp(read, image, sizeof read) == 0);
  OK(dpr_renderer_gradient_view(renderer, "sigma", &view, &offset));
  EXPECT(view.count == 1 && view.components == 1 && view.byte_offset == offset);
  REFUSED(dpr_renderer_gradient_view(renderer, "sigma", &view, NULL), "byte_offset");
  OK(dpr_renderer_reserve(renderer, &room));
  room.fragments = (size_t)-1;
  REFUSED(dpr_renderer_reserve(renderer, &room), "fragments (reserve)");
  OK(dpr_renderer_frame_history(renderer, &emptied, &room));
  EXPECT(emptied == 0 && room.pairs > 0 && room.fragments > 0);
  OK(dpr_renderer_frame_history_view(renderer, &view));
  EXPECT(view.buffer != NULL && view.count == 1 && view.components == 4);
  REFUSED(dpr_renderer_set_positions_from(renderer, 0, &to, NULL), "only write");
  REFUSED(dpr_renderer_set_positions_from(renderer, 0, NULL, NULL), "positions");
  REFUSED(dpr_renderer_set_colors_from(renderer, 1, &from, NULL), "mesh");
  REFUSED(dpr_renderer_set_texels_from(renderer, 0, 0, &from, NULL), "texture");
  REFUSED(dpr_renderer_set_texcoords_from(renderer, 0, &from, NULL), "textures");
  REFUSED(dpr_renderer_set_transforms_from(renderer, &from, NULL), "transforms");
  REFUSED(dpr_renderer_copy_images(renderer, &to, NULL), "images");
  REFUSED(dpr_renderer_gradient_view(renderer, "color", &view, &offset), "color");
  second.wait = NULL;
  REFUSED(dpr_renderer_forward_on_device(renderer, &second), "events.wait");
  to.size = sizeof to + 1;
  REFUSED(dpr_renderer_copy_images(renderer, &to, NULL), "size");
  clReleaseEvent(set);
  clReleaseEvent(copied);
  clReleaseMemObject(vertices);
  clReleaseMemObject(gradients);
}

/* A frame that outgrows its room is told by the next call, whose own frame is whole. */
static void test_emptied_frames(cl_context context, cl_command_queue queue, const dpr_device* device,
                                const dpr_scene* scene) {
  dpr_buffer from = DPR_BUFFER_INIT, to = DPR_BUFFER_INIT;
  float small[9], emptied[FLOATS], found[FLOATS], whole[FLOATS];
  dpr_renderer* renderer = NULL;
  dpr_attribute* depths = NULL;
  int i;
  cl_mem vertices = clCreateBuffer(context, CL_MEM_READ_ONLY, sizeof small, NULL, NULL);
  cl_mem image = clCreateBuffer(context, CL_MEM_READ_WRITE, sizeof found, NULL, NULL);
  from.buffer = vertices;
  to.buffer = image;
  for (i = 0; i < 9; ++i) small[i] = 0.01f * positions[i];
  clEnqueueWriteBuffer(queue, vertices, CL_TRUE, 0, sizeof small, small, 0, NULL, NULL);
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  OK(dpr_attribute_create(device, "depth", &depths));
  OK(dpr_renderer_set_positions_from(renderer, 0, &from, NULL));
  OK(dpr_renderer_forward_on_device(renderer, NULL));
  OK(dpr_attribute_forward_on_device(depths, renderer, NULL));
  clEnqueueWriteBuffer(queue, vertices, CL_TRUE, 0, sizeof positions, positions, 0, NULL, NULL);
  OK(dpr_renderer_set_positions_from(renderer, 0, &from, NULL));
  OK(dpr_renderer_forward_on_device(renderer, NULL));
  OK(dpr_attribute_forward_on_device(depths, renderer, NULL));
  OK(dpr_renderer_copy_images(renderer, &to, NULL));
  clEnqueueReadBuffer(queue, image, CL_TRUE, 0, sizeof emptied, emptied, 0, NULL, NULL);
  EXPECT(dpr_renderer_forward_on_device(renderer, NULL) == DPR_FRAME_EMPTIED);
  EXPECT(strstr(dpr_last_error(), "emptied") != NULL);
  EXPECT(dpr_attribute_forward_on_device(depths, renderer, NULL) == DPR_FRAME_EMPTIED);
  OK(dpr_renderer_copy_images(renderer, &to, NULL));
  clEnqueueReadBuffer(queue, image, CL_TRUE, 0, sizeof found, found, 0, NULL, NULL);
  OK(dpr_renderer_forward_on_device(renderer, NULL));
  OK(dpr_attribute_forward_on_device(depths, renderer, NULL));
  OK(dpr_renderer_read_image(renderer, whole, FLOATS));
  EXPECT(memcmp(found, whole, sizeof whole) == 0);
  EXPECT(memcmp(emptied, whole, sizeof whole) != 0);
  dpr_attribute_destroy(depths);
  dpr_renderer_destroy(renderer);
  clReleaseMemObject(vertices);
  clReleaseMemObject(image);
}

/* Auxiliary outputs and attributes of a frame on the device are those that the host reads. */
static void test_attributes_on_device(cl_context context, cl_command_queue queue, const dpr_device* device,
                                      dpr_renderer* renderer) {
  dpr_buffer view = DPR_BUFFER_INIT, to = DPR_BUFFER_INIT;
  dpr_frame_room room = DPR_FRAME_ROOM_INIT;
  float depth[SIDE * SIDE], expected[SIDE * SIDE], image[FLOATS], pixels[FLOATS], gradient[9];
  double of_host[9];
  const float values[3] = {1, 2, 4};
  size_t emptied = 1, offset = 1, i;
  dpr_attribute *attribute = NULL, *numbers = NULL;
  dpr_gradient* host = NULL;
  cl_mem copied = clCreateBuffer(context, CL_MEM_READ_WRITE, sizeof image, NULL, NULL);
  cl_mem rows = clCreateBuffer(context, CL_MEM_READ_WRITE, sizeof values, NULL, NULL);
  to.buffer = copied;
  OK(dpr_renderer_read_aov(renderer, "depth", expected, SIDE * SIDE));
  OK(dpr_renderer_forward_on_device(renderer, NULL));
  OK(dpr_renderer_aov_view(renderer, "depth", &view, NULL));
  EXPECT(view.count == SIDE * SIDE && view.components == 1 && view.byte_stride == 16);
  OK(dpr_renderer_copy_aov(renderer, "depth", &to, NULL));
  clEnqueueReadBuffer(queue, copied, CL_TRUE, 0, sizeof depth, depth, 0, NULL, NULL);
  EXPECT(memcmp(depth, expected, sizeof depth) == 0);

  OK(dpr_attribute_create(device, "depth", &attribute));
  OK(dpr_attribute_reserve(attribute, &room));
  OK(dpr_attribute_forward(attribute, renderer));
  OK(dpr_attribute_read_image(attribute, pixels, FLOATS));
  OK(dpr_attribute_backward_pixels(attribute, pixels, FLOATS, &host));
  OK(dpr_gradient_read(host, "meshes[0].positions", of_host, 9));
  OK(dpr_attribute_forward_on_device(attribute, renderer, NULL));
  OK(dpr_attribute_copy_images(attribute, &to, NULL));
  clEnqueueReadBuffer(queue, copied, CL_TRUE, 0, sizeof image, image, 0, NULL, NULL);
  for (i = 0; i < FLOATS; ++i) EXPECT(fabsf(image[i] - pixels[i]) < 1e-5f);
  OK(dpr_attribute_image_view(attribute, &view));
  EXPECT(view.count == SIDE * SIDE && view.components == 4);
  OK(dpr_attribute_backward_on_device(attribute, &view, NULL));
  OK(dpr_attribute_copy_gradient(attribute, "meshes[0].positions", &to, NULL));
  clEnqueueReadBuffer(queue, copied, CL_TRUE, 0, sizeof gradient, gradient, 0, NULL, NULL);
  for (i = 0; i < 9; ++i) EXPECT(fabs(gradient[i] - of_host[i]) < 1e-3 * (1 + fabs(of_host[i])));
  OK(dpr_attribute_gradient_view(attribute, "sigma", &view, &offset));
  EXPECT(view.count == 1);
  OK(dpr_attribute_frame_history(attribute, &emptied, &room));
  EXPECT(emptied == 0 && room.fragments > 0);

  clEnqueueWriteBuffer(queue, rows, CL_TRUE, 0, sizeof values, values, 0, NULL, NULL);
  OK(dpr_attribute_create_values(device, 1, &numbers));
  to.buffer = rows;
  OK(dpr_attribute_set_values_from(numbers, &to, 3, NULL));
  OK(dpr_attribute_forward_on_device(numbers, renderer, NULL));
  OK(dpr_attribute_image_view(numbers, &view));
  OK(dpr_attribute_backward_on_device(numbers, &view, NULL));
  OK(dpr_attribute_gradient_view(numbers, "values", &view, &offset));
  EXPECT(view.count == 3 && view.components == 1);
  REFUSED(dpr_attribute_set_values_from(attribute, &to, 3, NULL), "depth");
  REFUSED(dpr_attribute_gradient_view(attribute, "values", &view, &offset), "values");
  REFUSED(dpr_attribute_forward_on_device(attribute, NULL, NULL), "renderer");
  REFUSED(dpr_renderer_copy_aov(renderer, "uv", &to, NULL), "texture coordinates");
  REFUSED(dpr_renderer_aov_view(renderer, "deep", &view, NULL), "effective_faces");
  dpr_gradient_destroy(host);
  dpr_attribute_destroy(attribute);
  dpr_attribute_destroy(numbers);
  clReleaseMemObject(copied);
  clReleaseMemObject(rows);
}

/* Shapes and view matrices from buffers are those of the host. */
static void test_shapes_on_device(cl_context context, cl_command_queue queue, dpr_renderer* renderer) {
  const float closer[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -2};
  dpr_buffer from = DPR_BUFFER_INIT;
  dpr_camera camera = three_units_away();
  float shape[9], host[FLOATS], found[FLOATS];
  int i;
  cl_mem vertices = clCreateBuffer(context, CL_MEM_READ_ONLY, sizeof shape, NULL, NULL);
  cl_mem matrix = clCreateBuffer(context, CL_MEM_READ_ONLY, sizeof closer, NULL, NULL);
  for (i = 0; i < 9; ++i) shape[i] = 0.7f * positions[i];
  clEnqueueWriteBuffer(queue, vertices, CL_TRUE, 0, sizeof shape, shape, 0, NULL, NULL);
  clEnqueueWriteBuffer(queue, matrix, CL_TRUE, 0, sizeof closer, closer, 0, NULL, NULL);
  camera.view[11] = -2;
  OK(dpr_renderer_set_views(renderer, &camera, 1, NULL, 0));
  OK(dpr_renderer_set_shapes(renderer, shape, 9, NULL, 0));
  OK(dpr_renderer_forward(renderer));
  OK(dpr_renderer_read_image(renderer, host, FLOATS));
  camera = three_units_away();
  OK(dpr_renderer_set_views(renderer, &camera, 1, NULL, 0));
  from.buffer = vertices;
  OK(dpr_renderer_set_shapes_from(renderer, &from, NULL, NULL));
  from.buffer = matrix;
  OK(dpr_renderer_set_view_matrices_from(renderer, &from, NULL));
  OK(dpr_renderer_forward(renderer));
  OK(dpr_renderer_read_image(renderer, found, FLOATS));
  EXPECT(memcmp(host, found, sizeof host) == 0);
  REFUSED(dpr_renderer_set_shapes(renderer, shape, 6, NULL, 0), "positions: got 2 vectors, expected 3");
  REFUSED(dpr_renderer_set_shapes(renderer, NULL, 9, NULL, 0), "positions");
  from.byte_offset = 48;
  REFUSED(dpr_renderer_set_shapes_from(renderer, NULL, &from, NULL), "colors");
  REFUSED(dpr_renderer_set_shapes_from(renderer, &from, NULL, NULL), "positions");
  REFUSED(dpr_renderer_set_view_matrices_from(renderer, NULL, NULL), "matrices");
  REFUSED(dpr_renderer_set_normals_from(renderer, 0, &from, NULL), "without normals");
  REFUSED(dpr_renderer_set_materials_from(renderer, 0, &from, NULL), "without materials");
  REFUSED(dpr_renderer_set_materials_from(renderer, 0, NULL, NULL), "materials");
  OK(dpr_renderer_set_views(renderer, &camera, 1, NULL, 0));
  clReleaseMemObject(vertices);
  clReleaseMemObject(matrix);
}

/* Materials from a buffer are those of the host; their gradient goes into one. */
static void test_materials_on_device(cl_context context, cl_command_queue queue, const dpr_device* device) {
  const dpr_material dull = {{0.1f, 0.2f, 0.3f}, 3}, bright = {{1, 0.9f, 0.8f}, 5};
  const char* const wanted[] = {"materials"};
  const dpr_camera camera = three_units_away();
  dpr_point_light light = {{1, 2, 4}, {0.6f, 0.6f, 0.6f}, {0.5f, 0.5f, 0.5f}};
  dpr_lights lights = DPR_LIGHTS_INIT;
  dpr_mesh mesh = triangle();
  dpr_buffer values = DPR_BUFFER_INIT;
  dpr_scene* scene = NULL;
  dpr_renderer* renderer = NULL;
  dpr_gradient* gradient = NULL;
  float host[FLOATS], found[FLOATS], of_device[3], shininess = 0;
  double of_host[3], of_shininess = 0;
  int i;
  cl_mem buffer = clCreateBuffer(context, CL_MEM_READ_WRITE, sizeof bright, NULL, NULL);
  clEnqueueWriteBuffer(queue, buffer, CL_TRUE, 0, sizeof bright, &bright, 0, NULL, NULL);
  values.buffer = buffer;
  mesh.materials = &dull, mesh.material_count = 1;
  lights.point = &light, lights.point_count = 1;
  OK(dpr_scene_create(SIDE, SIDE, &scene));
  OK(dpr_scene_add_mesh(scene, &mesh));
  OK(dpr_scene_set_camera(scene, &camera));
  OK(dpr_scene_set_lights(scene, &lights));
  OK(dpr_scene_set_gradients(scene, wanted, 1));
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  OK(dpr_renderer_set_materials(renderer, 0, &bright, 1));
  OK(dpr_renderer_forward(renderer));
  OK(dpr_renderer_read_image(renderer, host, FLOATS));
  OK(dpr_backward_pixels(renderer, host, FLOATS, &gradient));
  OK(dpr_gradient_read(gradient, "meshes[0].specular", of_host, 3));
  OK(dpr_gradient_read(gradient, "meshes[0].shininess", &of_shininess, 1));
  OK(dpr_renderer_set_materials(renderer, 0, &dull, 1));
  OK(dpr_renderer_set_materials_from(renderer, 0, &values, NULL));
  OK(dpr_renderer_forward_on_device(renderer, NULL));
  OK(dpr_renderer_read_image(renderer, found, FLOATS));
  EXPECT(memcmp(host, found, sizeof host) == 0);
  OK(dpr_renderer_image_view(renderer, &values));
  OK(dpr_renderer_backward_on_device(renderer, &values, NULL));
  values.buffer = buffer;
  OK(dpr_renderer_copy_gradient(renderer, "meshes[0].specular", &values, NULL));
  clEnqueueReadBuffer(queue, buffer, CL_TRUE, 0, sizeof of_device, of_device, 0, NULL, NULL);
  OK(dpr_renderer_copy_gradient(renderer, "meshes[0].shininess", &values, NULL));
  clEnqueueReadBuffer(queue, buffer, CL_TRUE, 0, sizeof shininess, &shininess, 0, NULL, NULL);
  for (i = 0; i < 3; ++i) EXPECT((double)of_device[i] == of_host[i] && of_host[i] != 0);
  EXPECT((double)shininess == of_shininess && shininess != 0);
  dpr_gradient_destroy(gradient);
  dpr_renderer_destroy(renderer);
  dpr_scene_destroy(scene);
  clReleaseMemObject(buffer);
}

/* In the caller's context, on the caller's queue: images and gradients as buffers. */
static void test_own_opencl(const dpr_scene* scene) {
  cl_platform_id platform;
  cl_device_id id;
  cl_context context;
  cl_command_queue queue;
  cl_mem image = NULL;
  float read[FLOATS], mapped[FLOATS];
  double of_buffer[9], of_pixels[9];
  dpr_device* device = NULL;
  dpr_renderer* renderer = NULL;
  dpr_gradient *first = NULL, *second = NULL;
  EXPECT(clGetPlatformIDs(1, &platform, NULL) == CL_SUCCESS);
  EXPECT(clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 1, &id, NULL) == CL_SUCCESS);
  context = clCreateContext(NULL, 1, &id, NULL, NULL, NULL);
  queue = clCreateCommandQueue(context, id, 0, NULL);
  OK(dpr_device_adopt(context, queue, &device));
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  REFUSED(dpr_renderer_image_buffer(renderer, &image), "forward");
  OK(dpr_renderer_forward(renderer));
  OK(dpr_renderer_read_image(renderer, read, FLOATS));
  OK(dpr_renderer_image_buffer(renderer, &image));
  EXPECT(clEnqueueReadBuffer(queue, image, CL_TRUE, 0, sizeof mapped, mapped, 0, NULL, NULL) == CL_SUCCESS);
  EXPECT(memcmp(read, mapped, sizeof read) == 0);
  OK(dpr_backward_buffer(renderer, image, &first));
  OK(dpr_backward_pixels(renderer, read, FLOATS, &second));
  OK(dpr_gradient_read(first, "meshes[0].positions", of_buffer, 9));
  OK(dpr_gradient_read(second, "meshes[0].positions", of_pixels, 9));
  EXPECT(memcmp(of_buffer, of_pixels, sizeof of_buffer) == 0);
  REFUSED(dpr_backward_buffer(renderer, NULL, &first), "grad");
  test_on_device(context, queue, renderer, read, of_pixels);
  test_emptied_frames(context, queue, device, scene);
  test_attributes_on_device(context, queue, device, renderer);
  test_shapes_on_device(context, queue, renderer);
  test_materials_on_device(context, queue, device);
  REFUSED(dpr_device_adopt(NULL, queue, &device), "context");
  REFUSED(dpr_device_adopt(context, NULL, &device), "queue");
  dpr_gradient_destroy(first);
  dpr_gradient_destroy(second);
  dpr_renderer_destroy(renderer);
  dpr_device_destroy(device);
  clReleaseCommandQueue(queue);
  clReleaseContext(context);
}

/* Arrays into a file, and back. */
static void test_mesh_files(void) {
  static const char* const path = "c_api_mesh.ply";
  float vertices[9], colors[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, texels[3] = {1, 1, 1};
  int32_t of_faces[] = {0, 1, 2};
  const dpr_array arrays[] = {{"vertices", vertices, DPR_FLOAT32, 2, {3, 3}},
                              {"faces", of_faces, DPR_INT32, 2, {1, 3}},
                              {"colors", colors, DPR_FLOAT32, 2, {3, 3}},
                              {"textures[0]", texels, DPR_FLOAT32, 3, {1, 1, 3}}};
  const char* const unknown[] = {"wrap=round"};
  dpr_mesh_contents contents = DPR_MESH_CONTENTS_INIT;
  dpr_mesh_file* file = NULL;
  memcpy(vertices, positions, sizeof vertices);
  REFUSED(dpr_mesh_file_write(path, arrays, 1, NULL, 0), "faces");
  REFUSED(dpr_mesh_file_write(path, arrays, 4, NULL, 0), "texcoords");
  REFUSED(dpr_mesh_file_write(path, arrays, 3, unknown, 1), "wrap");
  REFUSED(dpr_mesh_file_write(NULL, arrays, 3, NULL, 0), "path");
  EXPECT(dpr_mesh_file_read(path, &file) == DPR_IO_ERROR && file == NULL);
  OK(dpr_mesh_file_write(path, arrays, 3, NULL, 0));
  REFUSED(dpr_mesh_file_read(path, NULL), "file");
  OK(dpr_mesh_file_read(path, &file));
  OK(dpr_mesh_file_contents(file, &contents));
  EXPECT(contents.array_count == 3 && contents.setting_count == 0 && contents.note_count == 0);
  EXPECT(strcmp(contents.arrays[1].name, "faces") == 0 && contents.arrays[1].element == DPR_INT32);
  EXPECT(contents.arrays[0].shape[0] == 3 && memcmp(contents.arrays[0].data, vertices, sizeof vertices) == 0);
  EXPECT(memcmp(contents.arrays[2].data, colors, sizeof colors) == 0);
  contents.size = 1;
  REFUSED(dpr_mesh_file_contents(file, &contents), "contents.size");
  dpr_mesh_file_destroy(file);
  REFUSED(dpr_mesh_file_contents(file, &contents), "file");
  EXPECT(remove(path) == 0);
}

static void test_image_files(void) {
  static const char* const path = "c_api_image.exr";
  float pixels[2 * 3 * 4];
  const dpr_array given = {"pixels", pixels, DPR_FLOAT32, 3, {2, 3, 4}};
  const dpr_array wrong = {"pixels", pixels, DPR_FLOAT32, 3, {2, 4, 3}};
  dpr_array found;
  dpr_image_file* file = NULL;
  int i;
  for (i = 0; i < 24; ++i) pixels[i] = (float)i / 16;
  REFUSED(dpr_image_file_write(path, NULL, &wrong), "pixels");
  REFUSED(dpr_image_file_write(path, "gamma", &given), "encoding");
  EXPECT(dpr_image_file_read(path, NULL, &file) == DPR_IO_ERROR && file == NULL);
  OK(dpr_image_file_write(path, NULL, &given));
  OK(dpr_image_file_read(path, "linear", &file));
  REFUSED(dpr_image_file_pixels(file, NULL), "pixels");
  OK(dpr_image_file_pixels(file, &found));
  EXPECT(found.shape[0] == 2 && found.shape[1] == 3 && memcmp(found.data, pixels, sizeof pixels) == 0);
  dpr_image_file_destroy(file);
  REFUSED(dpr_image_file_pixels(file, &found), "file");
  EXPECT(remove(path) == 0);
}

/* A frame of named arrays: <u, J v> = <J^T u, v> of two directions at once, and tangents that are refused. */
static void test_frame_tangents(void) {
  static float pixels[FLOATS], tangents[2 * FLOATS], weights[FLOATS], texels[3] = {1, 1, 1};
  float view[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -3, 0, 0, 0, 1}, intrinsics[] = {20, 20, 8.2f, 7.9f};
  float vertices[9], of_vertices[18], of_view[32], grad_vertices[9], grad_view[16];
  int32_t of_faces[] = {0, 1, 2};
  const char* const settings[] = {"preset=joint_gaussian", "sigma=1e-2"};
  const char* const wanted[] = {"vertices", "views"};
  const dpr_array arrays[] = {{"vertices", vertices, DPR_FLOAT32, 2, {3, 3}},
                              {"faces", of_faces, DPR_INT32, 2, {1, 3}},
                              {"views", view, DPR_FLOAT32, 3, {1, 4, 4}},
                              {"intrinsics", intrinsics, DPR_FLOAT32, 2, {1, 4}}};
  const dpr_array image = {"image", pixels, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array grad = {"image", weights, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array gradients[] = {{"vertices", grad_vertices, DPR_FLOAT32, 2, {3, 3}},
                                 {"views", grad_view, DPR_FLOAT32, 3, {1, 4, 4}}};
  const dpr_array moved[] = {{"vertices", of_vertices, DPR_FLOAT32, 3, {2, 3, 3}},
                             {"views", of_view, DPR_FLOAT32, 4, {2, 1, 4, 4}}};
  dpr_array wrong = moved[0];
  dpr_frame_options options = DPR_FRAME_OPTIONS_INIT;
  dpr_frame* frame = NULL;
  int i, direction;
  memcpy(vertices, positions, sizeof vertices);
  for (i = 0; i < 18; ++i) of_vertices[i] = sinf((float)i);
  for (i = 0; i < 32; ++i) of_view[i] = i % 16 < 12 ? cosf((float)i) : 0;
  for (i = 0; i < FLOATS; ++i) weights[i] = sinf(0.7f * (float)i);
  options.width = options.height = SIDE;
  options.settings = settings, options.setting_count = 2;
  options.gradients = wanted, options.gradient_count = 2;
  OK(dpr_frame_render(&options, arrays, 4, &frame));
  OK(dpr_frame_read(frame, &image, 1));
  OK(dpr_frame_backward(frame, &grad, 1, gradients, 2));
  OK(dpr_frame_tangent(frame, 2, moved, 2, tangents, 2 * FLOATS));
  for (direction = 0; direction < 2; ++direction) {
    double forward = 0, size = 0, backward = 0;
    for (i = 0; i < FLOATS; ++i) {
      const double term = (double)weights[i] * (double)tangents[direction * FLOATS + i];
      forward += term, size += fabs(term);
    }
    for (i = 0; i < 9; ++i) backward += (double)grad_vertices[i] * (double)of_vertices[direction * 9 + i];
    for (i = 0; i < 16; ++i) backward += (double)grad_view[i] * (double)of_view[direction * 16 + i];
    EXPECT(size > 1 && fabs(forward - backward) < 1e-5 * size);
  }
  OK(dpr_frame_tangent(frame, 1, NULL, 0, tangents, FLOATS)); /* nothing moves */
  for (i = 0; i < FLOATS; ++i) EXPECT(tangents[i] == 0);
  REFUSED(dpr_frame_tangent(frame, 0, moved, 2, tangents, 0), "directions");
  REFUSED(dpr_frame_tangent(frame, 2, moved, 2, tangents, FLOATS), "pixels");
  REFUSED(dpr_frame_tangent(frame, 2, moved, 2, NULL, 2 * FLOATS), "pixels");
  REFUSED(dpr_frame_tangent(frame, 1, moved, 1, tangents, FLOATS), "[2, 3, 3]");
  wrong.shape[1] = 2;
  REFUSED(dpr_frame_tangent(frame, 2, &wrong, 1, tangents, 2 * FLOATS), "9 numbers a direction");
  wrong = (dpr_array){"background", of_vertices, DPR_FLOAT32, 2, {2, 3}};
  REFUSED(dpr_frame_tangent(frame, 2, &wrong, 1, tangents, 2 * FLOATS), "`gradients`");
  wrong = (dpr_array){"textures[0]", texels, DPR_FLOAT32, 4, {1, 1, 1, 3}};
  REFUSED(dpr_frame_tangent(frame, 1, &wrong, 1, tangents, FLOATS), "textures[0]");
  of_vertices[4] = NAN;
  REFUSED(dpr_frame_tangent(frame, 2, moved, 1, tangents, 2 * FLOATS), "finite");
  REFUSED(dpr_frame_tangent(NULL, 2, moved, 1, tangents, 2 * FLOATS), "frame");
  dpr_frame_destroy(frame);
  {
    static const char* const unknown[] = {"vertices", "vertexes"};
    options.gradients = unknown;
    REFUSED(dpr_frame_render(&options, arrays, 4, &frame), "\"vertexes\"");
  }
}

/* Of the samples with a face alone, in a frame whose samples these are: as of all samples. */
static void check_covered(dpr_frame* frame, const dpr_array* samples, size_t seen) {
  static float images[FLOATS], of_all_images[FLOATS], weights[FLOATS];
  const size_t h = samples->shape[1], w = samples->shape[2], all = h * w;
  const int64_t* const faces_seen = samples[0].data;
  float table[12], grad_table[12], of_all_table[12], by_table[9], of_all[9], by_contours[9], again[9];
  float *const rows = calloc(4 * seen, sizeof(float)), *const grad_rows = malloc(4 * seen * sizeof(float));
  float *const kept_rows = malloc(4 * seen * sizeof(float)), *const whole = malloc(4 * all * sizeof(float));
  float *const grad_whole = malloc(4 * all * sizeof(float)), *const grad_places =
                                                                 malloc(3 * all * sizeof(float));
  int32_t of_faces[] = {0, 1, 2};
  const dpr_array attributes = {"attributes", table, DPR_FLOAT32, 2, {3, 4}};
  const dpr_array at_samples[] = {
      samples[0], samples[1], attributes, {"faces", of_faces, DPR_INT32, 2, {1, 3}}};
  const dpr_array values = {"values", rows, DPR_FLOAT32, 2, {seen, 4}};
  const dpr_array grad_values = {"values", grad_rows, DPR_FLOAT32, 2, {seen, 4}};
  const dpr_array kept_values = {"values", kept_rows, DPR_FLOAT32, 2, {seen, 4}};
  const dpr_array of_samples = {"values", whole, DPR_FLOAT32, 4, {1, h, w, 4}};
  const dpr_array grad_of_samples = {"values", grad_whole, DPR_FLOAT32, 4, {1, h, w, 4}};
  const dpr_array image = {"images", images, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array whole_image = {"images", of_all_images, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array grad = {"images", weights, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array grads[] = {{"attributes", of_all_table, DPR_FLOAT32, 2, {3, 4}},
                             {"barycentrics", grad_places, DPR_FLOAT32, 4, {1, h, w, 3}}};
  dpr_array by_values = {"attributes", grad_table, DPR_FLOAT32, 2, {3, 4}}, wrong = values;
  dpr_array gradient = {"vertices", by_table, DPR_FLOAT32, 2, {3, 3}};
  size_t count = 0, k, row = 0;
  int i;
  for (i = 0; i < 12; ++i) table[i] = cosf(1.3f * (float)i);
  for (i = 0; i < FLOATS; ++i) weights[i] = sinf(0.3f * (float)i);
  OK(dpr_frame_covered(frame, &count));
  EXPECT(count == seen);
  OK(dpr_frame_interpolate(frame, &attributes, 1, &values));
  OK(dpr_interpolate(at_samples, 4, &of_samples, 1));
  for (k = 0; k < all; ++k) {
    if (faces_seen[k] < 0) continue;
    for (i = 0; i < 4; ++i) EXPECT(rows[4 * row + (size_t)i] == whole[4 * k + (size_t)i]);
    ++row;
  }
  gradient.data = by_contours; /* there are no values yet */
  REFUSED(dpr_frame_resolve_backward(frame, NULL, &grad, &kept_values, &gradient, 1), "values");
  OK(dpr_frame_resolve(frame, &of_samples, &whole_image));
  OK(dpr_frame_resolve(frame, &values, &image));
  for (i = 0; i < FLOATS; ++i) EXPECT(images[i] == of_all_images[i]);

  /* By contours: of the values that were resolved last, of the same given again, and of all. */
  gradient.data = by_contours;
  OK(dpr_frame_resolve_backward(frame, NULL, &grad, &kept_values, &gradient, 1));
  gradient.data = again;
  OK(dpr_frame_resolve_backward(frame, &values, &grad, &grad_values, &gradient, 1));
  gradient.data = of_all;
  OK(dpr_frame_resolve_backward(frame, &of_samples, &grad, &grad_of_samples, &gradient, 1));
  for (i = 0; i < 9; ++i) EXPECT(by_contours[i] == again[i] && again[i] == of_all[i]);
  for (k = row = 0; k < all; ++k) {
    if (faces_seen[k] < 0) continue;
    for (i = 0; i < 4; ++i, ++row)
      EXPECT(kept_rows[row] == grad_rows[row] && grad_rows[row] == grad_whole[4 * k + (size_t)i]);
  }
  REFUSED(dpr_frame_resolve_backward(frame, NULL, &grad, &grad_values, &gradient, 1), "values");

  /* By places on the faces. */
  gradient.data = by_table;
  OK(dpr_frame_interpolate_backward(frame, &attributes, 1, &grad_values, &by_values, &gradient, 1));
  {
    const dpr_array grad_at = {"values", grad_whole, DPR_FLOAT32, 4, {1, h, w, 4}};
    OK(dpr_interpolate_backward(at_samples, 4, &grad_at, 1, grads, 2));
  }
  gradient.data = of_all;
  OK(dpr_frame_samples_backward(frame, grads + 1, 1, &gradient, 1));
  for (i = 0; i < 9; ++i) EXPECT(by_table[i] != 0 && by_table[i] == of_all[i]);
  for (i = 0; i < 12; ++i)
    EXPECT(fabsf(grad_table[i] - of_all_table[i]) < 1e-5f * (1 + fabsf(grad_table[i])));

  wrong.shape[0] = seen + 1;
  REFUSED(dpr_frame_resolve(frame, &wrong, &image), "samples with a face");
  REFUSED(dpr_frame_interpolate(frame, &attributes, 1, &wrong), "samples with a face");
  REFUSED(dpr_frame_interpolate(frame, samples, 1, &values), "attributes");
  wrong = by_values, wrong.shape[0] = 2;
  REFUSED(dpr_frame_interpolate_backward(frame, &attributes, 1, &grad_values, &wrong, &gradient, 1),
          "attributes");
  rows[0] = NAN;
  REFUSED(dpr_frame_resolve(frame, &values, &image), "finite");
  REFUSED(dpr_frame_covered(frame, NULL), "count");
  free(rows), free(grad_rows), free(kept_rows), free(whole), free(grad_whole), free(grad_places);
}

/* Shading of the caller's own: white samples make the frame's own image and its gradients. */
static void test_frame_samples(void) {
  static float pixels[FLOATS], images[FLOATS], weights[FLOATS], other[2 * FLOATS];
  float view[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -3, 0, 0, 0, 1}, intrinsics[] = {20, 20, 8.2f, 7.9f};
  float vertices[9], wanted_gradient[9], by_contours[9], inside[9];
  int32_t of_faces[] = {0, 1, 2};
  const char* const settings[] = {"preset=pixel", "sigma=1e-2"};
  const char* const wanted[] = {"vertices", "sigma"};
  const dpr_array arrays[] = {{"vertices", vertices, DPR_FLOAT32, 2, {3, 3}},
                              {"faces", of_faces, DPR_INT32, 2, {1, 3}},
                              {"views", view, DPR_FLOAT32, 3, {1, 4, 4}},
                              {"intrinsics", intrinsics, DPR_FLOAT32, 2, {1, 4}}};
  const dpr_array image = {"image", pixels, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array grad = {"image", weights, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array resolved = {"images", images, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  dpr_array gradient = {"vertices", wanted_gradient, DPR_FLOAT32, 2, {3, 3}};
  dpr_frame_options options = DPR_FRAME_OPTIONS_INIT;
  dpr_raster raster;
  dpr_frame* frame = NULL;
  size_t count, k, seen = 0;
  int i;
  memcpy(vertices, positions, sizeof vertices);
  for (i = 0; i < FLOATS; ++i) weights[i] = sinf(0.7f * (float)i);
  options.width = options.height = SIDE;
  options.settings = settings, options.setting_count = 2;
  options.gradients = wanted, options.gradient_count = 2;
  OK(dpr_frame_render(&options, arrays, 4, &frame));
  OK(dpr_frame_read(frame, &image, 1));
  OK(dpr_frame_backward(frame, &grad, 1, &gradient, 1));
  dpr_frame_destroy(frame);
  frame = NULL;
  options.defers_image = 1;
  OK(dpr_frame_render(&options, arrays, 4, &frame));
  OK(dpr_frame_raster(frame, &raster));
  EXPECT(raster.width == raster.supersampling * SIDE + 2 * raster.margin && raster.height == raster.width);
  count = (size_t)raster.width * (size_t)raster.height;
  {
    int64_t* const faces_seen = malloc(count * sizeof *faces_seen);
    float *const barycentrics = malloc(3 * count * sizeof(float)), *const depth =
                                                                       malloc(count * sizeof(float));
    float *const values = calloc(4 * count, sizeof(float)), *const grad_values =
                                                                malloc(4 * count * sizeof(float));
    const size_t h = (size_t)raster.height, w = (size_t)raster.width;
    const dpr_array samples[] = {{"face_id", faces_seen, DPR_INT64, 3, {1, h, w}},
                                 {"barycentrics", barycentrics, DPR_FLOAT32, 4, {1, h, w, 3}},
                                 {"depth", depth, DPR_FLOAT32, 3, {1, h, w}}};
    const dpr_array shaded = {"values", values, DPR_FLOAT32, 4, {1, h, w, 4}};
    const dpr_array grad_shaded = {"grad_values", grad_values, DPR_FLOAT32, 4, {1, h, w, 4}};
    dpr_array wrong = shaded;
    OK(dpr_frame_samples(frame, samples, 3));
    for (k = 0; k < count; ++k) {
      const float sum = barycentrics[3 * k] + barycentrics[3 * k + 1] + barycentrics[3 * k + 2];
      EXPECT(faces_seen[k] == 0 ? fabsf(sum - 1) < 1e-5f && depth[k] > 0 : sum == 0 && depth[k] == 0);
      for (i = 0; i < 4; ++i) values[4 * k + (size_t)i] = faces_seen[k] == 0 ? 1 : 0;
      seen += faces_seen[k] == 0;
    }
    EXPECT(seen > 0 && seen < count);
    check_covered(frame, samples, seen);
    OK(dpr_frame_resolve(frame, &shaded, &resolved));
    for (i = 0; i < FLOATS; ++i) EXPECT(fabsf(images[i] - pixels[i]) < 1e-5f);
    gradient.data = by_contours;
    OK(dpr_frame_resolve_backward(frame, &shaded, &grad, &grad_shaded, &gradient, 1));
    for (i = 0; i < 9; ++i) EXPECT(fabsf(by_contours[i] - wanted_gradient[i]) < 1e-4f);
    for (k = 0; k < count; ++k) depth[k] = 0;
    gradient.data = inside;
    OK(dpr_frame_samples_backward(frame, samples + 2, 1, &gradient, 1)); /* a gradient of nothing */
    for (i = 0; i < 9; ++i) EXPECT(inside[i] == 0);
    REFUSED(dpr_frame_samples(frame, &image, 1), "face_id");
    EXPECT(raster.layers == 1);
    { /* The image and its gradient are there when they are asked for. */
      const dpr_array later = {"image", other, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
      gradient.data = inside;
      OK(dpr_frame_backward(frame, &grad, 1, &gradient, 1));
      OK(dpr_frame_read(frame, &later, 1));
      for (i = 0; i < FLOATS; ++i) EXPECT(other[i] == pixels[i]);
      for (i = 0; i < 9; ++i) EXPECT(inside[i] == wanted_gradient[i]);
    }
    REFUSED(dpr_frame_samples_backward(frame, samples, 1, &gradient, 1), "barycentrics or depth");
    wrong.shape[2] = SIDE;
    REFUSED(dpr_frame_resolve(frame, &wrong, &resolved), "values");
    wrong = (dpr_array){"images", other, DPR_FLOAT32, 4, {1, SIDE, SIDE, 8}};
    REFUSED(dpr_frame_resolve(frame, &shaded, &wrong), "images");
    gradient = (dpr_array){"sigma", inside, DPR_FLOAT32, 1, {1}};
    REFUSED(dpr_frame_resolve_backward(frame, &shaded, &grad, &grad_shaded, &gradient, 1), "sigma");
    values[0] = NAN;
    REFUSED(dpr_frame_resolve(frame, &shaded, &resolved), "finite");
    REFUSED(dpr_frame_resolve(frame, NULL, &resolved), "values");
    REFUSED(dpr_frame_raster(frame, NULL), "raster");
    free(faces_seen), free(barycentrics), free(depth), free(values), free(grad_values);
  }
  dpr_frame_destroy(frame);
}

/* A textured triangle that the caller shades: the frame's own image, its gradients of texels and coordinates, and
 * <u, J v> = <J^T u, v>. */
static void test_own_texture(void) {
  static float pixels[FLOATS], images[SIDE * SIDE * 3], weights[FLOATS], own_weights[SIDE * SIDE * 3];
  float view[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -3, 0, 0, 0, 1}, intrinsics[] = {20, 20, 8.2f, 7.9f};
  float vertices[9], coordinates[] = {-0.2f, 0.1f, 1.3f, 0.2f, 0.4f, 1.6f}, texels[4 * 3 * 3], of_view[6],
                     of_texels[36], wanted_view[6], wanted_texels[36], moved_texels[36], moved_coordinates[6];
  int32_t of_faces[] = {0, 1, 2};
  const char* const settings[] = {"preset=pixel", "sigma=1e-2", "wrap=mirror", "filter=bilinear"};
  const char* const wanted[] = {"texcoords", "textures[0]"};
  const dpr_array arrays[] = {
      {"vertices", vertices, DPR_FLOAT32, 2, {3, 3}},     {"faces", of_faces, DPR_INT32, 2, {1, 3}},
      {"views", view, DPR_FLOAT32, 3, {1, 4, 4}},         {"intrinsics", intrinsics, DPR_FLOAT32, 2, {1, 4}},
      {"texcoords", coordinates, DPR_FLOAT32, 2, {3, 2}}, {"textures[0]", texels, DPR_FLOAT32, 3, {4, 3, 3}}};
  const dpr_array image = {"image", pixels, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array grad = {"image", weights, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array of_image[] = {{"texcoords", wanted_view, DPR_FLOAT32, 2, {3, 2}},
                                {"textures[0]", wanted_texels, DPR_FLOAT32, 3, {4, 3, 3}}};
  const dpr_array resolved = {"images", images, DPR_FLOAT32, 4, {1, SIDE, SIDE, 3}};
  const dpr_array grad_resolved = {"grad_images", own_weights, DPR_FLOAT32, 4, {1, SIDE, SIDE, 3}};
  dpr_frame_options options = DPR_FRAME_OPTIONS_INIT;
  dpr_raster raster;
  dpr_frame* frame = NULL;
  size_t count, k;
  memcpy(vertices, positions, sizeof vertices);
  for (k = 0; k < 36; ++k) texels[k] = 0.5f + 0.5f * sinf((float)k), moved_texels[k] = cosf((float)k);
  for (k = 0; k < 6; ++k) moved_coordinates[k] = cosf(2.0f * (float)k);
  for (k = 0; k < SIDE * SIDE; ++k) {
    size_t c;
    for (c = 0; c < 3; ++c) weights[4 * k + c] = own_weights[3 * k + c] = sinf(0.7f * (float)(4 * k + c));
    weights[4 * k + 3] = 0;
  }
  options.width = options.height = SIDE;
  options.settings = settings, options.setting_count = 4;
  options.gradients = wanted, options.gradient_count = 2;
  OK(dpr_frame_render(&options, arrays, 6, &frame));
  OK(dpr_frame_read(frame, &image, 1));
  OK(dpr_frame_backward(frame, &grad, 1, of_image, 2));
  OK(dpr_frame_raster(frame, &raster));
  count = (size_t)raster.width * (size_t)raster.height;
  {
    const size_t h = (size_t)raster.height, w = (size_t)raster.width;
    int64_t* const face_id = malloc(count * sizeof *face_id);
    float *const numbers = malloc(30 * count * sizeof(float)), *const barycentrics = numbers,
                 *const barycentric_steps = numbers + 3 * count, *const uv = numbers + 7 * count,
                 *const steps = numbers + 9 * count, *const values = numbers + 13 * count,
                 *const grad_values = numbers + 16 * count, *const grad_uv = numbers + 19 * count,
                 *const moved_uv = numbers + 21 * count, *const moved_values = numbers + 23 * count,
                 *const grad_barycentrics = numbers + 26 * count;
    const dpr_array samples[] = {{"face_id", face_id, DPR_INT64, 3, {1, h, w}},
                                 {"barycentrics", barycentrics, DPR_FLOAT32, 4, {1, h, w, 3}},
                                 {"barycentric_steps", barycentric_steps, DPR_FLOAT32, 4, {1, h, w, 4}},
                                 {"attributes", coordinates, DPR_FLOAT32, 2, {3, 2}},
                                 {"faces", of_faces, DPR_INT32, 2, {1, 3}}};
    const dpr_array outputs[] = {{"values", uv, DPR_FLOAT32, 4, {1, h, w, 2}},
                                 {"steps", steps, DPR_FLOAT32, 4, {1, h, w, 4}}};
    const dpr_array grad_outputs[] = {{"values", grad_uv, DPR_FLOAT32, 4, {1, h, w, 2}}};
    const dpr_array of_samples[] = {{"attributes", of_view, DPR_FLOAT32, 2, {3, 2}},
                                    {"barycentrics", grad_barycentrics, DPR_FLOAT32, 4, {1, h, w, 3}}};
    const dpr_array moving[] = {{"attributes", moved_coordinates, DPR_FLOAT32, 2, {3, 2}}};
    const dpr_array uv_moved = {"values", moved_uv, DPR_FLOAT32, 4, {1, h, w, 2}};
    const dpr_array map[] = {{"texels[0]", texels, DPR_FLOAT32, 4, {1, 4, 3, 3}},
                             {"texcoords", uv, DPR_FLOAT32, 4, {1, h, w, 2}},
                             {"steps", steps, DPR_FLOAT32, 4, {1, h, w, 4}}};
    const dpr_array of_map[] = {{"texels[0]", of_texels, DPR_FLOAT32, 4, {1, 4, 3, 3}},
                                {"texcoords", grad_uv, DPR_FLOAT32, 4, {1, h, w, 2}}};
    const dpr_array map_moved[] = {{"texels[0]", moved_texels, DPR_FLOAT32, 4, {1, 4, 3, 3}},
                                   {"texcoords", moved_uv, DPR_FLOAT32, 4, {1, h, w, 2}}};
    const dpr_array shaded = {"values", values, DPR_FLOAT32, 4, {1, h, w, 3}};
    const dpr_array grad_shaded = {"values", grad_values, DPR_FLOAT32, 4, {1, h, w, 3}};
    const dpr_array values_moved = {"values", moved_values, DPR_FLOAT32, 4, {1, h, w, 3}};
    dpr_array wrong[3];
    double forward = 0, size = 0, backward = 0;
    OK(dpr_frame_samples(frame, samples, 3));
    OK(dpr_interpolate(samples, 5, outputs, 2));
    OK(dpr_texture_map(map, 2, "mirror", "bilinear", &shaded));
    for (k = 0; k < 3 * count; ++k) values[k] = face_id[k / 3] < 0 ? 0 : values[k];
    OK(dpr_frame_resolve(frame, &shaded, &resolved));
    for (k = 0; k < SIDE * SIDE * 3; ++k) EXPECT(fabsf(images[k] - pixels[k / 3 * 4 + k % 3]) < 1e-5f);
    OK(dpr_frame_resolve_backward(frame, &shaded, &grad_resolved, &grad_shaded, NULL, 0));
    for (k = 0; k < 3 * count; ++k) grad_values[k] = face_id[k / 3] < 0 ? 0 : grad_values[k];
    OK(dpr_texture_map_backward(map, 2, "mirror", NULL, &grad_shaded, of_map, 2));
    OK(dpr_interpolate_backward(samples, 5, grad_outputs, 1, of_samples, 2));
    for (k = 0; k < 36; ++k) EXPECT(fabsf(of_texels[k] - wanted_texels[k]) < 1e-4f);
    for (k = 0; k < 6; ++k) EXPECT(fabsf(of_view[k] - wanted_view[k]) < 1e-3f);

    OK(dpr_interpolate_tangent(samples, 5, moving, 1, &uv_moved));
    OK(dpr_texture_map_tangent(map, 2, "mirror", "bilinear", map_moved, 2, &values_moved));
    for (k = 0; k < 3 * count; ++k) {
      const double term = (double)grad_values[k] * (double)moved_values[k];
      forward += term, size += fabs(term);
    }
    for (k = 0; k < 36; ++k) backward += (double)of_texels[k] * (double)moved_texels[k];
    for (k = 0; k < 6; ++k) backward += (double)of_view[k] * (double)moved_coordinates[k];
    EXPECT(size > 1 && fabs(forward - backward) < 1e-5 * size);

    /* Smaller versions, made here or given. */
    OK(dpr_texture_map(map, 3, "mirror", "trilinear", &shaded));
    memcpy(moved_values, values, 3 * count * sizeof(float));
    for (k = 0; k < 4 * count; ++k) steps[k] *= 100;
    OK(dpr_texture_map(map, 3, "mirror", "trilinear", &shaded)); /* a mean of all texels */
    for (k = 0; k < 3 * count; ++k) {
      float mean = 0;
      size_t i;
      if (face_id[k / 3] < 0) continue;
      for (i = 0; i < 12; ++i) mean += texels[3 * i + k % 3] / 12;
      EXPECT(fabsf(values[k] - mean) < 1e-5f);
      backward += fabs((double)(moved_values[k] - mean));
    }
    EXPECT(backward > 1);

    memcpy(wrong, map, sizeof wrong);
    wrong[0].shape[0] = 2;
    REFUSED(dpr_texture_map(wrong, 2, NULL, NULL, &shaded), "texels[0]");
    REFUSED(dpr_texture_map(map, 2, "round", NULL, &shaded), "repeat, mirror, clamp or zero");
    REFUSED(dpr_texture_map(map, 2, NULL, "cubic", &shaded), "trilinear");
    REFUSED(dpr_texture_map(map, 1, NULL, NULL, &shaded), "texcoords, places or directions");
    REFUSED(dpr_texture_map(map + 1, 2, NULL, NULL, &shaded), "texels[0]");
    REFUSED(dpr_texture_map(map, 2, NULL, NULL, &outputs[0]), "values");
    REFUSED(dpr_texture_map(samples, 5, NULL, NULL, &shaded), "name (texture)");
    REFUSED(dpr_texture_map_backward(map, 2, NULL, NULL, &grad_shaded, samples, 1), "face_id");
    memcpy(wrong, map, sizeof wrong);
    wrong[2] = map[0], wrong[2].name = "texels[2]";
    REFUSED(dpr_texture_map(wrong, 3, NULL, "trilinear", &shaded), "texels[2]");
    uv[0] = NAN;
    REFUSED(dpr_texture_map(map, 2, NULL, NULL, &shaded), "texcoords");
    REFUSED(dpr_interpolate(samples, 4, outputs, 1), "faces");
    REFUSED(dpr_interpolate(samples, 5, samples, 1), "values or steps");
    face_id[0] = 1;
    REFUSED(dpr_interpolate(samples, 5, outputs, 1), "expected more than 1");
    REFUSED(dpr_interpolate_backward(samples, 5, NULL, 1, of_samples, 1), "grads");
    free(face_id), free(numbers);
  }
  dpr_frame_destroy(frame);
}

/* Of two shapes, one of them the other way round: a square's corner is moved along its normal. */
static void test_vertex_normals(void) {
  float vertices[24] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0}, normals[24], grad[24] = {0}, by_vertices[24];
  int faces[] = {0, 1, 2, 0, 2, 3}, i;
  dpr_array arrays[] = {{"vertices", vertices, DPR_FLOAT32, 3, {2, 4, 3}},
                        {"faces", faces, DPR_INT32, 2, {2, 3}}};
  const dpr_array of_normals = {"normals", normals, DPR_FLOAT32, 3, {2, 4, 3}};
  const dpr_array grad_normals = {"normals", grad, DPR_FLOAT32, 3, {2, 4, 3}};
  const dpr_array grad_vertices = {"vertices", by_vertices, DPR_FLOAT32, 3, {2, 4, 3}};
  for (i = 0; i < 12; ++i) vertices[12 + i] = (i % 3 == 0 ? -1.0f : 1.0f) * vertices[i];
  OK(dpr_vertex_normals(arrays, 2, &of_normals));
  for (i = 0; i < 24; ++i) EXPECT(normals[i] == (i % 3 != 2 ? 0 : i < 12 ? 1.0f : -1.0f));
  grad[3] = grad[15] = 1; /* x of vertex 1, of the first face alone, whose normal is 4 long */
  OK(dpr_vertex_normals_backward(arrays, 2, &grad_normals, &grad_vertices));
  EXPECT(by_vertices[2] == 0.5f && by_vertices[5] == -0.5f && by_vertices[8] == 0 && by_vertices[11] == 0);
  EXPECT(by_vertices[14] == 0.5f && by_vertices[17] == -0.5f);
  faces[5] = 4;
  REFUSED(dpr_vertex_normals(arrays, 2, &of_normals), "indices below 4");
  arrays[1].name = "face";
  REFUSED(dpr_vertex_normals(arrays, 2, &of_normals), "vertices or faces");
}

/* What nvdiffrast calls rast and rast_db, of a frame of one triangle: by the interpolation of z and w, and of u and v. */
static void check_rast(dpr_frame* frame, const dpr_array* given, const float* positions) {
  static float rast[FLOATS], rast_db[FLOATS], values[FLOATS], steps[2 * FLOATS], of_rast[FLOATS],
      of_db[FLOATS];
  float attributes[12], of_attributes[12];
  int64_t firsts[] = {6};
  int32_t of_seventh[21] = {0};
  dpr_array arrays[] = {given[0], given[1], {"firsts", firsts, DPR_INT64, 1, {1}}};
  dpr_array outputs[] = {{"rast", rast, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}},
                         {"rast_db", rast_db, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}}};
  const dpr_array samples[] = {outputs[0],
                               outputs[1],
                               {"attributes", attributes, DPR_FLOAT32, 2, {3, 4}},
                               {"faces", of_seventh, DPR_INT32, 2, {7, 3}}};
  const dpr_array found[] = {{"values", values, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}},
                             {"steps", steps, DPR_FLOAT32, 4, {1, SIDE, SIDE, 8}}};
  const dpr_array gradients[] = {{"attributes", of_attributes, DPR_FLOAT32, 2, {3, 4}},
                                 {"rast", of_rast, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}},
                                 {"rast_db", of_db, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}}};
  double by_attributes = 0, by_samples = 0, size = 0;
  int i, k, covered = 0;
  for (k = 0; k < 3; ++k) {
    attributes[4 * k] = positions[4 * k + 2], attributes[4 * k + 1] = positions[4 * k + 3];
    attributes[4 * k + 2] = k == 0, attributes[4 * k + 3] = k == 1;
    of_seventh[18 + k] = k;
  }
  OK(dpr_clip_space_rast(frame, arrays, 3, outputs, 2));
  OK(dpr_interpolate(samples, 4, found, 2));
  for (i = 0; i < SIDE * SIDE; ++i) {
    const float *const at = rast + 4 * i, *const value = values + 4 * i;
    if (at[3] == 0) {
      for (k = 0; k < 4; ++k) EXPECT(at[k] == 0 && rast_db[4 * i + k] == 0 && value[k] == 0);
      continue;
    }
    ++covered;
    EXPECT(at[3] == 7 && fabsf(value[0] / value[1] - at[2]) < 1e-5f);
    EXPECT(fabsf(value[2] - at[0]) < 1e-6f && fabsf(value[3] - at[1]) < 1e-6f);
    for (k = 0; k < 4; ++k) EXPECT(fabsf(steps[8 * i + 4 + k] - rast_db[4 * i + k]) < 1e-5f);
  }
  EXPECT(covered > SIDE);
  /* Linear in the attributes; and in u, v and their steps, apart from what corner 2 has of everything. */
  for (i = 0; i < SIDE * SIDE; ++i)
    for (k = 0; k < 8; ++k)
      steps[8 * i + k] *= cosf((float)(8 * i + k)), values[4 * i + k / 2] *= k % 2 ? 0.5f : 1;
  OK(dpr_interpolate_backward(samples, 4, found, 2, gradients, 3));
  for (k = 0; k < 12; ++k) by_attributes += (double)of_attributes[k] * (double)attributes[k];
  for (i = 0; i < FLOATS; ++i) {
    const double of_last = i % 4 ? 0 : (double)(values[i] * attributes[8] + values[i + 1] * attributes[9]);
    const double term = (double)of_rast[i] * (double)rast[i] + (double)of_db[i] * (double)rast_db[i];
    by_samples += term + (rast[i / 4 * 4 + 3] > 0 ? of_last : 0), size += fabs(term);
  }
  EXPECT(size > 1 && fabs(by_attributes - by_samples) < 1e-4 * size);
  arrays[0].shape[1] = 2;
  REFUSED(dpr_clip_space_rast(frame, arrays, 3, outputs, 2), "indices below 2");
  REFUSED(dpr_clip_space_rast(frame, arrays + 1, 2, outputs, 2), "positions");
  arrays[0].shape[1] = 3, firsts[0] = -1;
  REFUSED(dpr_clip_space_rast(frame, arrays, 3, outputs, 2), "firsts");
  firsts[0] = 6, outputs[1].shape[3] = 3;
  REFUSED(dpr_clip_space_rast(frame, arrays, 3, outputs, 2), "rast_db");
}

/* A triangle by its positions in clip space, under z = 1.2 w - 2.2: a frame's image and gradient, and those of a step. */
static void test_clip_space(void) {
  static float pixels[FLOATS], moved[FLOATS], weights[FLOATS];
  float positions_of_clip[] = {-1.5f, -1.2f, 1.4f, 3, 1.4f, -1, 2.6f, 4, 0.2f, 1.3f, 0.8f, 2.5f};
  float vertices[9], views[16], intrinsics[4], planes[2], by_vertices[9], by_positions[12];
  int32_t of_faces[] = {0, 1, 2};
  char znear[32], zfar[32];
  const char* settings[] = {"preset=pixel", "sigma=1e-2", znear, zfar};
  const char* const wanted[] = {"vertices"};
  dpr_array given[] = {{"positions", positions_of_clip, DPR_FLOAT32, 3, {1, 3, 4}},
                       {"faces", of_faces, DPR_INT32, 2, {1, 3}}};
  const dpr_array arrays[] = {{"vertices", vertices, DPR_FLOAT32, 3, {1, 3, 3}},
                              {"views", views, DPR_FLOAT32, 3, {1, 4, 4}},
                              {"intrinsics", intrinsics, DPR_FLOAT32, 2, {1, 4}},
                              {"planes", planes, DPR_FLOAT32, 1, {2}}};
  const dpr_array grad = {"image", weights, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
  const dpr_array gradient = {"vertices", by_vertices, DPR_FLOAT32, 3, {1, 3, 3}};
  dpr_array of_positions = {"positions", by_positions, DPR_FLOAT32, 3, {1, 3, 4}};
  const float step = 2e-3f;
  double by_step = 0;
  size_t shapes = 0, numbers = 0;
  int side, i;
  for (i = 0; i < FLOATS; ++i) weights[i] = sinf(0.7f * (float)i);
  for (side = 0; side < 3; ++side) { /* as it is, and a step to either side */
    dpr_array frame_arrays[4];
    dpr_frame_options options = DPR_FRAME_OPTIONS_INIT;
    dpr_clip_space* clip = NULL;
    dpr_frame* frame = NULL;
    const dpr_array image = {"image", side == 0 ? pixels : moved, DPR_FLOAT32, 4, {1, SIDE, SIDE, 4}};
    positions_of_clip[4] += side == 0 ? 0 : side == 1 ? step : -2 * step; /* x of a corner */
    OK(dpr_clip_space_create(SIDE, SIDE, given, 2, &clip));
    OK(dpr_clip_space_size(clip, &shapes, &numbers));
    EXPECT(shapes == 1 && numbers == 4);
    OK(dpr_clip_space_read(clip, arrays, 4));
    memcpy(frame_arrays, arrays, sizeof frame_arrays);
    frame_arrays[3] = given[1];
    sprintf(znear, "znear=%g", planes[0]), sprintf(zfar, "zfar=%g", planes[1]);
    options.width = options.height = SIDE;
    options.settings = settings, options.setting_count = 4;
    options.gradients = wanted, options.gradient_count = 1;
    OK(dpr_frame_render(&options, frame_arrays, 4, &frame));
    OK(dpr_frame_read(frame, &image, 1));
    if (side == 0) {
      OK(dpr_frame_backward(frame, &grad, 1, &gradient, 1));
      OK(dpr_clip_space_backward(clip, &gradient, &of_positions));
      of_positions.name = "position";
      REFUSED(dpr_clip_space_backward(clip, &gradient, &of_positions), "positions");
      of_positions.name = "positions", of_positions.shape[1] = 2;
      REFUSED(dpr_clip_space_backward(clip, &gradient, &of_positions), "positions");
      REFUSED(dpr_clip_space_read(clip, given, 1), "vertices, views, intrinsics, planes or scales");
      check_rast(frame, given, positions_of_clip);
    } else {
      for (i = 0; i < FLOATS; ++i)
        by_step += (side == 1 ? 1.0 : -1.0) * (double)weights[i] * (double)moved[i];
    }
    dpr_frame_destroy(frame);
    dpr_clip_space_destroy(clip);
  }
  by_step /= 2 * (double)step;
  EXPECT(fabs(by_step) > 0.1 && fabs(by_step - (double)by_positions[4]) < 0.02 * fabs(by_step));
  {
    dpr_clip_space* clip = NULL;
    given[0].shape[2] = 3;
    REFUSED(dpr_clip_space_create(SIDE, SIDE, given, 2, &clip), "positions");
    given[0].shape[2] = 4, of_faces[0] = 7;
    REFUSED(dpr_clip_space_create(SIDE, SIDE, given, 2, &clip), "faces");
    EXPECT(clip == NULL);
  }
}

/* The two nearest surfaces of two triangles, one behind the other; and forward against backward mode of samples and of
 * what is made of them: <u, J v> = <J^T u, v>, two directions at once. */
static void test_frame_layers(void) {
  float view[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -3, 0, 0, 0, 1}, intrinsics[] = {20, 20, 8.2f, 7.9f};
  float vertices[18], of_vertices[36], grad_vertices[18], weights[SIDE * SIDE * 3],
      images[2 * SIDE * SIDE * 3];
  int32_t of_faces[] = {0, 1, 2, 3, 4, 5};
  const char* const settings[] = {"preset=pixel", "sigma=1e-2", "layers=2"};
  const char* const wanted[] = {"vertices"};
  const dpr_array arrays[] = {{"vertices", vertices, DPR_FLOAT32, 2, {6, 3}},
                              {"faces", of_faces, DPR_INT32, 2, {2, 3}},
                              {"views", view, DPR_FLOAT32, 3, {1, 4, 4}},
                              {"intrinsics", intrinsics, DPR_FLOAT32, 2, {1, 4}}};
  const dpr_array moved = {"vertices", of_vertices, DPR_FLOAT32, 3, {2, 6, 3}};
  const dpr_array gradient = {"vertices", grad_vertices, DPR_FLOAT32, 2, {6, 3}};
  dpr_frame_options options = DPR_FRAME_OPTIONS_INIT;
  dpr_raster raster;
  dpr_frame* frame = NULL;
  size_t count, k, covered = 0, direction;
  memcpy(vertices, positions, sizeof positions);
  for (k = 0; k < 9; ++k) vertices[9 + k] = 1.3f * positions[k] - (k % 3 == 2 ? 0.5f : 0);
  for (k = 0; k < 36; ++k) of_vertices[k] = sinf((float)k);
  for (k = 0; k < SIDE * SIDE * 3; ++k) weights[k] = sinf(0.7f * (float)k);
  options.width = options.height = SIDE;
  options.settings = settings, options.setting_count = 3;
  options.gradients = wanted, options.gradient_count = 1;
  OK(dpr_frame_render(&options, arrays, 4, &frame));
  OK(dpr_frame_raster(frame, &raster));
  EXPECT(raster.layers == 2);
  count = (size_t)raster.width * (size_t)raster.height;
  {
    const size_t h = (size_t)raster.height, w = (size_t)raster.width;
    int64_t* const faces_seen = malloc(2 * count * sizeof *faces_seen);
    float *const depth = malloc(2 * count * sizeof(float)),
                 *const grad_depth = malloc(2 * count * sizeof(float)),
                 *const of_depth = malloc(4 * count * sizeof(float));
    float *const values = malloc(3 * count * sizeof(float)),
                 *const grad_values = malloc(3 * count * sizeof(float)),
                 *const of_values = malloc(6 * count * sizeof(float));
    const dpr_array samples[] = {{"face_id", faces_seen, DPR_INT64, 3, {2, h, w}},
                                 {"depth", depth, DPR_FLOAT32, 3, {2, h, w}}};
    const dpr_array grad_samples = {"depth", grad_depth, DPR_FLOAT32, 3, {2, h, w}};
    const dpr_array depths_moved = {"depth", of_depth, DPR_FLOAT32, 3, {4, h, w}};
    const dpr_array shaded = {"values", values, DPR_FLOAT32, 4, {1, h, w, 3}};
    const dpr_array grad_shaded = {"grad_values", grad_values, DPR_FLOAT32, 4, {1, h, w, 3}};
    const dpr_array values_moved = {"value_tangents", of_values, DPR_FLOAT32, 4, {2, h, w, 3}};
    const dpr_array grad = {"grad_images", weights, DPR_FLOAT32, 4, {1, SIDE, SIDE, 3}};
    const dpr_array images_moved = {"images", images, DPR_FLOAT32, 4, {2, SIDE, SIDE, 3}};
    dpr_array wrong = values_moved;
    OK(dpr_frame_samples(frame, samples, 2));
    for (k = 0; k < count; ++k) {
      const int64_t nearest = faces_seen[k], behind = faces_seen[count + k];
      EXPECT(behind == (nearest == 0 ? 1 : -1) || nearest == 0);
      EXPECT(behind < 0 ? depth[count + k] == 0 : depth[count + k] > depth[k]);
      covered += behind == 1;
    }
    EXPECT(covered > 0 && covered < count);

    for (k = 0; k < 2 * count; ++k) grad_depth[k] = cosf((float)k);
    OK(dpr_frame_samples_backward(frame, &grad_samples, 1, &gradient, 1));
    OK(dpr_frame_samples_tangent(frame, 2, &moved, 1, &depths_moved, 1));
    for (direction = 0; direction < 2; ++direction) {
      double forward = 0, size = 0, backward = 0;
      for (k = 0; k < 2 * count; ++k) {
        const double term = (double)grad_depth[k] * (double)of_depth[2 * count * direction + k];
        forward += term, size += fabs(term);
      }
      for (k = 0; k < 18; ++k) backward += (double)grad_vertices[k] * (double)of_vertices[18 * direction + k];
      EXPECT(size > 1 && fabs(forward - backward) < 1e-5 * size);
    }

    for (k = 0; k < 3 * count; ++k) values[k] = sinf(0.3f * (float)k);
    for (k = 0; k < 6 * count; ++k) of_values[k] = cosf(1.1f * (float)k);
    OK(dpr_frame_resolve_backward(frame, &shaded, &grad, &grad_shaded, &gradient, 1));
    OK(dpr_frame_resolve_tangent(frame, 2, &moved, 1, &shaded, &values_moved, &images_moved));
    for (direction = 0; direction < 2; ++direction) {
      double forward = 0, size = 0, backward = 0;
      for (k = 0; k < SIDE * SIDE * 3; ++k) {
        const double term = (double)weights[k] * (double)images[SIDE * SIDE * 3 * direction + k];
        forward += term, size += fabs(term);
      }
      for (k = 0; k < 18; ++k) backward += (double)grad_vertices[k] * (double)of_vertices[18 * direction + k];
      for (k = 0; k < 3 * count; ++k)
        backward += (double)grad_values[k] * (double)of_values[3 * count * direction + k];
      EXPECT(size > 1 && fabs(forward - backward) < 1e-5 * size);
    }

    REFUSED(dpr_frame_samples_tangent(frame, 0, &moved, 1, &depths_moved, 1), "directions");
    REFUSED(dpr_frame_samples_tangent(frame, 1, &moved, 1, &depths_moved, 1), "depth");
    REFUSED(dpr_frame_samples_tangent(frame, 2, &moved, 1, samples, 1), "face_id");
    wrong.shape[0] = 1;
    REFUSED(dpr_frame_resolve_tangent(frame, 2, &moved, 1, &shaded, &wrong, &images_moved), "value_tangents");
    wrong = grad;
    REFUSED(dpr_frame_resolve_tangent(frame, 2, &moved, 1, &shaded, &values_moved, &wrong), "images");
    of_values[0] = NAN;
    REFUSED(dpr_frame_resolve_tangent(frame, 2, &moved, 1, &shaded, &values_moved, &images_moved), "finite");
    free(faces_seen), free(depth), free(grad_depth), free(of_depth);
    free(values), free(grad_values), free(of_values);
  }
  dpr_frame_destroy(frame);
}

/* An image of the renderer's last frame that differs from another. */
static int differs(const dpr_renderer* renderer, const float* image) {
  float pixels[FLOATS];
  OK(dpr_renderer_read_image(renderer, pixels, FLOATS));
  return memcmp(pixels, image, sizeof pixels) != 0;
}

/* A renderer's setters leave the state that a new scene would: normals, materials, opacities, lights and the rest. */
static void test_setters(const dpr_device* device) {
  const float normals[] = {0, 0, 1}, turned[] = {0.3f, 0.2f, 1}, grey[] = {0.5f, 0.5f, 0.5f};
  const uint32_t first[] = {0, 0, 0}, beyond[] = {0, 1, 0}, of_face[] = {0};
  const dpr_material dull[] = {{{0.1f, 0.2f, 0.3f}, 3}}, bright[] = {{{1, 0.9f, 0.8f}, 0}};
  const float clear[] = {0.5f, 0.25f, 0.75f}, opaque[] = {1, 1, 1};
  const float texels[] = {1, 0.5f, 0.5f, 0.5f, 1, 0.5f}, texcoords[] = {0.3f, 0.5f, 0.9f, 0.5f};
  const uint32_t corners[] = {0, 1, 0};
  const char* const wanted[] = {"normals", "materials", "opacities", "texel_opacities"};
  const char* const others[] = {"positions"};
  const dpr_camera camera = three_units_away();
  dpr_point_light light = {{1, 2, 4}, {0.6f, 0.6f, 0.6f}, {0.5f, 0.5f, 0.5f}};
  dpr_lights lights = DPR_LIGHTS_INIT;
  const dpr_texture leaf = {2, 1, texels, DPR_WRAP_CLAMP, DPR_FILTER_BILINEAR};
  const float* of_leaf[1];
  dpr_mesh mesh = triangle();
  float image[FLOATS];
  size_t count = 0;
  int is_new;
  dpr_renderer *renderers[2] = {NULL, NULL}, *renderer;
  dpr_gradient* gradient = NULL;
  lights.point = &light, lights.point_count = 1;
  for (is_new = 1; is_new >= 0; --is_new) { /* by a new scene, then by setters */
    dpr_scene* scene = NULL;
    mesh.normals = is_new ? turned : normals, mesh.normal_count = 1;
    mesh.face_normals = first;
    mesh.materials = is_new ? bright : dull, mesh.material_count = 1;
    mesh.face_materials = of_face;
    mesh.vertex_opacities = is_new ? clear : opaque;
    of_leaf[0] = mesh.vertex_opacities;
    mesh.texel_opacities = of_leaf;
    mesh.texcoords = texcoords, mesh.texcoord_count = 2, mesh.face_texcoords = corners;
    mesh.textures = &leaf, mesh.texture_count = 1;
    OK(dpr_scene_create(SIDE, SIDE, &scene));
    OK(dpr_scene_add_mesh(scene, &mesh));
    OK(dpr_scene_set_camera(scene, &camera));
    OK(dpr_scene_set_gradients(scene, wanted, is_new ? 4 : 2)); /* noise on the pixel has none of opacities */
    OK(dpr_renderer_create(device, &renderers[is_new]));
    renderer = renderers[is_new];
    if (is_new) OK(dpr_scene_set_background(scene, grey));
    if (is_new) OK(dpr_scene_set_lights(scene, &lights));
    if (is_new) OK(dpr_scene_set_smoothing_word(scene, "preset", "joint_gaussian"));
    OK(dpr_renderer_set_scene(renderer, scene));
    OK(dpr_renderer_forward(renderer));
    if (is_new) {
      OK(dpr_renderer_read_image(renderer, image, FLOATS));
    } else {
      EXPECT(differs(renderer, image));
      OK(dpr_scene_set_smoothing_word(scene, "preset", "joint_gaussian"));
      OK(dpr_renderer_set_smoothing(renderer, scene));
      OK(dpr_renderer_set_lights(renderer, &lights));
      OK(dpr_renderer_set_background(renderer, grey));
      OK(dpr_renderer_set_normals(renderer, 0, turned, 3));
      OK(dpr_renderer_forward(renderer));
      EXPECT(differs(renderer, image));
      OK(dpr_renderer_set_materials(renderer, 0, bright, 1));
      OK(dpr_renderer_forward(renderer));
      EXPECT(differs(renderer, image));
      OK(dpr_renderer_set_opacities(renderer, 0, clear, 3));
      OK(dpr_renderer_forward(renderer));
      EXPECT(differs(renderer, image));
      OK(dpr_renderer_set_texel_opacities(renderer, 0, 0, clear, 2));
      OK(dpr_renderer_forward(renderer));
      EXPECT(!differs(renderer, image));
      OK(dpr_renderer_set_lights(renderer, NULL));
      OK(dpr_renderer_forward(renderer));
      EXPECT(differs(renderer, image));
      OK(dpr_renderer_set_lights(renderer, &lights));
      OK(dpr_renderer_set_cull(renderer, "front"));
      OK(dpr_renderer_forward(renderer));
      EXPECT(differs(renderer, image));
    }
    REFUSED(dpr_renderer_set_normals(renderer, 0, turned, 6), "expected 1");
    REFUSED(dpr_renderer_set_materials(renderer, 0, NULL, 1), "materials");
    REFUSED(dpr_renderer_set_materials(renderer, 0, bright, 0), "expected 1");
    REFUSED(dpr_renderer_set_opacities(renderer, 0, clear, 2), "expected 3");
    REFUSED(dpr_renderer_set_texel_opacities(renderer, 0, 0, clear, 3), "expected 2");
    REFUSED(dpr_renderer_set_smoothing(renderer, NULL), "scene");
    REFUSED(dpr_renderer_set_cull(renderer, "some"), "word");
    REFUSED(dpr_renderer_set_background(renderer, NULL), "color");
    dpr_scene_destroy(scene);
  }
  renderer = renderers[1];
  OK(dpr_backward_pixels(renderer, image, FLOATS, &gradient));
  OK(dpr_gradient_size(gradient, "meshes[0].normals", &count));
  EXPECT(count == 3);
  OK(dpr_gradient_size(gradient, "meshes[0].opacities", &count));
  EXPECT(count == 3);
  OK(dpr_gradient_size(gradient, "meshes[0].texel_opacities", &count));
  EXPECT(count == 2);
  OK(dpr_gradient_size(gradient, "meshes[0].specular", &count));
  dpr_gradient_destroy(gradient);
  OK(dpr_renderer_set_gradients(renderer, others, 1));
  OK(dpr_backward_pixels(renderer, image, FLOATS, &gradient));
  OK(dpr_gradient_count(gradient, &count));
  EXPECT(count == 1);
  REFUSED(dpr_renderer_set_gradients(renderer, NULL, 1), "names");
  dpr_gradient_destroy(gradient);
  mesh.face_normals = beyond;
  {
    dpr_scene* scene = make_scene();
    REFUSED(dpr_scene_add_mesh(scene, &mesh), "normal 1");
    mesh.face_normals = first, mesh.face_materials = &beyond[1];
    REFUSED(dpr_scene_add_mesh(scene, &mesh), "material 1");
    mesh.materials = NULL;
    REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.materials");
    dpr_scene_destroy(scene);
  }
  dpr_renderer_destroy(renderers[0]);
  dpr_renderer_destroy(renderers[1]);
}

/* A mesh's own loss joins that of the images. */
static void test_mesh_loss(const dpr_device* device, const dpr_scene* scene) {
  const float target[FLOATS] = {0};
  dpr_mesh_loss_weights weights = DPR_MESH_LOSS_WEIGHTS_INIT;
  dpr_mesh mesh = triangle();
  double value = 0, alone[9], both[9], joined = 0;
  int i;
  dpr_renderer* renderer = NULL;
  dpr_gradient *of_images = NULL, *of_both = NULL;
  dpr_mesh_loss* shape = NULL;
  dpr_loss* loss = make_loss(device, target);
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  OK(dpr_renderer_forward(renderer));
  weights.edge_length = 1;
  OK(dpr_mesh_loss_create(device, &weights, &mesh, &shape));
  OK(dpr_loss_evaluate(loss, renderer, &value));
  OK(dpr_mesh_loss_evaluate(shape, renderer, 0, &value));
  EXPECT(fabs(value - 14.0 / 3) < 1e-5); /* of edges as long as 2, sqrt(5) and sqrt(5) */
  OK(dpr_backward_loss(renderer, loss, &of_images));
  OK(dpr_backward_losses(renderer, loss, shape, &of_both));
  OK(dpr_gradient_read(of_images, "meshes[0].positions", alone, 9));
  OK(dpr_gradient_read(of_both, "meshes[0].positions", both, 9));
  for (i = 0; i < 9; ++i) joined += fabs(both[i] - alone[i]);
  EXPECT(joined > 1);
  weights.flatness = -1;
  REFUSED(dpr_mesh_loss_create(device, &weights, &mesh, &shape), "weight (mesh loss)");
  REFUSED(dpr_mesh_loss_create(device, NULL, &mesh, &shape), "weights");
  REFUSED(dpr_mesh_loss_evaluate(shape, renderer, 1, &value), "mesh");
  REFUSED(dpr_backward_losses(renderer, loss, NULL, &of_both), "mesh_loss");
  dpr_gradient_destroy(of_images);
  dpr_gradient_destroy(of_both);
  dpr_mesh_loss_destroy(shape);
  dpr_loss_destroy(loss);
  dpr_renderer_destroy(renderer);
}

/* Auxiliary outputs, and images of attributes with their gradients. */
static void test_attributes(const dpr_device* device, const dpr_scene* scene) {
  const size_t middle = SIDE * SIDE / 2 + SIDE / 2;
  const float heat[3] = {1, 1, 1};
  float depth[SIDE * SIDE], normal[3 * SIDE * SIDE], image[FLOATS];
  double of_values[3];
  size_t count = 0;
  dpr_renderer* renderer = NULL;
  dpr_attribute *depths = NULL, *heats = NULL, *none = NULL;
  dpr_gradient* gradient = NULL;
  OK(dpr_renderer_create(device, &renderer));
  REFUSED(dpr_renderer_aov_size(renderer, "depth", &count), "set_scene() first");
  REFUSED(dpr_renderer_image_size(renderer, &count), "set_scene() first");
  OK(dpr_renderer_set_scene(renderer, scene));
  REFUSED(dpr_renderer_aov_size(renderer, "uv", &count), "a mesh without texture coordinates");
  OK(dpr_attribute_create(device, "depth", &depths));
  REFUSED(dpr_attribute_forward(depths, renderer), "forward");
  REFUSED(dpr_attribute_image_size(depths, &count), "forward");
  OK(dpr_renderer_forward(renderer));
  OK(dpr_renderer_aov_size(renderer, "normal", &count));
  EXPECT(count == 3 * SIDE * SIDE);
  OK(dpr_renderer_read_aov(renderer, "depth", depth, SIDE * SIDE));
  OK(dpr_renderer_read_aov(renderer, "normal", normal, 3 * SIDE * SIDE));
  EXPECT(fabsf(depth[middle] - 3) < 1e-4f && fabsf(normal[3 * middle + 2] - 1) < 1e-4f);
  OK(dpr_attribute_forward(depths, renderer));
  OK(dpr_attribute_image_size(depths, &count));
  EXPECT(count == FLOATS);
  OK(dpr_attribute_read_image(depths, image, FLOATS));
  EXPECT(fabsf(image[4 * middle] / image[4 * middle + 3] - depth[middle]) < 1e-4f);
  OK(dpr_attribute_backward_pixels(depths, image, FLOATS, &gradient));
  OK(dpr_gradient_size(gradient, "meshes[0].positions", &count));
  EXPECT(count == 9);
  dpr_gradient_destroy(gradient);
  OK(dpr_attribute_create_values(device, 1, &heats));
  OK(dpr_attribute_set_values(heats, heat, 3));
  OK(dpr_attribute_forward(heats, renderer));
  OK(dpr_attribute_read_image(heats, image, FLOATS));
  EXPECT(fabsf(image[4 * middle] - image[4 * middle + 3]) < 1e-5f);
  OK(dpr_attribute_backward_pixels(heats, image, FLOATS, &gradient));
  OK(dpr_gradient_read(gradient, "values", of_values, 3));
  EXPECT(of_values[0] > 0 && of_values[1] > 0 && of_values[2] > 0);
  REFUSED(dpr_renderer_read_aov(renderer, "depth", depth, 3), "expected 256");
  REFUSED(dpr_renderer_read_aov(renderer, "deep", depth, 3), "face_id");
  REFUSED(dpr_attribute_read_image(depths, image, 3), "expected 1024");
  REFUSED(dpr_attribute_backward_pixels(depths, image, 3, &gradient), "grad");
  REFUSED(dpr_attribute_create(device, "heat", &none), "texcoords");
  REFUSED(dpr_attribute_create_values(device, 0, &none), "channels");
  REFUSED(dpr_attribute_set_values(depths, heat, 3), "depth");
  REFUSED(dpr_attribute_set_values(heats, NULL, 3), "values");
  dpr_gradient_destroy(gradient);
  dpr_attribute_destroy(depths);
  dpr_attribute_destroy(heats);
  dpr_renderer_destroy(renderer);
}

/* A mesh that stands in two places against two meshes: the image, and the gradients, which are summed. */
static void test_instances(const dpr_device* device) {
  const float aside[16] = {0.5f, 0, 0, 1, 0, 0.5f, 0, 0.25f, 0, 0, 0.5f, 0.5f, 0, 0, 0, 1};
  const float singular[16] = {0};
  const char* const wanted[] = {"positions", "transform"};
  const char* const moved = "views[0].meshes[1].translation";
  const dpr_camera camera = three_units_away();
  float images[2][FLOATS];
  double sums[2][9] = {{0}}, more[9], translation[2][3];
  size_t i, count = 0;
  int is_instance;
  for (is_instance = 0; is_instance < 2; ++is_instance) {
    dpr_scene* scene = NULL;
    dpr_renderer* renderer = NULL;
    dpr_gradient* gradient = NULL;
    dpr_mesh mesh = triangle();
    OK(dpr_scene_create(SIDE, SIDE, &scene));
    OK(dpr_scene_add_mesh(scene, &mesh));
    mesh.transform = aside;
    if (is_instance) OK(dpr_scene_add_instance(scene, 0, aside));
    if (!is_instance) OK(dpr_scene_add_mesh(scene, &mesh));
    OK(dpr_scene_set_camera(scene, &camera));
    OK(dpr_scene_set_gradients(scene, wanted, 2));
    OK(dpr_renderer_create(device, &renderer));
    OK(dpr_renderer_set_scene(renderer, scene));
    OK(dpr_renderer_forward(renderer));
    OK(dpr_renderer_read_image(renderer, images[is_instance], FLOATS));
    OK(dpr_backward_pixels(renderer, images[is_instance], FLOATS, &gradient));
    OK(dpr_gradient_read(gradient, "meshes[0].positions", sums[is_instance], 9));
    OK(dpr_gradient_read(gradient, moved, translation[is_instance], 3));
    if (is_instance) {
      REFUSED(dpr_gradient_read(gradient, "meshes[1].positions", more, 9), "name (gradient)");
      REFUSED(dpr_renderer_set_positions(renderer, 1, positions, 9), "an instance of mesh 0");
      REFUSED(dpr_renderer_set_views(renderer, &camera, 1, aside, 16), "got 16 floats, expected 32");
      REFUSED(dpr_scene_add_instance(scene, 1, aside), "got 1, itself an instance of 0");
      REFUSED(dpr_scene_add_instance(scene, 2, aside), "got 2, where there are 2 meshes");
      REFUSED(dpr_scene_add_instance(scene, 0, singular), "transform");
      REFUSED(dpr_scene_add_instance(NULL, 0, aside), "scene");
      OK(dpr_scene_add_instance(scene, 0, NULL));
    } else {
      OK(dpr_gradient_read(gradient, "meshes[1].positions", more, 9));
      for (i = 0; i < 9; ++i) sums[0][i] += more[i];
    }
    OK(dpr_gradient_count(gradient, &count));
    EXPECT(count == (is_instance ? 5u : 6u)); /* of two places each: rotation and translation */
    dpr_gradient_destroy(gradient);
    dpr_renderer_destroy(renderer);
    dpr_scene_destroy(scene);
  }
  EXPECT(memcmp(images[0], images[1], sizeof images[0]) == 0);
  EXPECT(memcmp(translation[0], translation[1], sizeof translation[0]) == 0 && translation[0][0] != 0);
  for (i = 0; i < 9; ++i) EXPECT(fabs(sums[0][i] - sums[1][i]) < 1e-4 * (1 + fabs(sums[0][i])));
}

/* A scene of a batch: its gradient is that of a renderer of its own, with the loss' mean over so many views.
 */
static void expect_gradient_alone(const dpr_device* device, const dpr_scene* scene, const float* image,
                                  const dpr_gradient* found, double share) {
  const float black[FLOATS] = {0};
  float pixels[FLOATS];
  double alone[9], in_batch[9], value, sum = 0;
  int i;
  dpr_renderer* renderer = NULL;
  dpr_gradient* gradient = NULL;
  dpr_loss* loss = make_loss(device, black);
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  OK(dpr_renderer_forward(renderer));
  OK(dpr_renderer_read_image(renderer, pixels, FLOATS));
  EXPECT(memcmp(pixels, image, sizeof pixels) == 0);
  OK(dpr_loss_evaluate(loss, renderer, &value));
  OK(dpr_backward_loss(renderer, loss, &gradient));
  OK(dpr_gradient_read(gradient, "meshes[0].positions", alone, 9));
  OK(dpr_gradient_read(found, "meshes[0].positions", in_batch, 9));
  for (i = 0; i < 9; ++i) {
    EXPECT(fabs(in_batch[i] - share * alone[i]) < 1e-5 * (1 + fabs(alone[i])));
    sum += fabs(alone[i]);
  }
  EXPECT(sum > 1e-3);
  dpr_gradient_destroy(gradient);
  dpr_loss_destroy(loss);
  dpr_renderer_destroy(renderer);
}

/* A batch refuses these; `batch` has been rendered with two scenes of one view each. */
static void test_wrong_batches(dpr_batch* batch, const dpr_scene* const* scenes) {
  float pixels[2 * FLOATS] = {0};
  dpr_gradient* gradients[2] = {NULL, NULL};
  dpr_renderer *renderer = NULL, *none = NULL;
  dpr_scene* larger = NULL;
  const dpr_scene *unlike[2], *with_null[2] = {NULL, NULL};
  OK(dpr_scene_create(SIDE + 1, SIDE, &larger));
  {
    const dpr_mesh mesh = triangle();
    OK(dpr_scene_add_mesh(larger, &mesh));
  }
  unlike[0] = scenes[0], unlike[1] = larger;
  REFUSED(dpr_batch_create(NULL, &batch), "device");
  REFUSED(dpr_batch_set_scenes(NULL, scenes, 2), "batch");
  REFUSED(dpr_batch_set_scenes(batch, scenes, 0), "at least one");
  REFUSED(dpr_batch_set_scenes(batch, NULL, 2), "scenes");
  REFUSED(dpr_batch_set_scenes(batch, with_null, 2), "scenes");
  REFUSED(dpr_batch_set_scenes(batch, unlike, 2), "size (scenes[1]): got 17x16");
  REFUSED(dpr_batch_scene_renderer(batch, 2, &none), "below 2");
  REFUSED(dpr_batch_image_size(batch, NULL), "count");
  REFUSED(dpr_batch_read_image(batch, pixels, FLOATS), "got 1024 floats, expected 2048");
  REFUSED(dpr_batch_read_image(batch, NULL, 2 * FLOATS), "pixels");
  REFUSED(dpr_batch_backward_pixels(batch, pixels, 2 * FLOATS, gradients, 1), "expected 2, one a scene");
  REFUSED(dpr_batch_backward_pixels(batch, pixels, 2 * FLOATS, NULL, 2), "gradients");
  REFUSED(dpr_batch_backward_pixels(batch, pixels, FLOATS, gradients, 2), "pixels");
  REFUSED(dpr_batch_backward_buffer(batch, NULL, gradients, 2), "grad");
  REFUSED(dpr_batch_backward_loss(batch, NULL, gradients, 2), "loss");
  EXPECT(gradients[0] == NULL && gradients[1] == NULL && none == NULL);
  /* A renderer of a scene that is gone is refused, and back with the scene. */
  OK(dpr_batch_scene_renderer(batch, 1, &renderer));
  OK(dpr_batch_set_scenes(batch, scenes, 1));
  REFUSED(dpr_renderer_forward(renderer), "scene (SceneBatch::renderer): got 1, expected below 1");
  REFUSED(dpr_batch_read_image(batch, pixels, FLOATS), "forward() first");
  OK(dpr_batch_set_scenes(batch, scenes, 2));
  OK(dpr_renderer_forward(renderer));
  dpr_batch_destroy(batch);
  OK(dpr_renderer_forward(renderer)); /* what was made from a handle may outlive it */
  dpr_renderer_destroy(renderer);
  dpr_scene_destroy(larger);
  dpr_batch_destroy(NULL);
}

/* Unlike scenes as one batch: a loss, one backward pass, a gradient each; and a mesh's own loss in one. */
static void test_batch(const dpr_device* device, dpr_scene* scene) {
  const float near[3] = {0.2f, 0.1f, 0.3f};
  const float targets[2 * FLOATS] = {0};
  float before[2 * FLOATS], pixels[2 * FLOATS], smaller[9];
  double value = 0, alone[9], with_mesh[9], changed = 0;
  size_t count = 0, i;
  dpr_loss_weights weights = DPR_LOSS_WEIGHTS_INIT;
  dpr_mesh_loss_weights of_mesh = DPR_MESH_LOSS_WEIGHTS_INIT;
  dpr_mesh mesh = triangle();
  dpr_buffer view = DPR_BUFFER_INIT;
  dpr_scene* other = make_scene();
  const dpr_scene* scenes[2];
  dpr_batch* batch = NULL;
  dpr_renderer* renderer = NULL;
  dpr_loss* loss = NULL;
  dpr_mesh_loss* shape = NULL;
  const dpr_mesh_loss* shapes[2] = {NULL, NULL};
  dpr_gradient* gradients[2] = {NULL, NULL};
  OK(dpr_scene_set_background(other, near));
  OK(dpr_scene_set_smoothing_number(other, "sigma", 0.03));
  scenes[0] = scene, scenes[1] = other;
  OK(dpr_batch_create(device, &batch));
  REFUSED(dpr_batch_forward(batch), "no scenes");
  REFUSED(dpr_batch_image_size(batch, &count), "set_scenes() first");
  OK(dpr_batch_set_scenes(batch, scenes, 2));
  REFUSED(dpr_batch_read_image(batch, pixels, 2 * FLOATS), "forward() first");
  OK(dpr_batch_forward(batch));
  OK(dpr_batch_image_size(batch, &count));
  EXPECT(count == 2 * FLOATS);
  OK(dpr_batch_read_image(batch, before, count));
  weights.mse = 1;
  OK(dpr_loss_create(device, &weights, targets, 2 * FLOATS, 2, SIDE, SIDE, &loss));
  REFUSED(dpr_batch_backward_loss(batch, loss, gradients, 2), "loss");
  OK(dpr_loss_evaluate_batch(loss, batch, &value));
  EXPECT(value > 0);
  OK(dpr_batch_backward_loss(batch, loss, gradients, 2));
  for (i = 0; i < 2; ++i) {
    expect_gradient_alone(device, scenes[i], before + i * FLOATS, gradients[i], 0.5);
    OK(dpr_gradient_read(gradients[i], "meshes[0].positions", i ? with_mesh : alone, 9));
    dpr_gradient_destroy(gradients[i]);
  }
  EXPECT(memcmp(alone, with_mesh, sizeof alone) != 0); /* the scenes are unlike */

  of_mesh.edge_length = 1;
  OK(dpr_mesh_loss_create(device, &of_mesh, &mesh, &shape));
  OK(dpr_batch_scene_renderer(batch, 0, &renderer));
  OK(dpr_mesh_loss_evaluate(shape, renderer, 0, &value));
  shapes[0] = shape;
  OK(dpr_batch_backward_losses(batch, loss, shapes, gradients, 2));
  OK(dpr_gradient_read(gradients[0], "meshes[0].positions", with_mesh, 9));
  for (i = 0; i < 9; ++i) changed += fabs(with_mesh[i] - alone[i]);
  EXPECT(changed > 1);
  REFUSED(dpr_batch_backward_losses(batch, loss, NULL, gradients, 2), "mesh_losses");
  dpr_gradient_destroy(gradients[0]);
  dpr_gradient_destroy(gradients[1]);

  /* The setters of a scene's renderer are in force with the next forward pass. */
  for (i = 0; i < 9; ++i) smaller[i] = 0.5f * positions[i];
  OK(dpr_renderer_set_positions(renderer, 0, smaller, 9));
  REFUSED(dpr_batch_read_image(batch, pixels, 2 * FLOATS), "scenes[0]");
  OK(dpr_batch_forward(batch));
  OK(dpr_batch_read_image(batch, pixels, 2 * FLOATS));
  EXPECT(memcmp(pixels, before, FLOATS * sizeof *pixels) != 0);
  EXPECT(memcmp(pixels + FLOATS, before + FLOATS, FLOATS * sizeof *pixels) == 0);

  OK(dpr_batch_backward_pixels(batch, pixels, 2 * FLOATS, gradients, 2));
  OK(dpr_gradient_read(gradients[1], "meshes[0].positions", alone, 9));
  dpr_gradient_destroy(gradients[0]);
  dpr_gradient_destroy(gradients[1]);
  OK(dpr_batch_image_view(batch, &view));
  EXPECT(view.count == 2 * SIDE * SIDE && view.components == 4);
  OK(dpr_batch_backward_buffer(batch, view.buffer, gradients, 2));
  OK(dpr_gradient_read(gradients[1], "meshes[0].positions", with_mesh, 9));
  EXPECT(memcmp(alone, with_mesh, sizeof alone) == 0);
  dpr_gradient_destroy(gradients[0]);
  dpr_gradient_destroy(gradients[1]);
  dpr_mesh_loss_destroy(shape);
  dpr_loss_destroy(loss);
  dpr_renderer_destroy(renderer);
  test_wrong_batches(batch, scenes);
  dpr_scene_destroy(other);
}

static void test_wrong_meshes(dpr_scene* scene) {
  const float not_finite[] = {-1, -1, 0, 1, NAN, 0, 0, 1, 0};
  const float singular[16] = {0};
  const uint32_t beyond[] = {0, 1, 3};
  dpr_mesh mesh = triangle();
  REFUSED(dpr_scene_add_mesh(NULL, &mesh), "scene");
  REFUSED(dpr_scene_add_mesh(scene, NULL), "mesh");
  mesh.positions = NULL;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.positions");
  mesh.positions = not_finite;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "positions[1]");
  mesh = triangle();
  mesh.faces = NULL;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.faces");
  mesh.faces = beyond;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "vertex 3");
  mesh = triangle();
  mesh.vertices = (size_t)-1;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.vertices");
  mesh = triangle();
  mesh.face_count = 0;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.face_count");
  mesh = triangle();
  mesh.vertex_colors = positions;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "face_colors");
  mesh = triangle();
  mesh.transform = singular;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.transform");
  mesh = triangle();
  mesh.size = 0;
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.size");
  mesh.size = sizeof mesh + 8; /* of a later version, with more than this library knows */
  REFUSED(dpr_scene_add_mesh(scene, &mesh), "mesh.size");
  mesh.size = offsetof(dpr_mesh, texcoords); /* a program compiled before there were textures */
  mesh.textures = NULL, mesh.texture_count = 1;
  OK(dpr_scene_add_mesh(scene, &mesh));
}

/* The lens' own gradients, and an orthographic camera's. */
static void test_cameras(const dpr_device* device) {
  const float barrel[5] = {-0.2f, 0.1f, 0, 0, 0}, nan[5] = {0, NAN, 0, 0, 0};
  const float fisheye[4] = {0.1f, -0.05f, 0.02f, 0};
  const char* const wanted[] = {"camera", "distortion"};
  const char* const names[] = {"views[0].camera.distortion.k1", "views[0].camera.orthographic_height",
                               "views[0].camera.fisheye.k4"};
  float ones[FLOATS];
  size_t i, kind;
  for (i = 0; i < FLOATS; ++i) ones[i] = (float)i;
  for (kind = 0; kind < 3; ++kind) {
    double slope = 0;
    dpr_scene* scene = make_scene();
    dpr_renderer* renderer = NULL;
    dpr_gradient* gradient = NULL;
    dpr_camera camera = three_units_away();
    if (kind == 0) camera.distortion = barrel;
    if (kind == 1) camera.orthographic_height = 3;
    if (kind == 2) camera.fisheye = fisheye;
    OK(dpr_scene_set_gradients(scene, wanted, 2));
    OK(dpr_scene_set_camera(scene, &camera));
    OK(dpr_renderer_create(device, &renderer));
    OK(dpr_renderer_set_scene(renderer, scene));
    OK(dpr_renderer_forward(renderer));
    OK(dpr_backward_pixels(renderer, ones, FLOATS, &gradient));
    OK(dpr_gradient_read(gradient, names[kind], &slope, 1));
    EXPECT(slope != 0);
    REFUSED(dpr_gradient_read(gradient, names[(kind + 1) % 3], &slope, 1), "name (gradient)");
    dpr_gradient_destroy(gradient);
    gradient = NULL;
    camera = three_units_away(); /* a view's camera has what it has, whatever the scene's */
    camera.fx = camera.fy = 20, camera.cx = camera.cy = SIDE / 2;
    OK(dpr_renderer_set_views(renderer, &camera, 1, NULL, 0));
    OK(dpr_renderer_forward(renderer));
    OK(dpr_backward_pixels(renderer, ones, FLOATS, &gradient));
    slope = 0;
    OK(dpr_gradient_read(gradient, "views[0].camera.intrinsics.fx", &slope, 1));
    EXPECT(slope != 0);
    REFUSED(dpr_gradient_read(gradient, names[kind], &slope, 1), "name (gradient)");
    camera.distortion = nan;
    REFUSED(dpr_scene_set_camera(scene, &camera), "k2");
    camera.fisheye = fisheye;
    REFUSED(dpr_scene_set_camera(scene, &camera), "distortion and fisheye");
    camera.distortion = NULL;
    OK(dpr_scene_set_camera(scene, &camera));
    camera.fisheye = nan;
    REFUSED(dpr_scene_set_camera(scene, &camera), "k2 (camera.fisheye)");
    camera.size = offsetof(dpr_camera, fisheye); /* a program compiled before there were fisheyes */
    OK(dpr_scene_set_camera(scene, &camera));
    dpr_gradient_destroy(gradient);
    dpr_renderer_destroy(renderer);
    dpr_scene_destroy(scene);
  }
}

static void test_wrong_scenes(void) {
  const float black[3] = {0, 0, INFINITY};
  const char* const names[] = {"positions", "position"};
  dpr_point_light light = {{0, 0, 0}, {1, 1, 1}, {0, 0, NAN}};
  dpr_directional_light sun = {{0, 0, 0}, {1, 1, 1}, {0, 0, 0}};
  dpr_spot_light spot = {{0, 0, 3}, {0, 0, -1}, 20, 20, {1, 1, 1}, {0, 0, 0}};
  const float harmonics[27] = {1, 1, 1};
  dpr_lights lights = DPR_LIGHTS_INIT;
  dpr_camera camera = three_units_away();
  dpr_scene *scene = NULL, *none = NULL;
  REFUSED(dpr_scene_create(0, SIDE, &none), "0x16");
  REFUSED(dpr_scene_create(SIDE, 1 << 30, &none), "pixels");
  REFUSED(dpr_scene_create(SIDE, SIDE, NULL), "scene");
  EXPECT(dpr_scene_read("no-such-file.json", &none) == DPR_IO_ERROR);
  EXPECT(strstr(dpr_last_error(), "no-such-file.json") != NULL);
  REFUSED(dpr_scene_read(NULL, &none), "file");
  EXPECT(none == NULL);
  OK(dpr_scene_create(SIDE, SIDE, &scene));
  camera.fov_y_degrees = 180;
  REFUSED(dpr_scene_set_camera(scene, &camera), "fov_y_degrees");
  camera = three_units_away();
  camera.view[0] = NAN;
  REFUSED(dpr_scene_set_camera(scene, &camera), "view");
  REFUSED(dpr_scene_set_camera(scene, NULL), "camera");
  REFUSED(dpr_scene_set_background(scene, black), "color");
  REFUSED(dpr_scene_set_background(scene, NULL), "color");
  REFUSED(dpr_scene_set_cull(scene, "both"), "none, back or front");
  REFUSED(dpr_scene_set_cull(scene, NULL), "word");
  lights.point_count = 1;
  REFUSED(dpr_scene_set_lights(scene, &lights), "lights.point");
  lights.point = &light;
  REFUSED(dpr_scene_set_lights(scene, &lights), "finite");
  lights.point_count = (size_t)-1;
  REFUSED(dpr_scene_set_lights(scene, &lights), "count (lights.point)");
  lights.point_count = 0;
  lights.directional_count = 1;
  REFUSED(dpr_scene_set_lights(scene, &lights), "lights.directional");
  lights.directional = &sun;
  REFUSED(dpr_scene_set_lights(scene, &lights), "direction (lights.directional[0])");
  lights.directional_count = 0;
  lights.spot = &spot;
  lights.spot_count = 1;
  REFUSED(dpr_scene_set_lights(scene, &lights), "inner_angle_degrees (lights.spot[0])");
  spot.inner_angle_degrees = 10;
  lights.harmonics = harmonics;
  OK(dpr_scene_set_lights(scene, &lights));
  lights.size = offsetof(dpr_lights, directional); /* a program compiled before there were more kinds */
  lights.spot = NULL;
  OK(dpr_scene_set_lights(scene, &lights));
  lights.size = sizeof lights;
  lights.spot_count = 0;
  lights.shading = DPR_SHADING_MICROFACET;
  OK(dpr_scene_set_lights(scene, &lights));
  lights.shading = 7;
  REFUSED(dpr_scene_set_lights(scene, &lights), "lights.shading");
  OK(dpr_scene_set_lights(scene, NULL));
  REFUSED(dpr_scene_set_smoothing_word(scene, "preset", "soft"), "softras");
  REFUSED(dpr_scene_set_smoothing_word(scene, "sigma", "wide"), "a number");
  REFUSED(dpr_scene_set_smoothing_word(scene, NULL, "wide"), "key");
  REFUSED(dpr_scene_set_smoothing_word(scene, "preset", NULL), "word");
  REFUSED(dpr_scene_set_smoothing_number(scene, "sgima", 1), "preset, ");
  REFUSED(dpr_scene_set_smoothing_number(scene, "sigma", NAN), "finite");
  REFUSED(dpr_scene_set_smoothing_number(scene, "samples", 2.5), "whole");
  REFUSED(dpr_scene_set_gradients(scene, names, 2), "\"position\"");
  REFUSED(dpr_scene_set_gradients(scene, names, 1000), "count");
  REFUSED(dpr_scene_set_gradients(scene, NULL, 1), "names");
  test_wrong_meshes(scene);
  test_wrong_textures(scene);
  dpr_scene_destroy(scene);
}

static void test_wrong_renderers(const dpr_device* device, const dpr_scene* scene) {
  const float target[FLOATS] = {NAN};
  dpr_loss_weights weights = DPR_LOSS_WEIGHTS_INIT;
  float pixels[FLOATS];
  double value = 0;
  size_t count = 0;
  dpr_renderer *renderer = NULL, *none = NULL;
  dpr_scene* empty = NULL;
  dpr_loss* loss = NULL;
  dpr_gradient* gradient = NULL;
  REFUSED(dpr_renderer_create(NULL, &none), "device");
  REFUSED(dpr_renderer_create(device, NULL), "renderer");
  OK(dpr_renderer_create(device, &renderer));
  REFUSED(dpr_renderer_forward(renderer), "scene");
  REFUSED(dpr_renderer_forward(NULL), "renderer");
  REFUSED(dpr_renderer_read_image(renderer, pixels, 0), "set_scene() first");
  REFUSED(dpr_renderer_set_positions(renderer, 0, positions, 9), "scene");
  OK(dpr_scene_create(SIDE, SIDE, &empty));
  REFUSED(dpr_renderer_set_scene(renderer, empty), "mesh");
  OK(dpr_renderer_set_scene(renderer, scene));
  REFUSED(dpr_renderer_set_positions(renderer, 1, positions, 9), "below 1");
  REFUSED(dpr_renderer_set_positions(renderer, 0, positions, 6), "expected 3");
  REFUSED(dpr_renderer_set_positions(renderer, 0, positions, 8), "multiple of 3");
  REFUSED(dpr_renderer_set_positions(renderer, 0, NULL, 9), "positions");
  REFUSED(dpr_renderer_set_colors(renderer, 0, colors, 9), "expected 1");
  weights.mse = 1;
  REFUSED(dpr_loss_create(device, &weights, target, FLOATS, 1, SIDE, SIDE, &loss), "finite");
  REFUSED(dpr_loss_create(device, &weights, target, FLOATS, 2, SIDE, SIDE, &loss), "count");
  REFUSED(dpr_loss_create(device, &weights, NULL, FLOATS, 1, SIDE, SIDE, &loss), "targets");
  REFUSED(dpr_loss_create(device, NULL, target, FLOATS, 1, SIDE, SIDE, &loss), "weights");
  weights.mse = -1;
  REFUSED(dpr_loss_create(device, &weights, pixels, FLOATS, 1, SIDE, SIDE, &loss), "weight");
  OK(dpr_renderer_forward(renderer));
  OK(dpr_renderer_read_image(renderer, pixels, FLOATS));
  loss = make_loss(device, pixels);
  REFUSED(dpr_backward_loss(renderer, loss, &gradient), "loss");
  REFUSED(dpr_loss_evaluate(loss, NULL, &value), "renderer");
  REFUSED(dpr_loss_evaluate(loss, renderer, NULL), "value");
  REFUSED(dpr_gradient_count(NULL, &count), "gradient");
  EXPECT(gradient == NULL && none == NULL);
  dpr_loss_destroy(loss);
  dpr_scene_destroy(empty);
  dpr_renderer_destroy(renderer);
  dpr_device_destroy(NULL);
  dpr_scene_destroy(NULL);
  dpr_renderer_destroy(NULL);
  dpr_loss_destroy(NULL);
  dpr_gradient_destroy(NULL);
}

int main(void) {
  dpr_device* device = NULL;
  dpr_scene* scene;
  const char* name = NULL;
  EXPECT(strcmp(dpr_last_error(), "") == 0);
  EXPECT(strncmp(dpr_version(), "0.", 2) == 0);
  REFUSED(dpr_device_open("no such device", &device), "no such device");
  REFUSED(dpr_device_open("", NULL), "device");
  OK(dpr_device_open(NULL, &device));
  OK(dpr_device_name(device, &name));
  EXPECT(name != NULL && strlen(name) > 0);
  scene = make_scene();
  test_descent(device, scene);
  test_losses(device, scene);
  test_loss_options(device, scene);
  test_views(device, scene);
  test_textures(device);
  test_wrap_and_filter(device);
  test_own_opencl(scene);
  test_cameras(device);
  test_frame_tangents();
  test_mesh_files();
  test_image_files();
  test_frame_samples();
  test_frame_layers();
  test_own_texture();
  test_vertex_normals();
  test_clip_space();
  test_setters(device);
  test_mesh_loss(device, scene);
  test_attributes(device, scene);
  test_instances(device);
  test_batch(device, scene);
  test_wrong_scenes();
  test_wrong_renderers(device, scene);
  dpr_scene_destroy(scene);
  dpr_device_destroy(device);
  printf("%d failures\n", failures);
  return failures == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
