// Choice of a device: by the caller's word, or the best that can be used.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "dpr/device.hpp"

namespace dpr {

/// Positions in `devices`, the best first: GPUs with memory of their own, other GPUs, accelerators, CPUs;
/// among equals by the time of a frame, or in their order where that is not known of all.
std::vector<std::size_t> by_preference(std::span<const DeviceInfo> devices);

/// Positions of the best and its equals: of its type, with memory of their own if it has.
std::vector<std::size_t> best_equals(std::span<const DeviceInfo> devices);

/// Why a device is preferred, e.g. "the first GPU with memory of its own".
std::string reason_of_preference(const DeviceInfo& info, std::span<const DeviceInfo> devices);

/// True if a selector names the device: "cpu" and "gpu" its type, a number its index, anything else a part of
/// its platform, name or version, ignoring case. An empty selector names the default.
bool matches(const DeviceInfo& info, const std::string& selector);

/// A device of a list, or equal parts of it.
struct DeviceChoice {
  std::size_t position;
  unsigned parts = 1;
};

/// True if the text is a list or asks for parts, rather than naming one of the devices as it stands.
bool names_several(std::span<const DeviceInfo> devices, const std::string& selectors);

/// The devices that such a text names. Each item takes the first that matches and is not taken yet. Throws
/// InvalidArgument, which calls the text `where`, for an item that is empty or finds none, and for
/// more parts than compute units.
std::vector<DeviceChoice> choose_devices(std::span<const DeviceInfo> devices, const std::string& selectors,
                                         const std::string& where);

/// "0 (cpu, NAME), 1 (gpu, NAME)", as messages have it.
std::string device_names(std::span<const DeviceInfo> devices);

/// Opens the best device that can be used. Those that cannot, because `open` throws a DeviceError or a
/// BuildError, are named with the reason in the `passed_over` of the one that is opened. What the last one
/// throws is thrown.
/// @param devices  at least one
/// @param open     opens and tries the device at a position; the last one, after which there is no other, is
/// not tried
Device open_best(std::span<const DeviceInfo> devices,
                 const std::function<Device(std::size_t, bool is_tried)>& open);

}  // namespace dpr
