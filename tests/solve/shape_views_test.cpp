// Views files: what is read of the images.
#include <doctest/doctest.h>

#include <string>

#include "dpr/dpr.hpp"
#include "dpr/notes.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace shape_views_test {

namespace {

using dpr::Image;
using dpr::test::TempDir;

/// True if the image, written in a format, is taken to show a silhouette.
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

  TEST_CASE("views: a silhouette cuts the picture out, a picture of the background does where they differ") {
    const TempDir folder;
    Image picture(3, 1, glm::vec4(0.2F, 0.4F, 0.6F, 1)), empty = picture;
    picture.pixels[1] = glm::vec4(0.9F, 0.4F, 0.6F, 1);
    dpr::write_image(folder / "picture.exr", picture);
    dpr::write_image(folder / "empty.exr", empty);
    Image silhouette(3, 1, glm::vec4(0, 0, 0, 1));
    silhouette.pixels[1] = glm::vec4(1);
    silhouette.pixels[2] = glm::vec4(0.5F, 0, 0, 1);
    dpr::write_image(folder / "silhouette.exr", silhouette);
    const auto read = [&](const std::string& more) {
      folder.write("views.json", R"({"width": 3, "height": 1, "background": [1, 1, 1], "views": [
          {"image": "picture.exr", )" +
                                     more + "}]}");
      return dpr::read_views(folder / "views.json").views.at(0);
    };
    const dpr::ShapeView cut = read(R"("silhouette": "silhouette.exr")");
    CHECK(cut.has_alpha);
    CHECK(cut.image.pixels[0] == glm::vec4(1, 1, 1, 0));
    CHECK(cut.image.pixels[1] == picture.pixels[1]);
    CHECK(glm::distance(cut.image.pixels[2], glm::vec4(0.6F, 0.7F, 0.8F, 0.5F)) < 1e-6F);
    const dpr::ShapeView seen = read(R"("background": "empty.exr")");
    CHECK(seen.has_alpha);
    CHECK(seen.image.pixels[0] == glm::vec4(1, 1, 1, 0));
    CHECK(seen.image.pixels[1] == picture.pixels[1]);
    CHECK(seen.image.pixels[2] == glm::vec4(1, 1, 1, 0));
    const auto refuse = [&](const std::string& more, const char* part) {
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, read(more), part);
    };
    refuse(R"("silhouette": "silhouette.exr", "background": "empty.exr")", "one of the two");
    dpr::write_image(folder / "large.exr", Image(4, 1));
    refuse(R"("silhouette": "large.exr")", "large.exr");
    dpr::write_image(folder / "bright.exr", Image(3, 1, glm::vec4(2)));
    refuse(R"("silhouette": "bright.exr")", "[0, 1]");
  }

  TEST_CASE("views: depths are in the first channel, and what is 0 is not known") {
    const TempDir folder;
    dpr::write_image(folder / "view.exr", Image(3, 1));
    Image depth(3, 1, glm::vec4(4, 7, 7, 1)), normal(3, 1, glm::vec4(0, 0.6F, 0.8F, 0.5F));
    depth.pixels[1] = glm::vec4(0, 0, 0, 1);
    depth.pixels[2].w = 0;
    normal.pixels[0] = glm::vec4(0, 0, 0, 1);
    dpr::write_image(folder / "depth.exr", depth);
    dpr::write_image(folder / "normal.exr", normal);
    const auto read = [&](const std::string& more) {
      folder.write("views.json",
                   R"({"width": 3, "height": 1, "views": [{"image": "view.exr", )" + more + "}]}");
      return dpr::read_views(folder / "views.json").views.at(0);
    };
    const dpr::ShapeView view = read(R"("depth": "depth.exr", "normal": "normal.exr")");
    CHECK(view.depth.pixels[0] == glm::vec4(4, 4, 4, 1));
    CHECK(view.depth.pixels[1].w == 0);
    CHECK(view.depth.pixels[2].w == 0);
    CHECK(view.normal.pixels[0].w == 0);
    CHECK(view.normal.pixels[1] == glm::vec4(0, 0.6F, 0.8F, 0.5F));
    CHECK(read(R"("depth": "depth.exr")").normal.pixels.empty());
    dpr::write_image(folder / "large.exr", Image(4, 1));
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, read(R"("normal": "large.exr")"), "large.exr");
  }

  TEST_CASE("views: a camera is known, near another, or unknown") {
    const TempDir folder;
    dpr::write_image(folder / "view.exr", Image(2, 1));
    const auto read = [&](const std::string& more) {
      folder.write("views.json",
                   R"({"width": 2, "height": 1, "views": [{"image": "view.exr")" + more + "}]}");
      return dpr::read_views(folder / "views.json").views.at(0);
    };
    const std::string camera = R"({"fov_y_degrees": 33, "znear": 1, "zfar": 10})";
    CHECK(read(R"(, "camera": )" + camera).knowledge == dpr::CameraKnowledge::known);
    CHECK(read("").knowledge == dpr::CameraKnowledge::unknown);
    const dpr::ShapeView near = read(R"(, "initial_camera": )" + camera);
    CHECK(near.knowledge == dpr::CameraKnowledge::near);
    CHECK(near.camera.fov_y_degrees == 33);
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument,
                          read(R"(, "camera": )" + camera + R"(, "initial_camera": )" + camera),
                          "one of the two");
    const std::string of_file = " (" + (folder / "views.json").string() + "): got -1";
    for (const std::string key : {"camera", "initial_camera"}) {
      DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, read(", \"" + key + R"(": {"znear": -1})"),
                            "views[0]." + key + ".znear" + of_file);
    }
    folder.write(
        "views.json",
        R"({"width": 2, "height": 1, "views": [{"image": "view.exr"}], "smoothing": {"sigma": -1}})");
    DPR_CHECK_MESSAGE_HAS(dpr::InvalidArgument, dpr::read_views(folder / "views.json"),
                          "smoothing.sigma" + of_file);
  }
}

}  // namespace shape_views_test
