#include "estimator_list.hpp"

#include "dpr/error.hpp"
#include "scene/scene_json.hpp"

namespace dpr::experiments {

std::optional<Smoothing> smoothing_of(const Json& base, const Estimate& estimate, std::string* reason) {
  nlohmann::json words(base);
  words.update(nlohmann::json::parse(estimate.words));
  try {
    return resolve_smoothing(parse_smoothing(JsonNode(words, estimate.name)));
  } catch (const InvalidArgument& error) {
    if (reason != nullptr) *reason = error.what();
    return std::nullopt;
  }
}

}  // namespace dpr::experiments
