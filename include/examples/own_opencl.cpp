// Inside a program that has OpenCL objects of its own: its kernels are the loss and the optimizer, and no
// step waits for the device or moves a byte from it.
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
  }
  kernel void descend(global const float4* grad, uint first, global float* colors) {
    const size_t i = get_global_id(0);
    const float3 step = 40.0f * grad[first + i].xyz;
    colors[3 * i] -= step.x;
    colors[3 * i + 1] -= step.y;
    colors[3 * i + 2] -= step.z;
  })";

int main() {
  const cl::Context context(CL_DEVICE_TYPE_ALL);
  cl::CommandQueue queue(context, context.getInfo<CL_CONTEXT_DEVICES>().front());
  cl::Program program(context, k_source);
  program.build();
  cl::KernelFunctor<cl::Buffer, cl::Buffer, cl::Buffer> difference(program, "difference");
  cl::KernelFunctor<cl::Buffer, cl_uint, cl::Buffer> descend(program, "descend");
  const cl::Buffer target(context, CL_MEM_READ_WRITE, k_side * k_side * sizeof(cl_float4));
  const cl::Buffer grad(context, CL_MEM_READ_WRITE, k_side * k_side * sizeof(cl_float4));

  dpr::Scene scene;
  scene.width = scene.height = k_side;
  scene.camera = dpr::orbit_camera(/*distance*/ 5, /*elevation*/ 20, /*azimuth*/ 30);
  scene.meshes.push_back({.mesh = dpr::make_cube()});
  dpr::Renderer renderer(dpr::adopt_device(context, queue));
  renderer.set_scene(scene);
  dpr::reserve(renderer, {.pairs = 500, .fragments = 10000, .contours = 500});  // more than any step takes
  dpr::forward_on_device(renderer);
  dpr::copy_images(renderer, dpr::span_of(target));

  std::vector<glm::vec3> values(scene.meshes[0].mesh.face_colors.size(), glm::vec3(0.5F));
  const std::size_t bytes = values.size() * sizeof(glm::vec3);
  const cl::Buffer colors(context, CL_MEM_COPY_HOST_PTR, bytes, values.data());
  const cl::NDRange pixels(k_side * k_side), faces(values.size());
  for (int i = 0; i < 80; ++i) {
    dpr::set_colors(renderer, 0, dpr::span_of(colors));
    dpr::forward_on_device(renderer);
    difference(cl::EnqueueArgs(queue, pixels), dpr::buffer_of(dpr::image_view(renderer)).buffer, target,
               grad);
    dpr::backward_on_device(renderer, dpr::span_of(grad));
    const auto [gradient, offset] = dpr::buffer_of(dpr::gradient_view(renderer, "meshes[0].colors"));
    descend(cl::EnqueueArgs(queue, faces), gradient, static_cast<cl_uint>(offset / sizeof(cl_float4)),
            colors);
  }
  queue.enqueueReadBuffer(colors, /*blocking*/ true, 0, bytes, values.data());
  const glm::vec3 seen = values[0], wanted = scene.meshes[0].mesh.face_colors[0];
  std::printf("a face is (%.2f, %.2f, %.2f)\n", double{seen.x}, double{seen.y}, double{seen.z});
  return glm::length(seen - wanted) < 0.05F && dpr::frame_history(renderer).emptied == 0 ? 0 : 1;
}
