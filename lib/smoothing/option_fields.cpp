#include "smoothing/option_fields.hpp"

#include <algorithm>
#include <cmath>

#include "dpr/error.hpp"
#include "smoothing/choice_names.hpp"

namespace dpr {
namespace {

/// A value's text in messages.
std::string text_of(const OptionValue& value) {
  if (const auto* const word = std::get_if<std::string>(&value)) return "\"" + *word + "\"";
  if (const auto* const whole = std::get_if<std::int64_t>(&value)) return std::to_string(*whole);
  return std::to_string(std::get<double>(value));
}

const std::string& word_of(const OptionValue& value, std::string_view where) {
  if (const auto* const word = std::get_if<std::string>(&value)) return *word;
  throw InvalidArgument(std::string(where), text_of(value), "a word");
}

template <SmoothingChoice Choice>
void read(const OptionValue& value, std::string_view where, std::optional<Choice>& option) {
  option = parse_choice<Choice>(word_of(value, where), where);
}

void read(const OptionValue& value, std::string_view where, std::optional<std::string>& preset) {
  require_preset(word_of(value, where), where);
  preset = std::get<std::string>(value);
}

void read(const OptionValue& value, std::string_view where, std::optional<float>& option) {
  if (const auto* const whole = std::get_if<std::int64_t>(&value)) {
    option = static_cast<float>(*whole);
  } else if (const auto* const number = std::get_if<double>(&value)) {
    option = static_cast<float>(*number);
  } else {
    throw InvalidArgument(std::string(where), text_of(value), "a number");
  }
}

/// A double holds whole numbers up to 2^53.
template <typename Unsigned>
void read_whole(const OptionValue& value, std::string_view where, std::optional<Unsigned>& option) {
  constexpr double k_most_exact = 0x1p53;
  constexpr auto k_most = std::numeric_limits<Unsigned>::max();
  if (const auto* const whole = std::get_if<std::int64_t>(&value)) {
    if (*whole >= 0 && static_cast<std::uint64_t>(*whole) <= k_most) {
      option = static_cast<Unsigned>(*whole);
      return;
    }
  } else if (const auto* const number = std::get_if<double>(&value)) {
    const double most = std::min(k_most_exact, static_cast<double>(k_most));
    if (*number >= 0 && *number <= most && *number == std::floor(*number)) {
      option = static_cast<Unsigned>(*number);
      return;
    }
  }
  throw InvalidArgument(std::string(where), text_of(value),
                        "a whole number from 0 to " + std::to_string(k_most));
}

void read(const OptionValue& value, std::string_view where, std::optional<std::uint32_t>& option) {
  read_whole(value, where, option);
}
void read(const OptionValue& value, std::string_view where, std::optional<std::uint64_t>& option) {
  read_whole(value, where, option);
}

}  // namespace

std::vector<std::string_view> option_keys() {
  std::vector<std::string_view> keys;
  for_each_option([&](std::string_view key, auto, auto) { keys.push_back(key); });
  return keys;
}

std::string option_type(const std::optional<std::string>&) { return joined(smoothing_preset_names()); }

bool set_option(SmoothingOptions& options, std::string_view key, const OptionValue& value,
                std::string_view where) {
  bool is_known = false;
  for_each_option([&](std::string_view known, auto, auto member) {
    if (known != key) return;
    read(value, where, options.*member);
    is_known = true;
  });
  return is_known;
}

std::string noise_note(const SmoothingOptions& scene, const SmoothingOptions& options) {
  if (!says_nothing(scene) || says_nothing(options) || options.noise || options.preset) return {};
  return "the smoothing that is given has noise of the triangles; --noise pixel keeps that of the pixel, the "
         "default";
}

}  // namespace dpr
