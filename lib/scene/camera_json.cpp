// Cameras in the scene format.
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "scene/take_json.hpp"

namespace dpr {
namespace {

Distortion parse_distortion(const JsonNode& node) {
  const std::vector<JsonNode> k = node.elements(5);
  return {k[0].number(), k[1].number(), k[2].number(), k[3].number(), k[4].number()};
}

Distortion parse_fisheye(const JsonNode& node) {
  const std::vector<JsonNode> k = node.elements(4);
  return fisheye(k[0].number(), k[1].number(), k[2].number(), k[3].number());
}

/// "orthographic" or "perspective", and what belongs to it.
void take_projection(const JsonNode& node, Camera& camera) {
  enum class Kind { perspective, orthographic } kind{};
  constexpr std::array<std::string_view, 2> k_kinds{"perspective", "orthographic"};
  take_word(node, "projection", kind, k_kinds);
  if (kind == Kind::perspective) {
    if (node.find("orthographic_height"))
      node.fail("orthographic_height without orthographic projection", "\"projection\": \"orthographic\"");
    return;
  }
  camera.orthographic_height = node.at("orthographic_height").number();
  for (const char* const key : {"fov_y_degrees", "intrinsics", "distortion", "fisheye"}) {
    if (node.find(key)) node.fail(std::string(key) + " and an orthographic projection", "one of the two");
  }
}

}  // namespace

Camera parse_camera(const JsonNode& node) {
  node.require_keys({"view", "fov_y_degrees", "intrinsics", "distortion", "fisheye", "projection",
                     "orthographic_height", "znear", "zfar"});
  Camera camera;
  take(node, "view", camera.view, [](const JsonNode& n) { return n.mat4(); });
  take_number(node, "fov_y_degrees", camera.fov_y_degrees);
  take_number(node, "znear", camera.znear);
  take_number(node, "zfar", camera.zfar);
  if (node.find("distortion") && node.find("fisheye")) node.fail("distortion and fisheye", "one of the two");
  take(node, "distortion", camera.distortion, parse_distortion);
  take(node, "fisheye", camera.distortion, parse_fisheye);
  take_projection(node, camera);
  const auto intrinsics = node.find("intrinsics");
  if (!intrinsics) return camera;
  if (node.find("fov_y_degrees")) node.fail("fov_y_degrees and intrinsics", "one of the two");
  intrinsics->require_keys({"fx", "fy", "cx", "cy"});
  camera.intrinsics = Intrinsics{intrinsics->at("fx").number(), intrinsics->at("fy").number(),
                                 intrinsics->at("cx").number(), intrinsics->at("cy").number()};
  return camera;
}

}  // namespace dpr
