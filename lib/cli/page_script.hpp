// Style and scripts of the pages.
#pragma once

#include <string_view>

namespace dpr::cli {

/// A style element.
std::string_view page_style();
/// A script element: wipes, players and plots.
std::string_view page_script();
/// A script element: models, by three.js.
std::string_view model_script();
/// The text of three.js; empty where there was none when the command was built.
std::string_view three_js();

}  // namespace dpr::cli
