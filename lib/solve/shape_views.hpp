// The views format in memory.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "dpr/notes.hpp"
#include "dpr/shape.hpp"
#include "dpr/smoothing_options.hpp"

namespace dpr {

/// A file of views before its smoothing is resolved: a command line may have more to say of it.
struct ViewsFile {
  ShapeViews views;  ///< without the smoothing
  std::optional<SmoothingOptions> smoothing;
};

/// Parses a file of views. Messages call it `file`, and images are looked for beside that path. Throws as
/// read_views() does. Without its initial mesh the file that this is in may be missing.
ViewsFile parse_views_file(const std::filesystem::path& file, std::string_view text, Notes& notes,
                           Encoding encoding = Encoding::srgb, bool with_initial = true);
/// The same, resolved.
ShapeViews parse_views(const std::filesystem::path& file, std::string_view text, Notes& notes);

}  // namespace dpr
