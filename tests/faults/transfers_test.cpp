// A step that stays on the device: the caller's kernels are its loss and its optimizer. Counted by the
// library that stands before OpenCL, no call waits, and none moves a byte between host and device but the
// counts of a frame.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "device/context.hpp"
#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "faults/opencl_faults.hpp"
#include "pipeline/scenes.hpp"
#include "support/caller.hpp"

namespace transfers_test {

using namespace dpr;
using namespace dpr::test;
using namespace dpr::test::pipeline;

namespace {

constexpr int k_size = 16;

constexpr const char* k_source = R"(
kernel void loss(global const float4* image, global const float4* target, global float4* grad) {
  const size_t i = get_global_id(0);
  grad[i] = image[i] - target[i];
}
kernel void descend(global const float* grad, const float rate, global float* values) {
  const size_t i = get_global_id(0), k = i / 3 * 4 + i % 3;  // a gradient has four floats of room
  values[i] -= rate * grad[k];
})";

/// Calls that move bytes to the device or wait, since the last arming, but for reads.
std::size_t calls_to_the_host() {
  std::size_t calls = 0;
  for (const char* name : {"clEnqueueWrite*", "clEnqueueMap*", "clWaitForEvents", "clFinish",
                           "clCreateBuffer", "clBuildProgram"})
    calls += dpr_opencl_calls(name);
  return calls;
}

class Program {
 public:
  explicit Program(const Scene& scene, bool shows_attributes = false)
      : shows_attributes_(shows_attributes),
        renderer_(adopt_device(caller_.context(), caller_.queue())),
        depths_(renderer_.device(), Attribute::depth),
        normals_(renderer_.device(), Attribute::normal),
        loss_(caller_.kernel(k_source, "loss")),
        step_(caller_.kernel(k_source, "descend")) {
    renderer_.set_scene(scene);
    const Mesh& mesh = scene.meshes[0].mesh;
    positions_ = caller_.buffer(mesh.positions);
    if (!mesh.materials.empty()) materials_ = caller_.buffer(std::vector<glm::vec4>{{0.8F, 0.6F, 0.4F, 9}});
    colors_ = caller_.buffer(mesh.vertex_colors);
    numbers_ = 3 * mesh.positions.size();
    pixels_ = static_cast<std::size_t>(scene.width * scene.height);
    target_ = caller_.buffer(std::vector<glm::vec4>(pixels_, glm::vec4(0.4F)));
    grad_ = caller_.buffer(std::vector<glm::vec4>(pixels_));
    outputs_ = caller_.buffer(std::vector<glm::vec3>(pixels_));
  }

  void step() {
    set_positions(renderer_, 0, {positions_()});
    set_colors(renderer_, 0, {colors_()});
    if (materials_()) set_materials(renderer_, 0, {materials_()});
    cl_event rendered = nullptr;
    forward_on_device(renderer_, {.done = &rendered});
    run(loss_, pixels_, cl::Buffer(image_view(renderer_).buffer, true), target_, grad_);
    backward_on_device(renderer_, {grad_()}, {.wait = {&rendered, 1}});
    run(step_, numbers_, gradient_of("meshes[0].positions"), 1e-7F, positions_);
    run(step_, numbers_, gradient_of("meshes[0].colors"), 1e-2F, colors_);
    clReleaseEvent(rendered);
    if (materials_()) {
      copy_gradient(renderer_, "meshes[0].shininess", {grad_()});
      run(step_, 3, gradient_of("meshes[0].specular"), 1e-3F, materials_);
    }
    if (!shows_attributes_) return;
    copy_aov(renderer_, Aov::normal, {outputs_()});
    aov_view(renderer_, Aov::face_id);
    for (AttributeImages* const images : {&depths_, &normals_}) {
      forward_on_device(*images, renderer_);
      run(loss_, pixels_, cl::Buffer(image_view(*images).buffer, true), target_, grad_);
      backward_on_device(*images, {grad_()});
      gradient_view(*images, "sigma");
      const BufferView gradient = gradient_view(*images, "meshes[0].positions");
      run(step_, numbers_, cl::Buffer(gradient.buffer, true), 1e-7F, positions_);
    }
  }

  TransferCounts transfers() const { return impl_of(renderer_.device()).transfers(); }
  std::vector<float> colors() const { return caller_.read(colors_); }
  std::size_t emptied() {
    std::size_t frames = frame_history(renderer_).emptied;
    if (shows_attributes_) frames += frame_history(depths_).emptied + frame_history(normals_).emptied;
    return frames;
  }

 private:
  cl::Buffer gradient_of(const char* name) { return cl::Buffer(gradient_view(renderer_, name).buffer, true); }

  template <class... Args>
  void run(cl::Kernel& kernel, std::size_t count, const Args&... args) {
    cl_uint index = 0;
    (kernel.setArg(index++, args), ...);
    caller_.queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(count));
  }

  Caller caller_;
  bool shows_attributes_;
  Renderer renderer_;
  AttributeImages depths_, normals_;
  cl::Kernel loss_, step_;
  cl::Buffer positions_, colors_, materials_, target_, grad_, outputs_;
  std::size_t numbers_ = 0, pixels_ = 0;
};

/// Counts in steps after the second: the first measures, and both make buffers and kernels.
void check_step(const Scene& scene, bool shows_attributes = false) {
  Program program(scene, shows_attributes);
  program.step();
  program.step();
  const std::vector<float> before = program.colors();
  const TransferCounts transfers = program.transfers();
  constexpr std::size_t k_steps = 5, k_counts_bytes = 16;
  dpr_arm_opencl_fault("", 0);
  for (std::size_t i = 0; i < k_steps; ++i) program.step();
  const std::size_t reads = dpr_opencl_calls("clEnqueueRead*"), frames = shows_attributes ? 3 : 1;
  CHECK(calls_to_the_host() == 0);
  CHECK(program.transfers().host_waits == transfers.host_waits);
  CHECK(reads <= k_steps * frames);
  CHECK(program.transfers().bytes_from_device - transfers.bytes_from_device == k_counts_bytes * reads);
  CHECK(dpr_opencl_calls("clEnqueueNDRangeKernel") > 100);
  CHECK(program.colors() != before);
  CHECK(program.emptied() == 0);
  CHECK(dpr_opencl_calls("clEnqueueRead*") > reads);  // which shows that they are counted
}

Scene scene_with_gradients(const char* preset) {
  Scene scene = scene_of(random_soup(8, 3), k_size, k_size);
  scene.smoothing = smoothing_preset(preset);
  return scene;
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("transfers: a step on the device has none, and waits for nothing") {
    for (const char* preset : {"gaussian", "joint_gaussian", "softras", "pixel", "paper_gaussian"}) {
      CAPTURE(std::string(preset));
      check_step(scene_with_gradients(preset));
    }
    Scene lit = scene_with_gradients("pixel");
    lit.lights = every_light(Shading::phong);
    lit.gradients.lights = lit.gradients.distortion = true;
    check_step(lit);
    lit.meshes[0].mesh.materials.resize(1);
    lit.gradients.materials = true;
    check_step(lit);
    Scene texture = scene_with_gradients("gaussian");
    texture.meshes[0].mesh =
        textured(texture.meshes[0].mesh, random_texture(5, 3, Wrap::mirror, Filter::trilinear));
    texture.gradients.texture = texture.gradients.texcoords = true;
    check_step(texture);
  }

  TEST_CASE("transfers: a step with auxiliary outputs and attributes has none either") {
    for (const char* preset : {"gaussian", "joint_gaussian", "pixel"}) {
      CAPTURE(std::string(preset));
      check_step(scene_with_gradients(preset), true);
    }
  }

  TEST_CASE("transfers: the ordinary path has some") {
    Renderer renderer(open_device());
    renderer.set_scene(scene_with_gradients("gaussian"));
    renderer.forward();
    dpr_arm_opencl_fault("", 0);
    renderer.forward();
    renderer.image();
    CHECK(dpr_opencl_calls("clEnqueueRead*") > 0);
  }
}

}  // namespace transfers_test
