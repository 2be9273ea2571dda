// Validity of a scene.
#include "dpr/scene.hpp"

#include <string>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "scene/scene_parts.hpp"
#include "scene/see_through.hpp"

namespace dpr {
namespace {

void validate_side(int value, const std::string& argument) {
  if (value >= 1 && value <= checks::k_largest_side) return;
  throw InvalidArgument(argument, std::to_string(value),
                        "1 to " + std::to_string(checks::k_largest_side) + " pixels");
}

void validate_instance(const Scene& scene, std::size_t i, const std::string& name) {
  require_source(scene.meshes, i, *scene.meshes[i].instance_of, checks::in("instance_of", name));
  const Mesh& mesh = scene.meshes[i].mesh;
  if (!mesh.positions.empty() || !mesh.faces.empty())
    throw InvalidArgument(name, "a mesh of its own and instance_of", "one of the two");
}

}  // namespace

View own_view(const Scene& scene) {
  View view{scene.camera, {}};
  for (const Instance& entry : scene.meshes) view.transforms.push_back(entry.transform);
  return view;
}

void require_source(std::span<const Instance> meshes, std::size_t i, std::size_t source,
                    const std::string& argument) {
  const auto fault = [&]() -> std::string {
    if (source >= meshes.size()) return "where there are " + std::to_string(meshes.size()) + " meshes";
    if (source == i) return "which is the instance itself";
    if (source > i) return "a later mesh";
    if (meshes[source].instance_of)
      return "itself an instance of " + std::to_string(*meshes[source].instance_of);
    return "";
  }();
  if (fault.empty()) return;
  throw InvalidArgument(argument, std::to_string(source) + ", " + fault,
                        "the number of an earlier mesh, from 0 on, that is no instance");
}

Cull parse_cull(std::string_view word, std::string_view where) {
  return static_cast<Cull>(position_of(word, k_culls, std::string(where)));
}

void validate(const Scene& scene) {
  validate_side(scene.width, "width (scene)");
  validate_side(scene.height, "height (scene)");
  validate(scene.camera);
  checks::require_enumerator(scene.cull, Cull::front, "cull (scene)");
  checks::require_finite(scene.background, "background (scene)");
  if (scene.meshes.empty()) throw InvalidArgument("meshes (scene)", "none", "at least one");
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    const std::string name = checks::element("meshes", i);
    if (scene.meshes[i].instance_of) {
      validate_instance(scene, i, name);
    } else {
      validate(scene.meshes[i].mesh, name);
    }
    checks::require_affine(scene.meshes[i].transform, checks::in("transform", name));
  }
  if (scene.lights) validate(*scene.lights);
  validate(scene.smoothing);
  if (is_see_through(scene)) require_sees_through(scene.smoothing);
}

}  // namespace dpr
