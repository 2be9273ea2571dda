// Auxiliary outputs, on the device and on the host.
#include "dpr/aov.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <type_traits>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "renderer/on_device.hpp"

namespace dpr {
namespace {

constexpr std::array<std::string_view, 6> k_names{"depth",        "normal", "face_id",
                                                  "barycentrics", "uv",     "effective_faces"};

bool have_texcoords(const Scene& scene) {
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    if (mesh_of(scene, m).face_texcoords.empty()) return false;
  }
  return true;
}

InvalidArgument no_texcoords() {
  return {"uv (auxiliary outputs)", "a mesh without texture coordinates",
          "texture coordinates on all meshes, as an OBJ file with vt has them"};
}

}  // namespace

void require_shown(const Scene& scene, Aov aov) {
  if (aov == Aov::uv && !have_texcoords(scene)) throw no_texcoords();
}

std::string_view to_string(Aov aov) { return k_names[static_cast<std::size_t>(aov)]; }

Aov parse_aov(std::string_view word, std::string_view where) {
  return static_cast<Aov>(position_of(word, k_names, std::string(where)));
}

std::shared_ptr<CornerTexcoords> Renderer::Impl::corner_texcoords_in_force() {
  if (!corner_texcoords) corner_texcoords = std::make_shared<CornerTexcoords>(impl_of(device), scene);
  corner_texcoords->update(*geometry, made_exchange());
  return corner_texcoords;
}

void Renderer::Impl::render_aov() {
  if (aov && aov_frame == frame_number) return;
  require_whole();
  if (!aov) aov.emplace(impl_of(device));
  if (pixel_noise) see_layers(front_layers());
  for (const Band& band : bands) {
    if (bands.size() > 1) render(band);  // other bands' fragments have replaced its own
    aov->forward(aggregate_inputs(), *geometry, transform, aggregate);
  }
  aov_surface.resize(impl_of(device), 0);
  if (pixel_noise) {
    aov->weigh(frame, aggregate);
    pixel_noise->smooth(contour_inputs(), aov->surface, image_size(), aov_surface);
    pixel_noise->smooth(contour_inputs(), aov->coverage, image_size(), aov_coverage);
  }
  aov->finish(frame,
              {static_cast<std::size_t>(scene.width), static_cast<std::size_t>(scene.height),
               static_cast<std::size_t>(raster.supersampling), static_cast<std::size_t>(raster.margin)},
              aov_surface, aov_coverage, *corner_texcoords_in_force());
  aov_frame = frame_number;
}

AuxiliaryOutputs auxiliary_outputs(Renderer& renderer, std::size_t view) {
  Renderer::Impl& m = impl_of(renderer);
  m.require_forward("auxiliary_outputs");
  if (view >= m.views.size()) {
    throw InvalidArgument("view", std::to_string(view), "below " + std::to_string(m.views.size()));
  }
  m.render_aov();
  AuxiliaryOutputs result;
  result.width = m.scene.width;
  result.height = m.scene.height;
  const std::size_t count = static_cast<std::size_t>(result.width) * static_cast<std::size_t>(result.height);
  std::vector<cl_float4> normals(count), places(count);
  std::vector<cl_float2> uvs(m.corner_texcoords->empty() ? 0 : count);
  std::vector<cl_uint> faces(count);
  m.aov->normals.download(normals, view * count);
  m.aov->places.download(places, view * count);
  m.aov->uvs.download(uvs, view * count);
  m.aov->faces.download(faces, view * count);
  for (std::size_t i = 0; i < count; ++i) {
    const cl_float4 &normal = normals[i], &place = places[i];
    result.normal.emplace_back(normal.s[0], normal.s[1], normal.s[2]);
    result.depth.push_back(normal.s[3]);
    result.barycentrics.emplace_back(place.s[0], place.s[1], place.s[2]);
    result.effective_faces.push_back(place.s[3]);
  }
  for (const cl_uint face : faces)
    result.face_id.push_back(face == DPR_NO_FACE ? -1 : static_cast<std::int32_t>(face));
  for (const cl_float2& uv : uvs) result.uv.emplace_back(uv.s[0], uv.s[1]);
  return result;
}

BufferView aov_view(Renderer& renderer, Aov aov, const Events& events) {
  Renderer::Impl& m = impl_of(renderer);
  m.require_rendered("aov_view");
  require_shown(m.scene, aov);
  enqueue(impl_of(m.device), events, [&] { m.render_aov(); });
  const std::size_t count = m.image().size();
  const auto part = [&](const auto& buffer, std::size_t first, std::size_t components) {
    using Element = typename std::decay_t<decltype(buffer)>::Element;
    return BufferView{buffer.cl_buffer()(), first * sizeof(float), sizeof(Element), count, components};
  };
  switch (aov) {
    case Aov::depth:
      return part(m.aov->normals, 3, 1);
    case Aov::normal:
      return part(m.aov->normals, 0, 3);
    case Aov::face_id:
      return part(m.aov->faces, 0, 1);
    case Aov::barycentrics:
      return part(m.aov->places, 0, 3);
    case Aov::uv:
      return part(m.aov->uvs, 0, 2);
    case Aov::effective_faces:
      return part(m.aov->places, 3, 1);
  }
  throw InvalidArgument("aov (aov_view)", std::to_string(static_cast<int>(aov)), "an Aov");
}

void copy_aov(Renderer& renderer, Aov aov, const BufferSpan& outputs, const Events& events) {
  copy_view(impl_of(renderer), aov_view(renderer, aov, {.wait = events.wait}), outputs, {.done = events.done},
            "outputs");
}

Image aov_image(const AuxiliaryOutputs& outputs, Aov aov) {
  if (aov == Aov::uv && outputs.uv.empty()) throw no_texcoords();
  checks::require_enumerator(aov, Aov::effective_faces, "aov (aov_image)");
  Image image(outputs.width, outputs.height);
  const auto require_pixels = [&](std::size_t count) {
    if (count != image.pixels.size())
      throw InvalidArgument("outputs (aov_image)", std::to_string(count) + " pixels",
                            std::to_string(image.pixels.size()));
  };
  for (const std::size_t count : {outputs.depth.size(), outputs.normal.size(), outputs.face_id.size(),
                                  outputs.barycentrics.size(), outputs.effective_faces.size()})
    require_pixels(count);
  if (!outputs.uv.empty()) require_pixels(outputs.uv.size());
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const auto value = [&]() -> glm::vec3 {
      switch (aov) {
        case Aov::depth:
          return glm::vec3(outputs.depth[i]);
        case Aov::normal:
          return outputs.normal[i];
        case Aov::face_id:
          return glm::vec3(static_cast<float>(outputs.face_id[i]));
        case Aov::barycentrics:
          return outputs.barycentrics[i];
        case Aov::uv:
          return {outputs.uv[i], 0};
        case Aov::effective_faces:
          return glm::vec3(outputs.effective_faces[i]);
      }
      return glm::vec3(0);
    };
    image.pixels[i] = glm::vec4(value(), outputs.face_id[i] >= 0 ? 1 : 0);
  }
  return image;
}

}  // namespace dpr
