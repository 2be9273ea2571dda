// Report of the pose solver: numbers, pictures and plots.
#include "cli/pose_report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <iterator>
#include <memory>

#include "base/output_file.hpp"
#include "cli/difference.hpp"
#include "cli/plot.hpp"
#include "cli/pose_page.hpp"
#include "cli/progress.hpp"
#include "cli/scene_file.hpp"
#include "cli/text.hpp"
#include "dpr/renderer.hpp"
#include "solve/resample.hpp"

namespace dpr::cli {
namespace {

constexpr std::size_t k_strip_length = 12, k_most_equals = 12;  // the start among those of the strip

/// Renders the scene with its body in any pose, in a light that was found.
class PoseCamera {
 public:
  PoseCamera(const Device& device, Scene scene, const FoundBody& found, const FoundLight& light)
      : renderer_(device),
        body_(scene, found.meshes),
        camera_(scene.camera),
        background_(scene.background),
        gain_(light.gain) {
    if (light.gain || light.lights) scene.lights = light.lights;
    renderer_.set_scene(scene);
  }

  /// Renders the pose of a solver's step or result.
  template <typename Found>
  Image render(const Found& found, const Smoothing& smoothing) {
    return render(calibrated(camera_, found.focal_scale, found.radial), found.pose, smoothing);
  }
  /// Another light of the same kind.
  void set_light(const FoundLight& light) {
    gain_ = light.gain;
    if (light.lights) renderer_.set_lights(light.lights);
  }
  Image render_start(const PoseResult& result) { return render(camera_, result.start, rigid_smoothing()); }

 private:
  Image render(const Camera& camera, const Pose& pose, const Smoothing& smoothing) {
    const View view{camera, body_.transforms(pose)};
    renderer_.set_views({&view, 1});
    renderer_.set_smoothing(smoothing);
    renderer_.forward();
    Image image = renderer_.image();
    if (!gain_) return image;
    for (glm::vec4& pixel : image.pixels) {
      const glm::vec3 behind = (1 - pixel.w) * background_;
      const glm::vec3 object =
          (glm::vec3(pixel) - behind) * glm::vec3(gain_->gain) + pixel.w * glm::vec3(gain_->offset);
      pixel = glm::vec4(object + behind, pixel.w);
    }
    return image;
  }

  Renderer renderer_;
  PoseBody body_;
  Camera camera_;
  glm::vec3 background_;
  std::optional<ColorGain> gain_;
};

/// ", 3.20 degrees from the truth" where that is known.
std::string angle_text(const Pose& pose, const std::optional<glm::dmat3>& truth) {
  return truth ? format(", %.2f degrees from the truth", angle_degrees(pose.rotation, *truth)) : "";
}

/// As blurred as the step was, by noise of the pixel: in the joint composition of triangles their seams would
/// show.
Smoothing blur_of(const PoseIteration& step) {
  const Smoothing& own = step.smoothing;
  if (own.composition != Composition::joint || own.occupancy_width != OccupancyWidth::fixed ||
      own.occupancy_prior == Prior::gumbel || is_sampled(own)) {
    return own;
  }
  Smoothing smoothing = own;
  smoothing.noise = Noise::pixel;
  smoothing.blur_radius.reset();
  return smoothing;
}

/// The start, then iterations of the descent that found the pose, at equal distances, first and last among
/// them.
std::vector<Picture> write_frames(const std::filesystem::path& file, PoseCamera& camera,
                                  const PoseResult& result, const std::optional<glm::dmat3>& truth) {
  std::vector<PoseIteration> history;
  std::ranges::copy_if(result.history, std::back_inserter(history),
                       [&](const PoseIteration& step) { return step.descent == result.descent; });
  std::vector<Image> images{camera.render_start(result)};
  std::vector<std::string> captions{"start" + angle_text(result.start, truth)};
  const std::size_t count = std::min(k_strip_length - 1, history.size());
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t last = history.size() - 1;
    const PoseIteration& step = history[count > 1 ? i * last / (count - 1) : last];
    images.push_back(camera.render(step, blur_of(step)));
    captions.push_back(format("iteration %u, %dx%d", step.iteration, step.width, step.height) +
                       angle_text(step.pose, truth));
  }
  return write_strip(file, images, captions);
}

/// Poses that explain the target equally well, as the end is rendered, each in the light that `light_with` finds with it.
std::vector<Picture> write_equals(const std::filesystem::path& file, PoseCamera& camera,
                                  const PoseResult& result,
                                  const std::function<FoundLight(const PoseHypothesis&)>& light_with) {
  if (result.equals.size() < 2) return {};
  std::vector<Image> images;
  std::vector<std::string> captions;
  for (const PoseHypothesis& other : result.equals) {
    if (images.size() == k_most_equals) break;
    camera.set_light(light_with(other));
    images.push_back(camera.render(other, rigid_smoothing()));
    captions.push_back(format("%.2f degrees from the result, loss %.4g",
                              angle_degrees(other.pose.rotation, result.pose.rotation), other.loss));
  }
  return write_strip(file, images, captions);
}

Plot pose_plot(const std::vector<PoseIteration>& history, const glm::dmat3& start,
               const std::optional<glm::dmat3>& truth) {
  constexpr double k_smallest = 1e-12;  // zero has no place on a logarithmic axis
  std::vector<double> x;
  Curve loss{"loss", {}}, angle{"angle", {}}, sigma{"sigma", {}}, gamma{"gamma", {}};
  for (const PoseIteration& step : history) {
    x.push_back(step.iteration);
    loss.y.push_back(std::max(step.loss, k_smallest));
    sigma.y.push_back(number(step.smoothing.sigma));
    gamma.y.push_back(number(step.smoothing.gamma));
    angle.y.push_back(truth ? angle_degrees(step.pose.rotation, *truth)
                            : angle_degrees(step.pose.rotation, start));
  }
  const char* const angle_title = truth ? "Rotation from the truth" : "Rotation from the start";
  return {"iteration",
          x,
          {{"Loss at the level's resolution", "loss", true, {loss}},
           {angle_title, "degrees", false, {angle}},
           {"Smoothing", "scale", true, {sigma, gamma}}}};
}

Json iteration_to_json(const PoseIteration& step, const std::optional<glm::dmat3>& truth) {
  const Smoothing& smoothing = step.smoothing;
  Json entry{{"iteration", step.iteration},
             {"descent", step.descent},
             {"loss", step.loss},
             {"sigma", number(smoothing.sigma)},
             {"gamma", number(smoothing.gamma)},
             {"samples", smoothing.samples},
             {"width", step.width},
             {"height", step.height},
             {"hypotheses", step.hypotheses}};
  if (truth) entry["angle_error_degrees"] = angle_degrees(step.pose.rotation, *truth);
  return entry;
}

/// The scene with all bodies but one where they were found.
Scene with_others(const Scene& scene, std::span<const FoundBody> found, const FoundBody* one = nullptr) {
  Scene result = scene;
  for (const FoundBody& body : found) {
    if (&body != one) PoseBody(scene, body.meshes).place(result, body.result.pose);
  }
  return result;
}

}  // namespace

std::span<const std::string_view> light_names() {
  static constexpr std::array<std::string_view, 3> names{"fixed", "gain", "harmonics"};
  return names;
}

std::string name_of(PoseLight light) { return std::string(light_names()[static_cast<std::size_t>(light)]); }

std::string name_of(PoseDoubt doubt) {
  constexpr std::array<const char*, 4> k_names{"none", "wrong_poses", "empty_picture", "other_pose"};
  return k_names[static_cast<std::size_t>(doubt)];
}

std::string doubt_text(const PoseResult& result) {
  if (result.doubt == PoseDoubt::other_pose) return "another pose leaves little more of it";
  return format("the error is %.3g times that of %s", result.unexplained_part,
                result.doubt == PoseDoubt::empty_picture ? "a picture without the object" : "wrong poses");
}

std::string suffix_of(const FoundBody& body, std::size_t bodies) {
  if (bodies == 1) return "";
  std::string text;
  for (const std::size_t mesh : body.meshes) text += (text.empty() ? "" : ", ") + std::to_string(mesh);
  return (body.meshes.size() > 1 ? ", meshes " : ", mesh ") + text;
}

PoseSolver::Callback progress_callback(unsigned iterations, bool quiet, const std::string& part) {
  const auto progress = std::make_shared<Progress>(iterations, quiet, "step", "of at most");
  return [progress, iterations, part, done = 0U, last = PoseIteration{}](const PoseIteration& step) mutable {
    const bool is_other_fit = !part.empty() && (step.body != last.body || step.width < last.width);
    if (is_other_fit || done == iterations) done = 0;
    last = step;
    const std::string restart = step.descent > 0 ? format("restart %u  ", step.descent) : "";
    const std::string of_part = part.empty() ? "" : part + format(" %zu  ", step.body);
    progress->update(++done, of_part + restart +
                                 format("%dx%d  poses tried: %u  loss %.4e", step.width, step.height,
                                        step.hypotheses, step.loss));
    return true;
  };
}

Json hypothesis_to_json(const PoseHypothesis& hypothesis, const Scene& scene, const PoseBody& body) {
  const Pose& pose = hypothesis.pose;
  const std::vector<glm::mat4> transforms = body.transforms(pose);
  Json json{{"rotation_matrix", rows_to_json(pose.rotation)},
            {"rotation", to_json(vector_from_rotation(pose.rotation))},
            {"translation", to_json(pose.translation)},
            {"transform", rows_to_json(glm::dmat4(transforms[body.first().mesh]))},
            {"focal_scale", hypothesis.focal_scale},
            {"loss", hypothesis.loss}};
  if (scene.meshes.size() > 1) {
    for (const BodyPart& part : body.parts()) {
      json["meshes"].push_back(part.mesh);
      json["transforms"].push_back(rows_to_json(glm::dmat4(transforms[part.mesh])));
    }
  }
  add_lens(json, calibrated(scene.camera, 1, hypothesis.radial));
  return json;
}

Json covariance_to_json(const std::vector<double>& covariance) {
  const auto size = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(covariance.size()))));
  Json rows = Json::array();
  for (std::size_t i = 0; i < size; ++i) {
    rows.push_back(
        Json(std::vector<double>(covariance.begin() + static_cast<std::ptrdiff_t>(i * size),
                                 covariance.begin() + static_cast<std::ptrdiff_t>((i + 1) * size))));
  }
  return rows;
}

/// The whole of pose.json for an only body; one of its `bodies` for several.
Json pose_to_json(const Scene& scene, const FoundBody& found, const std::optional<glm::dmat3>& truth) {
  const PoseBody body(scene, found.meshes);
  const PoseResult& result = found.result;
  Json json = hypothesis_to_json(result, scene, body);
  json["width"] = scene.width;
  json["height"] = scene.height;
  json["camera"] = camera_with_view(calibrated(scene.camera, result.focal_scale, result.radial));
  json["explained"] = result.explained;
  if (!result.explained) json["doubt"] = name_of(result.doubt);
  json["unexplained_part"] = result.unexplained_part;
  json["light"] = name_of(result.light);
  json["iterations"] = result.iterations;
  json["seconds"] = result.seconds;
  if (truth) {
    json["angle_error_degrees"] = {{"start", angle_degrees(result.start.rotation, *truth)},
                                   {"end", angle_degrees(result.pose.rotation, *truth)}};
  }
  json["covariance"] = covariance_to_json(result.covariance);
  Json& equals = json["hypotheses"] = Json::array();
  for (const PoseHypothesis& hypothesis : result.equals)
    equals.push_back(hypothesis_to_json(hypothesis, scene, body));
  Json& history = json["history"] = Json::array();
  for (const PoseIteration& step : result.history) history.push_back(iteration_to_json(step, truth));
  return json;
}

namespace {

/// A scene as it was found, from where its camera sees it; turned about a body of it.
Model found_model(const Scene& scene, const FoundBody& body, const Image& target) {
  Model model;
  model.heading = "The result, to turn by hand";
  model.caption = "The result as the camera sees it, before the target.";
  const PoseBody turned(scene, body.meshes);
  std::vector<std::size_t> meshes;
  for (const BodyPart& part : turned.parts()) meshes.push_back(part.mesh);
  const auto add = [&](std::size_t i) { add_mesh(model, mesh_of(scene, i), scene.meshes[i].transform); };
  for (const std::size_t i : meshes) add(i);
  model.pivot = center(bounding_box(model.positions));
  for (std::size_t i = 0; i < scene.meshes.size(); ++i)
    if (std::ranges::find(meshes, i) == meshes.end()) add(i);

  const Camera camera = calibrated(scene.camera, body.result.focal_scale, body.result.radial);
  float depth = camera.znear;
  for (const glm::vec3& p : model.positions) depth = std::max(depth, -(camera.view * glm::vec4(p, 1)).z);
  model.start = {camera, scene.width, scene.height};
  model.up = glm::normalize(glm::vec3(glm::inverse(camera.view)[1]));
  model.cameras = {{.camera = camera,
                    .width = scene.width,
                    .height = scene.height,
                    .depth = depth,
                    .label = "camera",
                    .name = "camera",
                    .picture = target}};
  return model;
}

/// The kind of light that all bodies are seen in: one that is found with any body holds for all.
PoseLight light_of_all(std::span<const FoundBody> found) {
  const auto strongest =
      std::ranges::max_element(found, {}, [](const FoundBody& body) { return body.result.light; });
  return strongest->result.light;
}

}  // namespace

Json poses_to_json(const Scene& scene, std::span<const FoundBody> found,
                   const std::optional<glm::dmat3>& truth) {
  if (found.size() == 1) return pose_to_json(scene, found.front(), truth);
  Json json{{"width", scene.width}, {"height", scene.height}, {"camera", camera_with_view(scene.camera)}};
  json["explained"] = std::ranges::all_of(found, [](const FoundBody& body) { return body.result.explained; });
  json["light"] = name_of(light_of_all(found));
  Json& bodies = json["bodies"] = Json::array();
  for (const FoundBody& body : found) {
    Json own = pose_to_json(scene, body, truth);
    for (const char* const shared : {"width", "height", "camera", "light"}) own.erase(shared);
    bodies.push_back(std::move(own));
  }
  return json;
}

FoundLight light_of(const Device& device, Scene scene, std::span<const FoundBody> found,
                    const PoseTarget& target) {
  const PoseResult& result = found.front().result;
  const PoseLight light = light_of_all(found);
  if (light == PoseLight::fixed) return {};
  constexpr float k_blur_pixels = 0.25F, k_robust_scale = 0.1F;  // of a robust fit that leaves it open
  const float blur = k_blur_pixels * 2 / static_cast<float>(std::min(scene.width, scene.height));  // NDC
  scene = with_others(scene, found);
  scene.smoothing = Smoothing();
  scene.smoothing.sigma = blur * blur;
  scene.camera = calibrated(scene.camera, result.focal_scale, result.radial);
  const auto& [image, method] = target;
  const ShapeView view{.image = image, .camera = scene.camera, .has_alpha = false, .mask = method.mask};
  const float open_scale = method.robust_scale > 0 ? method.robust_scale : k_robust_scale;
  const float scale = method.robust ? open_scale : 0;
  if (light == PoseLight::gain) return {find_gain(device, scene, view, scale), {}};
  return {{}, find_light(device, scene, {&view, 1}, scale)};
}

void add_light(Json& json, const FoundLight& light) {
  if (light.gain) {
    json["gain"] = to_json(light.gain->gain);
    json["offset"] = to_json(light.gain->offset);
  }
  if (light.lights) add_found_light(json, *light.lights);
}

void write_pose_report(const std::filesystem::path& folder, const PageSource& source, const Device& device,
                       const Scene& scene, std::span<const FoundBody> found, const PoseTarget& target,
                       const FoundLight& light, bool quiet, const std::optional<glm::dmat3>& truth) {
  make_folder(folder);
  PosePictures pictures;
  pictures.target = write_picture(folder / "target.png", target.image, "target");
  Image end;  // the same for every body
  unsigned iterations = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const PoseResult& result = found[i].result;
    const std::string number = found.size() > 1 ? "_" + std::to_string(i) : "";
    PoseCamera camera(device, with_others(scene, found, &found[i]), found[i], light);
    const auto light_with = [&](const PoseHypothesis& other) {
      std::vector<FoundBody> instead(found.begin(), found.end());
      static_cast<PoseHypothesis&>(instead[i].result) = other;
      return light_of(device, scene, instead, target);
    };
    if (i == 0) end = camera.render(result, rigid_smoothing());
    iterations += result.iterations;
    BodyPictures& body = pictures.bodies.emplace_back();
    body.frames = write_frames(folder / ("iterations" + number + ".png"), camera, result, truth);
    body.equals = write_equals(folder / ("equals" + number + ".png"), camera, result, light_with);
    body.plot = "plot" + number + ".png";
    body.curves = pose_plot(result.history, result.start.rotation, truth);
    if (!plot(folder / body.plot, body.curves)) {
      if (!quiet) std::printf("%s is left out: gnuplot is not installed\n", body.plot.c_str());
      body.plot.clear();
    }
  }
  const PoseResult& first = found.front().result;
  const Image start = PoseCamera(device, scene, found.front(), light).render_start(first);
  pictures.start = write_picture(folder / "start.png", start, "start" + angle_text(first.start, truth));
  pictures.end =
      write_picture(folder / "end.png", end,
                    format("end, after %u iterations", iterations) + angle_text(first.pose, truth));
  const Differences difference = differences({end}, {target.image});
  pictures.difference = write_picture(folder / "difference.png", difference.images.front(),
                                      difference.caption() + ": end and target");
  pictures.model = found_model(with_others(scene, found), found.front(), target.image);
  write_pose_page(folder / "index.html", source, found, pictures, truth);
}

}  // namespace dpr::cli
