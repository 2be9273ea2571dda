// What else is known of an image file.
#pragma once

#include <filesystem>

namespace dpr {

/// Whether its numbers are floats, which are linear, and not fractions of a largest one. Throws as
/// read_image() does.
bool holds_floats(const std::filesystem::path& file);

}  // namespace dpr
