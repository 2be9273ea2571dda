#include "smoothing/choice_names.hpp"

#include <algorithm>
#include <array>

#include "dpr/error.hpp"
#include "smoothing/priors.hpp"

namespace dpr {
namespace {

template <SmoothingChoice Choice, std::size_t n>
using Names = std::array<NamedChoice<Choice>, n>;

constexpr Names<Composition, 2> k_compositions{
    {{Composition::barrier, "barrier"}, {Composition::joint, "joint"}}};
constexpr Names<Estimator, 2> k_estimators{
    {{Estimator::exact, "exact"}, {Estimator::monte_carlo, "monte_carlo"}}};
constexpr Names<VarianceReduction, 3> k_variance_reductions{
    {{VarianceReduction::none, "none"},
     {VarianceReduction::rigid, "rigid"},
     {VarianceReduction::leave_one_out, "leave_one_out"}}};
constexpr Names<Draws, 3> k_draws{{{Draws::independent, "independent"},
                                   {Draws::antithetic, "antithetic"},
                                   {Draws::stratified, "stratified"}}};
constexpr Names<DistanceMetric, 2> k_distance_metrics{
    {{DistanceMetric::squared, "squared"}, {DistanceMetric::euclidean, "euclidean"}}};
constexpr Names<OccupancyWidth, 3> k_occupancy_widths{{{OccupancyWidth::fixed, "fixed"},
                                                       {OccupancyWidth::variable, "variable"},
                                                       {OccupancyWidth::zero, "zero"}}};
constexpr Names<Noise, 2> k_noises{{{Noise::triangle, "triangle"}, {Noise::pixel, "pixel"}}};

}  // namespace

template <>
std::span<const NamedChoice<Prior>> choice_names() {
  static const std::vector<NamedChoice<Prior>> names = [] {
    std::vector<NamedChoice<Prior>> list;
    for (const PriorRow& row : priors()) list.push_back({row.prior, row.name});
    return list;
  }();
  return names;
}
template <>
std::span<const NamedChoice<Composition>> choice_names() {
  return k_compositions;
}
template <>
std::span<const NamedChoice<Estimator>> choice_names() {
  return k_estimators;
}
template <>
std::span<const NamedChoice<VarianceReduction>> choice_names() {
  return k_variance_reductions;
}
template <>
std::span<const NamedChoice<Draws>> choice_names() {
  return k_draws;
}
template <>
std::span<const NamedChoice<DistanceMetric>> choice_names() {
  return k_distance_metrics;
}
template <>
std::span<const NamedChoice<OccupancyWidth>> choice_names() {
  return k_occupancy_widths;
}
template <>
std::span<const NamedChoice<Noise>> choice_names() {
  return k_noises;
}

template <SmoothingChoice Choice>
std::string_view to_string(Choice value) {
  const auto rows = choice_names<Choice>();
  const auto row = std::ranges::find(rows, value, &NamedChoice<Choice>::value);
  return row == rows.end() ? std::string_view() : row->name;
}

template <SmoothingChoice Choice>
Choice parse_choice(std::string_view word, std::string_view where) {
  const auto rows = choice_names<Choice>();
  const auto row = std::ranges::find(rows, word, &NamedChoice<Choice>::name);
  if (row != rows.end()) return row->value;
  throw InvalidArgument(std::string(where), "\"" + std::string(word) + "\"",
                        one_of(names_of_choices<Choice>()));
}

template <SmoothingChoice Choice>
std::vector<Choice> choices() {
  std::vector<Choice> values;
  for (const auto& row : choice_names<Choice>()) values.push_back(row.value);
  return values;
}

#define DPR_INSTANTIATE(Choice)                                             \
  template std::string_view to_string<Choice>(Choice);                      \
  template Choice parse_choice<Choice>(std::string_view, std::string_view); \
  template std::vector<Choice> choices<Choice>();
DPR_INSTANTIATE(Prior)
DPR_INSTANTIATE(Composition)
DPR_INSTANTIATE(Estimator)
DPR_INSTANTIATE(VarianceReduction)
DPR_INSTANTIATE(Draws)
DPR_INSTANTIATE(DistanceMetric)
DPR_INSTANTIATE(OccupancyWidth)
DPR_INSTANTIATE(Noise)
#undef DPR_INSTANTIATE

}  // namespace dpr
