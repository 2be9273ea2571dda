#include "solve/measured_images.hpp"

#include <algorithm>

#include "base/checks.hpp"
#include "image/codec.hpp"

namespace dpr {
namespace {

std::string name_of_kind(Measured kind) { return kind == Measured::depth ? "depth" : "normal"; }

const Image& image_of(const ShapeView& view, Measured kind) {
  return kind == Measured::depth ? view.depth : view.normal;
}

/// Throws unless the image can be compared with what the view shows.
void check_image(const Image& measured, const Image& picture, const std::string& name) {
  if (measured.width != picture.width || measured.height != picture.height) {
    throw InvalidArgument(checks::in("size of the " + name, "shape"),
                          checks::size(measured.width, measured.height),
                          checks::size(picture.width, picture.height));
  }
  checks::require_pixels(measured, checks::in(name, "shape"));
  for (const glm::vec4& pixel : measured.pixels) {
    if (!(pixel.w >= 0))
      throw InvalidArgument(checks::in("alpha of the " + name, "shape"), checks::text(pixel.w), "at least 0");
  }
  if (std::ranges::none_of(measured.pixels, [](const glm::vec4& pixel) { return pixel.w > 0; })) {
    throw InvalidArgument(checks::in(name, "shape"), "no pixel that counts",
                          "some with alpha above 0 that, in a file, are not 0 themselves");
  }
}

}  // namespace

void MeasuredImages::Finding::add(const std::string& what) {
  if (count++ == 0) first = what;
}

Image MeasuredImages::read(const std::filesystem::path& file, const Image& picture, Measured kind) {
  PixelFacts facts;
  Image image = read_image(file, Encoding::linear, facts);
  if (image.width != picture.width || image.height != picture.height) {
    throw InvalidArgument("size (" + file.string() + ")", checks::size(image.width, image.height),
                          checks::size(picture.width, picture.height) + ", the view's");
  }
  if (!facts.floats && !(kind == Measured::depth && depth_scale_)) whole_numbers_.add(file.string());
  const float scale = depth_scale_.value_or(1.0F);
  for (glm::vec4& pixel : image.pixels) {
    if (kind == Measured::depth) pixel = glm::vec4(glm::vec3(scale * pixel.x), pixel.w);
    if (glm::vec3(pixel) == glm::vec3(0)) pixel.w = 0;
    if (kind == Measured::depth && pixel.x < 0 && pixel.w > 0) {
      throw InvalidArgument("depth (" + file.string() + ")", checks::text(pixel.x),
                            "the distance along the camera's axis, or 0 where it is not known");
    }
  }
  return image;
}

void MeasuredImages::check_range(const ShapeView& view, const std::string& name) {
  const float znear = view.camera.znear, zfar = view.camera.zfar;
  std::size_t known = 0, beyond = 0;
  float furthest = 0;
  for (const glm::vec4& pixel : view.depth.pixels) {
    if (!(pixel.w > 0)) continue;
    ++known;
    if (pixel.x >= znear && pixel.x <= zfar) continue;
    if (beyond++ == 0 || pixel.x > furthest) furthest = pixel.x;
  }
  if (beyond == 0) return;
  if (beyond == known) {
    throw InvalidArgument("depth of " + name,
                          "up to " + checks::text(furthest) + ", all outside its camera's range",
                          "some from znear to zfar, " + checks::text(znear) + " to " + checks::text(zfar) +
                              ", in the scene's units along the view direction");
  }
  out_of_range_.add(std::to_string(beyond) + " pixels of the depth of " + name + ", up to " +
                    checks::text(furthest) + ", are not between its camera's znear and zfar, " +
                    checks::text(znear) + " and " + checks::text(zfar));
}

void MeasuredImages::append_to(Notes& notes) const {
  const auto add = [&](const Finding& finding, const std::string& consequence) {
    if (finding.count == 0) return;
    const std::string others =
        finding.count > 1 ? " (and others, " + std::to_string(finding.count) + " in all)" : "";
    notes.push_back(finding.first + others + consequence);
  };
  add(whole_numbers_,
      ": whole numbers, which are taken for parts of 1, where depths are lengths and normals may be "
      "negative: files of floats (.exr) hold both, and \"depth_scale\" says what a depth of 1 is");
  add(out_of_range_, ": the shape cannot be there; 0 says that a depth is not known");
}

void check_measured(const ShapeViews& views, Measured kind) {
  const auto has_none = [&](const ShapeView& view) { return image_of(view, kind).pixels.empty(); };
  const auto without = std::ranges::find_if(views.views, has_none);
  const auto with = std::ranges::find_if_not(views.views, has_none);
  const auto name = [&](auto view) {
    const auto number = static_cast<std::size_t>(view - views.views.begin());
    return name_of_kind(kind) + " of " + checks::element("views", number);
  };
  if (with == views.views.end()) return;
  if (without != views.views.end())
    throw InvalidArgument(checks::in(name(without), "shape"), "none",
                          "one, because there is a " + name(with));
  for (auto view = views.views.begin(); view != views.views.end(); ++view)
    check_image(image_of(*view, kind), view->image, name(view));
}

}  // namespace dpr
