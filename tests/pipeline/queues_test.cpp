// Many small frames whose buffers are written and read again and again by the caller's own kernels: on the
// device's queue, on a second one, and on one that runs commands in any order. Events alone keep them apart.
#include <doctest/doctest.h>

#include <cstring>
#include <vector>

#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "pipeline/determinism.hpp"
#include "support/caller.hpp"

namespace queues_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::Caller;
using dpr::test::reduced;

namespace {

constexpr const char* k_source = R"(
kernel void move(global const float* from, const uint first, global float* to) {
  to[get_global_id(0)] = from[first + get_global_id(0)];
})";

/// Positions of every frame, one frame after the other.
std::vector<float> moving_positions(const Mesh& mesh, int frames) {
  std::vector<float> all;
  for (int i = 0; i < frames; ++i) {
    const float factor = 1.0F - 0.3F * static_cast<float>(i % 17) / 17.0F;
    for (const glm::vec3& p : mesh.positions) {
      for (int axis = 0; axis < 3; ++axis) all.push_back(factor * p[axis]);
    }
  }
  return all;
}

/// Gradients of every frame alone, by way of the host: of half the sum of the squared image.
std::vector<float> expected_gradients(const Scene& scene, const std::vector<float>& positions) {
  Renderer renderer(open_device());
  renderer.set_scene(scene);
  const std::size_t vertices = scene.meshes[0].mesh.positions.size();
  std::vector<float> gradients;
  for (std::size_t first = 0; first < positions.size(); first += 3 * vertices) {
    std::vector<glm::vec3> moved(vertices);
    std::memcpy(moved.data(), &positions[first], vertices * sizeof(glm::vec3));
    renderer.set_positions(0, moved);
    renderer.forward();
    const Image image = renderer.image();
    const SceneGradient gradient = renderer.backward(std::span(&image, 1));
    for (const glm::vec3& g : gradient.meshes[0].positions)
      gradients.insert(gradients.end(), {g.x, g.y, g.z});
  }
  return gradients;
}

/// A caller's command after events, and its event.
class Commands {
 public:
  Commands(const Caller& caller, const cl::CommandQueue& queue)
      : queue_(queue), move_(caller.kernel(k_source, "move")) {}

  cl::Event move(const cl::Buffer& from, std::size_t first, const cl::Buffer& to, std::size_t count,
                 const std::vector<cl::Event>& after) {
    REQUIRE(move_.setArg(0, from) == CL_SUCCESS);
    REQUIRE(move_.setArg(1, static_cast<cl_uint>(first)) == CL_SUCCESS);
    REQUIRE(move_.setArg(2, to) == CL_SUCCESS);
    cl::Event done;
    REQUIRE(queue_.enqueueNDRangeKernel(move_, cl::NullRange, cl::NDRange(count), cl::NullRange, &after,
                                        &done) == CL_SUCCESS);
    REQUIRE(queue_.flush() == CL_SUCCESS);
    return done;
  }

 private:
  cl::CommandQueue queue_;
  cl::Kernel move_;
};

/// enqueue(Events) after an event; its own.
template <class Enqueue>
cl::Event after(const cl::Event& event, const Enqueue& enqueue) {
  const cl_event wait = event();
  cl_event done = nullptr;
  enqueue(Events{.wait = {&wait, 1}, .done = &done});
  return cl::Event(done);
}

/// The gradients of all frames, of which the caller does its part on a queue of its own.
std::vector<float> gradients_of_frames(const Caller& caller, const Device& device,
                                       const cl::CommandQueue& own, const Scene& scene,
                                       const std::vector<float>& positions) {
  const std::size_t numbers = 3 * scene.meshes[0].mesh.positions.size();
  const auto pixels = static_cast<std::size_t>(scene.width * scene.height);
  const cl::Buffer all = caller.buffer(positions), moved(caller.context, CL_MEM_READ_WRITE, numbers * 4),
                   grad_images(caller.context, CL_MEM_READ_WRITE, pixels * sizeof(cl_float4)),
                   gradients = caller.buffer(std::vector<float>(positions.size()));
  Renderer renderer(device);
  renderer.set_scene(scene);
  forward_on_device(renderer);  // the largest; measured
  Commands commands(caller, own);
  std::vector<cl::Event> last;  // of the frame before
  for (std::size_t first = 0; first < positions.size(); first += numbers) {
    cl::Event event = commands.move(all, first, moved, numbers, last);
    event = after(event, [&](const Events& e) { set_positions(renderer, 0, {moved()}, e); });
    event = after(event, [&](const Events& e) { forward_on_device(renderer, e); });
    const cl::Buffer image(image_view(renderer).buffer, true);
    event = commands.move(image, 0, grad_images, 4 * pixels, {event});
    event = after(event, [&](const Events& e) { backward_on_device(renderer, {grad_images()}, e); });
    event = after(event, [&](const Events& e) {
      copy_gradient(renderer, "meshes[0].positions", {gradients(), first * sizeof(float)}, e);
    });
    last = {event};
  }
  CHECK(frame_history(renderer).emptied == 0);
  return caller.read(gradients, last);
}

void check_queue(const Caller& caller, const Device& device, const cl::CommandQueue& own) {
  const Scene scene = cube_scene(12, 10);
  const std::vector<float> positions = moving_positions(scene.meshes[0].mesh, reduced(1000, 3));
  const std::vector<float> expected = expected_gradients(scene, positions),
                           found = gradients_of_frames(caller, device, own, scene, positions);
  REQUIRE(found.size() == expected.size());
  CHECK(std::memcmp(found.data(), expected.data(), found.size() * sizeof(float)) == 0);
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("queues: an out-of-order one of the caller's") {
    const Caller caller(CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE);
    if (caller.queue() == nullptr) return;  // the device has none
    check_queue(caller, adopt_device(caller.context(), caller.queue()), caller.queue);
  }

  TEST_CASE("queues: a second one beside the device's") {
    const Caller caller;
    const cl::CommandQueue second(caller.context, caller.device);
    check_queue(caller, adopt_device(caller.context(), caller.queue()), second);
  }

  TEST_CASE("queues: the device's own") {
    const Caller caller;
    check_queue(caller, adopt_device(caller.context(), caller.queue()), caller.queue);
  }
}

}  // namespace queues_test
