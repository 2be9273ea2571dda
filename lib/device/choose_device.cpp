#include "device/choose_device.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "base/name_list.hpp"
#include "device/context.hpp"

namespace dpr {
namespace {

int rank(const DeviceInfo& info) {
  if (info.type == "gpu") return info.shares_host_memory ? 1 : 0;
  return info.type == "accelerator" ? 2 : 3;
}

/// True if the device has equals, and a frame's time is known of all of them.
bool is_measured(std::span<const DeviceInfo> devices, const DeviceInfo& info) {
  std::size_t equals = 0;
  for (const DeviceInfo& other : devices) {
    if (rank(other) != rank(info)) continue;
    if (other.frame_milliseconds <= 0) return false;
    ++equals;
  }
  return equals > 1;
}

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::optional<std::size_t> parse_index(const std::string& text) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return index;
}

/// "DEVICE/N" taken apart.
struct Parts {
  std::string device;
  unsigned count;
};

std::optional<Parts> parse_parts(const std::string& text) {
  const std::size_t slash = text.rfind('/');
  if (slash == std::string::npos) return std::nullopt;
  const auto count = parse_index(text.substr(slash + 1));
  if (!count || *count > std::numeric_limits<unsigned>::max()) return std::nullopt;
  return Parts{text.substr(0, slash), static_cast<unsigned>(*count)};
}

bool names_one(std::span<const DeviceInfo> devices, const std::string& text) {
  return std::ranges::any_of(devices, [&](const DeviceInfo& info) { return matches(info, text); });
}

}  // namespace

std::vector<std::size_t> by_preference(std::span<const DeviceInfo> devices) {
  std::vector<std::size_t> order(devices.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto preference = [&](std::size_t i) {
    const DeviceInfo& info = devices[i];
    return std::pair(rank(info), is_measured(devices, info) ? info.frame_milliseconds : 0.0);
  };
  std::ranges::stable_sort(order, {}, preference);
  return order;
}

std::vector<std::size_t> best_equals(std::span<const DeviceInfo> devices) {
  std::vector<std::size_t> equals;
  for (const std::size_t i : by_preference(devices)) {
    if (equals.empty() || rank(devices[i]) == rank(devices[equals.front()])) equals.push_back(i);
  }
  return equals;
}

std::string reason_of_preference(const DeviceInfo& info, std::span<const DeviceInfo> devices) {
  constexpr std::array k_kinds{"GPU with memory of its own", "GPU", "accelerator: there is no GPU",
                               "CPU: there is no GPU or accelerator"};
  return std::string("the ") + (is_measured(devices, info) ? "fastest " : "first ") +
         k_kinds[static_cast<std::size_t>(rank(info))];
}

bool matches(const DeviceInfo& info, const std::string& selector) {
  if (selector.empty()) return info.is_default;
  if (selector == "cpu" || selector == "gpu") return info.type == selector;
  if (const auto index = parse_index(selector)) return info.index == *index;
  return lower(info.platform + " " + info.name + " " + info.version).find(lower(selector)) !=
         std::string::npos;
}

bool names_several(std::span<const DeviceInfo> devices, const std::string& selectors) {
  if (names_one(devices, selectors)) return false;
  return selectors.find(',') != std::string::npos || parse_parts(selectors).has_value();
}

std::vector<DeviceChoice> choose_devices(std::span<const DeviceInfo> devices, const std::string& selectors,
                                         const std::string& where) {
  std::vector<DeviceChoice> choices;
  const auto is_taken = [&](std::size_t position) {
    return std::ranges::any_of(choices, [&](const DeviceChoice& c) { return c.position == position; });
  };
  for (const std::string& item : split_list(selectors)) {
    if (item.empty())
      throw InvalidArgument(where, "'" + selectors + "', in which one is empty",
                            "devices separated by commas");
    const auto parts = names_one(devices, item) ? std::nullopt : parse_parts(item);
    const std::string& wanted = parts ? parts->device : item;
    std::size_t position = 0;
    while (position < devices.size() && (is_taken(position) || !matches(devices[position], wanted)))
      ++position;
    if (position == devices.size()) {
      const std::string names = device_names(devices);
      throw InvalidArgument(where, "'" + item + "' in '" + selectors + "'",
                            names_one(devices, wanted) ? "no more such devices than there are: " + names
                                                       : "devices that are there: " + names);
    }
    const unsigned units = devices[position].compute_units;
    if (parts && (parts->count < 1 || parts->count > units)) {
      throw InvalidArgument(where, "'" + item + "'",
                            "1 to " + std::to_string(units) + " parts, as many as " + devices[position].name +
                                " has compute units for this process");
    }
    choices.push_back({position, parts ? parts->count : 1});
  }
  return choices;
}

std::string device_names(std::span<const DeviceInfo> devices) {
  std::string list;
  for (const DeviceInfo& info : devices) {
    list +=
        (list.empty() ? "" : ", ") + std::to_string(info.index) + " (" + info.type + ", " + info.name + ")";
  }
  return list;
}

namespace {

/// The device, whose notes begin with these.
Device noted(Device device, const std::vector<std::string>& passed_over) {
  std::vector<std::string>& notes = impl_of(device).info.passed_over;
  notes.insert(notes.begin(), passed_over.begin(), passed_over.end());
  return device;
}

}  // namespace

Device open_best(std::span<const DeviceInfo> devices, const std::function<Device(std::size_t, bool)>& open) {
  std::vector<std::string> passed_over;
  const std::vector<std::size_t> order = by_preference(devices);
  for (const std::size_t position : std::span(order).first(order.size() - 1)) {
    const auto pass_over = [&](const Error& error) {
      passed_over.push_back(devices[position].name + " is not used: " + error.what());
    };
    try {
      return noted(open(position, true), passed_over);
    } catch (const DeviceError& error) {
      pass_over(error);
    } catch (const BuildError& error) {
      pass_over(error);
    }
  }
  return noted(open(order.back(), false), passed_over);
}

}  // namespace dpr
