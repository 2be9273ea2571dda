#include "cli/scene_file.hpp"

#include <type_traits>

#include "scene/light_table.hpp"
#include "scene/scene_parts.hpp"
#include "smoothing/choice_names.hpp"

namespace dpr::cli {
namespace {

Json to_list(const glm::vec3& v) { return Json::array({number(v.x), number(v.y), number(v.z)}); }

Json rows(const glm::mat4& matrix) {
  glm::dmat4 numbers;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) numbers[column][row] = number(matrix[column][row]);
  }
  return rows_to_json(numbers);
}

template <typename Light>
Json light_to_json(const Light& light) {
  Json json;
  LightKind<Light>::for_each_member([&](std::string_view key, auto member, auto...) {
    if constexpr (std::is_same_v<std::decay_t<decltype(light.*member)>, float>) {
      json[std::string(key)] = number(light.*member);
    } else {
      json[std::string(key)] = to_list(light.*member);
    }
  });
  return json;
}

Json lights_to_json(const Lights& lights) {
  Json json{{"ambient", to_list(lights.ambient)},
            {"shininess", number(lights.shininess)},
            {"shading", k_shadings[static_cast<std::size_t>(lights.shading)]}};
  if (!lights.harmonics.empty()) json["harmonics"] = to_json(lights.harmonics);
  for_each_light_kind([&](auto kind) {
    for (const auto& light : lights.*kind.lights) json[std::string(kind.key)].push_back(light_to_json(light));
  });
  return json;
}

/// Every member, so that no default of a later version changes the scene.
Json all_of_smoothing(const Smoothing& s) {
  Json json{{"noise", to_string(s.noise)},
            {"occupancy_prior", to_string(s.occupancy_prior)},
            {"depth_prior", to_string(s.depth_prior)},
            {"sigma", number(s.sigma)},
            {"gamma", number(s.gamma)},
            {"alpha", number(s.alpha)},
            {"composition", to_string(s.composition)},
            {"occupancy_estimator", to_string(s.occupancy_estimator)},
            {"aggregation_estimator", to_string(s.aggregation_estimator)},
            {"samples", s.samples},
            {"variance_reduction", to_string(s.variance_reduction)},
            {"draws", to_string(s.draws)},
            {"seed", s.seed},
            {"occupancy_threshold", number(s.occupancy_threshold)},
            {"background_depth", number(s.background_depth)},
            {"distance", to_string(s.distance)},
            {"occupancy_width", to_string(s.occupancy_width)},
            {"supersampling", s.supersampling}};
  if (s.blur_radius) json["blur_radius"] = number(*s.blur_radius);
  return json;
}

}  // namespace

Json camera_with_view(const Camera& camera) {
  Json json{{"view", rows(camera.view)}};
  json.update(camera_to_json(camera));
  return json;
}

Json scene_without_smoothing(const Scene& scene, const std::vector<std::string>& files) {
  Json meshes = Json::array();
  for (std::size_t i = 0; i < scene.meshes.size(); ++i)
    meshes.push_back({{"file", files.at(i)}, {"transform", rows(scene.meshes[i].transform)}});
  Json json{{"width", scene.width},
            {"height", scene.height},
            {"camera", camera_with_view(scene.camera)},
            {"background", to_list(scene.background)},
            {"meshes", meshes},
            {"cull", k_culls[static_cast<std::size_t>(scene.cull)]},
            {"perspective_correct", scene.perspective_correct}};
  if (scene.lights) json["lights"] = lights_to_json(*scene.lights);
  return json;
}

void write_scene(const std::filesystem::path& file, const Scene& scene, std::vector<std::string> files) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::absolute(file).parent_path();
  for (std::string& mesh : files) mesh = fs::proximate(mesh, folder).string();
  Json json = scene_without_smoothing(scene, files);
  json["smoothing"] = all_of_smoothing(scene.smoothing);
  write_json(file, json);
}

}  // namespace dpr::cli
