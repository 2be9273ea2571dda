// Choosing a device, and working with the caller's own OpenCL objects.
#include <doctest/doctest.h>

#include <cctype>
#include <optional>
#include <string>
#include <vector>

#include "check/comparison.hpp"
#include "device/context.hpp"
#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "pipeline/scenes.hpp"
#include "support/caller.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"
#include "support/variable.hpp"

namespace device_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::Caller;
using dpr::test::reduced;
using dpr::test::Variable;

namespace {

std::string changed_case(std::string text) {
  for (char& c : text) {
    const auto byte = static_cast<unsigned char>(c);
    c = static_cast<char>(std::isupper(byte) ? std::tolower(byte) : std::toupper(byte));
  }
  return text;
}

Scene small_scene() {
  const int size = reduced(24, 6);
  return cube_scene(size, size + 3);
}

std::vector<double> flat_values(const SceneGradient& gradient) {
  std::vector<double> values;
  for (const Block& block : blocks_of(gradient))
    values.insert(values.end(), block.found.begin(), block.found.end());
  return values;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("device: the list describes every device, one of them the default with a reason") {
    const std::vector<DeviceInfo> devices = list_devices();
    REQUIRE_FALSE(devices.empty());
    std::size_t defaults = 0;
    for (std::size_t i = 0; i < devices.size(); ++i) {
      const DeviceInfo& info = devices[i];
      CHECK(info.index == i);
      CHECK_FALSE(info.platform.empty());
      CHECK_FALSE(info.name.empty());
      CHECK_FALSE(info.version.empty());
      CHECK_FALSE(info.driver.empty());
      CHECK(info.name.find('\0') == std::string::npos);
      CHECK((info.type == "cpu" || info.type == "gpu" || info.type == "accelerator"));
      CHECK(info.compute_units > 0);
      CHECK(info.max_allocation_bytes > 0);
      CHECK(info.memory_bytes >= info.max_allocation_bytes);
      CHECK((info.lanes == 1 || info.lanes == 8 || info.lanes == 16));
      CHECK(info.is_default == !info.default_reason.empty());
      if (info.is_default) ++defaults;
    }
    CHECK(defaults == 1);
  }

  TEST_CASE("device: opened by default, type, index, part of the name in any case, environment") {
    const Variable unset("DPR_DEVICE", nullptr);
    const std::vector<DeviceInfo> devices = list_devices();
    for (const DeviceInfo& info : devices) {
      CHECK(open_device(std::to_string(info.index)).info().name == info.name);
      CHECK(open_device(std::to_string(info.index)).info().index == info.index);
      const DeviceInfo by_name = open_device(changed_case(info.name)).info();
      CHECK(by_name.name == info.name);
      CHECK(open_device(changed_case(info.platform.substr(0, 4))).info().platform.substr(0, 4) ==
            info.platform.substr(0, 4));
      if (info.is_default) CHECK(open_device("").info().index == info.index);
      if (info.type == "cpu") CHECK(open_device("cpu").info().type == "cpu");
      {
        const Variable chosen("DPR_DEVICE", std::to_string(info.index).c_str());
        CHECK(open_device("").info().index == info.index);
        CHECK(open_device().info().index == info.index);
      }
      {
        // The caller's choice counts more than the environment.
        const Variable other("DPR_DEVICE", "no such device");
        CHECK(open_device(std::to_string(info.index)).info().index == info.index);
        CHECK_THROWS_AS(open_device(""), InvalidArgument);
      }
    }
    const Variable empty("DPR_DEVICE", "");
    CHECK(open_device("").info().is_default);
  }

  TEST_CASE("device: an unknown one is an error that lists those there are") {
    const Variable unset("DPR_DEVICE", nullptr);
    const std::vector<DeviceInfo> devices = list_devices();
    for (const std::string name : {"no such device", "99", "-1"}) {
      for (const DeviceInfo& info : devices) {
        DPR_CHECK_MESSAGE_HAS(InvalidArgument, open_device(name), "'" + name + "'");
        DPR_CHECK_MESSAGE_HAS(InvalidArgument, open_device(name), info.name);
      }
    }
    bool has_gpu = false;
    for (const DeviceInfo& info : devices) has_gpu = has_gpu || info.type == "gpu";
    if (!has_gpu) DPR_CHECK_MESSAGE_HAS(InvalidArgument, open_device("gpu"), "'gpu'");
    const Variable wrong("DPR_DEVICE", "nonsense");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, open_device(), "'nonsense'");
  }
}

TEST_SUITE("pipeline") {
  TEST_CASE("device: the caller's context and queue give the same image and gradient") {
    const Scene scene = small_scene();
    const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
    Renderer own(open_device(""));
    own.set_scene(scene);
    own.forward();

    const Caller caller;
    Renderer adopted(adopt_device(caller.context(), caller.queue()));
    CHECK(adopted.device().info().name == own.device().info().name);
    CHECK(adopted.device().info().lanes == own.device().info().lanes);
    adopted.set_scene(scene);
    adopted.forward();
    CHECK(adopted.image().pixels == own.image().pixels);
    CHECK(flat_values(adopted.backward(std::span(&grad, 1))) ==
          flat_values(own.backward(std::span(&grad, 1))));
  }

  TEST_CASE("device: a queue of another context is refused") {
    const Caller caller, other;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, adopt_device(caller.context(), other.queue()), "another context");
  }

  TEST_CASE("device: losses serve the renderers of their own device") {
    const Scene scene = small_scene();
    const Image target = random_image(scene.width, scene.height, 0.0F, 1.0F);
    const Device device = open_device();
    Renderer renderer(open_device()), own(device);
    ImageLoss loss(device, LossWeights::only(LossKind::mse), std::span(&target, 1));
    MeshLoss mesh_loss(device, {.laplacian = 1}, scene.meshes[0].mesh);
    for (Renderer* const r : {&renderer, &own}) {
      r->set_scene(scene);
      r->forward();
    }
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, loss.evaluate(renderer), "device (ImageLoss::evaluate)");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, mesh_loss.evaluate(renderer), "device (MeshLoss::evaluate)");
    CHECK(loss.evaluate(own) > 0);
    CHECK(mesh_loss.evaluate(own) > 0);
  }

  TEST_CASE("device: the objects of a caller who lets go of them live on") {
    std::optional<Device> device;
    {
      const Caller caller;
      device = adopt_device(caller.context(), caller.queue());
    }
    Renderer renderer(*device);
    renderer.set_scene(small_scene());
    renderer.forward();
    CHECK(renderer.image().pixels.size() ==
          static_cast<std::size_t>(small_scene().width * small_scene().height));
  }

  TEST_CASE("device: the image is read, and the gradient given, in buffers of the caller") {
    const Scene scene = small_scene();
    const Caller caller;
    Renderer renderer(adopt_device(caller.context(), caller.queue()));
    renderer.set_scene(scene);
    CHECK_THROWS_AS(image_handle(renderer), InvalidArgument);
    std::vector<View> views(2, renderer.views()[0]);
    views[1].camera.fov_y_degrees *= 1.1F;
    renderer.set_views(views);
    renderer.forward();

    const std::size_t pixels = static_cast<std::size_t>(scene.width) * static_cast<std::size_t>(scene.height);
    std::vector<glm::vec4> read(2 * pixels, glm::vec4(-1));
    const std::size_t bytes = read.size() * sizeof(glm::vec4);
    REQUIRE(caller.queue.enqueueReadBuffer(cl::Buffer(image_handle(renderer), true), CL_TRUE, 0, bytes,
                                           read.data()) == CL_SUCCESS);
    CHECK(std::vector<glm::vec4>(read.begin(), read.begin() + static_cast<std::ptrdiff_t>(pixels)) ==
          renderer.image(0).pixels);
    CHECK(std::vector<glm::vec4>(read.begin() + static_cast<std::ptrdiff_t>(pixels), read.end()) ==
          renderer.image(1).pixels);

    const std::vector<Image> grads{random_image(scene.width, scene.height, -1.0F, 1.0F, 1),
                                   random_image(scene.width, scene.height, -1.0F, 1.0F, 2)};
    std::vector<glm::vec4> joined = grads[0].pixels;
    joined.insert(joined.end(), grads[1].pixels.begin(), grads[1].pixels.end());
    const cl::Buffer buffer(caller.context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, bytes, joined.data());
    const std::vector<double> from_host = flat_values(renderer.backward(grads));
    CHECK(flat_values(backward(renderer, buffer())) == from_host);
    // The order of the views matters: the comparison sees it.
    const std::vector<Image> swapped{grads[1], grads[0]};
    CHECK(flat_values(renderer.backward(swapped)) != from_host);

    const cl::Buffer short_buffer(caller.context, CL_MEM_READ_ONLY, bytes - sizeof(glm::vec4));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, backward(renderer, short_buffer()), "grad_images");
    const Caller stranger;
    const cl::Buffer foreign(stranger.context, CL_MEM_READ_ONLY, bytes);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, backward(renderer, foreign()), "another context");
    CHECK(flat_values(backward(renderer, buffer())) == from_host);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("an object that does not say what it is, is an error") {
    DPR_CHECK_MESSAGE_HAS(DeviceError, adopt_device(nullptr, nullptr), "clGetCommandQueueInfo");
    DPR_CHECK_MESSAGE_HAS(DeviceError, describe(cl::Platform::getDefault(), cl::Device()), "clGetDeviceInfo");
  }
}

}  // namespace device_test
