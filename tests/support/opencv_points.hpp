// Cameras and points that OpenCV projected: tests/data/opencv.
#pragma once

#include <fstream>
#include <glm/glm.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dpr/camera.hpp"
#include "dpr/pose.hpp"
#include "support/data.hpp"

namespace dpr::test {

/// A camera and what it sees.
struct OpencvCase {
  Camera camera;  ///< in the library's conventions
  std::vector<glm::vec3> points;
  std::vector<glm::dvec2> pixels;  ///< OpenCV's: a pixel's centre is at whole numbers
};

inline OpencvCase opencv_case(const nlohmann::json& json) {
  OpencvCase result;
  const bool is_fisheye = json.contains("fisheye");
  const auto k = json.at("camera_matrix").get<std::vector<float>>(),
             d = json.at(is_fisheye ? "fisheye" : "distortion").get<std::vector<float>>();
  const auto r = json.at("rotation_vector").get<std::vector<double>>(),
             t = json.at("translation").get<std::vector<double>>();
  glm::dmat4 view(rotation_from_vector({r[0], r[1], r[2]}));
  view[3] = glm::dvec4(t[0], t[1], t[2], 1);
  result.camera.view = from_opencv_view(glm::mat4(view));
  result.camera.intrinsics = from_opencv_intrinsics({k[0], k[1], k[2], k[3]});
  result.camera.distortion =
      is_fisheye ? fisheye(d[0], d[1], d[2], d[3]) : Distortion{d[0], d[1], d[2], d[3], d[4]};
  for (const auto& p : json.at("points").get<std::vector<std::vector<float>>>())
    result.points.emplace_back(p[0], p[1], p[2]);
  for (const auto& p : json.at("pixels").get<std::vector<std::vector<double>>>())
    result.pixels.emplace_back(p[0], p[1]);
  return result;
}

/// "lenses", "boards" or "fisheyes": project_points.py says what they are.
inline std::vector<OpencvCase> opencv_cases(const std::string& name) {
  std::ifstream file(data_folder() / "opencv/project_points.json");
  const nlohmann::json table = nlohmann::json::parse(file);
  std::vector<OpencvCase> cases;
  for (const auto& json : table.at(name)) cases.push_back(opencv_case(json));
  return cases;
}

}  // namespace dpr::test
