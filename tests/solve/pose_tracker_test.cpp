// Poses in rendered sequences: of an object that moves faster and faster, that is covered, that leaves and comes back,
// that depths tell from its surroundings; and what the tracker refuses.
#include "dpr/pose_tracker.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "dpr/aov.hpp"
#include "dpr/error.hpp"
#include "dpr/renderer.hpp"
#include "support/messages.hpp"
#include "support/reduced.hpp"

namespace pose_tracker_test {

using namespace dpr;

namespace {

/// A body that looks different from every side: a sphere with bumps and colours.
Mesh body(int level) {
  Mesh mesh = make_icosphere(test::reduced(level, 1));
  mesh.vertex_colors.clear();
  for (glm::vec3& p : mesh.positions) {
    mesh.vertex_colors.push_back({0.5F + 0.4F * std::sin(3 * p.x + 1), 0.5F + 0.4F * std::sin(4 * p.y),
                                  0.5F + 0.4F * std::cos(2 * p.z + 2 * p.x)});
    p *= 1 + 0.25F * std::sin(2.5F * p.x + 0.5F) * std::cos(2 * p.y - p.z);
  }
  return mesh;
}

/// By default some 5,000 triangles.
Scene body_scene(int size = 160, int level = 4) {
  Scene scene;
  scene.width = scene.height = test::reduced(size, 16);
  scene.camera.view[3] = glm::vec4(0, 0, -5, 1);
  scene.camera.fov_y_degrees = 45;
  scene.camera.znear = 1;
  scene.camera.zfar = 20;
  scene.meshes.push_back({body(level), glm::mat4(1)});
  scene.lights.emplace();
  scene.lights->ambient = glm::vec3(0.4F);
  scene.lights->directional.push_back({.direction = {1, -1, -1}, .diffuse = glm::vec3(0.6F)});
  return scene;
}

/// A camera that sees the scene sharply.
class Film {
 public:
  Film(const Device& device, Scene scene) : camera_(scene.camera), renderer_(device) {
    scene.smoothing = rigid_smoothing();
    renderer_.set_scene(scene);
  }

  Image at(const Pose& pose) {
    glm::mat4 transform(glm::mat3(pose.rotation));
    transform[3] = glm::vec4(glm::vec3(pose.translation), 1);
    const View view{camera_, {transform}};
    renderer_.set_views({&view, 1});
    renderer_.forward();
    return renderer_.image();
  }

  /// The image with a silhouette and depths.
  TrackFrame seen_at(const Pose& pose) {
    TrackFrame frame{at(pose)};
    frame.silhouette = frame.depth = frame.image;
    const AuxiliaryOutputs outputs = auxiliary_outputs(renderer_);
    for (std::size_t i = 0; i < frame.image.pixels.size(); ++i) {
      frame.silhouette.pixels[i] = glm::vec4(frame.image.pixels[i].w);
      frame.depth.pixels[i] = glm::vec4(outputs.depth[i]);
    }
    return frame;
  }

 private:
  Camera camera_;
  Renderer renderer_;
};

/// Turns and moves faster and faster: at the end by 4.7 degrees and 1.5 pixels a frame.
Pose accelerating(int frame) {
  const double t = frame / 59.0;
  return {rotation_from_vector({0.6 * t * t, 2.4 * t * t, -0.5 * t}),
          glm::dvec3(-0.3 + 0.6 * t * t, 0.25 * t, 0.4 * t * t)};
}

TrackOptions near_start() {
  TrackOptions options;
  options.solve_translation = true;
  if (test::is_reduced()) {
    options.method.rotations = 4;
    options.method.iterations = 1;
    options.method.coarsest = 8;
  }
  return options;
}

/// Puts what moves behind the object, stripes of all colours and a wall with depths; and a grain over all colours.
void put_before_stripes(TrackFrame& frame, int number) {
  for (int row = 0; row < frame.image.height; ++row) {
    for (int column = 0; column < frame.image.width; ++column) {
      glm::vec4& pixel = frame.image.at(column, row);
      const float place = 0.2F * static_cast<float>(column + 3 * number) + 0.13F * static_cast<float>(row);
      const glm::vec3 stripe(0.5F + 0.4F * std::sin(place), 0.5F + 0.4F * std::cos(1.3F * place),
                             0.5F + 0.4F * std::sin(0.7F * place));
      const float grain = 0.07F * std::sin(static_cast<float>(7919 * column + 104729 * row + 17 * number));
      pixel = glm::vec4(glm::mix(stripe, glm::vec3(pixel), pixel.w) + grain, 1);
      if (frame.silhouette.at(column, row).x < 0.5F) frame.depth.at(column, row) = glm::vec4(8);
    }
  }
}

}  // namespace

TEST_SUITE("pipeline") {
  TEST_CASE(
      "tracker: an object that moves faster and faster is followed, and nothing is allocated on the way") {
    const Device device = open_device();
    const Scene scene = body_scene();
    Film film(device, scene);
    PoseTracker tracker(device, scene, near_start());
    std::size_t allocated = 0;
    int growths = 0;
    const int frames = test::reduced(60, 2);
    double worst_degrees = 0, worst_shift = 0;
    for (int frame = 0; frame < frames; ++frame) {
      CAPTURE(frame);
      const Pose truth = accelerating(frame);
      const TrackedPose found = tracker.track(film.at(truth));
      if (test::is_reduced()) continue;
      CHECK(found.status == (frame == 0 ? TrackStatus::found : TrackStatus::tracked));
      CHECK(found.loss < found.explained_below);
      CHECK(found.covariance.empty());
      worst_degrees = std::max(worst_degrees, angle_degrees(found.pose.rotation, truth.rotation));
      worst_shift = std::max(worst_shift, glm::length(found.pose.translation - truth.translation));
      growths += device.allocated_bytes() != allocated ? 1 : 0;
      allocated = device.allocated_bytes();
    }
    CHECK(growths < 8);  // buffers grow as the object comes nearer, not from frame to frame
    CHECK(worst_degrees < 0.8);
    CHECK(worst_shift < 0.02);  // mostly along the camera's axis: a third of a pixel at the rim is 0.03
  }

  TEST_CASE("tracker: an object that is covered, or leaves, is reported lost, and found again") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = body_scene(96, 3);
    Film film(device, scene);
    TrackOptions options = near_start();
    options.covariance = true;
    options.search_interval = 4;
    PoseTracker tracker(device, scene, options);
    const auto check_is_at = [](const TrackedPose& found, const Pose& truth) {
      CHECK(angle_degrees(found.pose.rotation, truth.rotation) < 0.8);
      CHECK(glm::length(found.pose.translation - truth.translation) < 0.02);
      CHECK(found.covariance.size() == 36);
    };
    const auto pose_at = [](double t) {
      return Pose{rotation_from_vector({0.1 * t, 0.04 * t, 0}), glm::dvec3(0.02 * t, 0, 0)};
    };
    for (int t = 0; t < 4; ++t) check_is_at(tracker.track(film.at(pose_at(t))), pose_at(t));
    // A grey board before it, and a scene without it.
    const Image board(scene.width, scene.height, glm::vec4(0.4F, 0.4F, 0.4F, 1));
    const Image empty(scene.width, scene.height, glm::vec4(0, 0, 0, 1));
    for (const Image& nothing : {board, empty}) {
      const TrackedPose lost = tracker.track(nothing);
      CHECK(lost.status == TrackStatus::lost);
      CHECK_FALSE(lost.loss < lost.explained_below);
      CHECK(lost.covariance.empty());
    }
    // About where it was: at once.
    TrackedPose found = tracker.track(film.at(pose_at(7)));
    CHECK(found.status == TrackStatus::found);
    check_is_at(found, pose_at(7));
    // It leaves to the left, in steps of a dozen pixels, and comes in from the other side after half a turn: found by a search everywhere, no
    // later than that is due.
    const auto leaving = [&](int t) {
      return Pose{pose_at(7).rotation, pose_at(7).translation - glm::dvec3(0.35 * t, 0, 0)};
    };
    bool was_lost = false;
    for (int t = 1; t < 12; ++t) was_lost = tracker.track(film.at(leaving(t))).status == TrackStatus::lost;
    CHECK(was_lost);
    const Pose elsewhere{rotation_from_vector({0.3, 2.8, 0.2}), glm::dvec3(0.8, 0.4, 0)};
    const Image back = film.at(elsewhere);
    unsigned waited = 0;
    do {
      found = tracker.track(back);
      ++waited;
    } while (found.status == TrackStatus::lost && waited < options.search_interval);
    CHECK(found.status == TrackStatus::found);
    check_is_at(found, elsewhere);
    CHECK(tracker.track(back).status == TrackStatus::tracked);
  }

  TEST_CASE("tracker: an object that comes in late is found where nothing is known of its rotation") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = body_scene(96, 3);
    Film film(device, scene);
    TrackOptions options = near_start();
    options.search = true;
    options.search_interval = 1;
    PoseTracker tracker(device, scene, options);
    const TrackedPose none = tracker.track(Image(scene.width, scene.height, glm::vec4(0, 0, 0, 1)));
    CHECK(none.status == TrackStatus::lost);
    CHECK(none.explained_below == 0);
    const Pose truth{rotation_from_vector({-0.5, 2, 1}), glm::dvec3(0.1, -0.2, 0)};
    const TrackedPose found = tracker.track(film.at(truth));
    CHECK(found.status == TrackStatus::found);
    CHECK(angle_degrees(found.pose.rotation, truth.rotation) < 0.8);
  }

  TEST_CASE("tracker: where the first rotation is wrong the first frame is searched everywhere") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = body_scene(96, 3);
    Film film(device, scene);
    const Pose truth{rotation_from_vector({-0.5, 2, 1}), glm::dvec3(0.1, -0.2, 0)};
    TrackOptions options = near_start();
    const TrackedPose found = PoseTracker(device, scene, options).track(film.at(truth));
    CHECK(found.status == TrackStatus::found);
    CHECK(angle_degrees(found.pose.rotation, truth.rotation) < 0.8);
    options.search_interval = 0;
    CHECK(PoseTracker(device, scene, options).track(film.at(truth)).status == TrackStatus::lost);
  }

  TEST_CASE("tracker: depths hold an object before surroundings that are not known") {
    if (test::is_reduced()) return;
    const Device device = open_device();
    const Scene scene = body_scene(96, 3);
    Film film(device, scene);
    TrackOptions options = near_start();
    options.method.robust = options.method.unknown_background = true;
    double worst[2] = {0, 0};  // distance from the truth without depths, and with
    for (const bool has_depth : {false, true}) {
      PoseTracker tracker(device, scene, options);
      for (int t = 0; t < 12; ++t) {
        const Pose truth{rotation_from_vector({0.05 * t, 0.03 * t, 0}), glm::dvec3(0.02 * t, 0, -0.08 * t)};
        TrackFrame frame = film.seen_at(truth);
        put_before_stripes(frame, t);
        frame.silhouette = {};
        if (!has_depth) frame.depth = {};
        const TrackedPose found = tracker.track(frame);
        CHECK(found.status == (t == 0 ? TrackStatus::found : TrackStatus::tracked));
        double& most = worst[has_depth ? 1 : 0];
        most = std::max(most, glm::length(found.pose.translation - truth.translation));
      }
    }
    CAPTURE(worst[0]);
    CHECK(worst[1] < 0.02);
    CHECK(worst[1] < 0.5 * worst[0]);
  }

  TEST_CASE("tracker: silhouettes count, and a frame may show nothing of the object") {
    const Device device = open_device();
    const Scene scene = body_scene(96, 3);
    Film film(device, scene);
    TrackOptions options = near_start();
    options.method.silhouette.weight = 1000;  // colours are exact
    PoseTracker tracker(device, scene, options);
    const auto pose_at = [](int t) {
      return Pose{rotation_from_vector({0.05 * t, 0, 0}), glm::dvec3(0.03 * t, 0, 0)};
    };
    for (int t = 0; t < test::reduced(4, 1); ++t) {
      const TrackedPose found = tracker.track(film.seen_at(pose_at(t)));
      if (test::is_reduced()) continue;
      CHECK(found.status == (t == 0 ? TrackStatus::found : TrackStatus::tracked));
      CHECK(angle_degrees(found.pose.rotation, pose_at(t).rotation) < 0.8);
    }
    TrackFrame nothing = film.seen_at(pose_at(4));
    std::ranges::fill(nothing.silhouette.pixels, glm::vec4(0));
    std::ranges::fill(nothing.depth.pixels, glm::vec4(0));
    CHECK(tracker.track(nothing).status == TrackStatus::lost);
    const TrackedPose again = tracker.track(film.seen_at(pose_at(5)));
    if (!test::is_reduced()) CHECK(again.status == TrackStatus::found);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("tracker: frames and options that it cannot use are refused, and the track goes on") {
    const Device device = open_device();
    const Scene scene = body_scene();
    Film film(device, scene);
    PoseTracker tracker(device, scene, near_start());
    const TrackedPose first = tracker.track(film.at({}));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, tracker.track(Image(3, 2)), "size of the frame (pose): got 3x2");
    Image broken = film.at({});
    broken.at(1, 1).y = std::numeric_limits<float>::quiet_NaN();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, tracker.track(broken), "frame (track): got a pixel that is not");
    TrackFrame frame = film.seen_at({});
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, tracker.track(frame),
                          "silhouette (track): got one, expected what");
    PoseTracker observing(device, scene, near_start());
    const auto refuses = [&](const char* says, auto change) {
      TrackFrame changed = frame;
      change(changed);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, observing.track(changed), says);
    };
    refuses("pixel of the depth (track): got -1",
            [](TrackFrame& f) { f.depth.at(1, 1) = glm::vec4(-1, 0, 0, 1); });
    refuses("pixel of the silhouette (track): got 2", [](TrackFrame& f) { f.silhouette.at(1, 1).x = 2; });
    refuses("size of the depth (pose): got 3x2", [](TrackFrame& f) { f.depth = Image(3, 2); });
    observing.track(frame);
    refuses("depth (track): got none", [](TrackFrame& f) { f.depth = {}; });
    TrackOptions anything = near_start();
    anything.method.robust = anything.method.unknown_background = true;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, PoseTracker(device, scene, anything).track(frame),
                          "silhouette (track): got one, which tells the background apart");
    const TrackedPose next = tracker.track(film.at({}));
    if (!test::is_reduced()) CHECK(first.status == TrackStatus::found);
    if (!test::is_reduced()) CHECK(next.status == TrackStatus::tracked);

    const auto refused = [&](const char* says, auto change) {
      TrackOptions options = near_start();
      change(options);
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, PoseTracker(device, scene, options), says);
    };
    refused("damping (track): got 1.5", [](TrackOptions& o) { o.damping = 1.5F; });
    refused("damping (track)", [](TrackOptions& o) { o.damping = std::numeric_limits<float>::quiet_NaN(); });
    refused("explained (pose): got 0", [](TrackOptions& o) { o.explained = 0; });
    refused("rotations (track search): got 0", [](TrackOptions& o) {
      o.search = true;
      o.method.rotations = 0;
    });
    refused("got a silhouette or depths",
            [](TrackOptions& o) { o.method.silhouette.image = Image(160, 160); });
    Scene two = scene;
    two.meshes.push_back(two.meshes.front());
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, PoseTracker(device, two, near_start()),
                          "number of meshes (pose): got 2");
    two.meshes.clear();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, PoseTracker(device, two, near_start()),
                          "meshes (scene): got none");
  }
}

}  // namespace pose_tracker_test
