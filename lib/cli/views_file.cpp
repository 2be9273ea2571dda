#include "cli/views_file.hpp"

#include "cli/json.hpp"
#include "cli/scene_file.hpp"
#include "solve/resample.hpp"

namespace dpr::cli {

void write_views(const std::filesystem::path& file, const ViewsText& from, const ShapeViews& views) {
  namespace fs = std::filesystem;
  const fs::path old_folder = fs::absolute(from.file).parent_path(),
                 folder = fs::absolute(file).parent_path();
  const auto move_files = [&](Json& json, std::initializer_list<const char*> keys) {
    for (const char* key : keys) {
      if (!json.contains(key) || !json[key].is_string()) continue;
      const fs::path named(json[key].get<std::string>());
      if (named.is_relative()) json[key] = fs::proximate(old_folder / named, folder).string();
    }
  };
  Json json = Json::parse(from.text);
  move_files(json, {"initial"});
  const int width = json["width"], height = json["height"];
  for (std::size_t i = 0; i < views.views.size(); ++i) {
    Json& view = json["views"][i];
    move_files(view, {"image", "silhouette", "background", "mask", "depth", "normal"});
    const Json camera =
        camera_with_view(resample(views.views[i].camera, views.width, views.height, width, height));
    if (view.contains("camera")) {
      view["camera"]["view"] = camera["view"];
    } else {
      view.erase("initial_camera");
      view["camera"] = camera;
    }
  }
  write_json(file, json);
}

}  // namespace dpr::cli
