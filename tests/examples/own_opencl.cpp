// Inside a program that has OpenCL objects of its own: its kernel is the loss, and no image leaves the
// device.
#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#include <cstdio>
#include <dpr/dpr.hpp>
#include <dpr/opencl.hpp>

constexpr int k_side = 64;
constexpr const char* k_source = R"(
  kernel void difference(global const float4* image, global const float4* target, global float4* grad) {
    const size_t i = get_global_id(0);
    grad[i] = (float4)(2.0f * (image[i] - target[i]).xyz, 0.0f) / (3.0f * get_global_size(0));
  })";

int main() {
  const cl::Context context(CL_DEVICE_TYPE_ALL);
  cl::CommandQueue queue(context, context.getInfo<CL_CONTEXT_DEVICES>().front());
  cl::Program program(context, k_source, /*build*/ true);
  cl::KernelFunctor<cl::Buffer, cl::Buffer, cl::Buffer> difference(program, "difference");
  const cl::Buffer target(context, CL_MEM_READ_WRITE, k_side * k_side * sizeof(cl_float4));
  const cl::Buffer grad(context, CL_MEM_READ_WRITE, k_side * k_side * sizeof(cl_float4));

  dpr::Scene scene;
  scene.width = scene.height = k_side;
  scene.camera = dpr::orbit_camera(/*distance*/ 5, /*elevation*/ 20, /*azimuth*/ 30);
  scene.meshes.push_back({.mesh = dpr::make_cube()});
  dpr::Renderer renderer(dpr::adopt_device(context, queue));
  renderer.set_scene(scene);
  renderer.forward();
  queue.enqueueCopyBuffer(dpr::image_buffer(renderer), target, 0, 0, k_side * k_side * sizeof(cl_float4));

  std::vector<glm::vec3> colors(scene.meshes[0].mesh.face_colors.size(), glm::vec3(0.5F));
  for (int i = 0; i < 80; ++i) {
    renderer.set_colors(0, colors);
    renderer.forward();
    difference(cl::EnqueueArgs(queue, cl::NDRange(k_side * k_side)), dpr::image_buffer(renderer), target,
               grad);
    const std::vector<glm::vec3> gradient = dpr::backward(renderer, grad).meshes[0].colors;
    for (std::size_t face = 0; face < colors.size(); ++face) colors[face] -= 40.0F * gradient[face];
  }
  const glm::vec3 seen = colors[0], wanted = scene.meshes[0].mesh.face_colors[0];
  std::printf("a face is (%.2f, %.2f, %.2f)\n", double{seen.x}, double{seen.y}, double{seen.z});
  return glm::length(seen - wanted) < 0.05F ? 0 : 1;
}
