// The interface beside a program's own settings of GLM and of OpenCL's C++ bindings: what crosses the border
// has the library's types and layout, and the program's own calls do as it has set them.
#include <dpr/dpr.h>

#include <cstdio>
#include <dpr/dpr.hpp>
#include <dpr/opencl.hpp>
#include <glm/gtc/matrix_transform.hpp>

namespace {

int failures = 0;

void expect(bool condition, const char* what) {
  if (condition) return;
  ++failures;
  std::printf("not so: %s\n", what);
}

/// By the library's, not this program's handedness: the camera looks at its target along -z.
void test_camera() {
  const glm::vec3 target(1, 2, 3);
  const dpr::Camera camera = dpr::orbit_camera(5, 20, 30, target);
  const glm::vec4 seen = glm::mat4(camera.view) * glm::vec4(target, 1);
  expect(glm::length(glm::vec3(seen) - glm::vec3(0, 0, -5)) < 1e-5F,
         "the camera looks along -z at its target");
  const glm::dvec3 turn(0.1, 0.2, 0.3);
  const glm::dvec3 back = dpr::vector_from_rotation(dpr::rotation_from_vector(turn));
  expect(glm::length(back - turn) < 1e-12, "a rotation's vector comes back");
  const dpr::Image strip = dpr::hstack({dpr::Image(1, 1), dpr::Image(1, 1)}, 1, glm::vec4(1, 2, 3, 4));
  expect(dpr::parse_choice<dpr::Prior>("cauchy", "prior") == dpr::choices<dpr::Prior>().at(1),
         "choices have names");
  expect(glm::vec4(strip.at(1, 0)) == glm::vec4(1, 2, 3, 4), "a colour arrives by value");
}

/// Arrays of a mesh, the image and the gradients; a face of one colour fills the image.
void test_render() {
  const glm::vec3 color(0.25F, 0.5F, 0.75F);
  dpr::Mesh mesh;
  mesh.positions = {glm::vec3(-9, -9, 0), glm::vec3(9, -9, 0), glm::vec3(0, 18, 0)};
  mesh.faces = {glm::uvec3(0, 1, 2)};
  mesh.face_colors = {color};
  dpr::Scene scene;
  scene.width = scene.height = 16;
  scene.camera.view = glm::translate(glm::mat4(1), glm::vec3(0, 0, -3));
  scene.meshes.push_back({.mesh = mesh});
  const cl::Context context(CL_DEVICE_TYPE_ALL);
  const cl::CommandQueue queue(context, context.getInfo<CL_CONTEXT_DEVICES>().front());
  dpr::Renderer renderer(dpr::adopt_device(context, queue));
  renderer.set_scene(scene);
  renderer.forward();
  const dpr::Image image = renderer.image();
  for (const glm::vec4 pixel : image.pixels)
    expect(glm::length(pixel - glm::vec4(color, 1)) < 1e-5F, "a pixel has the face's colour");
  const dpr::SceneGradient gradient = renderer.backward({&image, 1});
  const glm::vec3 of_color = gradient.meshes.at(0).colors.at(0);
  expect(glm::length(of_color - 256.0F * color) < 1e-3F, "the colour's gradient is the sum of the pixels");
  expect(dpr::image_buffer(renderer).getInfo<CL_MEM_SIZE>() >= sizeof(float) * 4 * 16 * 16, "image_buffer");
}

}  // namespace

int main() {
  try {
    dpr::make_icosphere(0, -1.0F);
    expect(false, "an error crosses the border as what it is");
  } catch (const dpr::InvalidArgument& error) {
    expect(error.argument().find("radius") != std::string::npos, "an error says what was wrong");
  }
  test_camera();
  test_render();
  std::printf("%d failures\n", failures);
  return failures == 0 ? 0 : 1;
}
