// Poses in a sequence: predicted, followed from level to level, given up and searched for.
#include "dpr/pose_tracker.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "base/checks.hpp"
#include "solve/pose_beam.hpp"
#include "solve/pose_fit.hpp"
#include "solve/pose_motion.hpp"
#include "solve/pose_pivot.hpp"
#include "solve/pose_pyramid.hpp"
#include "solve/resample.hpp"
#include "solve/track_levels.hpp"
#include "solve/track_starts.hpp"

namespace dpr {
namespace {

// Few hypotheses are worth following about a place that is known.
constexpr Beam k_narrow_beam{12, 6, 3, 2};

const auto k_go_on = [] { return true; };

PoseOptions pose_options(const TrackOptions& options) {
  return {.method = options.method,
          .solve_translation = options.solve_translation,
          .explained = options.explained};
}

void validate(const TrackOptions& options) {
  if (has_observations(options.method)) {
    throw InvalidArgument("method (track)", "a silhouette or depths, which are of one image",
                          "none: each frame has its own");
  }
  require(options.damping >= 0 && options.damping <= 1, "damping (track)", options.damping,
          "a number in [0, 1]");
  require(!options.search || options.method.rotations > 0, "rotations (track search)",
          options.method.rotations, "at least 1");
}

}  // namespace

LeastSquares track_least_squares() {
  LeastSquares method;
  method.noise = Noise::pixel;
  return method;
}

struct PoseTracker::Impl {
  Impl(Device device_, const Scene& scene, TrackOptions options_)
      : device(std::move(device_)),
        options(std::move(options_)),
        pivot(checked(scene, options, device), pose_options(options)),
        body(pivot.scene(), {}),
        start(body.pose()),
        motion(start, static_cast<double>(options.damping)),
        half_turns(dpr::half_turns(body.points(pivot.scene()))) {}

  TrackedPose track(const TrackFrame& frame);

 private:
  /// The solver for single images finds what is wrong with the scene or the method.
  static const Scene& checked(const Scene& scene, const TrackOptions& options, const Device& device) {
    validate(options);
    validate(scene);
    PoseSolver(device, scene, Image(scene.width, scene.height), pose_options(options));
    return scene;
  }

  /// True if a search everywhere is due.
  bool is_due() const {
    return options.search_interval > 0 && misses % options.search_interval == 0 &&
           options.method.rotations > 0;
  }
  /// A pose of a frame, and the loss below which it explains that.
  struct Judged {
    Candidate candidate;
    double below;

    /// The loss in parts of what is allowed: no number if nothing is left or allowed.
    double share() const { return candidate.equations.loss / below; }
  };
  Judged judge(const Candidate& candidate) { return {candidate, explained_below(candidate.hypothesis)}; }
  /// 0 of a hypothesis that covers nothing where the background is not known.
  double explained_below(const Hypothesis& hypothesis) {
    const double unexplained = levels->unexplained(levels->size() - 1);
    const LossParts parts = levels->finest().loss_parts(hypothesis);
    const double covered = unexplained - parts.common();
    if (covered <= k_least_covered * unexplained) return 0;
    return parts.sum() + explained_part(options.explained, options.method.robust) * covered;
  }

  void check(const TrackFrame& frame) const;
  TrackedPose first(const TrackFrame& frame);
  void make_levels(const Pose& near, const TrackFrame& frame);
  std::optional<Judged> follow();
  std::size_t first_level() const;
  Candidate follow_from(std::size_t level, const Pose& pose);
  void descend(std::vector<Candidate>& candidates, const Beam& beam);
  std::optional<Judged> search();
  std::optional<Judged> best_about();
  std::optional<Judged> best_everywhere();
  std::optional<Judged> judged(const std::vector<Candidate>& candidates);
  TrackedPose result(TrackStatus status, const Judged& judged);
  TrackedPose missed();

  Device device;
  TrackOptions options;
  PosePivot pivot;
  PoseBody body;
  Pose start;  // about the pivot, as all poses here
  PoseMotion motion;
  std::array<glm::dmat3, 3> half_turns;
  bool has_frame = false, has_silhouette = false, has_depth = false;  // as the first frame, if there was one
  unsigned misses = 0;                                                // frames since the object was seen
  std::optional<FittedPose> seen;       // in the first frame that showed the object
  std::unique_ptr<TrackLevels> levels;  // made then
  // Distance that the last prediction was off by, NDC at the rim.
  double surprise = std::numeric_limits<double>::infinity();
  double usual_share = 0;  // of the losses allowed, in the last frames; 0: not known
  double least_loss = 0;   // of the poses tried in a frame that is not explained
};

void PoseTracker::Impl::check(const TrackFrame& frame) const {
  const Scene& scene = pivot.scene();
  require_size(frame.image, scene, "frame");
  checks::require_pixels(frame.image, "frame (track)");
  const auto check_kind = [&](const Image& image, bool is_wanted, const char* name, const char* expected,
                              const auto& is_right) {
    const bool is_there = !image.pixels.empty();
    if (has_frame && is_there != is_wanted)
      throw InvalidArgument(checks::in(name, "track"), is_there ? "one" : "none", "what the first frame has");
    if (!is_there) return;
    require_size(image, scene, name);
    const auto wrong = std::ranges::find_if_not(image.pixels, is_right);
    if (wrong == image.pixels.end()) return;
    throw InvalidArgument(checks::in("pixel of the " + std::string(name), "track"), checks::text(wrong->x),
                          expected);
  };
  check_kind(frame.silhouette, has_silhouette, "silhouette", "a coverage in [0, 1]",
             [](const glm::vec4& p) { return p.x >= 0 && p.x <= 1; });
  check_kind(frame.depth, has_depth, "depth", "a distance along the camera's axis, or 0 for none",
             [](const glm::vec4& p) { return !dpr::has_depth(p) || p.x > 0; });
  if (options.method.unknown_background && !frame.silhouette.pixels.empty()) {
    throw InvalidArgument("silhouette (track)", "one, which tells the background apart",
                          "none beside an unknown background");
  }
}

TrackedPose PoseTracker::Impl::track(const TrackFrame& frame) {
  check(frame);
  if (!has_frame) {
    has_frame = true;
    has_silhouette = !frame.silhouette.pixels.empty();
    has_depth = !frame.depth.pixels.empty();
  }
  if (!seen) return first(frame);
  if (levels->suits(motion.last())) {
    levels->set_frame(frame);
  } else {
    make_levels(motion.last(), frame);
  }
  least_loss = std::numeric_limits<double>::infinity();
  if (misses == 0) {
    if (const auto followed = follow()) return result(TrackStatus::tracked, *followed);
  }
  if (const auto found = search()) return result(TrackStatus::found, *found);
  return missed();
}

/// A frame before the object was seen at all.
TrackedPose PoseTracker::Impl::first(const TrackFrame& frame) {
  const auto fit = [&](bool anywhere) {
    LeastSquares method = observing(options.method, frame);
    if (!anywhere) method.rotations = 0;
    PoseOptions single = pose_options(options);
    single.method = std::move(method);
    const Foreknowledge known = anywhere ? Foreknowledge::place : Foreknowledge::start;
    return fit_pose(device, pivot.scene(), frame.image, single, {&start, 1}, known, {});
  };
  const bool is_unknown = options.search || misses > 0;
  FittedPose fitted = fit(is_unknown && is_due());
  if (!fitted.result.explained && !is_unknown && is_due()) fitted = fit(true);
  if (!fitted.result.explained) {
    ++misses;
    return {.pose = pivot.to_origin(start), .loss = fitted.result.loss};
  }
  seen = std::move(fitted);
  make_levels(seen->result.pose, frame);
  return result(TrackStatus::found, judge(follow_from(levels->size() - 1, seen->result.pose)));
}

void PoseTracker::Impl::make_levels(const Pose& near, const TrackFrame& frame) {
  const std::vector<LossScales> scales = levels ? levels->scales() : std::vector<LossScales>();
  levels.reset();  // whose memory others may take
  levels =
      std::make_unique<TrackLevels>(device, pivot.scene(), pose_options(options), *seen, near, frame, scales);
}

/// The finest level alone where the last prediction was off by no more than a few pixels, or else from the one before:
/// coarser images lead astray where little of the surface shows in them.
std::size_t PoseTracker::Impl::first_level() const {
  constexpr double k_near_pixels = 3;
  const std::size_t last = levels->size() - 1;
  return last > 0 && surprise > k_near_pixels * levels->pixel_ndc(last) ? last - 1 : last;
}

/// One hypothesis, in few steps, and more while those are long.
Candidate PoseTracker::Impl::follow_from(std::size_t level, const Pose& pose) {
  constexpr Turns k_turns{.enough = 3, .most = 6, .is_end = true, .longer_pixels = 0.1};
  std::vector<Candidate> one{{{pose}}};
  for (; level < levels->size(); ++level) {
    one.front().restart();
    refine(levels->at(level), levels->space(), one, k_turns, k_go_on);
  }
  return one.front();
}

/// The pose in the next frame, where that explains it.
std::optional<PoseTracker::Impl::Judged> PoseTracker::Impl::follow() {
  // Losses that rise by so much, and are not small, may be those of a pose that has slipped.
  constexpr double k_unusual = 4, k_not_small = 0.25;
  const Pose expected = motion.next();
  const Judged followed = judge(follow_from(first_level(), expected));
  const double part = followed.share();
  if (part < 1 && part < std::max(k_unusual * usual_share, k_not_small)) return followed;
  std::vector<Candidate> candidates{{{expected}}, {{motion.last()}}, followed.candidate};
  descend(candidates, k_narrow_beam);
  return judged(candidates);
}

/// Refines candidates from the coarsest level to the finest.
void PoseTracker::Impl::descend(std::vector<Candidate>& candidates, const Beam& beam) {
  for (std::size_t i = 0; i < levels->size(); ++i) {
    const BeamWork work{options.method.iterations, most_at(beam, i + 1), levels->unexplained(i)};
    refine_distinct(levels->at(i), levels->space(), candidates, work, k_go_on);
  }
}

/// The best of candidates at the finest level, or the one nearest to the motion of those that are as good: none if it
/// does not explain the frame, or another leaves little more.
std::optional<PoseTracker::Impl::Judged> PoseTracker::Impl::judged(const std::vector<Candidate>& candidates) {
  const Candidate& best = candidates.front();
  least_loss = std::min(least_loss, best.equations.loss);
  const double enough = enough_to_equal(best.equations.loss, levels->unexplained(levels->size() - 1));
  const Judged judged_best = judge(best);
  if (!(judged_best.share() < 1) || is_doubtful(candidates, levels->space(), enough)) return std::nullopt;
  const Hypothesis expected{motion.next()};
  const Candidate* nearest = &best;
  for (const Candidate& c : candidates) {
    const auto distance = [&](const Candidate& of) {
      return levels->space().distance(of.hypothesis, expected);
    };
    if (c.equations.loss <= enough && distance(c) < distance(*nearest)) nearest = &c;
  }
  return nearest == &best ? judged_best : judge(*nearest);
}

std::optional<PoseTracker::Impl::Judged> PoseTracker::Impl::search() {
  if (const auto near = best_about()) return near;
  return is_due() ? best_everywhere() : std::nullopt;
}

/// About the last pose, and about the one that its motion would have led to.
std::optional<PoseTracker::Impl::Judged> PoseTracker::Impl::best_about() {
  std::vector<Hypothesis> hypotheses;
  for (const Pose& pose : {motion.last(), motion.next()}) {
    const auto about = hypotheses_about(pose, levels->space(), pivot.scene(), options.solve_translation);
    hypotheses.insert(hypotheses.end(), about.begin(), about.end());
  }
  std::vector<Candidate> candidates = least_losses(levels->at(0), hypotheses, k_narrow_beam.front());
  descend(candidates, k_narrow_beam);
  return judged(candidates);
}

std::optional<PoseTracker::Impl::Judged> PoseTracker::Impl::best_everywhere() {
  const Beam& beam = beam_of(options.method);
  const auto hypotheses = hypotheses_everywhere(motion.last().translation, levels->space(), pivot.scene(),
                                                options.method.rotations, options.solve_translation);
  std::vector<Candidate> candidates = least_losses(levels->at(0), hypotheses, beam.front());
  descend(candidates, beam);
  const std::size_t own = candidates.size();
  const double wrong = levels->unexplained(levels->size() - 1);
  add_half_turns(candidates, half_turns, 1);
  drop_hopeless_at(levels->finest(), candidates, own, k_hope, wrong);
  if (candidates.size() > own) {
    refine_distinct(levels->finest(), levels->space(), candidates,
                    {options.method.iterations, beam.back(), wrong}, k_go_on);
  }
  return judged(candidates);
}

TrackedPose PoseTracker::Impl::result(TrackStatus status, const Judged& judged) {
  constexpr double k_newest = 0.2;  // its weight in the mean
  const Hypothesis& hypothesis = judged.candidate.hypothesis;
  const Pose& pose = hypothesis.pose;
  const double part = judged.share();
  const bool is_followed = status == TrackStatus::tracked;
  surprise = is_followed ? levels->space().distance({motion.next()}, hypothesis)
                         : std::numeric_limits<double>::infinity();
  usual_share = is_followed && usual_share > 0 ? (1 - k_newest) * usual_share + k_newest * part : part;
  if (is_followed) {
    motion.follow(pose);
  } else {
    motion.restart(pose);
  }
  misses = 0;
  TrackedPose tracked{.status = status,
                      .pose = pivot.to_origin(pose),
                      .loss = judged.candidate.equations.loss,
                      .explained_below = judged.below};
  if (options.covariance) {
    tracked.covariance = pose_covariance(levels->finest(), levels->space(), hypothesis);
    pivot.to_origin(pose, tracked.covariance);
  }
  return tracked;
}

TrackedPose PoseTracker::Impl::missed() {
  ++misses;
  motion.miss();
  return {.pose = pivot.to_origin(motion.guess()),
          .loss = least_loss,
          .explained_below = explained_below({motion.guess()})};
}

PoseTracker::PoseTracker(Device device, const Scene& scene, TrackOptions options)
    : impl_(std::make_unique<Impl>(std::move(device), scene, std::move(options))) {}
PoseTracker::~PoseTracker() = default;
PoseTracker::PoseTracker(PoseTracker&&) noexcept = default;
PoseTracker& PoseTracker::operator=(PoseTracker&&) noexcept = default;

TrackedPose PoseTracker::track(const TrackFrame& frame) { return impl_->track(frame); }

}  // namespace dpr
