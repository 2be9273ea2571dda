// How well a shape explains its images, in words and numbers.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "cli/json.hpp"
#include "cli/page.hpp"
#include "dpr/shape.hpp"

namespace dpr::cli {

/// The images' names in the text of a views file: [view].
std::vector<std::string> image_names(std::string_view views_file);

/// Numbers of the views, the one that is explained worst first.
std::vector<std::size_t> worst_first(const std::vector<ViewExplanation>& views);

/// "IoU 0.934, 4.2% of the colours unexplained".
std::string explanation_text(const ViewExplanation& view);

/// A line about the images that are not explained; empty where all are.
std::string unexplained_text(const std::vector<ViewExplanation>& views,
                             const std::vector<std::string>& names);

/// Adds `explained`, of all views, and `views` with the numbers of each.
void add_explanations(Json& json, const std::vector<ViewExplanation>& views,
                      const std::vector<std::string>& names);

/// A table with a row for every view.
std::vector<TableRow> explanation_rows(const std::vector<ViewExplanation>& views,
                                       const std::vector<std::string>& names);

}  // namespace dpr::cli
