// Everything of a step on the device, in buffers of the caller's: to the bits of the ordinary path, which
// goes by way of the host; and what is refused of the caller's buffers.
#include <doctest/doctest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "dpr/dpr.hpp"
#include "dpr/opencl_handles.hpp"
#include "pipeline/determinism.hpp"
#include "pipeline/device_buffers.hpp"
#include "renderer/renderer_impl.hpp"
#include "scene/gradient_table.hpp"
#include "support/caller.hpp"
#include "support/messages.hpp"

namespace on_device_test {

using namespace dpr;
using namespace dpr::test::pipeline;
using dpr::test::Caller;
using dpr::test::reduced;

namespace {

Image read_image(const Caller& caller, Renderer& renderer) {
  const std::vector<float> values = read_view(caller, image_view(renderer));
  Image image(renderer.scene().width, renderer.scene().height);
  REQUIRE(values.size() == 4 * image.pixels.size());
  std::memcpy(image.pixels.data(), values.data(), values.size() * sizeof(float));
  return image;
}

/// The texels of one texture, or the numbers of any other array.
std::vector<std::pair<std::string, std::vector<float>>> arrays_of(const std::string& name,
                                                                  const GradientArray& array) {
  if (const auto* const* textures = std::get_if<std::vector<std::vector<glm::vec3>>*>(&array)) {
    std::vector<std::pair<std::string, std::vector<float>>> arrays;
    for (const std::vector<glm::vec3>& texels : **textures)
      arrays.emplace_back(name + "[" + std::to_string(arrays.size()) + "]",
                          packed(std::span<const glm::vec3>(texels)));
    return arrays;
  }
  if (const auto* const* textures = std::get_if<std::vector<std::vector<float>>*>(&array)) {
    std::vector<std::pair<std::string, std::vector<float>>> arrays;
    for (const std::vector<float>& opacities : **textures)
      arrays.emplace_back(name + "[" + std::to_string(arrays.size()) + "]", opacities);
    return arrays;
  }
  std::vector<float> values;
  transform_numbers(array, [&](double value) { return values.push_back(static_cast<float>(value)), value; });
  return {{name, values}};
}

/// Every gradient that is there, against that of the ordinary path. Returns how many.
std::size_t check_gradients(const Caller& caller, Renderer& renderer, SceneGradient& expected) {
  std::size_t checked = 0;
  for_each_array(expected, [&](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    if (!(renderer.scene().gradients.*row.wanted) || (row.exists && !row.exists(renderer.scene()))) return;
    for (const auto& [name, values] : arrays_of(name_of(row, index), array)) {
      if (values.empty()) continue;
      CAPTURE(name);
      const std::vector<float> found = read_view(caller, gradient_view(renderer, name));
      const bool is_one_sum = name.find(".camera.") == std::string::npos && !name.starts_with("lights") &&
                              !name.ends_with(".rotation") && name != "sigma";
      CHECK((is_one_sum ? same_bits(found, values) : is_near(found, values)));
      ++checked;
    }
  });
  return checked;
}

/// Every other number, from the third on.
std::vector<float> laid_out_numbers(const std::vector<float>& numbers) {
  std::vector<float> all(2);
  for (const float number : numbers) all.insert(all.end(), {number, -7.0F});
  return all;
}

/// The scene with other positions, so that what does not come from the buffers shows.
Scene spoiled(Scene scene) {
  for (Instance& instance : scene.meshes) {
    for (glm::vec3& p : instance.mesh.positions) p *= 0.9F;
    for (glm::vec3& c : instance.mesh.vertex_colors) c *= 0.5F;
    for (glm::vec3& c : instance.mesh.face_colors) c *= 0.5F;
    for (glm::vec3& n : instance.mesh.normals) n.x += 0.4F;
    for (Material& m : instance.mesh.materials) m = {};
    for (float& o : instance.mesh.face_opacities) o = 1;
    for (Texture& t : instance.mesh.textures) t.opacities.assign(t.opacities.size(), 1.0F);
    instance.transform[3].x += 0.1F;
  }
  if (!scene.lights) scene.camera.view[3].z -= 0.3F;
  return scene;
}

/// Sets the scene, with positions, colours, textures and transforms from the caller's buffers, in layouts of
/// all kinds.
void set_from_buffers(const Caller& caller, Renderer& renderer, const Scene& scene) {
  renderer.set_scene(spoiled(scene));
  const std::vector<Instance>& meshes = scene.meshes;
  std::vector<float> transforms;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const Mesh& mesh = meshes[m].mesh;
    const auto positions = caller.buffer(laid_out(std::span(mesh.positions), 5, 7));
    set_positions(renderer, m, {positions(), 5 * sizeof(float), 7 * sizeof(float)});
    const std::vector<glm::vec3>& of_mesh =
        mesh.vertex_colors.empty() ? mesh.face_colors : mesh.vertex_colors;
    if (!of_mesh.empty()) set_colors(renderer, m, {caller.buffer(packed(std::span(of_mesh)))()});
    for (std::size_t t = 0; t < mesh.textures.size(); ++t) {
      const std::vector<glm::vec3>& texels = mesh.textures[t].texels;
      set_texels(renderer, m, t, {caller.buffer(laid_out(std::span(texels), 0, 4))(), 0, 4 * sizeof(float)});
      const std::vector<float>& of_texels = mesh.textures[t].opacities;
      if (!of_texels.empty())
        set_texel_opacities(renderer, m, t, {caller.buffer(laid_out_numbers(of_texels))(), 8, 8});
    }
    if (!mesh.textures.empty())
      set_texcoords(renderer, m, {caller.buffer(packed(std::span(mesh.texcoords)))()});
    if (!mesh.face_normals.empty())
      set_normals(renderer, m, {caller.buffer(laid_out(std::span(mesh.normals), 2, 3))(), 2 * sizeof(float)});
    std::vector<float> materials;  // a shininess that kernels cannot use is the lights'
    for (const Material& material : mesh.materials) {
      const glm::vec3& s = material.specular;
      materials.insert(materials.end(), {s.x, s.y, s.z, material.shininess.value_or(-0.5F), 0});
    }
    if (!materials.empty()) set_materials(renderer, m, {caller.buffer(materials)(), 0, 5 * sizeof(float)});
    const std::vector<float>& opacities = mesh.face_opacities;
    if (!opacities.empty()) set_opacities(renderer, m, {caller.buffer(laid_out_numbers(opacities))(), 8, 8});
    const std::vector<float> rows = rows_of(meshes[m].transform);
    transforms.insert(transforms.end(), rows.begin(), rows.end());
  }
  set_transforms(renderer, {caller.buffer(transforms)()});
  if (scene.lights) return;  // whose highlights know the eye in double precision
  std::vector<float> view = rows_of(scene.camera.view);
  view.insert(view.begin(), {-9.0F, -9.0F});
  set_view_matrices(renderer, {caller.buffer(view)(), 2 * sizeof(float)});
}

std::vector<Scene> scenes() {
  Scene texture = textured_scene(make_cube(), random_texture(5, 3, Wrap::mirror, Filter::trilinear),
                                 reduced(24, 9), reduced(20, 8));
  Scene two = cube_scene(reduced(24, 9), reduced(20, 8));
  two.meshes.push_back({random_soup(5, 3), placed(40.0F, 0.8F)});
  Scene normals = two;
  normals.lights = two_lights(Shading::phong);
  for (const glm::vec3& p : two.meshes[0].mesh.positions)
    normals.meshes[0].mesh.normals.push_back(p + glm::vec3(0.1F, 0.2F, 0));
  normals.meshes[0].mesh.face_normals = two.meshes[0].mesh.faces;
  normals.gradients.normals = true;
  Mesh& soup = normals.meshes[1].mesh;  // behind a mesh without materials
  soup.materials = {{.specular = glm::vec3(0.9F, 0.5F, 0.2F), .shininess = 7.0F},
                    {glm::vec3(0.4F), std::nullopt}};
  soup.face_materials = {1, 0, 0, 1, 0};
  normals.gradients.materials = true;
  two.meshes[1].mesh.face_opacities = {0.3F, 0.5F, 0.7F, 0.9F, 1.0F};
  two.gradients.opacities = true;
  Scene leaf = texture;
  leaf.meshes[0].mesh.textures[0].opacities.assign(15, 0.6F);
  leaf.meshes[0].mesh.textures[0].opacities[4] = 0.2F;
  leaf.gradients.texel_opacities = true;
  std::vector<Scene> all{
      test_scene(), sampled_scene(), sampled_joint_scene(), joint_scene(), texture, two, normals, leaf};
  for (Scene& scene : all) scene.gradients.camera = scene.gradients.transform = true;
  return all;
}

/// A sphere that grows from buffers of the caller's.
struct Growing {
  explicit Growing(const char* preset) : renderer(adopt_device(caller.context(), caller.queue())) {
    scene = scene_of(make_icosphere(2), reduced(64, 32), reduced(64, 32));
    for (glm::vec3& p : scene.meshes[0].mesh.positions) p *= 0.3F;
    scene.smoothing = smoothing_preset(preset);
    if (scene.smoothing.noise == Noise::triangle) scene.smoothing.sigma = 1e-5F;  // counts follow the area
    renderer.set_scene(scene);
  }

  std::vector<glm::vec3> positions(float scale) const {
    std::vector<glm::vec3> scaled = scene.meshes[0].mesh.positions;
    for (glm::vec3& p : scaled) p *= scale;
    return scaled;
  }

  std::size_t frame(float scale) {
    const std::vector<glm::vec3> scaled = positions(scale);
    buffer = caller.buffer(packed(std::span<const glm::vec3>(scaled)));
    set_positions(renderer, 0, {buffer()});
    return forward_on_device(renderer);
  }

  /// A renderer that has rendered nothing yet, from a buffer too.
  Renderer fresh(float scale) const {
    Renderer made(renderer.device());
    made.set_scene(scene);
    const std::vector<glm::vec3> scaled = positions(scale);
    set_positions(made, 0, {caller.buffer(packed(std::span<const glm::vec3>(scaled)))()});
    return made;
  }

  /// Whether the image on the device is the one of a renderer that waits.
  bool is_whole(float scale) {
    Renderer waiting = fresh(scale);
    waiting.forward();
    return dpr::test::pipeline::same_bits(read_image(caller, renderer), waiting.image());
  }

  Caller caller;
  Scene scene;
  Renderer renderer;
  cl::Buffer buffer;
};

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE("on device: image and gradients have the bits of the ordinary path") {
    const Caller caller;
    for (const Scene& scene : scenes()) {
      const Device device = adopt_device(caller.context(), caller.queue());
      Renderer ordinary(device), renderer(device);
      ordinary.set_scene(scene);
      const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
      ordinary.forward();
      SceneGradient expected = ordinary.backward(std::span(&grad, 1));

      set_from_buffers(caller, renderer, scene);
      const cl::Buffer grad_images = caller.buffer(packed(std::span<const glm::vec4>(grad.pixels)));
      for (int frame = 0; frame < 3; ++frame) {  // measured, then within what was measured
        CAPTURE(frame);
        forward_on_device(renderer);
        backward_on_device(renderer, {grad_images()});
        CHECK(dpr::test::pipeline::same_bits(read_image(caller, renderer), ordinary.image()));
        CHECK(check_gradients(caller, renderer, expected) > 8);
      }
      CHECK(frame_history(renderer).emptied == 0);
      CHECK(dpr::test::pipeline::same_bits(renderer.backward(std::span(&grad, 1)), expected));
    }
  }

  TEST_CASE("on device: noise on the pixel") {
    // The mesh is not closed: of a closed one the ordinary path leaves out faces that look away.
    Scene scene = scene_of(random_soup(9, 4), reduced(24, 9), reduced(20, 8));
    scene.smoothing = smoothing_preset("pixel");
    scene.smoothing.sigma = 2e-3F;
    const Caller caller;
    for (const float sigma : {2e-3F, 0.1F}) {  // the second on a coarse grid
      scene.smoothing.sigma = sigma;
      const Device device = adopt_device(caller.context(), caller.queue());
      Renderer ordinary(device), renderer(device);
      ordinary.set_scene(scene);
      const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
      ordinary.forward();
      SceneGradient expected = ordinary.backward(std::span(&grad, 1));
      set_from_buffers(caller, renderer, scene);
      const cl::Buffer grad_images = caller.buffer(packed(std::span<const glm::vec4>(grad.pixels)));
      for (int frame = 0; frame < 2; ++frame) {
        forward_on_device(renderer);
        backward_on_device(renderer, {grad_images()});
        CHECK(dpr::test::pipeline::same_bits(read_image(caller, renderer), ordinary.image()));
        CHECK(check_gradients(caller, renderer, expected) > 8);
      }
    }
  }

  TEST_CASE("on device: shapes of views, and views of a batch") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    const Scene scene = cube_scene(reduced(24, 9), reduced(20, 8));
    std::vector<View> views(2, {scene.camera, {scene.meshes[0].transform}});
    views[1].camera.fov_y_degrees *= 1.2F;
    std::vector<glm::vec3> positions = scene.meshes[0].mesh.positions,
                           colors = scene.meshes[0].mesh.face_colors;
    for (const glm::vec3& p : scene.meshes[0].mesh.positions) positions.push_back(0.8F * p);
    for (const glm::vec3& c : scene.meshes[0].mesh.face_colors) colors.push_back(0.3F * c);
    std::vector<Image> grads;
    std::vector<glm::vec4> pixels;
    for (unsigned seed : {1U, 2U}) {
      grads.push_back(random_image(scene.width, scene.height, -1.0F, 1.0F, seed));
      pixels.insert(pixels.end(), grads.back().pixels.begin(), grads.back().pixels.end());
    }
    Renderer ordinary(device), renderer(device);
    for (Renderer* const r : {&ordinary, &renderer}) {
      r->set_scene(scene);
      r->set_views(views);
    }
    ordinary.set_shapes(positions, colors);
    ordinary.forward();
    SceneGradient expected = ordinary.backward(grads);
    set_shapes(renderer, {caller.buffer(packed(std::span<const glm::vec3>(positions)))()},
               {caller.buffer(packed(std::span<const glm::vec3>(colors)))()});
    for (int frame = 0; frame < 2; ++frame) {
      forward_on_device(renderer);
      backward_on_device(renderer, {caller.buffer(packed(std::span<const glm::vec4>(pixels)))()});
      CHECK(check_gradients(caller, renderer, expected) > 8);
    }
    CHECK(dpr::test::pipeline::same_bits(renderer.image(1), ordinary.image(1)));
  }

  TEST_CASE("on device: images and gradients are copied to where the caller wants them") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    const Scene scene = test_scene();
    Renderer renderer(device);
    renderer.set_scene(scene);
    forward_on_device(renderer);
    const Image image = read_image(caller, renderer);
    const std::size_t pixels = image.pixels.size();
    const cl::Buffer out = caller.buffer(std::vector<float>(2 + 5 * pixels, -7.0F));
    copy_images(renderer, {out(), 2 * sizeof(float), 5 * sizeof(float)});
    const std::vector<float> found = caller.read(out);
    std::vector<float> wanted(2 + 5 * pixels, -7.0F);
    for (std::size_t i = 0; i < pixels; ++i)
      std::memcpy(&wanted[2 + 5 * i], &image.pixels[i], sizeof(glm::vec4));
    CHECK(same_bits(found, wanted));

    backward_on_device(renderer, image_view(renderer).span());
    const BufferView view = gradient_view(renderer, "meshes[0].positions");
    const std::vector<float> gradient = read_view(caller, view);
    // A sub-buffer begins where the device allows it to.
    const std::size_t align = caller.device.getInfo<CL_DEVICE_MEM_BASE_ADDR_ALIGN>() / 8;
    const std::size_t bytes = gradient.size() * sizeof(float);
    cl::Buffer whole = caller.buffer(std::vector<float>((align + bytes) / sizeof(float), -7.0F));
    cl_buffer_region region{align, bytes};
    const cl::Buffer part = whole.createSubBuffer(CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region);
    copy_gradient(renderer, "meshes[0].positions", {part()});
    const std::vector<float> all = caller.read(whole);
    CHECK(same_bits({all.begin() + static_cast<std::ptrdiff_t>(align / sizeof(float)), all.end()}, gradient));
    CHECK(all[align / sizeof(float) - 1] == -7.0F);
  }

  TEST_CASE("on device: a frame that exceeds its room is emptied, and the caller learns of it") {
    const Caller caller;
    for (const bool pixel : {false, true}) {
      Scene scene = scene_of(random_soup(30, 4), reduced(40, 16), reduced(40, 16));
      if (pixel) scene.smoothing = smoothing_preset("pixel");
      const Mesh& mesh = scene.meshes[0].mesh;
      std::vector<glm::vec3> small = mesh.positions;
      for (glm::vec3& p : small) p *= 0.05F;
      Renderer renderer(adopt_device(caller.context(), caller.queue()));
      renderer.set_scene(scene);
      const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
      renderer.set_positions(0, small);
      forward_on_device(renderer);  // measured
      const cl::Buffer large = caller.buffer(packed(std::span<const glm::vec3>(mesh.positions)));
      set_positions(renderer, 0, {large()});
      forward_on_device(renderer);
      const cl::Buffer again = caller.buffer(packed(std::span<const glm::vec4>(grad.pixels)));
      backward_on_device(renderer, {again()});
      Renderer empty(renderer.device());
      empty.set_scene(scene);
      std::vector<glm::vec3> nowhere = small;
      for (glm::vec3& p : nowhere) p += glm::vec3(0, 1e4F, 0);
      empty.set_positions(0, nowhere);
      empty.forward();
      CHECK(dpr::test::pipeline::same_bits(read_image(caller, renderer), empty.image()));
      SceneGradient of_nothing = empty.backward(std::span(&grad, 1));
      CHECK(check_gradients(caller, renderer, of_nothing) > 8);
      const std::vector<float> counts = read_view(caller, frame_history_view(renderer));
      CHECK(std::bit_cast<cl_uint>(counts[3]) == 1);
      const FrameHistory history = frame_history(renderer);
      CHECK(history.emptied == 1);
      CHECK(history.largest.pairs == std::bit_cast<cl_uint>(counts[0]));
      // Rounds until there is room for all: fragments can be counted once the pairs fit.
      std::size_t rounds = 0;
      do {
        forward_on_device(renderer);
        backward_on_device(renderer, {again()});
      } while (frame_history(renderer).emptied > 0 && ++rounds < 5);
      CHECK(rounds <= 2);
      Renderer fresh(renderer.device());
      fresh.set_scene(scene);
      fresh.forward();
      CHECK(dpr::test::pipeline::same_bits(read_image(caller, renderer), fresh.image()));
      SceneGradient expected = fresh.backward(std::span(&grad, 1));
      check_gradients(caller, renderer, expected);
    }
  }

  TEST_CASE("on device: after an emptied frame the next call says so, and its frame is whole") {
    for (const char* preset : {"gaussian", "pixel"}) {
      Growing growing(preset);
      CHECK(growing.frame(1.0F) == 0);  // measured
      CHECK(growing.frame(1.0F) == 0);
      CHECK(growing.frame(1.6F) == 0);
      CHECK(!growing.is_whole(1.6F));  // which waits: the device is done
      CHECK(growing.frame(1.6F) == 1);
      CHECK(growing.is_whole(1.6F));
      CHECK(growing.frame(1.6F) == 0);
      CHECK(growing.is_whole(1.6F));
      CHECK(growing.frame(3.2F) == 0);
      CHECK(frame_history(growing.renderer).emptied == 2);
      CHECK(growing.frame(3.2F) == 0);  // said already
    }
  }

  TEST_CASE("on device: room grows with what is rendered, and no frame is emptied") {
    for (const char* preset : {"gaussian", "pixel"}) {
      Growing growing(preset);
      float scale = 1.0F;
      for (int step = 0; step < 100; ++step, scale *= 1.01F) {
        CHECK(growing.frame(scale) == 0);
        if (step % reduced(5, 1) == 0) growing.caller.queue.finish();  // few pixels grow by large parts
      }
      const std::size_t waits = impl_of(growing.renderer.device()).host_waits;
      CHECK(growing.frame(scale) == 0);
      CHECK(impl_of(growing.renderer.device()).host_waits == waits);
      CHECK(frame_history(growing.renderer).emptied == 0);
      CHECK(growing.is_whole(scale));
    }
  }

  TEST_CASE("on device: counts that arrive late are of no scene but their own") {
    Growing growing("gaussian");
    growing.frame(3.0F);
    growing.frame(3.0F);
    growing.caller.queue.finish();
    const std::size_t large = impl_of(growing.renderer).last_counts->fragments;
    growing.renderer.set_scene(growing.scene);
    growing.frame(0.5F);
    growing.frame(0.5F);
    CHECK(impl_of(growing.renderer).last_counts->fragments < large / 8);
  }

  TEST_CASE("on device: kernels are launched for what frames take, not for their room") {
    for (const char* preset : {"gaussian", "pixel"}) {
      Growing growing(preset);
      Renderer& renderer = growing.renderer;
      growing.frame(1.0F);
      const FrameCounts taken = *impl_of(renderer).last_counts;
      constexpr std::size_t k_more = 64;
      reserve(renderer, {k_more * taken.pairs, k_more * taken.fragments, k_more * taken.contours});
      for (int frame = 0; frame < 2; ++frame) {  // the second knows of the first
        growing.frame(1.0F);
        growing.caller.queue.finish();
      }
      growing.frame(1.0F);
      CHECK(impl_of(renderer).bin.pairs >= k_more * taken.pairs);
      CHECK(impl_of(renderer).bin.launched < 2 * taken.pairs);
      CHECK(impl_of(renderer).rasterize.launched_fragments() < 2 * taken.fragments);
      CHECK(growing.is_whole(1.0F));
      // Three times as large, it is whole all the same, and its gradients are.
      growing.frame(3.0F);
      const std::size_t launched = impl_of(renderer).bin.launched;
      CHECK(launched < 2 * taken.pairs);
      const Image grad = random_image(growing.scene.width, growing.scene.height, -1.0F, 1.0F);
      const cl::Buffer on_device = growing.caller.buffer(packed(std::span<const glm::vec4>(grad.pixels)));
      backward_on_device(renderer, {on_device()});
      CHECK(growing.is_whole(3.0F));
      Renderer fresh = growing.fresh(3.0F);
      fresh.forward();
      CHECK(fresh.statistics().pairs > launched);
      SceneGradient expected = fresh.backward(std::span(&grad, 1));
      CHECK(check_gradients(growing.caller, renderer, expected) > 3);
      CHECK(frame_history(renderer).emptied == 0);
    }
  }

  TEST_CASE("on device: room that is reserved makes the first frame whole without a wait") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    Renderer fresh(device), renderer(device);
    fresh.set_scene(test_scene());
    fresh.forward();
    const RenderStatistics taken = fresh.statistics();
    renderer.set_scene(test_scene());
    reserve(renderer, {taken.pairs, taken.fragments});
    const std::size_t before = impl_of(device).host_waits;
    forward_on_device(renderer);
    CHECK(impl_of(device).host_waits == before);
    CHECK(dpr::test::pipeline::same_bits(read_image(caller, renderer), fresh.image()));
    // A little less, and a frame of another size is emptied.
    Renderer tight(device);
    tight.set_scene(test_scene());
    reserve(tight, {taken.pairs / 2, taken.fragments / 2});
    forward_on_device(tight);
    CHECK(frame_history(tight).emptied == 1);
    // Who asks for the image by way of the host gets it all the same.
    CHECK(dpr::test::pipeline::same_bits(tight.image(), fresh.image()));
  }

  TEST_CASE("on device: numbers that are not finite do no harm") {
    const Caller caller;
    Scene scene = textured_scene(make_cube(), random_texture(5, 3, Wrap::repeat, Filter::bilinear), 12, 12);
    Renderer renderer(adopt_device(caller.context(), caller.queue()));
    renderer.set_scene(scene);
    const std::vector<float> bad(3 * 24, std::numeric_limits<float>::quiet_NaN());
    const std::vector<float> infinite(2 * scene.meshes[0].mesh.texcoords.size(),
                                      std::numeric_limits<float>::infinity());
    set_texcoords(renderer, 0, {caller.buffer(infinite)()});
    forward_on_device(renderer);
    backward_on_device(renderer, image_view(renderer).span());
    set_positions(renderer, 0, {caller.buffer(bad)()});
    forward_on_device(renderer);
    backward_on_device(renderer, image_view(renderer).span());
    for (const glm::vec4& p : read_image(caller, renderer).pixels) CHECK(p == glm::vec4(scene.background, 0));
  }

  TEST_CASE("on device: attributes and auxiliary outputs have the texture coordinates of a buffer") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    const Scene scene =
        textured_scene(make_cube(), random_texture(5, 3, Wrap::repeat, Filter::bilinear), 16, 14);
    std::vector<glm::vec2> texcoords = scene.meshes[0].mesh.texcoords;
    for (glm::vec2& uv : texcoords) uv = 0.5F * uv + glm::vec2(0.1F, 0.3F);
    Renderer ordinary(device), renderer(device);
    for (Renderer* const r : {&ordinary, &renderer}) r->set_scene(scene);
    ordinary.set_texcoords(0, texcoords);
    set_texcoords(renderer, 0, {caller.buffer(packed(std::span<const glm::vec2>(texcoords)))()});
    std::vector<Image> images;
    std::vector<AuxiliaryOutputs> outputs;
    for (Renderer* const r : {&ordinary, &renderer}) {
      r->forward();
      AttributeImages attribute(device, Attribute::texcoords);
      attribute.forward(*r);
      images.push_back(attribute.image());
      outputs.push_back(auxiliary_outputs(*r));
    }
    CHECK(dpr::test::pipeline::same_bits(images[1], images[0]));
    CHECK(outputs[1].uv == outputs[0].uv);
    Renderer before(device);
    before.set_scene(scene);
    before.forward();
    CHECK(auxiliary_outputs(before).uv != outputs[0].uv);
  }

  TEST_CASE("on device: gradients of a view's camera are those of its own kind") {
    const Caller caller;
    const Device device = adopt_device(caller.context(), caller.queue());
    Scene scene = cube_scene(16, 14);  // whose camera has a field of view
    scene.gradients.camera = true;
    View view{scene.camera, {scene.meshes[0].transform}};
    view.camera.intrinsics = Intrinsics{20.0F, 21.0F, 8.0F, 7.0F};
    Renderer renderer(device);
    renderer.set_scene(scene);
    renderer.set_views(std::span(&view, 1));
    renderer.forward();
    const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
    const SceneGradient expected = renderer.backward(std::span(&grad, 1));
    forward_on_device(renderer);
    backward_on_device(renderer, {caller.buffer(packed(std::span<const glm::vec4>(grad.pixels)))()});
    const char* const names[] = {"fx", "fy", "cx", "cy"};
    for (std::size_t k = 0; k < 4; ++k) {
      const std::string name = std::string("views[0].camera.intrinsics.") + names[k];
      const double wanted = expected.views[0].camera.intrinsics[k];
      CHECK(wanted != 0);
      CHECK(is_near(read_view(caller, gradient_view(renderer, name)), {static_cast<float>(wanted)}));
    }
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(renderer, "views[0].camera.fov_y_degrees"), "name");
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("on device: what cannot be used is refused when it is passed") {
    const Caller caller, stranger;
    const Scene scene = cube_scene(12, 10);
    const std::size_t vertices = scene.meshes[0].mesh.positions.size(), bytes = 12 * vertices;
    Renderer renderer(adopt_device(caller.context(), caller.queue()));
    const cl::Buffer buffer(caller.context, CL_MEM_READ_WRITE, bytes);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_positions(renderer, 0, {buffer()}), "no scene");
    renderer.set_scene(scene);
    const auto refuses = [&](const BufferSpan& span, const char* part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_positions(renderer, 0, span), part);
    };
    refuses({}, "positions: got no buffer");
    refuses({cl::Buffer(stranger.context, CL_MEM_READ_WRITE, bytes)()}, "another context");
    refuses({cl::Buffer(caller.context, CL_MEM_READ_WRITE, bytes - 4)()}, "room for");
    refuses({buffer(), 4}, "room for");
    refuses({buffer(), 0, 16}, "room for");
    refuses({buffer(), bytes + 4}, "room for");
    refuses({buffer(), std::size_t{1} << 34U}, "offset (positions)");
    refuses({buffer(), 2}, "offset (positions)");
    refuses({buffer(), 0, 13}, "stride (positions)");
    refuses({buffer(), 0, 8}, "at least 12");
    refuses({cl::Buffer(caller.context, CL_MEM_WRITE_ONLY, bytes)()}, "may only write");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_positions(renderer, 1, {buffer()}), "mesh");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_texels(renderer, 0, 0, {buffer()}), "texture");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_texcoords(renderer, 0, {buffer()}), "without textures");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_normals(renderer, 0, {buffer()}), "without normals");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_materials(renderer, 0, {buffer()}), "without materials");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, backward_on_device(renderer, {buffer()}), "forward() first");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, image_view(renderer), "forward() first");
    forward_on_device(renderer);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(renderer, "sigma"), "backward_on_device() first");
    backward_on_device(renderer, image_view(renderer).span());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(renderer, "meshes[1].positions"), "name");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(renderer, "lights.ambient"), "name");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(renderer, "shapes.positions"), "name");
    const cl::Buffer read_only(caller.context, CL_MEM_READ_ONLY, 16 * 12 * 10);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, copy_images(renderer, {read_only()}), "may only read");
    Scene lit = scene;
    lit.lights = two_lights(Shading::phong);
    Renderer with_lights(renderer.device());
    with_lights.set_scene(lit);
    set_view_matrices(with_lights, {caller.buffer(rows_of(lit.camera.view))()});
    forward_on_device(with_lights);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, backward_on_device(with_lights, image_view(with_lights).span()),
                          "set_views()");
    Scene white = scene;
    white.meshes[0].mesh.vertex_colors.clear();
    white.meshes[0].mesh.face_colors.clear();
    Renderer of_white(renderer.device());
    of_white.set_scene(white);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, set_colors(of_white, 0, {buffer()}), "without colours");
    forward_on_device(of_white);
    backward_on_device(of_white, image_view(of_white).span());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(of_white, "meshes[0].colors"), "name");
    const cl_event none = nullptr;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, forward_on_device(renderer, {.wait = {&none, 1}}), "wait[0]");
    const cl::UserEvent foreign(stranger.context);
    const cl_event handle = foreign();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, forward_on_device(renderer, {.wait = {&handle, 1}}),
                          "another context");
  }

  TEST_CASE("on device: gradients of another request or pass are not given") {
    const Caller caller;
    Scene scene = cube_scene(12, 10);
    scene.gradients.smoothing = false;
    Renderer renderer(adopt_device(caller.context(), caller.queue()));
    renderer.set_scene(scene);
    forward_on_device(renderer);
    backward_on_device(renderer, image_view(renderer).span());
    CHECK(gradient_view(renderer, "meshes[0].positions").count == scene.meshes[0].mesh.positions.size());
    scene.gradients.smoothing = true;
    renderer.set_gradients(scene.gradients);
    for (const char* const name : {"sigma", "meshes[0].positions"})
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(renderer, name), "backward_on_device() first");
    backward_on_device(renderer, image_view(renderer).span());
    CHECK(gradient_view(renderer, "sigma").count == 1);
    const Image grad = random_image(scene.width, scene.height, -1.0F, 1.0F);
    renderer.backward(std::span(&grad, 1));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, gradient_view(renderer, "sigma"), "backward_on_device() first");
    backward_on_device(renderer, image_view(renderer).span());
    CHECK(gradient_view(renderer, "sigma").count == 1);
  }

  TEST_CASE("on device: room that cannot be counted is refused") {
    constexpr std::size_t k_most = 3435973832, k_wraps = std::numeric_limits<std::size_t>::max() / 5 * 4 + 8;
    const Caller caller;
    Device device = adopt_device(caller.context(), caller.queue());
    device.set_memory_budget(std::size_t{1} << 30U);
    Renderer fresh(device), renderer(device);
    for (Renderer* const r : {&fresh, &renderer}) r->set_scene(cube_scene(12, 10));
    for (const std::size_t count : {k_most + 1, k_wraps, std::numeric_limits<std::size_t>::max()}) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, reserve(renderer, {.pairs = count}), "pairs (reserve)");
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, reserve(renderer, {.fragments = count}), "fragments (reserve)");
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, reserve(renderer, {.contours = count}), "at most 3435973832");
    }
    reserve(renderer, {.fragments = k_most});  // beyond the budget: the frame is measured
    fresh.forward();
    forward_on_device(renderer);
    CHECK(dpr::test::pipeline::same_bits(read_image(caller, renderer), fresh.image()));
  }
}

}  // namespace on_device_test
