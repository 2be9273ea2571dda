// Random scenes over the renderer's features, with all their parameters: what the gradient fuzzer draws.
#pragma once

#include <algorithm>
#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "check/scenes.hpp"
#include "dpr/renderer.hpp"
#include "scene/gradient_table.hpp"
#include "scene/light_table.hpp"
#include "support/reduced.hpp"

namespace dpr::test::gradients {

/// A scene, its views, and the names of what it has. `pixel` is what one pixel spans at the scene's middle,
/// in world units.
struct Trial {
  Scene scene;
  std::vector<View> views;
  std::set<std::string> features;
  double pixel = 0;

  bool has(const std::string& feature) const { return features.contains(feature); }
  std::string description() const {
    std::string all;
    for (const std::string& feature : features) all += (all.empty() ? "" : ", ") + feature;
    return all;
  }
};

/// Parameters of one kind, their derivatives, and for each the step that changes an image about as much as a
/// motion of one pixel does.
struct Parameters {
  std::string name;
  std::vector<double> found, units;
  std::function<void(Trial&, const std::vector<double>&)> move;
};

class Draw {
 public:
  explicit Draw(unsigned seed) : random_(seed) {}
  float between(float low, float high) { return random_(low, high); }
  glm::vec3 vector(float low, float high) { return random_.vector(low, high); }
  bool chance(float probability) { return random_(0, 1) < probability; }
  std::size_t below(std::size_t count) {
    return std::min(count - 1, static_cast<std::size_t>(random_(0, static_cast<float>(count))));
  }
  template <class Value>
  Value of(std::initializer_list<Value> values) {
    return values.begin()[below(values.size())];
  }

 private:
  check::Random random_;
};

inline Mesh random_mesh(Draw& draw, Trial& trial) {
  // On shared vertices: where two faces' own vertices part, a surface tears, and the image has a kink.
  Mesh mesh = draw.of<Mesh (*)()>(
      {[] { return make_icosphere(1, 1.1F); }, [] { return check::welded_cube(); },
       [] { return make_torus(0.8F, 0.35F, 12, 6); }, [] { return make_icosphere(2); }})();
  const bool many = mesh.faces.size() > 200;
  if (draw.chance(0.4F)) {
    trial.features.insert("face colours");
    mesh.vertex_colors.clear();
    mesh.face_colors.clear();
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) mesh.face_colors.push_back(draw.vector(0, 1));
  } else if (mesh.face_colors.empty() && draw.chance(0.5F)) {
    trial.features.insert("vertex colours");
    mesh.vertex_colors.clear();
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) mesh.vertex_colors.push_back(draw.vector(0, 1));
  }
  if (!mesh.face_colors.empty()) trial.features.insert("face colours");
  if (!many && draw.chance(0.25F)) {
    trial.features.insert("texture");
    mesh.textures.push_back(check::random_texture(5, 4, draw.of({Wrap::repeat, Wrap::mirror, Wrap::clamp}),
                                                  draw.of({Filter::bilinear, Filter::trilinear})));
    // One chart for all faces, with no vertex on a texel's centre, where bilinear filtering has a kink.
    for (const glm::vec3& p : mesh.positions)
      mesh.texcoords.emplace_back(0.41F * p.x + 0.317F, 0.41F * p.y + 0.1F * p.z + 0.131F);
    mesh.face_texcoords = mesh.faces;
  }
  return mesh;
}

inline void draw_lights(Draw& draw, Trial& trial) {
  if (!draw.chance(0.45F)) return;
  const auto shading = check::k_every_shading[draw.below(check::k_every_shading.size())];
  trial.features.insert("lit " + std::string(k_shadings[static_cast<std::size_t>(shading)]));
  trial.scene.lights = draw.chance(0.5F) ? check::every_light(shading) : check::two_lights(shading);
  Mesh& mesh = trial.scene.meshes[0].mesh;
  if (draw.chance(0.3F)) {
    trial.features.insert("materials");
    mesh.materials = {{draw.vector(0.2F, 1), 5.0F}, {draw.vector(0.2F, 1), std::nullopt}};
    for (std::size_t i = 0; i < mesh.faces.size(); ++i)
      mesh.face_materials.push_back(static_cast<unsigned>(i % 2));
  }
  if (draw.chance(0.3F)) {
    trial.features.insert("normals");
    for (const glm::vec3& p : mesh.positions) mesh.normals.push_back(p + draw.vector(-0.1F, 0.1F));
    mesh.face_normals = mesh.faces;
  }
}

inline void draw_camera(Draw& draw, Trial& trial) {
  Camera& camera = trial.scene.camera;
  const int size = std::min(trial.scene.width, trial.scene.height);
  const auto pixels = static_cast<float>(size);
  camera = orbit_camera(5.3F, draw.between(-60, 60), draw.between(0, 360), draw.vector(-0.1F, 0.1F));
  camera.fov_y_degrees = 40.0F;
  camera.znear = 2.0F;
  camera.zfar = 10.0F;
  trial.pixel = 2 * 5.3 * 0.364 / static_cast<double>(pixels);
  const std::size_t kind = draw.below(5);
  if (kind == 1) camera.orthographic_height = 3.9F;
  if (kind == 2) camera.intrinsics = {1.3F * pixels, 1.4F * pixels, 0.52F * pixels, 0.47F * pixels};
  if (kind == 3) {
    const float k1 = draw.between(-0.2F, 0.2F);
    camera.distortion =
        k1 < 0 ? Distortion{k1, 0.05F, 0.01F, -0.02F, 0.01F} : fisheye(k1, 0.05F, 0.01F, -0.02F);
  }
  // With noise of triangles images jump at the horizon of a face's plane (kernels/README.md).
  trial.scene.perspective_correct = draw.chance(trial.has("noise of triangles") ? 0.25F : 0.8F);
  if (!trial.scene.perspective_correct) trial.features.insert("affine");
  const bool is_far = trial.scene.width % 2 == 0;
  if (kind == 4) (is_far ? camera.zfar : camera.znear) = 5.0F;  // through the middle
  const char* const names[] = {"pinhole", "orthographic", "intrinsics", "lens",
                               is_far ? "far plane" : "near plane"};
  trial.features.insert(names[kind]);
}

inline void draw_smoothing(Draw& draw, Trial& trial) {
  Smoothing& smoothing = trial.scene.smoothing;
  const bool pixel = trial.has("noise of the pixel");
  const double size = std::min(trial.scene.width, trial.scene.height);
  const double scale = static_cast<double>(draw.between(0.7F, 2.0F)) * 2 / size;
  smoothing = smoothing_preset(pixel ? "pixel" : "gaussian");
  if (draw.chance(0.3F)) smoothing.distance = DistanceMetric::euclidean;
  smoothing.sigma =
      static_cast<float>(smoothing.distance == DistanceMetric::euclidean ? scale : scale * scale);
  smoothing.composition = draw.of({Composition::joint, Composition::barrier});
  smoothing.depth_prior = draw.of({Prior::gaussian, Prior::logistic, Prior::gumbel, Prior::cauchy});
  smoothing.occupancy_prior = draw.of({Prior::gaussian, Prior::logistic, Prior::cauchy});
  const std::size_t faces = trial.scene.meshes[0].mesh.faces.size();
  if (!pixel && faces > 200 && smoothing.occupancy_prior == Prior::cauchy)
    smoothing.occupancy_prior = Prior::gaussian;  // whose blur does not reach across the frame
  if (!pixel && trial.scene.meshes.size() * faces > 200 && smoothing.depth_prior == Prior::cauchy)
    smoothing.depth_prior = Prior::gaussian;  // under which a pixel's hundreds of faces do not all compete
  smoothing.gamma = draw.of({1e-4F, 1e-2F, 4e-2F});
  smoothing.background_depth = 0.45F;
  if (pixel) {
    smoothing.supersampling = draw.of({1U, 1U, 2U, 4U});
  } else {
    // The image jumps where a triangle comes within the blur radius (kernels/README.md): the less, the further
    // it is, and in the barrier the less depths count. Of the Cauchy prior it is the whole frame.
    smoothing.occupancy_threshold = 1e-6F;
    if (smoothing.occupancy_prior == Prior::cauchy) smoothing.blur_radius = 16.0F;
    if (smoothing.composition == Composition::barrier) {
      smoothing.gamma = draw.of({4e-2F, 8e-2F});
      smoothing.depth_prior = draw.of({Prior::gaussian, Prior::logistic, Prior::gumbel});
    }
  }
  trial.features.insert(std::string(to_string(smoothing.composition)));
  trial.features.insert("depths " + std::string(to_string(smoothing.depth_prior)));
  trial.features.insert("distances " + std::string(to_string(smoothing.occupancy_prior)));
  if (pixel) trial.features.insert("supersampling " + std::to_string(smoothing.supersampling));
}

/// Beside or before the first mesh: where meshes pass through each other, only the noise of depths moves the
/// line (kernels/README.md).
inline glm::mat4 beside(Draw& draw) {
  return check::placed(draw.between(0, 360), 0.5F, 1.9F * glm::normalize(draw.vector(-1, 1)));
}

inline Trial random_trial(unsigned seed) {
  Draw draw(seed);
  Trial trial;
  Scene& scene = trial.scene;
  for (int* const side : {&scene.width, &scene.height})
    *side = test::reduced(20, 8) + static_cast<int>(draw.below(test::is_reduced() ? 4 : 12));
  scene.background = draw.vector(0, 1);
  scene.meshes.push_back({random_mesh(draw, trial), check::placed(draw.between(0, 360))});
  if (draw.chance(0.3F)) {
    trial.features.insert("two meshes");
    scene.meshes.push_back({check::welded_cube(), beside(draw)});
  } else if (draw.chance(0.3F)) {
    trial.features.insert("instance");
    scene.meshes.push_back({{}, beside(draw), 0});
  }
  trial.features.insert(draw.chance(0.5F) ? "noise of the pixel" : "noise of triangles");
  draw_camera(draw, trial);
  draw_lights(draw, trial);
  draw_smoothing(draw, trial);
  // With noise of triangles a culled face's blur goes at once (kernels/README.md).
  if (draw.chance(0.3F) && trial.has("noise of the pixel")) {
    trial.features.insert("cull");
    scene.cull = draw.of({Cull::back, Cull::front});
  }
  for (const GradientName& name : gradient_names()) scene.gradients.*name.wanted = true;
  View view{scene.camera, {}};
  for (const Instance& instance : scene.meshes) view.transforms.push_back(instance.transform);
  trial.views = {view};
  if (draw.chance(0.2F)) {
    trial.features.insert("batch");
    for (glm::mat4& m : view.transforms) m = check::placed(draw.between(0, 50)) * m;
    trial.views.push_back(view);
  }
  return trial;
}

/// Every parameter of a trial that has a gradient there.
inline std::vector<Parameters> parameters_of(const Trial& trial, SceneGradient& gradient) {
  std::vector<Parameters> all;
  using Move = std::function<void(Trial&, std::size_t, double)>;  // of one number
  const auto add = [&](std::string name, std::vector<double> found, std::vector<double> units, Move move) {
    if (found.empty()) return;
    if (units.size() == 1) units.resize(found.size(), units[0]);
    all.push_back({std::move(name), std::move(found), std::move(units),
                   [move = std::move(move)](Trial& t, const std::vector<double>& by) {
                     for (std::size_t i = 0; i < by.size(); ++i) move(t, i, by[i]);
                   }});
  };
  const auto flat = [](const auto& vectors) {
    std::vector<double> numbers;
    for (const auto& v : vectors)
      for (int axis = 0; axis < v.length(); ++axis) numbers.push_back(static_cast<double>(v[axis]));
    return numbers;
  };
  const auto number = [](auto& vectors, std::size_t i, double by) {
    const auto length = static_cast<std::size_t>(vectors[0].length());
    vectors[i / length][static_cast<int>(i % length)] += static_cast<float>(by);
  };
  const double pixel = trial.pixel;
  const double size = std::min(trial.scene.width, trial.scene.height);
  for (std::size_t m = 0; m < trial.scene.meshes.size(); ++m) {
    const MeshGradient& of = gradient.meshes[m];
    const auto mesh = [m](Trial& t) -> Mesh& { return t.scene.meshes[m].mesh; };
    add("positions", flat(of.positions), {pixel},
        [=](Trial& t, std::size_t i, double by) { number(mesh(t).positions, i, by); });
    add("colours", flat(of.colors), {0.3}, [=](Trial& t, std::size_t i, double by) {
      number(mesh(t).vertex_colors.empty() ? mesh(t).face_colors : mesh(t).vertex_colors, i, by);
    });
    add("texture coordinates", flat(of.texcoords), {0.03},
        [=](Trial& t, std::size_t i, double by) { number(mesh(t).texcoords, i, by); });
    for (std::size_t k = 0; k < of.textures.size(); ++k)
      add("texels", flat(of.textures[k]), {0.3},
          [=](Trial& t, std::size_t i, double by) { number(mesh(t).textures[k].texels, i, by); });
    add("normals", flat(of.normals), {0.05},
        [=](Trial& t, std::size_t i, double by) { number(mesh(t).normals, i, by); });
    add("highlights", flat(of.specular), {0.3}, [=](Trial& t, std::size_t i, double by) {
      mesh(t).materials[i / 3].specular[static_cast<int>(i % 3)] += static_cast<float>(by);
    });
  }
  const auto add_pose = [&](const std::string& name, const PoseGradient& of, auto matrix) {
    add(name + " rotation", flat(std::vector{of.rotation}), {pixel},
        [=](Trial& t, std::size_t axis, double by) {
          glm::dvec3 about(0);
          about[static_cast<int>(axis)] = 1;
          glm::dmat4 m(matrix(t));
          const glm::dvec4 shift = m[3];
          m[3] = {0, 0, 0, 1};
          m = glm::rotate(glm::dmat4(1), by, about) * m;
          m[3] = shift;
          matrix(t) = glm::mat4(m);
        });
    add(name + " translation", flat(std::vector{of.translation}), {pixel},
        [=](Trial& t, std::size_t axis, double by) {
          matrix(t)[3][static_cast<int>(axis)] += static_cast<float>(by);
        });
  };
  for (std::size_t v = 0; v < trial.views.size(); ++v) {
    for (std::size_t m = 0; m < trial.scene.meshes.size(); ++m)
      add_pose("mesh", gradient.views[v].transforms[m],
               [=](Trial& t) -> glm::mat4& { return t.views[v].transforms[m]; });
    const CameraGradient& of = gradient.views[v].camera;
    const auto camera = [v](Trial& t) -> Camera& { return t.views[v].camera; };
    add_pose("camera", of.view, [=](Trial& t) -> glm::mat4& { return camera(t).view; });
    const Camera& own = trial.views[v].camera;
    if (own.orthographic_height)
      add("orthographic height", {of.orthographic_height}, {2 * pixel},
          [=](Trial& t, std::size_t, double by) {
            *camera(t).orthographic_height += static_cast<float>(by);
          });
    else if (own.intrinsics)
      add("intrinsics", {of.intrinsics.begin(), of.intrinsics.end()}, {2, 2, 1, 1},
          [=](Trial& t, std::size_t i, double by) {
            Intrinsics& k = *camera(t).intrinsics;
            (i == 0 ? k.fx : i == 1 ? k.fy : i == 2 ? k.cx : k.cy) += static_cast<float>(by);
          });
    else
      add("field of view", {of.fov_y_degrees}, {60 / size},
          [=](Trial& t, std::size_t, double by) { camera(t).fov_y_degrees += static_cast<float>(by); });
    if (own.distortion && own.distortion->model == LensModel::fisheye)
      add("distortion", {of.fisheye.begin(), of.fisheye.end()},
          {20 / size, 100 / size, 500 / size, 2500 / size}, [=](Trial& t, std::size_t i, double by) {
            Distortion& d = *camera(t).distortion;
            (i == 0 ? d.k1 : i == 1 ? d.k2 : i == 2 ? d.k3 : d.k4) += static_cast<float>(by);
          });
    else if (own.distortion)
      add("distortion", {of.distortion.begin(), of.distortion.end()},
          {20 / size, 100 / size, 8 / size, 8 / size, 500 / size}, [=](Trial& t, std::size_t i, double by) {
            Distortion& d = *camera(t).distortion;
            (i == 0 ? d.k1 : i == 1 ? d.k2 : i == 2 ? d.p1 : i == 3 ? d.p2 : d.k3) += static_cast<float>(by);
          });
  }
  if (trial.scene.lights) {
    std::vector<double> found, units;
    for_each_light_number(gradient, [&](std::string_view key, double value) {
      found.push_back(value);
      units.push_back(key.ends_with("degrees") ? 0.3 : 0.1);
    });
    add("lights", found, units, [](Trial& t, std::size_t i, double by) {
      std::size_t at = 0;
      for_each_light_number(*t.scene.lights, [&](std::string_view, float& value) {
        if (at++ == i) value += static_cast<float>(by);
      });
    });
  }
  const auto add_smoothing = [&](const char* name, double found, float Smoothing::*member) {
    add(name, {found}, {0.2 * static_cast<double>(trial.scene.smoothing.*member)},
        [=](Trial& t, std::size_t, double by) { t.scene.smoothing.*member += static_cast<float>(by); });
  };
  add_smoothing("sigma", gradient.sigma, &Smoothing::sigma);
  add_smoothing("gamma", gradient.gamma, &Smoothing::gamma);
  if (trial.scene.smoothing.composition == Composition::barrier)
    add_smoothing("alpha", gradient.alpha, &Smoothing::alpha);
  add("background", flat(std::vector{gradient.background}), {0.3}, [](Trial& t, std::size_t i, double by) {
    t.scene.background[static_cast<int>(i)] += static_cast<float>(by);
  });
  return all;
}

}  // namespace dpr::test::gradients
