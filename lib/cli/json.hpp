// JSON files as the commands write them.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <nlohmann/json.hpp>
#include <vector>

#include "dpr/camera.hpp"
#include "dpr/light.hpp"

namespace dpr::cli {

/// Keys in the order in which they were added.
using Json = nlohmann::ordered_json;

/// The number whose shortest decimal form is that of the float: 0.001, not 0.0010000000474974513.
double number(float value);

Json to_json(const glm::dvec3& v);
Json to_json(const std::vector<glm::vec3>& vectors);
Json to_json(const std::vector<glm::vec2>& vectors);
Json to_json(const std::vector<double>& numbers);
Json to_json(const std::vector<float>& numbers);
template <class Element>
Json to_json(const std::vector<std::vector<Element>>& lists) {
  Json json = Json::array();
  for (const std::vector<Element>& list : lists) json.push_back(to_json(list));
  return json;
}
/// Adds a distant light that was found: its "harmonics", and "lights" as a scene takes them.
void add_found_light(Json& json, const Lights& light);
/// A list of rows.
Json rows_to_json(const glm::dmat3& matrix);
Json rows_to_json(const glm::dmat4& matrix);

/// As scenes have it, without its view.
Json camera_to_json(const Camera& camera);
/// Adds the coefficients of a camera's lens, if it has one, as scenes have them.
void add_lens(Json& json, const Camera& camera);

/// Objects and lists of lists over several lines, lists of numbers on one.
std::string to_text(const Json& json);
/// On one line, and safe within a script element of a page: no text in it ends the element.
std::string script_safe(const Json& json);
/// Writes all or nothing. Throws IoError.
void write_json(const std::filesystem::path& file, const Json& json);

}  // namespace dpr::cli
