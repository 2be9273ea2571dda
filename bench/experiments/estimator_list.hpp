// The estimators that the experiments compare, as words of a scene's "smoothing".
#pragma once

#include <optional>
#include <span>
#include <string>

#include "cli/json.hpp"
#include "dpr/smoothing.hpp"

namespace dpr::experiments {

using cli::Json;

struct Estimate {
  const char* name;
  const char* words;  ///< JSON: keys of a scene's "smoothing"
};

/// One line each; the first is what the others are compared with.
inline constexpr Estimate k_estimates[] = {
    {"none", R"({"variance_reduction": "none"})"},
    {"rigid", R"({"variance_reduction": "rigid"})"},
    {"leave_one_out", R"({"variance_reduction": "leave_one_out"})"},
    {"rigid, antithetic", R"({"variance_reduction": "rigid", "draws": "antithetic"})"},
    {"leave_one_out, antithetic", R"({"variance_reduction": "leave_one_out", "draws": "antithetic"})"},
    {"rigid, stratified", R"({"variance_reduction": "rigid", "draws": "stratified"})"},
};

/// `base`, a scene's "smoothing", with an estimate's words added. Nothing where the library has no such
/// estimator: `reason`, if given, then says why.
std::optional<Smoothing> smoothing_of(const Json& base, const Estimate& estimate,
                                      std::string* reason = nullptr);

}  // namespace dpr::experiments
