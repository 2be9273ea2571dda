#include "cli/moving_meshes.hpp"

#include "base/from_chars.hpp"
#include "base/name_list.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

[[noreturn]] void refuse(const std::string& got, const Scene& scene) {
  const std::string last = std::to_string(scene.meshes.size() - 1);
  throw InvalidArgument("--mesh (command line)", got,
                        "numbers of the scene's meshes that move, from 0 to " + last + ", each once");
}

}  // namespace

PoseBodies parse_moving_meshes(const std::vector<std::string>& texts, const Scene& scene) {
  if (texts.empty() && scene.meshes.size() > 1) refuse("none", scene);
  if (texts.empty()) return {{}};
  PoseBodies bodies;
  std::vector<bool> is_named(scene.meshes.size());
  for (const std::string& text : texts) {
    std::vector<std::size_t>& meshes = bodies.emplace_back();
    for (const std::string& item : split_list(text)) {
      const char* const end = item.data() + item.size();
      std::size_t mesh = 0;
      const bool is_number = !item.empty() && from_chars(item.data(), end, mesh).ptr == end;
      if (!is_number || mesh >= scene.meshes.size() || is_named[mesh]) refuse("\"" + text + "\"", scene);
      is_named[mesh] = true;
      meshes.push_back(mesh);
    }
    if (meshes.empty()) refuse("\"" + text + "\"", scene);
  }
  return bodies;
}

}  // namespace dpr::cli
