// The paper's Figure 3: the gradients of the two operators as M samples estimate them. Every view of a batch
// has noise of its own, so that one batch is many estimates.
#include <cmath>
#include <numeric>
#include <sstream>

#include "cli/plot.hpp"
#include "estimator_list.hpp"
#include "experiment.hpp"
#include "probes.hpp"

namespace dpr::experiments {
namespace {

struct Operator {
  const char* name;
  const char* stage;  // whose estimator samples
  double argument;    // where neither a coin is tossed nor the outcome is certain
  Response (*evaluate)(const Device&, const Smoothing&, std::span<const double>);
};

constexpr Operator k_operators[] = {{"heaviside", "occupancy_estimator", 1.5, heaviside},
                                    {"arg_max", "aggregation_estimator", 2, arg_max}};

struct Spread {
  double mean = 0, deviation = 0;
};

Spread spread(std::span<const double> values) {
  const auto n = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double squares = 0;
  for (const double v : values) squares += (v - mean) * (v - mean);
  return {mean, std::sqrt(squares / (n - 1))};
}

/// Mean and deviation against M, a panel each, with the exact derivative as a line.
std::string panels(const Json& result, const std::vector<unsigned>& samples) {
  const std::string name = result["operator"].get<std::string>();
  std::ostringstream data, means, deviations;
  means << "plot " << result["exact"].get<double>() << " with lines lw 2 lc 'black' title 'exact'";
  std::size_t i = 0;
  for (const auto& [estimate, rows] : result["estimates"].items()) {
    data << "$" << name << i << " << EOD\n";
    for (std::size_t k = 0; k < samples.size(); ++k) {
      data << samples[k] << ' ' << rows["mean"][k].get<double>() << ' ' << rows["deviation"][k].get<double>()
           << '\n';
    }
    data << "EOD\n";
    constexpr double k_side_step = 1.05;  // so that error bars stand beside each other
    means << ", $" << name << i << " using ($1*" << std::pow(k_side_step, static_cast<double>(i))
          << "):2:3 with yerrorbars lw 2 pt 7 title " << cli::gnuplot_quote(estimate);
    deviations << (i == 0 ? "plot " : ", ") << "$" << name << i
               << " using 1:3 with linespoints lw 2 pt 7 title " << cli::gnuplot_quote(estimate);
    ++i;
  }
  return data.str() + "set xlabel 'samples M'\nset logscale x 2\nunset logscale y\nset title " +
         cli::gnuplot_quote(name) + "\nset ylabel 'derivative, mean and standard deviation'\n" + means.str() +
         "\nset logscale y\nset ylabel 'standard deviation of an estimate'\n" + deviations.str() +
         "\nunset logscale y\n";
}

Json run_operator(const Settings& settings, const Operator& op, const std::vector<unsigned>& samples,
                  std::size_t repeats) {
  const std::vector<double> arguments(repeats, op.argument);
  const Response exact =
      op.evaluate(settings.device, smoothing_preset("gaussian"), std::span(arguments).first(1));
  Json result{{"operator", op.name}, {"argument", op.argument}, {"exact", exact.derivative[0]}};
  Json& estimates = result["estimates"] = Json::object();
  for (const Estimate& estimate : k_estimates) {
    std::vector<double> means, deviations;
    for (const unsigned m : samples) {
      const auto smoothing = smoothing_of({{op.stage, "monte_carlo"}, {"samples", m}}, estimate);
      if (!smoothing) break;
      const Spread found = spread(op.evaluate(settings.device, *smoothing, arguments).derivative);
      means.push_back(found.mean);
      deviations.push_back(found.deviation);
    }
    if (means.size() == samples.size()) {
      estimates[estimate.name] = {{"mean", means}, {"deviation", deviations}};
    }
  }
  return result;
}

}  // namespace

void run_gradient_noise(const Settings& settings) {
  const std::size_t repeats = settings.smoke ? 64 : 1024;
  std::vector<unsigned> samples;
  for (unsigned m = 4; m <= (settings.smoke ? 16U : 512U); m *= 2) samples.push_back(m);
  Json operators = Json::array();
  std::string script = "set multiplot layout 2,2\nset grid\nset key outside right font ',9'\n";
  cli::Progress progress(static_cast<unsigned>(std::size(k_operators)), settings.quiet, "operator");
  for (const Operator& op : k_operators) {
    operators.push_back(run_operator(settings, op, samples, repeats));
    script += panels(operators.back(), samples);
    progress.update(static_cast<unsigned>(operators.size()), op.name);
  }
  write_data(settings, "gradient-noise",
             {{"repeats", repeats}, {"samples", samples}, {"operators", operators}});
  draw_figure(settings, "gradient-noise", 1500, 900, script + "unset multiplot\n");
}

}  // namespace dpr::experiments
