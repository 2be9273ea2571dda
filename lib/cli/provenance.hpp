// What a file of results says about where they come from.
#pragma once

#include "cli/json.hpp"
#include "dpr/device.hpp"

namespace dpr::cli {

/// The commit that was built; "unknown" outside a checkout.
const char* commit();

/// {"commit", "device": {...}, "build_options"}.
Json provenance(const Device& device);

}  // namespace dpr::cli
