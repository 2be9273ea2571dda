#include "batch/render_settings.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/checks.hpp"
#include "base/from_chars.hpp"
#include "base/name_list.hpp"
#include "dpr/error.hpp"
#include "image/texture_words.hpp"
#include "renderer/depth_range.hpp"
#include "renderer/setter_checks.hpp"
#include "scene/light_table.hpp"
#include "scene/scene_parts.hpp"

namespace dpr::batch {
namespace {

int image_side(std::int64_t value, const char* name) {
  if (value >= 1 && value <= checks::k_largest_side) return static_cast<int>(value);
  throw InvalidArgument(std::string(name) + " (batch)", std::to_string(value),
                        "1 to " + std::to_string(checks::k_largest_side));
}

float number_of(const OptionValue& value, const std::string& name) {
  if (const auto* const whole = std::get_if<std::int64_t>(&value)) return static_cast<float>(*whole);
  if (const auto* const number = std::get_if<double>(&value)) return static_cast<float>(*number);
  throw InvalidArgument(name + " (batch)", "\"" + std::get<std::string>(value) + "\"", "a number");
}

/// Sets how lights shade; false for another name.
bool set_shading(Lights& lights, const std::string& name, const OptionValue& value) {
  if (name == "shininess") {
    lights.shininess = number_of(value, name);
    return true;
  }
  if (name != "shading") return false;
  const auto* const word = std::get_if<std::string>(&value);
  lights.shading = parse_shading(word ? *word : "a number", name + " (batch)");
  return true;
}

Cull cull_value(const OptionValue& value) {
  constexpr const char* k_where = "cull (batch)";
  const auto* const word = std::get_if<std::string>(&value);
  if (word == nullptr) throw InvalidArgument(k_where, "a number", "none, back or front");
  return parse_cull(*word, k_where);
}

int layers_of(const OptionValue& value) {
  constexpr const char* k_where = "layers (batch)";
  const auto* const count = std::get_if<std::int64_t>(&value);
  const auto* const word = std::get_if<std::string>(&value);
  if (!count)
    throw InvalidArgument(k_where, word ? '"' + *word + '"' : checks::text(std::get<double>(value)),
                          "a whole number");
  check_layers(*count, k_where);
  return static_cast<int>(*count);
}

/// The modes that a list of words, "repeat,clamp", has.
template <typename Mode, std::size_t count>
std::vector<Mode> modes_of(const OptionValue& value, const std::array<std::string_view, count>& names,
                           const std::string& argument) {
  const auto* const words = std::get_if<std::string>(&value);
  if (words == nullptr) throw InvalidArgument(argument + " (batch)", "a number", one_of(names));
  std::vector<Mode> modes;
  for (const std::string& word : split_list(*words))
    modes.push_back(static_cast<Mode>(position_of(word, names, argument + " (batch)")));
  return modes;
}

[[noreturn]] void fail_name(const std::string& name) {
  throw InvalidArgument("setting (batch)", "\"" + name + "\"", one_of(setting_names()));
}

/// Checks the planes that are set; one that is not is put far enough from the other.
void validate_clipping(const std::optional<float>& znear, const std::optional<float>& zfar) {
  Camera camera;
  if (zfar && !znear) checks::require_positive(*zfar, "zfar (camera)");
  camera.znear = znear.value_or(zfar ? *zfar / 2 : 1);
  camera.zfar = zfar.value_or(2 * camera.znear);
  validate(camera);
}

/// Fails for an option that the smoothing, which follows from all options, does not use.
void require_parts(const SmoothingOptions& given, const Smoothing& smoothing) {
  const auto require = [](bool has_part, const std::string& name, bool is_given, const char* with,
                          const char* because) {
    if (is_given && !has_part)
      throw InvalidArgument(name + " (batch)", std::string("a value with ") + with,
                            std::string("none: ") + because);
  };
  const bool has_width = smoothing.occupancy_width != OccupancyWidth::zero;
  constexpr const char *k_zero = "occupancy_width zero (preset rigid)", *k_sharp = "no distance is perturbed";
  require(has_width, "sigma", given.sigma.has_value(), k_zero, k_sharp);
  require(has_width, "occupancy_prior", given.occupancy_prior.has_value(), k_zero, k_sharp);
  const bool has_barrier = smoothing.composition == Composition::barrier;
  constexpr const char *k_joint = "the joint composition", *k_weight = "the barrier alone has it";
  require(has_barrier, "alpha", given.alpha.has_value(), k_joint, k_weight);
  require(has_barrier, "background_depth", given.background_depth.has_value(), k_joint, k_weight);
  const bool has_blurred_triangles = smoothing.noise != Noise::pixel;
  constexpr const char *k_pixel = "noise of the pixel (preset pixel)", *k_whole = "it shows triangles whole";
  require(has_blurred_triangles, "alpha", given.alpha.has_value(), k_pixel, k_whole);
  require(has_blurred_triangles, "occupancy_threshold", given.occupancy_threshold.has_value(), k_pixel,
          k_whole);
  constexpr const char *k_exact = "the exact estimators", *k_draws = "monte_carlo alone draws samples";
  require(is_sampled(smoothing), "samples", given.samples.has_value(), k_exact, k_draws);
  require(is_sampled(smoothing), "draws", given.draws.has_value(), k_exact, k_draws);
  require(is_sampled(smoothing), "variance_reduction", given.variance_reduction.has_value(), k_exact,
          k_draws);
}

float power_of_two_below(double value) { return static_cast<float>(std::exp2(std::floor(std::log2(value)))); }

}  // namespace

std::vector<std::string_view> setting_names() {
  std::vector<std::string_view> names = option_keys();
  names.insert(names.end(), {"znear", "zfar", "cull", "shading", "shininess", "wrap", "filter", "layers"});
  return names;
}

RenderSettings::RenderSettings(std::int64_t width, std::int64_t height)
    : width_(image_side(width, "width")), height_(image_side(height, "height")) {}

void RenderSettings::set_smoothing(const Smoothing& smoothing) {
  validate(smoothing);
  smoothing_ = smoothing;
  otherwise_ = smoothing;
  options_ = {};
}

void RenderSettings::set(const std::string& name, const OptionValue& value) {
  RenderSettings changed = *this;
  if (name == "znear" || name == "zfar") {
    (name == "znear" ? changed.znear_ : changed.zfar_) = number_of(value, name);
    validate_clipping(changed.znear_, changed.zfar_);
  } else if (set_shading(changed.lights_, name, value)) {
    validate(changed.lights_);
  } else if (name == "cull") {
    changed.cull_ = cull_value(value);
  } else if (name == "layers") {
    changed.layers_ = layers_of(value);
  } else if (name == "wrap") {
    changed.wraps_ = modes_of<Wrap>(value, k_wrap_names, name);
  } else if (name == "filter") {
    changed.filters_ = modes_of<Filter>(value, k_filter_names, name);
  } else if (!set_option(changed.options_, name, value, name + " (batch)")) {
    fail_name(name);
  }
  changed.smoothing_ = resolve_smoothing(changed.options_, width_, height_, otherwise_);
  *this = std::move(changed);
}

void RenderSettings::require_parts() const { batch::require_parts(options_, smoothing_); }

void RenderSettings::set_clipping(Camera& camera, const std::optional<BoxCorners>& box) const {
  constexpr double k_widest = 1024, k_rounding = 1e-3;
  camera.znear = znear_.value_or(camera.znear);
  camera.zfar = zfar_.value_or(std::max(camera.zfar, 2 * camera.znear));
  if (has_clipping() || !box) return;
  const DepthRange range = depth_range(*box, camera, glm::mat4(1.0F));
  if (!(range.furthest > 0) || !std::isfinite(range.furthest)) return;  // nothing is before the camera
  if (!zfar_) camera.zfar = 2 * power_of_two_below((1 + k_rounding) * range.furthest);
  if (!znear_) {
    const double nearest = std::max((1 - k_rounding) * range.nearest, camera.zfar / k_widest);
    camera.znear = std::min(power_of_two_below(nearest), camera.zfar / 2);
  }
  camera.zfar = zfar_.value_or(std::max(camera.zfar, 2 * camera.znear));
}

void set_from_text(RenderSettings& settings, const std::string& text) {
  const std::size_t at = text.find('=');
  const std::string name = text.substr(0, at), value = at == std::string::npos ? "" : text.substr(at + 1);
  const char* const end = value.data() + value.size();
  const auto parses_as = [&](auto& number) {
    const auto [rest, error] = from_chars(value.data(), end, number);
    return error == std::errc() && rest == end && !value.empty();
  };
  std::int64_t whole = 0;
  double number = 0;
  if (parses_as(whole)) {
    settings.set(name, whole);
  } else if (parses_as(number)) {
    settings.set(name, number);
  } else {
    settings.set(name, value);
  }
}

void require_numbers_of(std::span<const std::string> gradients, NamedArrays arrays) {
  for (const std::string& name : gradients) {
    if (find(arrays, name)) continue;
    const std::vector<std::string_view> settings = setting_names();
    if (std::ranges::find(settings, name) == settings.end())
      throw InvalidArgument("gradients (batch)", '"' + name + '"', "names of given arrays and of settings");
  }
}

RenderSettings settings_from_texts(std::int64_t width, std::int64_t height,
                                   const std::vector<std::string>& texts) {
  RenderSettings settings(width, height);
  for (const std::string& text : texts) set_from_text(settings, text);
  settings.require_parts();
  return settings;
}

}  // namespace dpr::batch
