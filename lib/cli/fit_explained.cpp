#include "cli/fit_explained.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "cli/text.hpp"

namespace dpr::cli {
namespace {

std::string percent_text(double part) { return format("%.3g%%", 100 * part); }

}  // namespace

std::vector<std::string> image_names(std::string_view views_file) {
  std::vector<std::string> names;
  const Json document = Json::parse(views_file);
  for (const Json& view : document["views"]) names.push_back(view["image"]);
  return names;
}

std::vector<std::size_t> worst_first(const std::vector<ViewExplanation>& views) {
  std::vector<std::size_t> order(views.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) {
    return std::tuple(views[i].explained, -std::max(1 - views[i].iou.value_or(1), views[i].unexplained_part));
  });
  return order;
}

std::string explanation_text(const ViewExplanation& view) {
  const std::string silhouette = view.iou ? format("IoU %.3f, ", *view.iou) : "";
  return silhouette + percent_text(view.unexplained_part) + " of the colours unexplained";
}

std::string unexplained_text(const std::vector<ViewExplanation>& views,
                             const std::vector<std::string>& names) {
  constexpr std::size_t k_most_named = 3;
  const auto count = static_cast<std::size_t>(std::ranges::count(views, false, &ViewExplanation::explained));
  if (count == 0) return "";
  std::string text = std::to_string(count) + " of " + std::to_string(views.size()) +
                     (count == 1 ? " images is not explained:" : " images are not explained:");
  const std::vector<std::size_t> order = worst_first(views);
  for (std::size_t i = 0; i < std::min(count, k_most_named); ++i) {
    const std::size_t view = order[i];
    text += (i > 0 ? "; image " : " image ") + std::to_string(view) + " (" + names[view] + ", " +
            explanation_text(views[view]) + ")";
  }
  if (count > k_most_named) text += "; and " + counted(count - k_most_named, "other");
  return text;
}

void add_explanations(Json& json, const std::vector<ViewExplanation>& views,
                      const std::vector<std::string>& names) {
  json["explained"] = std::ranges::all_of(views, &ViewExplanation::explained);
  Json& list = json["views"] = Json::array();
  for (std::size_t i = 0; i < views.size(); ++i) {
    Json view{{"image", names[i]},
              {"explained", views[i].explained},
              {"unexplained_part", views[i].unexplained_part}};
    if (views[i].iou) view["iou"] = *views[i].iou;
    list.push_back(view);
  }
}

std::vector<TableRow> explanation_rows(const std::vector<ViewExplanation>& views,
                                       const std::vector<std::string>& names) {
  std::vector<TableRow> rows{{"image", "file", "IoU of silhouettes", "colours unexplained", "explained"}};
  for (std::size_t i = 0; i < views.size(); ++i) {
    const ViewExplanation& view = views[i];
    rows.push_back({std::to_string(i), names[i], view.iou ? format("%.3f", *view.iou) : "",
                    percent_text(view.unexplained_part), view.explained ? "yes" : "no"});
  }
  return rows;
}

}  // namespace dpr::cli
