// The paper's Figure 2: what growing sigma and gamma do to an image, for each composition.
#include <sstream>

#include "cli/plot.hpp"
#include "dpr/image.hpp"
#include "dpr/renderer.hpp"
#include "experiment.hpp"

namespace dpr::experiments {
namespace {

constexpr float k_sigmas[] = {1e-5F, 1e-4F, 1e-3F, 1e-2F};
constexpr float k_gammas[] = {1e-4F, 1e-3F, 1e-2F, 1e-1F};  // rows, from the top
constexpr const char* k_presets[] = {"softras", "gaussian", "joint_gaussian"};
constexpr int k_gap = 2;

Image contact_sheet(const Device& device, Scene scene, const std::string& preset) {
  Renderer renderer(device);
  renderer.set_scene(scene);
  std::vector<Image> rows;
  for (const float gamma : k_gammas) {
    std::vector<Image> row;
    for (const float sigma : k_sigmas) {
      renderer.set_smoothing(scaled_smoothing(preset, sigma, gamma));
      renderer.forward();
      row.push_back(opaque(renderer.image()));
    }
    rows.push_back(hstack(row, k_gap));
  }
  return vstack(rows, k_gap);
}

/// Labels in the middle of tiles.
std::string tics(std::span<const float> values, int size, bool from_top) {
  std::ostringstream text;
  const int count = static_cast<int>(values.size());
  for (int i = 0; i < count; ++i) {
    const int tile = from_top ? count - 1 - i : i;
    text << (i > 0 ? ", '" : "('") << values[static_cast<std::size_t>(i)] << "' "
         << tile * (size + k_gap) + size / 2;
  }
  return text.str() + ")";
}

/// A data block of gnuplot's: the colours in bytes, row by row from the top.
std::string pixel_data(const std::string& name, const Image& image) {
  std::ostringstream text;
  text << "$" << name << " << EOD\n";
  for (const glm::vec4& pixel : image.pixels) {
    const glm::ivec3 bytes(glm::round(255.0F * glm::clamp(glm::vec3(pixel), 0.0F, 1.0F)));
    text << bytes.r << ' ' << bytes.g << ' ' << bytes.b << '\n';
  }
  return text.str() + "EOD\n";
}

}  // namespace

void run_gallery(const Settings& settings) {
  const int size = settings.smoke ? 24 : 128;
  Scene scene;
  scene.width = scene.height = size;
  scene.background = glm::vec3(0.15F);
  scene.meshes.push_back({make_cube()});
  scene.camera = orbit_camera(/*distance=*/5.0F, /*elevation_degrees=*/30.0F, /*azimuth_degrees=*/35.0F);
  std::ostringstream script;
  script << "set multiplot layout 1," << std::size(k_presets)
         << "\nset size ratio -1\nunset key\nset tics out nomirror\n"
         << "set xlabel 'sigma'\nset ylabel 'gamma'\nset xtics " << tics(k_sigmas, size, false)
         << "\nset ytics " << tics(k_gammas, size, true) << "\n";
  Json means = Json::object();
  for (const char* const preset : k_presets) {
    const Image sheet = contact_sheet(settings.device, scene, preset);
    script << pixel_data(preset, sheet) << "set title " << cli::gnuplot_quote(preset)
           << "\nplot [0:" << sheet.width << "][0:" << sheet.height << "] $" << preset << " using (int($0) % "
           << sheet.width << "):(" << sheet.height - 1 << " - int($0) / " << sheet.width
           << "):1:2:3 with rgbimage\n";
    glm::dvec3 sum(0);
    for (const glm::vec4& pixel : sheet.pixels) sum += glm::dvec3(pixel);
    means[preset] = cli::to_json(sum / static_cast<double>(sheet.pixels.size()));
  }
  write_data(settings, "gallery",
             {{"sigmas", k_sigmas}, {"gammas", k_gammas}, {"size", size}, {"mean_color_of_sheet", means}});
  const int tile = 4 * (size + k_gap);
  draw_figure(settings, "gallery", 3 * (tile + 130), tile + 110, script.str() + "unset multiplot\n");
}

}  // namespace dpr::experiments
