// Readers that report the parts of a file that the library leaves out.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "dpr/export.h"
#include "dpr/mesh.hpp"
#include "dpr/scene.hpp"
#include "dpr/shape.hpp"

namespace dpr {

/// A sentence each: a texture or a material library that is not there, a
/// material that is in no library. None of them is an error.
using Notes = std::vector<std::string>;

// As the functions without notes, which keep silent about them; what was found is appended to `notes`.
DPR_API Mesh read_mesh(const std::filesystem::path& file, Notes& notes);
DPR_API Scene read_scene(const std::filesystem::path& file, Notes& notes);
DPR_API ShapeViews read_views(const std::filesystem::path& file, Notes& notes);

}  // namespace dpr
