/* The C interface in a host with floating-point traps and threads of small stacks, which mistakes handles. */
#define _GNU_SOURCE
#include <dpr/dpr.h>
#include <fenv.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

enum { SIDE = 16, STACK_BYTES = 64 * 1024 };

static int failures = 0;

static void expect(int condition, const char* what, int line) {
  if (condition) return;
  ++failures;
  printf("line %d: not so: %s (last error: %s)\n", line, what, dpr_last_error());
}

#define EXPECT(condition) expect(condition, #condition, __LINE__)
#define OK(call) EXPECT((call) == DPR_SUCCESS)
#define REFUSED(call, words) \
  expect((call) == DPR_INVALID_ARGUMENT && strstr(dpr_last_error(), words) != NULL, #call, __LINE__)

static dpr_scene* make_scene(void) {
  static const float positions[] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
  static const uint32_t faces[] = {0, 1, 2};
  const char* const wanted[] = {"transform", "positions"};
  dpr_mesh mesh = DPR_MESH_INIT;
  dpr_camera camera = DPR_CAMERA_INIT;
  dpr_scene* scene = NULL;
  mesh.positions = positions, mesh.vertices = 3;
  mesh.faces = faces, mesh.face_count = 1;
  camera.view[11] = -3; /* row 2, column 3 */
  OK(dpr_scene_create(SIDE, SIDE, &scene));
  OK(dpr_scene_add_mesh(scene, &mesh));
  OK(dpr_scene_set_camera(scene, &camera));
  OK(dpr_scene_set_gradients(scene, wanted, 2));
  return scene;
}

static dpr_renderer* make_renderer(const dpr_device* device) {
  dpr_scene* const scene = make_scene();
  dpr_renderer* renderer = NULL;
  OK(dpr_renderer_create(device, &renderer));
  OK(dpr_renderer_set_scene(renderer, scene));
  dpr_scene_destroy(scene);
  return renderer;
}

/* Opens a device, builds kernels, renders, and computes gradients, in a thread of a small stack. */
static void* render(void* unused) {
  static float pixels[SIDE * SIDE * 4];
  dpr_device* device = NULL;
  dpr_gradient* gradient = NULL;
  dpr_renderer* renderer;
  EXPECT(feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW) != -1);
  OK(dpr_device_open(NULL, &device));
  renderer = make_renderer(device);
  OK(dpr_renderer_forward(renderer));
  OK(dpr_renderer_read_image(renderer, pixels, SIDE * SIDE * 4));
  OK(dpr_backward_pixels(renderer, pixels, SIDE * SIDE * 4, &gradient));
  EXPECT(fegetexcept() == (FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW));
  dpr_gradient_destroy(gradient), dpr_renderer_destroy(renderer), dpr_device_destroy(device);
  return unused;
}

static void test_host(void) {
  pthread_attr_t small;
  pthread_t thread;
  EXPECT(pthread_attr_init(&small) == 0 && pthread_attr_setstacksize(&small, STACK_BYTES) == 0);
  EXPECT(pthread_create(&thread, &small, render, NULL) == 0);
  EXPECT(pthread_join(thread, NULL) == 0);
}

static void test_handles(void) {
  dpr_device* device = NULL;
  dpr_scene* scene = make_scene();
  dpr_renderer* renderer = NULL;
  size_t arrays = 0;
  float number = 0;
  OK(dpr_device_open(NULL, &device));
  OK(dpr_renderer_create(device, &renderer));
  REFUSED(dpr_renderer_set_scene(renderer, (const dpr_scene*)device), "a dpr_device");
  REFUSED(dpr_renderer_forward((dpr_renderer*)scene), "expected a dpr_renderer");
  REFUSED(dpr_gradient_count((const dpr_gradient*)&number, &arrays), "no handle");
  dpr_scene_destroy((dpr_scene*)device);
  EXPECT(strstr(dpr_last_error(), "expected a dpr_scene") != NULL);
  dpr_scene_destroy(scene);
  REFUSED(dpr_renderer_set_scene(renderer, scene), "destroyed");
  dpr_scene_destroy(scene);
  EXPECT(strstr(dpr_last_error(), "destroyed") != NULL);
  dpr_scene_destroy(NULL);
  dpr_renderer_destroy(renderer), dpr_renderer_destroy(renderer);
  dpr_device_destroy(device), dpr_device_destroy(device);
}

/* Gradients of several names share a buffer; each begins where its call says. An event that has failed is no
 * event to wait for. */
static void test_buffers(void) {
  cl_platform_id platform;
  cl_device_id id;
  cl_context context;
  cl_command_queue queue;
  cl_event failed, refused_by;
  cl_mem images;
  float copied[3], seen[3];
  size_t rotation_at = 0, translation_at = 0;
  dpr_device* device = NULL;
  dpr_renderer* renderer;
  dpr_buffer view = DPR_BUFFER_INIT, to = DPR_BUFFER_INIT;
  dpr_events events = DPR_EVENTS_INIT;
  EXPECT(clGetPlatformIDs(1, &platform, NULL) == CL_SUCCESS);
  EXPECT(clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 1, &id, NULL) == CL_SUCCESS);
  context = clCreateContext(NULL, 1, &id, NULL, NULL, NULL);
  queue = clCreateCommandQueue(context, id, 0, NULL);
  images = clCreateBuffer(context, CL_MEM_READ_WRITE, SIDE * SIDE * 16, NULL, NULL);
  OK(dpr_device_adopt(context, queue, &device));
  renderer = make_renderer(device);
  OK(dpr_renderer_forward_on_device(renderer, NULL));
  OK(dpr_renderer_image_view(renderer, &view));
  OK(dpr_renderer_backward_on_device(renderer, &view, NULL));
  OK(dpr_renderer_gradient_view(renderer, "views[0].meshes[0].rotation", &view, &rotation_at));
  OK(dpr_renderer_gradient_view(renderer, "views[0].meshes[0].translation", &view, &translation_at));
  EXPECT(rotation_at != translation_at && view.byte_offset == translation_at);
  EXPECT(clEnqueueReadBuffer(queue, view.buffer, CL_TRUE, translation_at, sizeof seen, seen, 0, NULL, NULL) ==
         CL_SUCCESS);
  to.buffer = images;
  OK(dpr_renderer_copy_gradient(renderer, "views[0].meshes[0].translation", &to, NULL));
  EXPECT(clEnqueueReadBuffer(queue, images, CL_TRUE, 0, sizeof copied, copied, 0, NULL, NULL) == CL_SUCCESS);
  EXPECT(memcmp(copied, seen, sizeof seen) == 0);

  failed = clCreateUserEvent(context, NULL);
  EXPECT(clSetUserEventStatus(failed, -5) == CL_SUCCESS);
  events.wait = &failed, events.wait_count = 1, events.done = &refused_by;
  REFUSED(dpr_renderer_copy_images(renderer, &to, &events), "failed with -5");
  EXPECT(clFinish(queue) == CL_SUCCESS);
  clReleaseEvent(failed);
  dpr_renderer_destroy(renderer), dpr_device_destroy(device);
  clReleaseMemObject(images), clReleaseCommandQueue(queue), clReleaseContext(context);
}

int main(void) {
  test_host();
  test_handles();
  test_buffers();
  printf("%d failures\n", failures);
  return failures == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
