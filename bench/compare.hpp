// Two results files against each other.
#pragma once

#include <string>

#include "results_file.hpp"

namespace dpr::bench {

/// Compares two timings {"median", "q1", "q3", "n"}. "same" if the medians differ by no more
/// than 5%. "faster" or "slower" (the second than the first) if they do and the middle halves of the runs do
/// not overlap: the second's q3 lies below the first's q1, or its q1 above the first's q3. "unclear" where
/// they overlap, or where either timing has fewer than 5 runs, whose quartiles say little.
std::string verdict(const Json& first, const Json& second);

/// {"a", "b": provenance; "warnings": what makes the files hard to compare, as text; "rows": [{"row",
/// "forward", "backward": {"a_ms", "b_ms", "ratio", "verdict"}}], "only_in_a", "only_in_b": row names}. A
/// ratio is second to first. Rows that were not measured in one of the files count as not in it.
Json compare(const Json& a, const Json& b);

/// Throws Error, which names the rows that the comparison calls slower by more than the ratio, if there are
/// any, or a row of the first file that the second does not have, or if no row is in both.
void require_none_slower(const Json& comparison, double ratio);

/// The comparison as lines of text, with the number of rows of each verdict at the end.
std::string to_lines(const Json& comparison);

}  // namespace dpr::bench
