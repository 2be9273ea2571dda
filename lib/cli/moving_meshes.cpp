#include "cli/moving_meshes.hpp"

#include <algorithm>

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

std::vector<std::size_t> parse_moving_meshes(const std::string& text, const Scene& scene) {
  if (text.empty() && scene.meshes.size() > 1) refuse("none", scene);
  if (text.empty()) return {};
  std::vector<std::size_t> meshes;
  for (const std::string& item : split_list(text)) {
    const char* const end = item.data() + item.size();
    std::size_t mesh = 0;
    const bool is_number = !item.empty() && from_chars(item.data(), end, mesh).ptr == end;
    if (!is_number || mesh >= scene.meshes.size() || std::ranges::count(meshes, mesh) > 0)
      refuse("\"" + text + "\"", scene);
    meshes.push_back(mesh);
  }
  if (meshes.empty()) refuse("\"" + text + "\"", scene);
  return meshes;
}

}  // namespace dpr::cli
