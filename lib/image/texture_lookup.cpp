#include "image/texture_lookup.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "base/parallel.hpp"
#include "image/texture_taps.hpp"

namespace dpr {
namespace {

/// Which numbers of a place are inputs: all, or where the first level alone is read its coordinates.
template <int Dimensions, bool HasLevels>
struct Form {
  static constexpr int k_dimensions = Dimensions;
  static constexpr bool k_has_levels = HasLevels;
  static constexpr int k_inputs = HasLevels ? 3 * Dimensions + 1 : Dimensions;
};

template <class Function>
void with_form(const TextureLookup& texture, bool has_level, const Function& function) {
  if (texture.border == Border::cube) {
    has_level ? function(Form<3, true>()) : function(Form<3, false>());
  } else {
    has_level ? function(Form<2, true>()) : function(Form<2, false>());
  }
}

/// Calls `function` with the numbers of place k, as TexturePlaces has them, and an index among the inputs.
template <int Dimensions, class Places, class Function>
decltype(auto) at_input(const Places& places, std::size_t k, int i, const Function& function) {
  constexpr std::size_t k_size = Dimensions;
  const auto index = static_cast<std::size_t>(i);
  if (i < Dimensions) return function(places.coordinates, k_size * k + index);
  if (i < 3 * Dimensions) return function(places.steps, 2 * k_size * k + index - k_size);
  return function(places.levels, k);
}

/// 0 where there are none.
float number_of(std::span<const float> of, std::size_t at) { return of.empty() ? 0.0F : of[at]; }

/// Calls `function` with each place's number, and the texels that it is a mixture of.
template <class Shape, class T, class Function>
void for_each_place(const TextureLookup& texture, const TexturePlaces& places, std::size_t first,
                    std::size_t last, const Function& function) {
  const taps::Reads reads{!places.steps.empty(), !places.levels.empty()};
  for (std::size_t k = first; k < last; ++k) {
    const auto number = [&](int i) -> T {
      const float value = at_input<Shape::k_dimensions>(places, k, i, number_of);
      if constexpr (std::is_same_v<T, float>) {
        return value;
      } else {
        return {value, Shape::k_inputs, i};
      }
    };
    function(k, taps::taps_of<Shape::k_dimensions, Shape::k_has_levels, T>(texture, reads, number));
  }
}

/// The same of all places, on the processor's threads.
template <class Shape, class T, class Function>
void for_all_places(const TextureLookup& texture, const TexturePlaces& places, const Function& function) {
  in_parallel(texture.count(places), [&](std::size_t first, std::size_t last) {
    for_each_place<Shape, T>(texture, places, first, last, function);
  });
}

bool has_level(const TextureLookup& texture, const TexturePlaces& places) {
  return texture.levels.size() > 1 && (!places.steps.empty() || !places.levels.empty());
}

}  // namespace

void look_up(const TextureLookup& texture, const TexturePlaces& places, std::span<float> values) {
  const std::size_t channels = texture.channels;
  const auto read = [&](std::size_t k, const taps::Taps<float>& mixture) {
    constexpr std::size_t k_together = 4;
    for (std::size_t first = 0; first < channels; first += k_together) {
      const std::size_t count = std::min(channels - first, k_together);
      std::array<float, k_together> sums{};
      for (const taps::Tap<float>& tap : mixture) {
        const float* texel = &texture.levels[tap.level].texels[channels * tap.texel + first];
        for (std::size_t c = 0; c < count; ++c) sums[c] += tap.weight * texel[c];
      }
      std::copy_n(sums.begin(), count, &values[channels * k + first]);
    }
  };
  with_form(texture, has_level(texture, places),
            [&]<class Shape>(Shape) { for_all_places<Shape, float>(texture, places, read); });
}

void look_up_backward(const TextureLookup& texture, const TexturePlaces& places,
                      std::span<const float> grad_values, const LookupGradients& gradients) {
  const std::size_t channels = texture.channels, count = texture.count(places);
  const bool moves = texture.filter != Filter::nearest &&
                     !(gradients.coordinates.empty() && gradients.steps.empty() && gradients.levels.empty());
  const auto to_texels = [&](std::size_t k, const taps::Taps<float>& mixture) {
    for (const taps::Tap<float>& tap : mixture) {
      float* grad = &gradients.texels[tap.level][channels * tap.texel];
      for (std::size_t c = 0; c < channels; ++c) grad[c] += tap.weight * grad_values[channels * k + c];
    }
  };
  with_form(texture, has_level(texture, places), [&]<class Shape>(Shape) {
    // Places share texels: one thread gathers these, in order.
    const auto gather = [&] { for_each_place<Shape, float>(texture, places, 0, count, to_texels); };
    if (!moves) return gradients.texels.empty() ? void() : gather();
    std::future<void> gathered;
    if (!gradients.texels.empty()) gathered = aside(count, gather);
    using T = taps::Derived<Shape::k_inputs>;
    for_all_places<Shape, T>(texture, places, [&](std::size_t k, const taps::Taps<T>& mixture) {
      typename T::DerType by_input = T::DerType::Zero();
      for (const taps::Tap<T>& tap : mixture) {
        const float* texel = &texture.levels[tap.level].texels[channels * tap.texel];
        by_input += std::inner_product(texel, texel + channels, &grad_values[channels * k], 0.0F) *
                    tap.weight.derivatives();
      }
      for (int i = 0; i < Shape::k_inputs; ++i)
        at_input<Shape::k_dimensions>(gradients, k, i, [&](std::span<float> of, std::size_t at) {
          if (!of.empty()) of[at] += by_input[i];
        });
    });
    if (gathered.valid()) gathered.get();
  });
}

void look_up_tangent(const TextureLookup& texture, const TexturePlaces& places, const TexturePlaces& moving,
                     std::span<const std::span<const float>> moving_texels, std::span<float> tangents) {
  const std::size_t channels = texture.channels;
  std::ranges::fill(tangents, 0.0F);
  with_form(texture, has_level(texture, places), [&]<class Shape>(Shape) {
    using T = taps::Derived<Shape::k_inputs>;
    for_all_places<Shape, T>(texture, places, [&](std::size_t k, const taps::Taps<T>& mixture) {
      typename T::DerType speed;
      for (int i = 0; i < Shape::k_inputs; ++i)
        speed[i] = at_input<Shape::k_dimensions>(moving, k, i, number_of);
      for (const taps::Tap<T>& tap : mixture) {
        const std::size_t first = channels * tap.texel;
        const float change = (tap.weight.derivatives() * speed).sum();
        for (std::size_t c = 0; c < channels; ++c) {
          float& tangent = tangents[channels * k + c];
          tangent += change * texture.levels[tap.level].texels[first + c];
          if (!moving_texels.empty()) tangent += tap.weight.value() * moving_texels[tap.level][first + c];
        }
      }
    });
  });
}

}  // namespace dpr
