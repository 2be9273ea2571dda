// JSON files as the commands write them.
#include "cli/json.hpp"

#include <charconv>

#include "base/from_chars.hpp"
#include "base/output_file.hpp"
#include "scene/lens.hpp"

namespace dpr::cli {
namespace {

bool is_flat(const Json& json) {
  for (const Json& element : json) {
    if (element.is_structured()) return false;
  }
  return true;
}

void append(std::string& out, const Json& json, std::size_t indent) {
  if (!json.is_structured() || is_flat(json)) {
    out += json.dump();
    return;
  }
  const std::string newline = "\n" + std::string(indent + 2, ' ');
  const bool is_object = json.is_object();
  out += is_object ? '{' : '[';
  for (auto it = json.begin(); it != json.end(); ++it) {
    if (it != json.begin()) out += ',';
    out += newline;
    if (is_object) out += Json(it.key()).dump() + ": ";
    append(out, *it, indent + 2);
  }
  out += "\n" + std::string(indent, ' ') + (is_object ? '}' : ']');
}

}  // namespace

double number(float value) {
  char text[64];
  const char* end = std::to_chars(text, text + sizeof text, value).ptr;
  double result = static_cast<double>(value);
  from_chars(text, end, result);
  return result;
}

Json to_json(const glm::dvec3& v) { return Json::array({v.x, v.y, v.z}); }

Json to_json(const std::vector<glm::vec3>& vectors) {
  Json list = Json::array();
  for (const glm::vec3& v : vectors) list.push_back(Json::array({number(v.x), number(v.y), number(v.z)}));
  return list;
}

Json to_json(const std::vector<glm::vec2>& vectors) {
  Json list = Json::array();
  for (const glm::vec2& v : vectors) list.push_back(Json::array({number(v.x), number(v.y)}));
  return list;
}

Json to_json(const std::vector<double>& numbers) { return numbers; }

Json to_json(const std::vector<float>& numbers) {
  Json list = Json::array();
  for (const float v : numbers) list.push_back(number(v));
  return list;
}

void add_found_light(Json& json, const Lights& light) {
  const Json harmonics = to_json(light.harmonics);
  json["harmonics"] = harmonics;
  json["lights"] = {{"ambient", to_json(glm::dvec3(light.ambient))}, {"harmonics", harmonics}};
}

Json rows_to_json(const glm::dmat3& matrix) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) {
    rows.push_back(Json::array({matrix[0][row], matrix[1][row], matrix[2][row]}));
  }
  return rows;
}

Json rows_to_json(const glm::dmat4& matrix) {
  Json rows = Json::array();
  for (int row = 0; row < 4; ++row) {
    rows.push_back(Json::array({matrix[0][row], matrix[1][row], matrix[2][row], matrix[3][row]}));
  }
  return rows;
}

Json camera_to_json(const Camera& camera) {
  Json json{{"znear", number(camera.znear)}, {"zfar", number(camera.zfar)}};
  if (const auto& k = camera.intrinsics) {
    json["intrinsics"] = {
        {"fx", number(k->fx)}, {"fy", number(k->fy)}, {"cx", number(k->cx)}, {"cy", number(k->cy)}};
  } else if (camera.orthographic_height) {
    json["projection"] = "orthographic";
    json["orthographic_height"] = number(*camera.orthographic_height);
  } else {
    json["fov_y_degrees"] = number(camera.fov_y_degrees);
  }
  add_lens(json, camera);
  return json;
}

void add_lens(Json& json, const Camera& camera) {
  if (!camera.distortion) return;
  Json& list = json[is_fisheye(camera) ? "fisheye" : "distortion"];
  for (const float coefficient : coefficients(*camera.distortion)) list.push_back(number(coefficient));
}

std::string to_text(const Json& json) {
  std::string text;
  append(text, json, 0);
  return text + "\n";
}

std::string script_safe(const Json& json) {
  std::string safe;
  for (const char c : json.dump(-1, ' ', false, Json::error_handler_t::replace))
    safe += c == '<' ? "\\u003c" : std::string(1, c);
  return safe;
}

void write_json(const std::filesystem::path& file, const Json& json) {
  write_whole_file(file, to_text(json));
}

}  // namespace dpr::cli
