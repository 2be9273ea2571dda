// Poses of several bodies in one picture: each is fitted in turn while the others stand still.
#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/checks.hpp"
#include "base/clock.hpp"
#include "dpr/error.hpp"
#include "dpr/pose.hpp"
#include "solve/pose_body.hpp"
#include "solve/pose_fit.hpp"
#include "solve/pose_space.hpp"

namespace dpr {
namespace {

PoseOptions options_of_body(PoseOptions options, const std::vector<std::size_t>& meshes) {
  options.meshes = meshes;
  return options;
}

void validate_bodies(const PoseBodies& bodies, const PoseOptions& options) {
  require(!bodies.empty(), "bodies (pose)", bodies.size(), "at least one");
  require(options.meshes.empty(), "meshes (pose)", options.meshes.size(), "none beside a list of bodies");
  std::vector<std::size_t> all;
  for (const std::vector<std::size_t>& meshes : bodies) {
    require(!meshes.empty(), "meshes of a body (pose)", meshes.size(), "at least one");
    all.insert(all.end(), meshes.begin(), meshes.end());
  }
  for (const std::size_t mesh : all) {
    if (std::ranges::count(all, mesh) > 1)
      throw InvalidArgument("meshes (pose)", std::to_string(mesh) + " twice", "each in one body, once");
  }
  if (bodies.size() == 1) return;
  const auto refuse = [](const char* option) {
    throw InvalidArgument(option, "one beside several bodies", "none, or one body");
  };
  const auto* method = std::get_if<LeastSquares>(&options.method);
  if (method == nullptr)
    throw InvalidArgument("method (pose)", "a descent beside several bodies", "least squares");
  if (method->box) refuse("box (pose)");
  if (!method->silhouette.image.pixels.empty()) refuse("silhouette (pose)");
  if (options.solve_focal) refuse("focal (pose)");
  if (options.solve_distortion) refuse("distortion (pose)");
}

/// A body, the pose that was found last, and the fits so far.
struct MovingBody {
  PoseOptions options;
  PoseBody body;
  std::optional<PoseResult> found{};
  std::vector<PoseIteration> history{};
  double seconds = 0;

  LeastSquares& method() { return std::get<LeastSquares>(options.method); }
};

std::vector<Pose> poses_of(const PoseResult& result) {
  std::vector<Pose> poses;
  for (const PoseHypothesis& hypothesis : result.equals) poses.push_back(hypothesis.pose);
  return poses;
}

double total_loss(const std::vector<PoseResult>& results) {
  double sum = 0;
  for (const PoseResult& result : results) sum += result.loss;
  return sum;
}

/// The fits of all bodies, in turn.
class BodiesFit {
 public:
  BodiesFit(const Device& device, const Scene& scene, const Image& target, const PoseBodies& bodies,
            const PoseOptions& options, Foreknowledge known, const PoseSolver::Callback& callback);

  std::vector<PoseResult> run();

 private:
  std::vector<PoseResult> run_in(PoseLight light);
  void find(std::size_t body);
  double find_again(std::size_t body);
  double refine(std::size_t body, const std::vector<Pose>& initial, PoseDoubt doubt);
  PoseResult fit(std::size_t body, const PoseOptions& options, const std::vector<Pose>& initial,
                 Foreknowledge known);
  Scene scene_of(std::size_t body) const;

  const Device& device_;
  const Scene& scene_;
  const Image& target_;
  Foreknowledge known_;
  const PoseSolver::Callback& callback_;
  bool goes_on_ = true;
  std::vector<MovingBody> bodies_;
};

BodiesFit::BodiesFit(const Device& device, const Scene& scene, const Image& target, const PoseBodies& bodies,
                     const PoseOptions& options, Foreknowledge known, const PoseSolver::Callback& callback)
    : device_(device), scene_(scene), target_(target), known_(known), callback_(callback) {
  for (const std::vector<std::size_t>& meshes : bodies) {
    const PoseOptions own = options_of_body(options, meshes);
    const PoseSolver checks_the_rest(device, scene, target, own);
    bodies_.push_back({own, PoseBody(scene, meshes)});
  }
}

/// The scene's own light comes first: while bodies are missing, light of many directions explains wrong poses.
std::vector<PoseResult> BodiesFit::run() {
  constexpr double k_better = 0.5;  // of the loss
  const PoseLight wanted = bodies_.front().method().light;
  std::vector<PoseResult> results = run_in(PoseLight::fixed);
  const bool is_explained = std::ranges::all_of(results, &PoseResult::explained);
  if (!is_explained && goes_on_ && wanted != PoseLight::fixed && !target_.pixels.empty()) {
    std::vector<PoseResult> lit = run_in(wanted);
    if (total_loss(lit) < k_better * total_loss(results)) results = std::move(lit);
  }
  for (std::size_t i = 0; i < results.size(); ++i) {
    results[i].start = bodies_[i].body.pose();
    results[i].history = bodies_[i].history;
    results[i].iterations = static_cast<unsigned>(bodies_[i].history.size());
    results[i].seconds = bodies_[i].seconds;
  }
  return results;
}

std::vector<PoseResult> BodiesFit::run_in(PoseLight light) {
  constexpr unsigned k_most_rounds = 8;
  constexpr double k_still = 0.02;  // pixels, less than noise moves a pose
  for (MovingBody& body : bodies_) {
    body.method().light = light;
    body.found.reset();
  }
  for (std::size_t i = 0; i < bodies_.size(); ++i) find(i);
  for (unsigned round = 1; round < k_most_rounds; ++round) {
    double moved = 0;
    for (std::size_t i = 0; i < bodies_.size() && goes_on_; ++i) {
      const PoseResult& found = *bodies_[i].found;
      moved = std::max(moved, round == 1 ? find_again(i) : refine(i, poses_of(found), found.doubt));
    }
    if (moved < k_still || !goes_on_) break;
  }
  std::vector<PoseResult> results;
  for (const MovingBody& body : bodies_) results.push_back(*body.found);
  return results;
}

/// Fits robustly, since other bodies are not yet where the picture shows them.
void BodiesFit::find(std::size_t body) {
  MovingBody& own = bodies_[body];
  PoseOptions robust = own.options;
  std::get<LeastSquares>(robust.method).robust = true;
  own.found = fit(body, robust, {own.body.pose()}, known_);
}

/// Fits from the start once more, with all others in the picture. Returns the distance from the last pose.
double BodiesFit::find_again(std::size_t body) {
  const MovingBody& own = bodies_[body];
  const PoseResult again = fit(body, own.options, {own.body.pose()}, known_);
  std::vector<Pose> initial = poses_of(again);
  for (const Pose& pose : poses_of(*own.found)) initial.push_back(pose);
  return refine(body, initial, again.doubt);
}

/// Fits from these poses alone. Returns the distance from the last pose, in pixels at the body's rim. The doubt of a
/// search about another pose stays, since no other pose is tried here.
double BodiesFit::refine(std::size_t body, const std::vector<Pose>& initial, PoseDoubt doubt) {
  MovingBody& own = bodies_[body];
  PoseOptions near = own.options;
  std::get<LeastSquares>(near.method).rotations = 0;
  PoseResult result = fit(body, near, initial, Foreknowledge::pose);
  if (result.explained && doubt == PoseDoubt::other_pose) {
    result.doubt = doubt;
    result.explained = false;
  }
  const PoseSpace space(scene_, result.pose, own.options);
  const double ndc = space.distance({own.found->pose}, {result.pose});
  own.found = std::move(result);
  return ndc * std::min(scene_.width, scene_.height) / 2;
}

PoseResult BodiesFit::fit(std::size_t body, const PoseOptions& options, const std::vector<Pose>& initial,
                          Foreknowledge known) {
  MovingBody& own = bodies_[body];
  const auto report = [&](PoseIteration step) {
    step.body = body;
    step.iteration = static_cast<unsigned>(own.history.size());
    own.history.push_back(step);
    goes_on_ = goes_on_ && (!callback_ || callback_(step));
    return goes_on_;
  };
  const auto start = Clock::now();
  PoseResult result = fit_pose(device_, scene_of(body), target_, options, initial, known, report).result;
  own.seconds += seconds_since(start);
  return result;
}

/// The scene in which a body is looked for. Others are where they were found last; until then they are where the scene
/// has them, or in a search, which knows nothing of their places, behind the camera.
Scene BodiesFit::scene_of(std::size_t body) const {
  Scene scene = scene_;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const MovingBody& other = bodies_[i];
    if (i == body || (!other.found && known_ == Foreknowledge::start)) continue;
    const PoseSpace space(scene_, other.body.pose(), other.options);
    other.body.place(scene, other.found ? other.found->pose : space.absent(scene_.camera).pose);
  }
  return scene;
}

}  // namespace

std::vector<PoseResult> solve_bodies(const Device& device, const Scene& scene, const Image& target,
                                     const PoseBodies& bodies, const PoseOptions& options,
                                     const PoseSolver::Callback& callback) {
  validate_bodies(bodies, options);
  if (bodies.size() > 1)
    return BodiesFit(device, scene, target, bodies, options, Foreknowledge::start, callback).run();
  const PoseSolver solver(device, scene, target, options_of_body(options, bodies.front()));
  return {solver.solve(solver.scene_pose(), callback)};
}

std::vector<PoseResult> search_bodies(const Device& device, const Scene& scene, const Image& target,
                                      const PoseBodies& bodies, const PoseOptions& options,
                                      const PoseSolver::Callback& callback) {
  validate_bodies(bodies, options);
  if (bodies.size() > 1) {
    const auto* method = std::get_if<LeastSquares>(&options.method);
    require(method->rotations > 0, "rotations (pose search)", method->rotations, "at least 1");
    return BodiesFit(device, scene, target, bodies, options, Foreknowledge::place, callback).run();
  }
  return {PoseSolver(device, scene, target, options_of_body(options, bodies.front())).search(callback)};
}

}  // namespace dpr
