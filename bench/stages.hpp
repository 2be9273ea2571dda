// The pipeline's stages by name, and how long each took.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "device/profile.hpp"

namespace dpr::bench {

/// In the order of the pipeline; scan, sort, gather and reduce serve several others.
inline constexpr std::string_view k_stages[] = {"transform", "setup",   "clip",      "contour",   "bin",
                                                "scan",      "sort",    "rasterize", "surface",   "shade",
                                                "occupancy", "opacity", "aggregate", "antialias", "blur",
                                                "loss",      "gather",  "texels",    "reduce"};

/// The stage of a kernel file: "aggregate_joint.cl" belongs to "aggregate".
inline std::string stage_of(std::string_view kernel_file) {
  if (kernel_file == "normals.cl") return "shade";
  return std::string(kernel_file.substr(0, kernel_file.find_first_of("_.")));
}

/// Milliseconds of each stage in a list of launches.
inline std::map<std::string, double> milliseconds_by_stage(std::span<const Profile::Launch> launches) {
  std::map<std::string, double> sums;
  for (const Profile::Launch& launch : launches) sums[stage_of(launch.file)] += launch.milliseconds;
  return sums;
}

}  // namespace dpr::bench
