// Views files: what is read of the images.
#include <doctest/doctest.h>

#include <string>

#include "dpr/dpr.hpp"
#include "dpr/notes.hpp"
#include "support/temp_dir.hpp"

namespace {

using dpr::Image;
using dpr::test::TempDir;

/// Whether the image, written in a format, is taken to show a silhouette.
bool shows_silhouette(const Image& image, const std::string& name) {
  const TempDir folder;
  dpr::write_image(folder / name, image);
  folder.write("views.json", R"({"width": 2, "height": 1, "views": [{"image": ")" + name +
                                 R"(", "camera": {"fov_y_degrees": 45, "znear": 1, "zfar": 10}}]})");
  dpr::Notes notes;
  const dpr::ShapeViews views = dpr::read_views(folder / "views.json", notes);
  return views.views.at(0).has_alpha;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("views: an alpha that is 1 everywhere is no silhouette") {
    Image cut_out(2, 1, glm::vec4(0.5F));
    cut_out.pixels[1].a = 0;
    const Image opaque(2, 1, glm::vec4(0.5F, 0.5F, 0.5F, 1));
    for (const char* const name : {"view.png", "view.exr"}) {
      CAPTURE(name);
      CHECK(shows_silhouette(cut_out, name));
      CHECK_FALSE(shows_silhouette(opaque, name));
    }
    CHECK_FALSE(shows_silhouette(cut_out, "view.jpg"));  // which has no alpha
  }
}
