// The views format in memory.
#pragma once

#include <filesystem>
#include <string_view>

#include "dpr/notes.hpp"

namespace dpr {

/// What a file of views holds; `file` is what messages call it, and beside it the images are looked for.
/// Throws as read_views() does.
ShapeViews parse_views(const std::filesystem::path& file, std::string_view text, Notes& notes);

}  // namespace dpr
