#include "cli/pose_bodies.hpp"

#include <set>

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

std::vector<std::vector<std::size_t>> parse_bodies(const std::vector<std::string>& texts,
                                                   const Scene& scene) {
  if (texts.empty() && scene.meshes.size() > 1) refuse("none", scene);
  if (texts.empty()) return {{0}};
  std::vector<std::vector<std::size_t>> bodies;
  std::set<std::size_t> known;
  for (const std::string& text : texts) {
    std::vector<std::size_t>& body = bodies.emplace_back();
    for (const std::string& item : split_list(text)) {
      const char* const end = item.data() + item.size();
      std::size_t mesh = 0;
      const bool is_number = !item.empty() && from_chars(item.data(), end, mesh).ptr == end;
      if (!is_number || mesh >= scene.meshes.size() || !known.insert(mesh).second)
        refuse("\"" + text + "\"", scene);
      body.push_back(mesh);
    }
    if (body.empty()) refuse("\"\"", scene);
  }
  return bodies;
}

}  // namespace dpr::cli
