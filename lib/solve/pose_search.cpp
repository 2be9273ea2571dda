// Hypotheses from a grid of rotations, halved from level to level.
#include "solve/pose_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>

#include "solve/pose_beam.hpp"
#include "solve/pose_pyramid.hpp"

namespace dpr {
namespace {

// Number of the best hypotheses, each in a light of its own, that are tried after half a turn too.
constexpr std::size_t k_turned = 4;
// Rotations by which it is known what a wrong pose leaves: the finest level's renders are dear.
constexpr std::size_t k_wrong = 15;

/// One fit at work: the candidates on their way through the levels.
class Fit {
 public:
  Fit(const Device& device, std::span<const PoseProblem> pictures, std::span<const Pose> initial,
      const PosePlaces& places, Foreknowledge known, const PoseSolver::Callback& callback)
      : device_(device),
        scene_(pictures.front().scene),
        options_(pictures.front().options),
        method_(std::get<LeastSquares>(options_.method)),
        has_colors_(std::ranges::any_of(pictures, [](const auto& p) { return !p.target.pixels.empty(); })),
        light_wanted_(has_colors_ ? method_.light : PoseLight::fixed),
        callback_(callback),
        anywhere_(known == Foreknowledge::place),
        is_near_(known == Foreknowledge::pose),
        beam_(beam_of(method_)),
        initial_(initial.begin(), initial.end()),
        places_(places),
        space_(scene_, places.about(), options_),
        half_turns_(half_turns(space_.body().points(scene_))) {
    for (const PoseProblem& p : pictures)
      pictures_.push_back({p.scene, p.target, std::get<LeastSquares>(p.options.method)});
  }

  FittedPose run();

 private:
  void start(PoseLevel& level);
  /// Candidates found under another light, and the level at which that search was given up.
  struct Found {
    std::vector<Candidate> candidates;
    std::size_t level = 0;
  };

  std::optional<Found> descend(const std::vector<LevelShape>& shapes, const Found& found);
  void add_others(PoseLevel& level, const std::vector<Candidate>& found);
  void add_initial();
  PoseLevel make_level(const LevelShape& shape, PoseLight light) const;
  void choose_light(const LevelShape& shape);
  void choose_normals(const LevelShape& shape);
  LevelShape final_shape(LevelShape shape) const;
  bool is_unexplained(PoseLevel& level, const LevelShape& shape, bool is_finest) const;
  bool fills_picture(double uncovered, double blank) const;
  float light_gain(PoseLevel& level, const LevelShape& shape) const;
  void rescale(PoseLevel& level);
  void set_scales(PoseLevel& level, std::span<const Hypothesis> hypotheses) const;
  std::vector<Hypothesis> hypotheses() const { return hypotheses_of(candidates_); }
  double wrong_loss(PoseLevel& level) const { return dpr::wrong_loss(level, places_.grid(k_wrong)); }
  /// Refines all candidates at a level and keeps the best distinct ones.
  void work(PoseLevel& level, std::size_t keep);
  void try_half_turns(PoseLevel& level);
  void try_wider(PoseLevel& level);
  double enough() const { return enough_to_equal(candidates_.front().equations.loss, wrong_); }
  void finish(PoseLevel& level);
  void choose_equals();
  bool report(const PoseLevel& level);

  const Device& device_;
  const Scene& scene_;  // of the first picture, as its options
  const PoseOptions& options_;
  const LeastSquares& method_;
  std::vector<LevelPicture> pictures_;
  bool has_colors_;
  PoseLight light_wanted_;  // fixed of targets without colours
  const PoseSolver::Callback& callback_;
  bool anywhere_, is_near_;  // the first initial pose is as good as any; it is nearly right
  const Beam& beam_;
  std::vector<Pose> initial_;
  const PosePlaces& places_;
  PoseSpace space_;
  std::array<glm::dmat3, 3> half_turns_;
  PoseLight light_ = PoseLight::fixed;  // tried at present
  CornerNormals normals_ = CornerNormals::parted;
  bool goes_on_ = true;
  std::vector<Candidate> candidates_;
  std::vector<Candidate> spare_;  // equals of the best that a level had no room for
  double wrong_ = 0;              // loss of a pose that explains nothing
  PoseResult result_;
};

FittedPose Fit::run() {
  result_.start = initial_.front();
  const std::vector<LevelShape> shapes = places_.shapes(level_shapes(scene_, method_), space_);
  if (const std::optional<Found> found = descend(shapes, {}); found && goes_on_) {
    light_ = light_wanted_;
    descend(shapes, *found);
    choose_light(shapes[shapes.size() - 2]);
    choose_normals(shapes[shapes.size() - 2]);
  }
  const LevelShape finest = final_shape(shapes.back());
  PoseLevel level = make_level(finest, light_);
  rescale(level);
  add_initial();
  drop_hopeless_at(level, candidates_, 0, k_last_hope, wrong_);
  work(level, beam_.back());
  if (method_.rotations > 0) try_half_turns(level);
  if (method_.robust && has_colors_) try_wider(level);
  // A wrong pose leaves as much in a pixel's sample as in the mean over its area, which is dear.
  PoseLevel sampled = make_level(shapes.back(), light_);
  sampled.set_scales(level.scales());
  wrong_ = wrong_loss(sampled);
  const double other = level.loss_parts(candidates_.front().hypothesis).sum();
  const bool is_doubted = anywhere_ && is_doubtful(candidates_, space_, enough(), other);
  finish(level);
  const LossParts parts = level.loss_parts(candidates_.front().hypothesis);
  const double blank = sampled.blank_loss(),
               unexplained = method_.unknown_background ? blank : std::min(wrong_, blank);
  const bool is_robust = method_.robust || (!has_colors_ && !method_.depth.image.pixels.empty());
  if (pictures_.size() > 1) result_.view_parts = level.blank_parts(candidates_.front().hypothesis);
  if (unexplained - parts.common() > k_least_covered * unexplained)
    result_.unexplained_part = std::max(result_.loss - parts.sum(), 0.0) / (unexplained - parts.common());
  if (!fills_picture(parts.uncovered, blank) &&
      result_.unexplained_part < explained_part(options_.explained, is_robust)) {
    result_.doubt = is_doubted ? PoseDoubt::other_pose : PoseDoubt::none;
  } else {
    result_.doubt = unexplained == blank ? PoseDoubt::empty_picture : PoseDoubt::wrong_poses;
  }
  result_.explained = result_.doubt == PoseDoubt::none;
  return {std::move(result_), normals_, level.color_scale(), finest.samples,
          blank > 0 ? unexplained / blank : 1};
}

/// True if the object covers nearly all that is compared, and nothing says that it does: before a background that is
/// not known, anything of few colours explains a picture so.
bool Fit::fills_picture(double uncovered, double blank) const {
  constexpr double k_little = 0.1;
  return method_.unknown_background && !method_.box && method_.mask.pixels.empty() &&
         uncovered < k_little * blank;
}

/// Through all levels but the last; `found` come in again where they were given up. Returns what was found if
/// another light should be tried.
std::optional<Fit::Found> Fit::descend(const std::vector<LevelShape>& shapes, const Found& found) {
  const std::vector<Candidate> none;
  candidates_.clear();
  for (std::size_t i = 0; i + 1 < shapes.size() && (goes_on_ || i == 0); ++i) {
    const bool is_finest = i + 2 == shapes.size();
    // The coarsest images constrain a light's direction so little that it would explain any pose.
    const bool is_known = light_ == PoseLight::fixed || i > 0 || is_finest;
    PoseLevel level = make_level(shapes[i], is_known ? light_ : PoseLight::gain);
    if (i == 0) start(level);
    if (i > 0) rescale(level);
    if (i > 0 && light_ != PoseLight::fixed) add_others(level, i == found.level ? found.candidates : none);
    work(level, most_at(beam_, i + 1));
    if (!goes_on_ || light_ != PoseLight::fixed || light_wanted_ == PoseLight::fixed) continue;
    if ((i > 0 || is_finest) && is_unexplained(level, shapes[i], is_finest))
      return Found{std::move(candidates_), i};
  }
  return std::nullopt;
}

/// Adds the candidates found elsewhere. A search over rotations also adds the best of them after half a turn:
/// many objects look much the same then, and coarse images in unknown light do not tell the two apart.
void Fit::add_others(PoseLevel& level, const std::vector<Candidate>& found) {
  const std::size_t own = candidates_.size();
  add_half_turns(candidates_, half_turns_, method_.rotations > 0 ? std::min(own, k_turned) : 0);
  candidates_.insert(candidates_.end(), found.begin(), found.end());
  drop_hopeless_at(level, candidates_, own, k_hope, wrong_);
}

/// Adds the initial poses as they were given: coarse images may have led away from one that was nearly right.
void Fit::add_initial() {
  if (anywhere_) return;
  for (const Pose& pose : initial_) candidates_.push_back({{pose}});
}

/// The best pose after half a turn about each axis, refined where it explains anything.
void Fit::try_half_turns(PoseLevel& level) {
  const std::size_t own = candidates_.size();
  add_half_turns(candidates_, half_turns_, 1);
  drop_hopeless_at(level, candidates_, own, k_hope, wrong_);
  if (candidates_.size() > own) work(level, beam_.back());
}

/// The best pose once more, from where a wide robust loss leads it: the last one sees nothing of edges that are not yet
/// aligned.
void Fit::try_wider(PoseLevel& level) {
  constexpr float k_wider = 12;
  if (!goes_on_) return;
  const auto go_on = [] { return true; };
  const std::vector<LossScales> scales = level.scales();
  const Turns turns{method_.iterations, k_patience * method_.iterations};
  std::vector<Candidate> wide{{candidates_.front().hypothesis}};
  level.set_color_scale(k_wider * level.color_scale());
  refine(level, space_, wide, turns, go_on);
  level.set_scales(scales);
  wide.front().restart();
  refine(level, space_, wide, turns, go_on);
  candidates_.push_back({wide.front().hypothesis});
  refine_distinct(level, space_, candidates_, {0, beam_.back(), wrong_}, go_on);
}

PoseLevel Fit::make_level(const LevelShape& shape, PoseLight light) const {
  const std::optional<glm::dmat3> rotation =
      is_near_ ? std::optional(initial_.front().rotation) : std::nullopt;
  return PoseLevel(device_, pictures_, space_, shape, light, normals_, rotation);
}

/// True if the search should go on in another light than the scene's.
bool Fit::is_unexplained(PoseLevel& level, const LevelShape& shape, bool is_finest) const {
  constexpr double k_unexplained = 0.2, k_doubtful = 0.1;  // of what a wrong pose leaves
  constexpr float k_better = 0.7F, k_much_better = 0.5F;
  // A robust loss cannot tell, and losses of levels whose observations differ in weight do not compare.
  if (!method_.robust && !level.has_observations()) {
    const Candidate& best = candidates_.front();
    const double noise = level.loss_parts(best.hypothesis).noise;
    const double part = (best.equations.loss - noise) / (wrong_ - noise);
    if (part > (is_finest ? k_doubtful : k_unexplained)) return true;
    if (!is_finest && part <= k_doubtful) return false;
  } else if (method_.robust && !is_finest) {
    return false;
  }
  return light_gain(level, shape) < (is_finest ? k_better : k_much_better);
}

/// Residual of most of the object in a light of its own, relative to the residual in the scene's light.
float Fit::light_gain(PoseLevel& level, const LevelShape& shape) const {
  PoseLevel lit = make_level(shape, light_wanted_);
  level.estimate_scale(hypotheses());
  lit.estimate_scale(hypotheses());
  return level.color_scale() > 0 ? lit.color_scale() / level.color_scale() : 1;
}

/// The scene's light, unless the other one leaves less.
void Fit::choose_light(const LevelShape& shape) {
  constexpr float k_less = 0.9F;
  PoseLevel level = make_level(shape, PoseLight::fixed);
  if (light_gain(level, shape) >= k_less) light_ = PoseLight::fixed;
}

/// Other software shades the faces at a sharp edge apart, or as one surface: whichever explains the target
/// better. A mesh's own normals leave nothing to choose.
void Fit::choose_normals(const LevelShape& shape) {
  const bool are_given = std::ranges::all_of(space_.body().parts(), [&](const BodyPart& part) {
    return !mesh_of(scene_, part.mesh).face_normals.empty();
  });
  if (light_ != PoseLight::harmonics || are_given) return;
  PoseLevel parted = make_level(shape, light_);
  set_scales(parted, hypotheses());
  const double loss = std::ranges::min(parted.losses(hypotheses()));
  normals_ = CornerNormals::smooth;
  PoseLevel smooth = make_level(shape, light_);
  smooth.set_scales(parted.scales());
  if (std::ranges::min(smooth.losses(hypotheses())) < loss) {
    work(smooth, beam_.back());
  } else {
    normals_ = CornerNormals::parted;
  }
}

/// Pictures show a sample in each pixel or, as other software makes them, the mean over its area: whichever
/// explains the target better.
LevelShape Fit::final_shape(LevelShape shape) const {
  PoseLevel sampled = make_level(shape, light_);
  set_scales(sampled, hypotheses());
  const auto least_loss = [&](PoseLevel& level) {
    level.set_scales(sampled.scales());
    return std::ranges::min(level.losses(hypotheses()));
  };
  const double loss = least_loss(sampled);
  shape.samples = most_samples(scene_);
  if (shape.samples == 1) return shape;
  PoseLevel averaged = make_level(shape, light_);
  if (least_loss(averaged) >= loss) shape.samples = 1;
  return shape;
}

void Fit::set_scales(PoseLevel& level, std::span<const Hypothesis> hypotheses) const {
  level.weigh_observations(hypotheses);
  if (!method_.robust || !has_colors_) return;
  set_robust_scale(level, method_, hypotheses);
}

/// By the candidates. Losses in which observations have other weights are others.
void Fit::rescale(PoseLevel& level) {
  set_scales(level, hypotheses());
  if (level.has_observations()) wrong_ = wrong_loss(level);
}

/// The initial poses, and the best of the grid and of other places.
void Fit::start(PoseLevel& level) {
  constexpr std::size_t k_enough = 144;  // to know the scale
  std::vector<Hypothesis> some = places_.grid(std::min<std::size_t>(method_.rotations, k_enough));
  for (const Pose& pose : initial_) some.push_back({pose});
  set_scales(level, some);
  wrong_ = wrong_loss(level);
  candidates_ = least_losses(level, places_.grid(method_.rotations), beam_.front());
  for (const PlaceGroup& group : places_.others(level, method_.rotations))
    std::ranges::copy(least_losses(level, group.hypotheses, group.keep), std::back_inserter(candidates_));
  for (const Pose& pose : initial_) candidates_.push_back({{pose}});
  candidates_[candidates_.size() - initial_.size()].is_initial = !anywhere_;
}

void Fit::work(PoseLevel& level, std::size_t keep) {
  const unsigned iterations = goes_on_ ? method_.iterations : 0;  // stopped: only judged at this level
  const BeamWork beam{iterations, candidates_.size(), wrong_, keep + keep / 2};
  goes_on_ = refine_distinct(level, space_, candidates_, beam, [&] { return report(level); }) && goes_on_;
  std::vector<Candidate> kept;
  for (const Candidate& c : candidates_) {
    if (kept.size() < keep || c.is_initial) {
      kept.push_back(c);
    } else if (c.equations.loss <= enough()) {
      spare_.push_back(c);
    }
  }
  candidates_ = std::move(kept);
}

bool Fit::report(const PoseLevel& level) {
  const Candidate& best = *std::ranges::min_element(candidates_, by_loss);
  result_.history.push_back({static_cast<unsigned>(result_.history.size()), 0, best.equations.loss,
                             level.smoothing(), level.width(), level.height(),
                             static_cast<unsigned>(candidates_.size()), best.hypothesis.pose,
                             best.hypothesis.focal_scale, best.hypothesis.radial});
  return !callback_ || callback_(result_.history.back());
}

void Fit::finish(PoseLevel& level) {
  const auto others = std::ranges::stable_partition(
      candidates_, [most = enough()](const Candidate& c) { return c.equations.loss <= most; });
  spare_.insert(spare_.end(), others.begin(), others.end());
  candidates_.erase(others.begin(), others.end());
  // By depths and silhouettes a body's own turns differ more than is enough: steps end somewhat earlier here or there.
  const double uneven = has_colors_ ? 1 : 20, best = candidates_.front().equations.loss;
  if (method_.rotations > 0 && goes_on_) {
    add_equals(level, space_, candidates_, std::move(spare_),
               {method_.iterations, best + uneven * (enough() - best)});
  }
  choose_equals();
  static_cast<PoseHypothesis&>(result_) = result_.equals.front();
  result_.covariance = pose_covariance(level, space_, candidates_.front().hypothesis);
  result_.light = light_;
}

/// The poses that explain the target as well as the best, the one to return first.
void Fit::choose_equals() {
  if (!anywhere_) {
    const Hypothesis first{initial_.front()};
    std::ranges::stable_sort(candidates_, {},
                             [&](const Candidate& c) { return space_.distance(c.hypothesis, first); });
  }
  for (const Candidate& c : candidates_) {
    const Hypothesis& h = c.hypothesis;
    result_.equals.push_back({h.pose, h.focal_scale, c.equations.loss, h.radial});
  }
}

}  // namespace

FittedPose search_pose(const Device& device, std::span<const PoseProblem> pictures,
                       std::span<const Pose> initial, const PosePlaces& places, Foreknowledge known,
                       const PoseSolver::Callback& callback) {
  return Fit(device, pictures, initial, places, known, callback).run();
}

}  // namespace dpr
