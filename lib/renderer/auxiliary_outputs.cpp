// Auxiliary outputs on the host.
#include "dpr/aov.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "renderer/renderer_impl.hpp"

namespace dpr {
namespace {

constexpr std::array<std::string_view, 6> k_names{"depth",        "normal", "face_id",
                                                  "barycentrics", "uv",     "effective_faces"};

/// Texture coordinates of the faces' corners, the meshes of the scene joined; empty if one has none.
std::vector<std::array<glm::vec2, 3>> corner_texcoords(const Scene& scene) {
  std::vector<std::array<glm::vec2, 3>> corners;
  for (const Instance& instance : scene.meshes) {
    const Mesh& mesh = instance.mesh;
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
  const auto* const found = std::ranges::find(k_names, word);
  if (found != k_names.end()) return static_cast<Aov>(found - k_names.begin());
  throw InvalidArgument(std::string(where), "\"" + std::string(word) + "\"",
                        "depth, normal, face_id, barycentrics, uv or effective_faces");
}

void Renderer::Impl::render_aov() {
  if (aov && aov_frame == frame_number) return;
  if (!aov) aov.emplace(device.impl());
  for (const Band& band : bands) {
    if (bands.size() > 1) render(band);  // its fragments have made room for other bands'
    aov->forward(aggregate_inputs(), *geometry, transform, aggregate);
  }
  aov_frame = frame_number;
}

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
  const std::size_t count = std::size_t{m.frame.width} * m.frame.height;
  const auto channel = [&](std::size_t index) {
    std::vector<float> values(count);
    m.aov->outputs.download(values, (index * m.views.size() + view) * count);
    return values;
  };
  result.depth = channel(DPR_AUXILIARY_DEPTH);
  result.effective_faces = channel(DPR_AUXILIARY_EFFECTIVE_FACES);
  const std::vector<float> x = channel(DPR_AUXILIARY_NORMAL), y = channel(DPR_AUXILIARY_NORMAL + 1),
                           z = channel(DPR_AUXILIARY_NORMAL + 2), b1 = channel(DPR_AUXILIARY_BARYCENTRICS),
                           b2 = channel(DPR_AUXILIARY_BARYCENTRICS + 1);
  std::vector<cl_uint> faces(count);
  m.aov->face_id.download(faces, view * count);
  const std::vector<std::array<glm::vec2, 3>> texcoords = corner_texcoords(m.scene);
  for (std::size_t i = 0; i < count; ++i) {
    const bool shows_face = faces[i] != DPR_NO_FACE;
    result.normal.emplace_back(x[i], y[i], z[i]);
    result.face_id.push_back(shows_face ? static_cast<std::int32_t>(faces[i]) : -1);
    const glm::vec3 b = shows_face ? glm::vec3(1 - b1[i] - b2[i], b1[i], b2[i]) : glm::vec3(0);
    result.barycentrics.push_back(glm::max(b, glm::vec3(0)));
    if (texcoords.empty()) continue;
    const auto corners = shows_face ? texcoords[faces[i]] : std::array<glm::vec2, 3>{};
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
