/* From C99: moves a triangle towards its image by gradient descent on its vertices. */
#include <dpr/dpr.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 64, FLOATS = SIDE * SIDE * 4 };

static void check(dpr_status status) {
  if (status == DPR_SUCCESS) return;
  fprintf(stderr, "%s\n", dpr_last_error());
  exit(EXIT_FAILURE);
}

int main(void) {
  float positions[9] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
  const uint32_t faces[3] = {0, 1, 2};
  static float target[FLOATS];
  double first = 0, loss = 0, grad[9];
  dpr_device* device;
  dpr_scene* scene;
  dpr_renderer* renderer;
  dpr_loss* image_loss;
  dpr_gradient* gradient;
  dpr_mesh mesh = DPR_MESH_INIT;
  dpr_camera camera = DPR_CAMERA_INIT;
  dpr_loss_weights weights = DPR_LOSS_WEIGHTS_INIT;
  mesh.positions = positions, mesh.vertices = 3;
  mesh.faces = faces, mesh.face_count = 1;
  camera.view[4 * 2 + 3] = -3; /* row-major: three units in front of the camera */
  weights.mse = 1;

  check(dpr_device_open(NULL, &device));
  check(dpr_scene_create(SIDE, SIDE, &scene));
  check(dpr_scene_add_mesh(scene, &mesh));
  check(dpr_scene_set_camera(scene, &camera));
  check(dpr_scene_set_smoothing_word(scene, "preset", "joint_gaussian"));
  check(dpr_scene_set_smoothing_number(scene, "sigma", 0.01));
  check(dpr_renderer_create(device, &renderer));
  check(dpr_renderer_set_scene(renderer, scene));
  check(dpr_renderer_forward(renderer));
  check(dpr_renderer_read_image(renderer, target, FLOATS));
  check(dpr_loss_create(device, &weights, target, FLOATS, 1, SIDE, SIDE, &image_loss));

  for (int i = 0; i < 9; ++i) positions[i] += 0.1f;
  for (int step = 0; step < 40; ++step) {
    check(dpr_renderer_set_positions(renderer, 0, positions, 9));
    check(dpr_renderer_forward(renderer));
    check(dpr_loss_evaluate(image_loss, renderer, &loss));
    check(dpr_backward_loss(renderer, image_loss, &gradient));
    check(dpr_gradient_read(gradient, "meshes[0].positions", grad, 9));
    dpr_gradient_destroy(gradient);
    for (int i = 0; i < 9; ++i) positions[i] -= (float)grad[i];
    if (step == 0) first = loss;
  }
  printf("loss %g, then %g\n", first, loss);
  dpr_loss_destroy(image_loss), dpr_renderer_destroy(renderer);
  dpr_scene_destroy(scene), dpr_device_destroy(device);
  return loss < 0.1 * first ? EXIT_SUCCESS : EXIT_FAILURE;
}
