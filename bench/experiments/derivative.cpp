// The README's picture: an image, its derivative with respect to a turn, and the gradient of a loss with
// respect to the surface.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <map>
#include <utility>
#include <vector>

#include "dpr/dpr.hpp"
#include "experiment.hpp"
#include "mesh/bounding_box.hpp"

namespace dpr::experiments {
namespace {

constexpr float k_azimuth_degrees = 36, k_target_degrees = 12;  // the target is turned by so much
constexpr float k_half_step_degrees = 0.1F;                     // of the central difference
constexpr float k_blur_pixels = 0.5F;
constexpr std::size_t k_subdivisions = 2;

/// Loop's subdivision of a closed mesh (Loop 1987): four faces for each. Texture coordinates are interpolated.
Mesh subdivided_smoothly(const Mesh& mesh) {
  using Edge = std::pair<std::uint32_t, std::uint32_t>;
  struct NewVertex {
    std::uint32_t index;
    glm::vec3 across{0.0F};  // sum of the two corners opposite the edge
  };
  const std::size_t count = mesh.positions.size();
  std::map<Edge, NewVertex> edges;
  const auto edge_of = [](std::uint32_t a, std::uint32_t b) { return Edge(std::min(a, b), std::max(a, b)); };
  std::vector<glm::vec3> neighbours(count, glm::vec3(0));
  std::vector<float> valence(count, 0);
  for (const uvec3& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t a = face[k], b = face[(k + 1) % 3];
      const auto index = static_cast<std::uint32_t>(count + edges.size());
      edges.try_emplace(edge_of(a, b), NewVertex{index}).first->second.across +=
          mesh.positions[face[(k + 2) % 3]];
      neighbours[a] += mesh.positions[b];
      ++valence[a];
    }
  }
  Mesh result;
  result.textures = mesh.textures;
  for (std::size_t v = 0; v < count; ++v) {
    const float c = 0.375F + 0.25F * std::cos(glm::two_pi<float>() / valence[v]);
    const float weight = (0.625F - c * c) / valence[v];
    result.positions.push_back((1 - weight * valence[v]) * mesh.positions[v] + weight * neighbours[v]);
  }
  result.positions.resize(count + edges.size());
  for (const auto& [edge, vertex] : edges) {
    result.positions[vertex.index] =
        0.375F * (mesh.positions[edge.first] + mesh.positions[edge.second]) + 0.125F * vertex.across;
  }
  const auto add_faces = [](std::vector<uvec3>& faces, const uvec3& corner, const uvec3& middle) {
    for (int k = 0; k < 3; ++k) faces.emplace_back(corner[k], middle[k], middle[(k + 2) % 3]);
    faces.push_back(middle);
  };
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const uvec3 face = mesh.faces[f];
    uvec3 middle, texcoord, middle_texcoord;
    for (int k = 0; k < 3; ++k) {
      const glm::vec2 at = mesh.texcoords[mesh.face_texcoords[f][k]];
      middle[k] = edges.at(edge_of(face[k], face[(k + 1) % 3])).index;
      texcoord[k] = static_cast<std::uint32_t>(result.texcoords.size());
      middle_texcoord[k] = texcoord[k] + 1;
      result.texcoords.push_back(at);
      result.texcoords.push_back(0.5F * (at + mesh.texcoords[mesh.face_texcoords[f][(k + 1) % 3]]));
    }
    add_faces(result.faces, face, middle);
    add_faces(result.face_texcoords, texcoord, middle_texcoord);
  }
  return result;
}

Scene make_scene(int side) {
  const std::filesystem::path folder = DPR_BENCH_DATA;
  Scene scene;
  scene.width = scene.height = side;
  scene.background = glm::vec3(1);
  Mesh mesh = read_mesh(folder / "spot_control_mesh.obj");
  mesh.textures[0].filter = Filter::trilinear;
  for (std::size_t i = 0; i < k_subdivisions; ++i) mesh = subdivided_smoothly(mesh);
  const glm::vec3 middle = center(bounding_box(mesh.positions));
  for (glm::vec3& p : mesh.positions) p -= middle;
  scene.meshes.push_back({.mesh = std::move(mesh)});
  scene.camera = orbit_camera(/*distance*/ 3.1F, /*elevation*/ 14.0F, /*azimuth*/ 180 + k_azimuth_degrees);
  scene.camera.fov_y_degrees = 36;
  const glm::vec3 eye = glm::vec3(glm::inverse(glm::mat4(scene.camera.view))[3]);
  scene.lights = Lights{.ambient = glm::vec3(0.35F),
                        .point = {{.position = 2.0F * eye + glm::vec3(-3, 4, 1),
                                   .diffuse = glm::vec3(0.6F),
                                   .specular = glm::vec3(0.08F)}},
                        .shininess = 24};
  const float pixel = 2.0F / static_cast<float>(side);  // NDC
  scene.smoothing.sigma = k_blur_pixels * k_blur_pixels * pixel * pixel;
  scene.smoothing.supersampling = 2;
  return scene;
}

glm::mat4 turned(float degrees) {
  return glm::rotate(glm::mat4(1), glm::radians(degrees), glm::vec3(0, 1, 0));
}

Image render(Renderer& renderer, const Scene& scene, float turn_degrees) {
  const View view{scene.camera, {turned(turn_degrees)}};
  renderer.set_views({&view, 1});
  renderer.forward();
  return renderer.image();
}

/// White at 0, red above, blue below, saturated at +-1.
glm::vec3 diverging(float value) {
  const float strength = std::min(std::abs(value), 1.0F);
  return glm::mix(glm::vec3(1), value > 0 ? glm::vec3(0.75F, 0.02F, 0.05F) : glm::vec3(0.02F, 0.12F, 0.7F),
                  strength);
}

/// The value below which this part of the magnitudes lies.
float quantile(std::vector<float> values, double part) {
  for (float& value : values) value = std::abs(value);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return std::max(*at, 1e-30F);
}

Image draw_signed(const Image& derivative) {
  std::vector<float> values, seen;
  for (const glm::vec4& d : derivative.pixels) values.push_back((d.r + d.g + d.b) / 3);
  std::ranges::copy_if(values, std::back_inserter(seen), [](float v) { return v != 0; });
  const float full = quantile(seen, 0.97);
  Image image = derivative;
  for (std::size_t i = 0; i < values.size(); ++i) image.pixels[i] = glm::vec4(diverging(values[i] / full), 1);
  return image;
}

/// The mesh with colours for the derivative of the loss by a motion of each vertex along its normal, per area.
Mesh coloured_by_gradient(const Mesh& mesh, const std::vector<vec3>& gradient) {
  std::vector<glm::vec3> normals(mesh.positions.size(), glm::vec3(0));  // times twice the faces' area
  for (const uvec3& face : mesh.faces) {
    const glm::vec3 a = mesh.positions[face.x];
    const glm::vec3 normal = glm::cross(mesh.positions[face.y] - a, mesh.positions[face.z] - a);
    for (int k = 0; k < 3; ++k) normals[face[k]] += normal;
  }
  std::vector<float> values;
  for (std::size_t v = 0; v < normals.size(); ++v) {
    const float area = glm::length(normals[v]);
    values.push_back(area > 0 ? -glm::dot(gradient[v], normals[v]) / (area * area) : 0);
  }
  const float full = quantile(values, 0.92);
  Mesh result;
  result.positions = mesh.positions;
  result.faces = mesh.faces;
  for (const float value : values) result.vertex_colors.push_back(diverging(value / full));
  return result;
}

}  // namespace

void run_derivative(const Settings& settings) {
  Scene scene = make_scene(settings.smoke ? 48 : 440);
  Renderer renderer(settings.device);
  renderer.set_scene(scene);
  const Image before = render(renderer, scene, -k_half_step_degrees);
  const Image after = render(renderer, scene, k_half_step_degrees);
  const Image target = render(renderer, scene, k_target_degrees);
  const Image image = render(renderer, scene, 0);

  // The derivative of every pixel by the angle, and the same along one direction in the space of images by a
  // backward pass: the sum of its squares is the gradient of a loss whose gradient by the image it is.
  Image derivative = image;
  double squares = 0;
  for (std::size_t i = 0; i < derivative.pixels.size(); ++i) {
    glm::vec4& d = derivative.pixels[i];
    d = (after.pixels[i] - before.pixels[i]) / glm::radians(2 * k_half_step_degrees);
    d.a = 0;
    squares += static_cast<double>(glm::dot(d, d));
  }
  const double by_backward = renderer.backward({&derivative, 1}).views[0].transforms[0].rotation.y;
  if (!settings.quiet)
    std::printf("along the derivative: %.6g by differences, %.6g by the backward pass\n", squares,
                by_backward);

  ImageLoss loss(settings.device, LossWeights::only(LossKind::mse), {&target, 1});
  const double value = loss.evaluate(renderer);
  const SceneGradient gradient = renderer.backward(loss);
  Scene coloured = scene;
  coloured.meshes[0].mesh = coloured_by_gradient(scene.meshes[0].mesh, gradient.meshes[0].positions);
  renderer.set_scene(coloured);
  const Image surface = render(renderer, coloured, 0);

  write_data(settings, "derivative",
             {{"pixels", scene.width},
              {"triangles", scene.meshes[0].mesh.faces.size()},
              {"half_step_degrees", cli::number(k_half_step_degrees)},
              {"along_derivative_by_differences", squares},
              {"along_derivative_by_backward", by_backward},
              {"target_degrees", cli::number(k_target_degrees)},
              {"loss", value}});
  write_image(settings.folder / "derivative.png",
              opaque(hstack({image, draw_signed(derivative), surface}, 0)));
  announce(settings, "derivative.png");
}

}  // namespace dpr::experiments
