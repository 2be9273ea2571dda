// The views format: images with their cameras.
#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "dpr/error.hpp"
#include "loss/image_loss_impl.hpp"
#include "scene/scene_json.hpp"
#include "solve/measured_images.hpp"
#include "solve/shape_views.hpp"

namespace dpr {
namespace {

/// True if an image's alpha tells the object from its surroundings. Programs without transparency write 1.
bool shows_silhouette(const Image& image) {
  return std::ranges::any_of(image.pixels, [](const glm::vec4& pixel) { return pixel.a < 1; });
}

/// Lays the picture on the views' background where the silhouette, an image's first channel, says so.
void cut_out(Image& picture, const Image& silhouette, const glm::vec3& background) {
  for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
    const float alpha = silhouette.pixels[i].x;
    picture.pixels[i] = glm::vec4(glm::mix(background, glm::vec3(picture.pixels[i]), alpha), alpha);
  }
}

/// Silhouette of the object: the pixels that differ from a picture of the background alone.
Image difference_silhouette(const Image& picture, const Image& background) {
  constexpr float k_same = 0.02F, k_other = 0.08F;  // of linear colours, in the channel that differs most
  Image silhouette(picture.width, picture.height);
  for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
    const glm::vec3 d = glm::abs(glm::vec3(picture.pixels[i]) - glm::vec3(background.pixels[i]));
    silhouette.pixels[i] = glm::vec4(glm::smoothstep(k_same, k_other, std::max({d.x, d.y, d.z})));
  }
  return silhouette;
}

Image read_beside(const JsonNode& node, const std::filesystem::path& folder, const Image& picture,
                  Encoding encoding) {
  const std::filesystem::path file = node.file_in(folder);
  Image image = read_image(file, nullptr, encoding);
  if (image.width != picture.width || image.height != picture.height) {
    throw InvalidArgument("size (" + file.string() + ")", checks::size(image.width, image.height),
                          checks::size(picture.width, picture.height) + ", the view's");
  }
  return image;
}

/// The object's silhouette in the picture, if the file names one.
std::optional<Image> parse_silhouette(const JsonNode& node, const std::filesystem::path& folder,
                                      const Image& picture, Encoding encoding) {
  const auto silhouette = node.find("silhouette"), background = node.find("background");
  if (silhouette && background) background->fail("one beside a silhouette", "one of the two");
  if (background) return difference_silhouette(picture, read_beside(*background, folder, picture, encoding));
  if (!silhouette) return std::nullopt;
  Image image = read_beside(*silhouette, folder, picture, Encoding::linear);
  for (const glm::vec4& pixel : image.pixels) {
    if (!(pixel.x >= 0 && pixel.x <= 1)) silhouette->fail(checks::text(pixel.x), "pixels in [0, 1]");
  }
  return image;
}

/// The camera of a view, and what is known of it.
void parse_view_camera(const JsonNode& node, ShapeView& view) {
  const auto camera = node.find("camera"), near = node.find("initial_camera");
  if (camera && near) near->fail("one beside a camera", "one of the two");
  view.knowledge = camera ? CameraKnowledge::known : near ? CameraKnowledge::near : CameraKnowledge::unknown;
  if (camera || near) view.camera = parse_camera(camera ? *camera : *near);
}

MeasuredImages measured_images(const JsonNode& views) {
  const auto node = views.find("depth_scale");
  if (!node) return {};
  const float scale = node->number();
  checks::require_positive(scale, node->name());
  return MeasuredImages(scale);
}

/// The next of the views, in what is known of all.
ShapeView parse_view(const JsonNode& node, const std::filesystem::path& views_file, const ShapeViews& views,
                     Encoding encoding, MeasuredImages& measured) {
  const std::filesystem::path folder = views_file.parent_path();
  node.require_keys(
      {"image", "camera", "initial_camera", "silhouette", "background", "mask", "depth", "normal"});
  ShapeView view;
  const std::filesystem::path file = node.at("image").file_in(folder);
  view.image = read_image(file, &view.has_alpha, encoding);
  view.has_alpha = view.has_alpha && shows_silhouette(view.image);
  if (view.image.width != views.width || view.image.height != views.height) {
    throw InvalidArgument("size (" + file.string() + ")", checks::size(view.image.width, view.image.height),
                          checks::size(views.width, views.height) + ", the views'");
  }
  if (const auto silhouette = parse_silhouette(node, folder, view.image, encoding)) {
    cut_out(view.image, *silhouette, views.background);
    view.has_alpha = true;
  }
  if (const auto mask = node.find("mask")) {
    view.mask = read_image(mask->file_in(folder), nullptr, Encoding::linear);
    require_mask(view.mask, view.image, "mask (" + mask->file_in(folder).string() + ")");
  }
  if (const auto depth = node.find("depth"))
    view.depth = measured.read(depth->file_in(folder), view.image, Measured::depth);
  if (const auto normal = node.find("normal"))
    view.normal = measured.read(normal->file_in(folder), view.image, Measured::normal);
  const std::string name = checks::element("views", views.views.size());
  parse_view_camera(node, view);
  with_keys_of(views_file, {}, {}, [&] {
    if (view.knowledge == CameraKnowledge::unknown) return;
    const bool is_known = view.knowledge == CameraKnowledge::known;
    validate(view.camera, name + (is_known ? ".camera" : ".initial_camera"));
    if (is_known) measured.check_range(view, name);
  });
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
  if (parsed.smoothing) {
    with_keys_of(file, *parsed.smoothing, {},
                 [&] { views.smoothing = resolve_smoothing(*parsed.smoothing, views.width, views.height); });
  }
  return std::move(views);
}

ViewsFile parse_views_file(const std::filesystem::path& file, std::string_view text, Notes& notes,
                           Encoding encoding, bool with_initial) {
  const nlohmann::json document = parse_json(file, text);
  const JsonNode node(document, file);
  node.require_keys({"width", "height", "background", "views", "initial", "smoothing", "depth_scale"});
  ViewsFile result;
  ShapeViews& views = result.views;
  views.width = node.at("width").image_side();
  views.height = node.at("height").image_side();
  if (const auto background = node.find("background")) views.background = background->vec3();
  const std::filesystem::path folder = file.parent_path();
  MeasuredImages measured = measured_images(node);
  for (const JsonNode& view : node.at("views").elements())
    views.views.push_back(parse_view(view, file, views, encoding, measured));
  measured.append_to(notes);
  if (views.views.empty()) node.at("views").fail("none", "at least one");
  if (const auto initial = node.find("initial")) {
    add_input(folder / initial->string());  // also where it is not read
    if (with_initial) views.initial = read_mesh(initial->file_in(folder), notes);
  }
  if (const auto smoothing = node.find("smoothing")) result.smoothing = parse_smoothing(*smoothing);
  return result;
}

}  // namespace dpr
