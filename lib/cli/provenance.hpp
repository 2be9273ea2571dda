// Provenance of results, in files and on pages.
#pragma once

#include <span>
#include <string>

#include "cli/common_options.hpp"
#include "cli/json.hpp"
#include "cli/page.hpp"
#include "dpr/device.hpp"

namespace dpr::cli {

/// The commit that was built; "unknown" outside a checkout.
const char* commit();

/// {"commit", "device": {...}, "build_options"}.
Json provenance(const Device& device);
/// The command as it was typed, and the devices it ran on.
PageSource page_source(const std::string& title, const CommonOptions& common,
                       std::span<const Device> devices);

}  // namespace dpr::cli
