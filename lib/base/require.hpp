// One line for each check of an option.
#pragma once

#include "base/checks.hpp"
#include "dpr/error.hpp"

namespace dpr {

/// Throws InvalidArgument unless `ok`.
template <typename Number>
void require(bool ok, const char* argument, Number got, const char* expected) {
  if (!ok) throw InvalidArgument(argument, checks::text(got), expected);
}

}  // namespace dpr
