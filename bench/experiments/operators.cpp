// The paper's Figure 8: what each prior makes of the two decisions of a renderer.
#include <sstream>

#include "cli/plot.hpp"
#include "dpr/error.hpp"
#include "experiment.hpp"
#include "probes.hpp"

namespace dpr::experiments {
namespace {

constexpr double k_reach = 6;

struct Curve {
  std::string prior;
  Response response;
};

/// True if the library has an estimator for the smoothing.
bool is_valid(const Smoothing& smoothing) {
  try {
    validate(smoothing);
    return true;
  } catch (const InvalidArgument&) {
    return false;
  }
}

std::vector<Curve> heaviside_curves(const Device& device, std::span<const double> x) {
  std::vector<Curve> curves;
  for (const Prior prior : choices<Prior>()) {
    Smoothing smoothing = smoothing_preset("gaussian");
    smoothing.occupancy_prior = prior;
    if (is_valid(smoothing))
      curves.push_back({std::string(to_string(prior)), heaviside(device, smoothing, x)});
  }
  return curves;
}

std::vector<Curve> arg_max_curves(const Device& device, std::span<const double> x) {
  std::vector<Curve> curves;
  for (const Prior prior : choices<Prior>()) {
    Smoothing smoothing = smoothing_preset("gaussian");
    smoothing.depth_prior = prior;
    if (is_valid(smoothing)) curves.push_back({std::string(to_string(prior)), arg_max(device, smoothing, x)});
  }
  return curves;
}

Json to_json(std::span<const Curve> curves) {
  Json json = Json::object();
  for (const Curve& curve : curves) {
    json[curve.prior] = {{"value", curve.response.value}, {"derivative", curve.response.derivative}};
  }
  return json;
}

/// Value and derivative, a panel each.
std::string panels(const std::string& id, std::span<const double> x, std::span<const Curve> curves,
                   const std::string& axis, const std::string& value, const std::string& derivative) {
  std::ostringstream data, plots[2];
  for (std::size_t i = 0; i < curves.size(); ++i) {
    data << "$" << id << i << " << EOD\n";
    for (std::size_t k = 0; k < x.size(); ++k) {
      data << x[k] << ' ' << curves[i].response.value[k] << ' ' << curves[i].response.derivative[k] << '\n';
    }
    data << "EOD\n";
    for (int column = 0; column < 2; ++column) {
      plots[column] << (i == 0 ? "plot " : ", ") << "$" << id << i << " using 1:" << 2 + column
                    << " with lines lw 2 title " << cli::gnuplot_quote(curves[i].prior);
    }
  }
  return data.str() + "set xlabel " + cli::gnuplot_quote(axis) + "\nset ylabel " + cli::gnuplot_quote(value) +
         "\nset key top left\nset yrange [0:1.05]\n" + plots[0].str() + "\nset yrange [0:*]\nset ylabel " +
         cli::gnuplot_quote(derivative) + "\n" + plots[1].str() + "\n";
}

}  // namespace

void run_operators(const Settings& settings) {
  // An even number, because there is no derivative where the distance is exactly 0.
  const int points = settings.smoke ? 24 : 400;
  std::vector<double> x;
  for (int i = 0; i < points; ++i) x.push_back(k_reach * (2.0 * i / (points - 1) - 1));
  const auto heavisides = heaviside_curves(settings.device, x);
  const auto arg_maxes = arg_max_curves(settings.device, x);
  write_data(settings, "operators",
             {{"x", x}, {"heaviside", to_json(heavisides)}, {"arg_max", to_json(arg_maxes)}});
  draw_figure(settings, "operators", 1200, 800,
              "set multiplot layout 2,2\nset grid\n" +
                  panels("heaviside", x, heavisides, "x = s / sigma", "perturbed Heaviside p(x)", "dp / dx") +
                  panels("arg_max", x, arg_maxes, "depth / gamma, the others at 0 and -2",
                         "weight of the moving depth", "d weight / d (depth / gamma)") +
                  "unset multiplot\n");
}

}  // namespace dpr::experiments
