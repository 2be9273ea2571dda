// A program with OpenCL objects of its own, which uses the C++ bindings of OpenCL 3 with exceptions: the
// library's own use of them is another one, and stays what it is.
#define CL_HPP_TARGET_OPENCL_VERSION 300
#define CL_HPP_MINIMUM_OPENCL_VERSION 200
#define CL_HPP_ENABLE_EXCEPTIONS
#include <dpr/dpr.hpp>
#include <dpr/opencl.hpp>

#include <cstdio>
#include <vector>

namespace {

/// True if an OpenCL call that fails within the library is its own error, not one of this program's bindings.
bool errors_are_the_librarys() {
  try {
    dpr::adopt_device(nullptr, nullptr);
  } catch (const dpr::DeviceError&) {
    return true;
  }
  return false;
}

/// True if a call that fails in this program throws.
bool errors_are_thrown_here() {
  try {
    cl::Context().getInfo<CL_CONTEXT_DEVICES>();
  } catch (const cl::Error&) {
    return true;
  }
  return false;
}

}  // namespace

int main() {
  const cl::Context context(CL_DEVICE_TYPE_ALL);
  const cl::CommandQueue queue(context, context.getInfo<CL_CONTEXT_DEVICES>().front());

  dpr::Scene scene;
  scene.width = scene.height = 32;
  scene.camera.view = dpr::orbit_camera(6.7F, 30, 120).view;
  scene.meshes.push_back({.mesh = dpr::make_cube()});
  dpr::Renderer renderer(dpr::adopt_device(context, queue));
  renderer.set_scene(scene);
  renderer.forward();

  const cl::Buffer image = dpr::image_buffer(renderer);
  std::vector<glm::vec4> pixels(32 * 32);
  queue.enqueueReadBuffer(image, CL_TRUE, 0, pixels.size() * sizeof(glm::vec4), pixels.data());
  const bool same_image = pixels == renderer.image().pixels;
  const dpr::SceneGradient gradient = dpr::backward(renderer, image);
  std::printf("same image: %d, gradients of %zu positions\n", same_image,
              gradient.meshes[0].positions.size());
  return same_image && gradient.meshes[0].positions.size() == scene.meshes[0].mesh.positions.size() &&
                 errors_are_the_librarys() && errors_are_thrown_here()
             ? 0
             : 1;
}
