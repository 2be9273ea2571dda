// The estimator table: what each estimator's image and vertex gradient are worth for the time they take. The
// oracle is the exact member of what is sampled without bias: the aggregation inside exact occupancies for
// the barrier (sampling inside its logarithm is biased, whatever M), both stages for the joint composition.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <glm/gtc/matrix_transform.hpp>
#include <map>
#include <set>
#include <sstream>

#include "cli/plot.hpp"
#include "dpr/renderer.hpp"
#include "estimator_list.hpp"
#include "experiment.hpp"
#include "workloads.hpp"

namespace dpr::experiments {
namespace {

constexpr const char* k_scenes[] = {"cube128", "sphere128"};

struct Member {
  const char *name, *words;  // JSON: keys of a scene's "smoothing"
};

constexpr Member k_members[] = {
    {"barrier", R"({"composition": "barrier", "aggregation_estimator": "monte_carlo"})"},
    {"joint", R"({"composition": "joint", "estimator": "monte_carlo"})"}};

/// A vector of all a render gives of one kind, and the figures of many renders.
using Values = std::vector<double>;

double norm(const Values& v) {
  double squares = 0;
  for (const double x : v) squares += x * x;
  return std::sqrt(squares);
}

double distance(const Values& a, const Values& b) {
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) squares += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(squares);
}

double median(Values values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

struct Render {
  Values image, gradient;  // RGB, object-space positions
  double milliseconds = 0;
};

void append(Values& values, glm::vec3 v) {
  for (int axis = 0; axis < 3; ++axis) values.push_back(static_cast<double>(v[axis]));
}

/// Renders a scene by any estimator, with the same d loss / d image: that of the mean squared error between
/// the exact image and the one that a camera turned about its axis sees.
class Comparison {
 public:
  Comparison(const Device& device, Scene scene, const Smoothing& exact) : renderer_(device) {
    scene.smoothing = exact;
    renderer_.set_scene(scene);
    renderer_.forward();
    grad_ = renderer_.image();
    View turned{scene.camera, {scene.meshes[0].transform}};
    constexpr float k_turn = 0.35F;  // radians
    turned.camera.view = glm::rotate(glm::mat4(1), k_turn, glm::vec3(0, 0, 1)) * turned.camera.view;
    renderer_.set_views({&turned, 1});
    renderer_.forward();
    const Image target = renderer_.image();
    const float scale = 2.0F / (3.0F * static_cast<float>(target.pixels.size()));
    for (std::size_t i = 0; i < target.pixels.size(); ++i) {
      grad_.pixels[i] = scale * (grad_.pixels[i] - target.pixels[i]);
      grad_.pixels[i].a = 0;
    }
    renderer_.set_scene(scene);
    exact_ = render(exact);
  }

  Render render(const Smoothing& smoothing) {
    renderer_.set_smoothing(smoothing);
    const auto start = std::chrono::steady_clock::now();
    renderer_.forward();
    const Image image = renderer_.image();
    const SceneGradient gradient = renderer_.backward(std::span(&grad_, 1));
    Render result;
    result.milliseconds =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    for (const glm::vec4& pixel : image.pixels) append(result.image, glm::vec3(pixel));
    for (const glm::vec3& position : gradient.meshes[0].positions) append(result.gradient, position);
    return result;
  }

  const Render& exact() const { return exact_; }

 private:
  Renderer renderer_;
  Image grad_;
  Render exact_;
};

/// Root mean square over the seeds of the error relative to the exact member. The time is that of the fastest
/// run: seeds change nothing in it, and whatever else the machine does only adds.
Json measure(Comparison& comparison, Smoothing smoothing, unsigned seeds) {
  double image = 0, gradient = 0;
  Values times;
  comparison.render(smoothing);  // kernels are compiled
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    smoothing.seed = seed;
    const Render found = comparison.render(smoothing);
    const Render& exact = comparison.exact();
    image += std::pow(distance(found.image, exact.image) / norm(exact.image), 2);
    gradient += std::pow(distance(found.gradient, exact.gradient) / norm(exact.gradient), 2);
    times.push_back(found.milliseconds);
  }
  const double ms = std::ranges::min(times);
  return {{"image_error", std::sqrt(image / seeds)},
          {"gradient_error", std::sqrt(gradient / seeds)},
          {"milliseconds", ms},
          {"image_cost", image / seeds * ms},
          {"gradient_cost", gradient / seeds * ms}};
}

Json base_words(const Smoothing& scene, const Member& member) {
  Json words = Json::parse(member.words);
  words["sigma"] = cli::number(scene.sigma);
  words["gamma"] = cli::number(scene.gamma);
  words["blur_radius"] = cli::number(*scene.blur_radius);
  return words;
}

Smoothing exact_member(Smoothing scene, const Member& member) {
  scene.composition = parse_choice<Composition>(member.name, "member");
  return scene;
}

/// All rows of a scene and member. What the library cannot sample is left out, with the reason.
void measure_member(const Settings& settings, const Scene& scene, const std::string& scene_name,
                    const Member& member, const std::vector<unsigned>& samples, Json& rows, Json& left_out) {
  Comparison comparison(settings.device, scene, exact_member(scene.smoothing, member));
  for (const Estimate& estimate : k_estimates) {
    for (const unsigned m : samples) {
      Json words = base_words(scene.smoothing, member);
      words["samples"] = m;
      std::string reason;
      const auto smoothing = smoothing_of(words, estimate, &reason);
      Json row{{"scene", scene_name}, {"member", member.name}, {"estimate", estimate.name}, {"samples", m}};
      if (!smoothing) {
        row["reason"] = reason;
        left_out.push_back(row);
        continue;
      }
      row.update(measure(comparison, *smoothing, settings.smoke ? 2 : 16));
      if (!settings.quiet) {
        std::printf("%-10s %-8s %-26s M %3u   image %9.2e   gradient %9.2e   %9.3f ms   error^2 x ms %9.2e\n",
                    scene_name.c_str(), member.name, estimate.name, m, row["image_error"].get<double>(),
                    row["gradient_error"].get<double>(), row["milliseconds"].get<double>(),
                    row["gradient_cost"].get<double>());
        std::fflush(stdout);
      }
      rows.push_back(row);
    }
  }
}

/// The estimates by the median, over scenes, members and M, of error^2 x time of the gradient relative to the
/// first estimate's: the best first. Only cells that every estimate has count: some need more samples than
/// others.
Json rank(const Json& rows) {
  std::map<std::string, std::map<std::string, double>> cells;  // by scene, member and M; by estimate
  std::set<std::string> estimates;
  for (const Json& row : rows) {
    const std::string cell =
        row["scene"].get<std::string>() + row["member"].get<std::string>() + row["samples"].dump();
    const std::string estimate = row["estimate"].get<std::string>();
    cells[cell][estimate] = row["gradient_cost"].get<double>();
    estimates.insert(estimate);
  }
  std::map<std::string, Values> ratios;
  for (const auto& [cell, costs] : cells) {
    if (costs.size() < estimates.size()) continue;
    for (const auto& [estimate, cost] : costs) {
      ratios[estimate].push_back(cost / costs.at(k_estimates[0].name));
    }
  }
  std::vector<std::pair<double, std::string>> order;
  for (const auto& [estimate, values] : ratios) order.emplace_back(median(values), estimate);
  std::ranges::sort(order);
  Json ranking = Json::array();
  for (const auto& [cost, estimate] : order) {
    ranking.push_back(
        {{"estimate", estimate}, {"gradient_cost_relative", cost}, {"cells", ratios[estimate].size()}});
  }
  return ranking;
}

/// Error of the gradient against time, a panel a scene and member; a point an M, a curve an estimate.
std::string figure(const Json& rows, int& panels) {
  std::map<std::string, std::map<std::string, std::string>> curves;  // by panel, by estimate
  for (const Json& row : rows) {
    std::ostringstream point;
    point << row["milliseconds"].get<double>() << ' ' << row["gradient_error"].get<double>() << '\n';
    curves[row["scene"].get<std::string>() + ", " + row["member"].get<std::string>()]
          [row["estimate"].get<std::string>()] += point.str();
  }
  panels = static_cast<int>(curves.size());
  std::ostringstream script;
  script << "set multiplot layout " << (panels + 1) / 2 << "," << std::min(panels, 2)
         << "\nset grid\nset key outside right font ',9'\nset logscale xy\nset xlabel 'forward and backward, "
            "milliseconds'\n"
         << "set ylabel 'relative error of the vertex gradient'\n";
  std::size_t index = 0;
  for (const auto& [title, estimates] : curves) {
    std::string plots;
    for (const auto& [estimate, points] : estimates) {
      script << "$data" << index << " << EOD\n" << points << "EOD\n";
      plots += (plots.empty() ? "plot $data" : ", $data") + std::to_string(index) +
               " with linespoints lw 2 pt 7 title " + cli::gnuplot_quote(estimate);
      ++index;
    }
    script << "set title " << cli::gnuplot_quote(title) << "\n" << plots << "\n";
  }
  return script.str() + "unset multiplot\n";
}

}  // namespace

void run_estimators(const Settings& settings) {
  constexpr int k_smoke_size = 24;
  const std::vector<unsigned> samples =
      settings.smoke ? std::vector<unsigned>{1, 4} : std::vector<unsigned>{1, 2, 8, 32, 128};
  Json rows = Json::array(), left_out = Json::array();
  for (const char* const name : k_scenes) {
    Scene scene = bench::make_workloads(name).front().scene;
    if (settings.smoke) scene.width = scene.height = k_smoke_size;
    for (const Member& member : k_members) {
      measure_member(settings, scene, name, member, samples, rows, left_out);
    }
  }
  const Json ranking = rank(rows);
  const std::string winner = ranking.front()["estimate"].get<std::string>();
  write_data(settings, "estimators",
             {{"winner", winner}, {"ranking", ranking}, {"rows", rows}, {"left_out", left_out}});
  int panels = 0;
  const std::string script = figure(rows, panels);
  draw_figure(settings, "estimators", 1500, 450 * ((panels + 1) / 2), script);
  if (settings.quiet) return;
  for (const Json& entry : ranking) {
    std::printf("%-26s error^2 x time of the gradient, relative to %s: %.3f\n",
                entry["estimate"].get<std::string>().c_str(), k_estimates[0].name,
                entry["gradient_cost_relative"].get<double>());
  }
  std::printf("best: %s\n", winner.c_str());
}

}  // namespace dpr::experiments
