#include "renderer/gradient_map.hpp"

#include <algorithm>
#include <map>
#include <tuple>
#include <vector>

namespace dpr {
namespace {

struct Term {
  std::size_t sum;
  double factor;
};

using Terms = std::vector<std::vector<Term>>;  // by number

/// The sums of a channel that a number may depend on.
Range sums_of(const SumList& list, std::size_t channel, const GradientRow& row, GradientIndex index,
              const GradientSums& all, std::size_t meshes) {
  const std::size_t first = list.first + channel * list.segments;
  for (const SumOf of : {SumOf::cuts, SumOf::contour_cuts, SumOf::eye}) {
    if (&list == &all[of]) return {first + index.view, 1};
  }
  if (&list != &all[SumOf::poses] && &list != &all[SumOf::normals]) return {first, list.segments};
  const std::size_t of_view = first + index.view * meshes;
  return row.of == GradientOf::mesh_in_view ? Range(of_view + index.item, 1) : Range(of_view, meshes);
}

/// Adds the terms that a gradient of unit sums in a channel has: numbers that sum over meshes have one factor.
void add_terms(SceneGradient& of_units, const SumList& list, std::size_t channel, const GradientSums& all,
               std::size_t meshes, Terms& terms) {
  std::size_t number = 0;
  for_each_array(of_units, [&](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    if (!is_summed(row)) return;
    const Range sums = sums_of(list, channel, row, index, all, meshes);
    transform_numbers(array, [&](double value) {
      if (number == terms.size()) terms.emplace_back();
      for (std::size_t k = 0; value != 0 && k < sums.count; ++k)
        terms[number].push_back({sums.first + k, value / static_cast<double>(sums.count)});
      ++number;
      return value;
    });
  });
}

GradientMap upload(Device::Impl& device, const Terms& terms) {
  std::vector<cl_uint> starts{0}, indices;
  std::vector<float> factors;
  for (const std::vector<Term>& of_number : terms) {
    for (const Term& term : of_number) {
      indices.push_back(to_uint(term.sum));
      factors.push_back(static_cast<float>(term.factor));
    }
    starts.push_back(to_uint(indices.size()));
  }
  if (indices.empty()) {  // never read, but arguments all the same
    indices.push_back(0);
    factors.push_back(0);
  }
  GradientMap map;
  map.numbers = terms.size();
  map.starts.upload(device, starts);
  map.terms.upload(device, indices);
  map.factors.upload(device, factors);
  return map;
}

}  // namespace

GradientMap make_map(Device::Impl& device, const GradientSums& sums, std::size_t meshes,
                     const std::function<SceneGradient(std::span<const float>)>& finish) {
  Terms terms;
  std::vector<float> units(sums.count());
  SceneGradient zero = finish(units);
  add_terms(zero, sums[SumOf::pixels], 0, sums, meshes, terms);  // makes room for all numbers
  for (const SumList& list : sums.lists) {
    for (std::size_t channel = 0; channel < list.channels; ++channel) {
      const auto first = units.begin() + static_cast<std::ptrdiff_t>(list.first + channel * list.segments);
      std::fill_n(first, list.segments, 1.0F);
      SceneGradient of_units = finish(units);
      add_terms(of_units, list, channel, sums, meshes, terms);
      std::fill_n(first, list.segments, 0.0F);
    }
  }
  return upload(device, terms);
}

SparseMap make_fold(Device::Impl& device, SceneGradient& of_passes, SceneGradient& of_views) {
  Terms terms;
  std::map<std::tuple<const GradientRow*, std::size_t, std::size_t>, std::size_t> first;  // number, by array
  for_each_array(of_views, [&](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    if (!is_summed(row)) return;
    first[{&row, index.view, index.item}] = terms.size();
    transform_numbers(array, [&](double value) { return terms.emplace_back(), value; });
  });
  std::size_t number = 0;
  const std::size_t views = of_views.views.size();
  for_each_array(of_passes, [&](const GradientRow& row, GradientIndex index, const GradientArray& array) {
    if (!is_summed(row)) return;
    std::size_t to = first.at({&row, index.view % views, index.item});
    transform_numbers(array, [&](double value) { return terms[to++].push_back({number++, 1.0}), value; });
  });
  return upload(device, terms);
}

}  // namespace dpr
