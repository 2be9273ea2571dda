// Auxiliary outputs on the host.
#include "dpr/aov.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "base/name_list.hpp"
#include "renderer/attribute_values.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr {
namespace {

constexpr std::array<std::string_view, 6> k_names{"depth",        "normal", "face_id",
                                                  "barycentrics", "uv",     "effective_faces"};

/// Texture coordinates of the faces' corners, the meshes of the scene joined; empty if one has none.
std::vector<std::array<glm::vec2, 3>> corner_texcoords(const Scene& scene) {
  std::vector<std::array<glm::vec2, 3>> corners;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    if (mesh.face_texcoords.empty()) return {};
    for (const glm::uvec3& f : mesh.face_texcoords) {
      corners.push_back({mesh.texcoords[f.x], mesh.texcoords[f.y], mesh.texcoords[f.z]});
    }
  }
  return corners;
}

}  // namespace

std::string_view to_string(Aov aov) { return k_names[static_cast<std::size_t>(aov)]; }

Aov parse_aov(std::string_view word, std::string_view where) {
  return static_cast<Aov>(position_of(word, k_names, std::string(where)));
}

void Renderer::Impl::render_aov() {
  if (aov && aov_frame == frame_number) return;
  if (!aov) aov.emplace(device.impl());
  for (const Band& band : bands) {
    if (bands.size() > 1) render(band);  // other bands' fragments have replaced its own
    aov->forward(aggregate_inputs(), *geometry, transform, aggregate);
  }
  if (pixel_noise) {
    Buffer<cl_float4> surface, coverage;
    aov->weigh(frame, aggregate, surface, coverage);
    pixel_noise->smooth(contour_inputs(), surface, image_size(), aov_surface);
    pixel_noise->smooth(contour_inputs(), coverage, image_size(), aov_coverage);
  }
  aov_frame = frame_number;
}

namespace {

/// A pixel of the auxiliary outputs, but for its texture coordinates.
struct AovPixel {
  float depth, effective_faces;
  glm::vec3 normal;
  cl_uint face;
  float bary1, bary2;
};

/// What the stage left of the samples of a view.
std::vector<AovPixel> read_samples(const Renderer::Impl& m, std::size_t view) {
  const std::size_t count = std::size_t{m.frame.width} * m.frame.height;
  const auto channel = [&](std::size_t index) {
    std::vector<float> values(count);
    m.aov->outputs.download(values, (index * m.views.size() + view) * count);
    return values;
  };
  const std::vector<float> depth = channel(DPR_AUXILIARY_DEPTH),
                           effective_faces = channel(DPR_AUXILIARY_EFFECTIVE_FACES),
                           x = channel(DPR_AUXILIARY_NORMAL), y = channel(DPR_AUXILIARY_NORMAL + 1),
                           z = channel(DPR_AUXILIARY_NORMAL + 2), b1 = channel(DPR_AUXILIARY_BARYCENTRICS),
                           b2 = channel(DPR_AUXILIARY_BARYCENTRICS + 1);
  std::vector<cl_uint> faces(count);
  m.aov->face_id.download(faces, view * count);
  std::vector<AovPixel> samples;
  samples.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    samples.push_back({depth[i], effective_faces[i], {x[i], y[i], z[i]}, faces[i], b1[i], b2[i]});
  }
  return samples;
}

/// With noise on the pixel: face and barycentrics are those of the sample at the pixel's centre or, of an
/// even number, behind it; the rest is the mean over what covers the pixel.
std::vector<AovPixel> to_pixels(const Renderer::Impl& m, std::size_t view,
                                const std::vector<AovPixel>& samples) {
  const auto width = static_cast<std::size_t>(m.scene.width),
             height = static_cast<std::size_t>(m.scene.height);
  const auto step = static_cast<std::size_t>(m.raster.supersampling),
             margin = static_cast<std::size_t>(m.raster.margin);
  std::vector<cl_float4> surface(width * height), coverage(width * height);
  m.aov_surface.download(surface, view * width * height);
  m.aov_coverage.download(coverage, view * width * height);
  std::vector<AovPixel> pixels;
  pixels.reserve(width * height);
  for (std::size_t i = 0; i < width * height; ++i) {
    const std::size_t row = margin + i / width * step + step / 2,
                      column = margin + i % width * step + step / 2;
    AovPixel pixel = samples[row * m.frame.width + column];
    const cl_float4& s = surface[i];
    const float covered = coverage[i].s[0], scale = covered > 0 ? 1 / covered : 0;
    const glm::vec3 normal(s.s[1], s.s[2], s.s[3]);
    const float length = glm::length(normal);
    pixel.depth = s.s[0] * scale;
    pixel.effective_faces = coverage[i].s[1] * scale;
    pixel.normal = length > 0 ? normal / length : glm::vec3(0);
    pixels.push_back(pixel);
  }
  return pixels;
}

}  // namespace

AuxiliaryOutputs auxiliary_outputs(Renderer& renderer, std::size_t view) {
  Renderer::Impl& m = renderer.impl();
  m.require_forward("auxiliary_outputs");
  if (view >= m.views.size()) {
    throw InvalidArgument("view", std::to_string(view), "below " + std::to_string(m.views.size()));
  }
  m.render_aov();
  AuxiliaryOutputs result;
  result.width = m.scene.width;
  result.height = m.scene.height;
  std::vector<AovPixel> pixels = read_samples(m, view);
  if (m.pixel_noise) pixels = to_pixels(m, view, pixels);
  const std::vector<std::array<glm::vec2, 3>> texcoords = corner_texcoords(texcoords_in_force(m));
  for (const AovPixel& pixel : pixels) {
    const bool shows_face = pixel.face != DPR_NO_FACE;
    result.depth.push_back(pixel.depth);
    result.effective_faces.push_back(pixel.effective_faces);
    result.normal.push_back(pixel.normal);
    result.face_id.push_back(shows_face ? static_cast<std::int32_t>(pixel.face) : -1);
    const glm::vec3 b =
        shows_face ? glm::vec3(1 - pixel.bary1 - pixel.bary2, pixel.bary1, pixel.bary2) : glm::vec3(0);
    result.barycentrics.push_back(glm::max(b, glm::vec3(0)));
    if (texcoords.empty()) continue;
    const auto corners = shows_face ? texcoords[pixel.face] : std::array<glm::vec2, 3>{};
    result.uv.push_back(b.x * corners[0] + b.y * corners[1] + b.z * corners[2]);
  }
  return result;
}

Image aov_image(const AuxiliaryOutputs& outputs, Aov aov) {
  if (aov == Aov::uv && outputs.uv.empty()) {
    throw InvalidArgument("uv (auxiliary outputs)", "a mesh without texture coordinates",
                          "texture coordinates on all meshes, as an OBJ file with vt has them");
  }
  Image image(outputs.width, outputs.height);
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
