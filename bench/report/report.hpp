// Plots of files of results.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "results_file.hpp"

namespace dpr::bench {

/// Draws into a folder, which is made if need be, what the files have the rows for:
/// - stages.png: the stages' share of a row's time, of the first file
/// - roofline.png: operations a second of the stages against operations a byte, of the first file
/// - scaling.png: time against triangles, pixels, samples and views, from the sweeps
/// - memory.png: peak device memory against samples
/// - devices.png: time of every row by file, where several are given
/// and index.html, which shows them and the times of the first file. `command` is what the page says it comes
/// from. Returns the files written. Throws InvalidArgument where no plot can be drawn, IoError where the
/// folder cannot be written or gnuplot is not installed.
std::vector<std::string> write_report(const std::filesystem::path& folder, std::span<const Json> results,
                                      const std::string& command);

}  // namespace dpr::bench
