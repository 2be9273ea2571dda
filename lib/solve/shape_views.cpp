// The views format: images with their cameras.
#include <algorithm>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "dpr/error.hpp"
#include "loss/image_loss_impl.hpp"
#include "scene/scene_json.hpp"
#include "solve/shape_views.hpp"

namespace dpr {
namespace {

int parse_side(const JsonNode& node) {
  const auto side = static_cast<int>(node.whole_number(checks::k_largest_side));
  if (side < 1) node.fail("0", "at least 1");
  return side;
}

/// Whether an image's alpha tells the object from what is around it. Programs that know no transparency
/// write 1.
bool shows_silhouette(const Image& image) {
  return std::ranges::any_of(image.pixels, [](const glm::vec4& pixel) { return pixel.a < 1; });
}

/// The next of the views, in what is known of all.
ShapeView parse_view(const JsonNode& node, const std::filesystem::path& folder, const ShapeViews& views,
                     Encoding encoding) {
  node.require_keys({"image", "camera", "mask"});
  ShapeView view;
  const std::filesystem::path file = node.at("image").file_in(folder);
  view.image = read_image(file, &view.has_alpha, encoding);
  view.has_alpha = view.has_alpha && shows_silhouette(view.image);
  if (view.image.width != views.width || view.image.height != views.height) {
    throw InvalidArgument("size (" + file.string() + ")", checks::size(view.image.width, view.image.height),
                          checks::size(views.width, views.height) + ", the views'");
  }
  if (const auto mask = node.find("mask")) {
    view.mask = read_image(mask->file_in(folder), nullptr, Encoding::linear);
    require_mask(view.mask, view.image, "mask (" + mask->file_in(folder).string() + ")");
  }
  view.camera = parse_camera(node.at("camera"));
  validate(view.camera, checks::element("views", views.views.size()) + ".camera");
  return view;
}

}  // namespace

ShapeViews read_views(const std::filesystem::path& file, Notes& notes) {
  return parse_views(file, read_file(file), notes);
}

ShapeViews read_views(const std::filesystem::path& file) {
  Notes ignored;
  return read_views(file, ignored);
}

ShapeViews parse_views(const std::filesystem::path& file, std::string_view text, Notes& notes) {
  ViewsFile parsed = parse_views_file(file, text, notes);
  ShapeViews& views = parsed.views;
  if (parsed.smoothing) views.smoothing = resolve_smoothing(*parsed.smoothing, views.width, views.height);
  return std::move(views);
}

ViewsFile parse_views_file(const std::filesystem::path& file, std::string_view text, Notes& notes,
                           Encoding encoding) {
  const nlohmann::json document = parse_json(file, text);
  const JsonNode node(document, file);
  node.require_keys({"width", "height", "background", "views", "initial", "smoothing"});
  ViewsFile result;
  ShapeViews& views = result.views;
  views.width = parse_side(node.at("width"));
  views.height = parse_side(node.at("height"));
  if (const auto background = node.find("background")) views.background = background->vec3();
  const std::filesystem::path folder = file.parent_path();
  for (const JsonNode& view : node.at("views").elements())
    views.views.push_back(parse_view(view, folder, views, encoding));
  if (views.views.empty()) node.at("views").fail("none", "at least one");
  if (const auto initial = node.find("initial")) views.initial = read_mesh(initial->file_in(folder), notes);
  if (const auto smoothing = node.find("smoothing")) result.smoothing = parse_smoothing(*smoothing);
  return result;
}

}  // namespace dpr
