// Texels at places, from named arrays, in the C interface.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "batch/inputs.hpp"
#include "c/handles.hpp"
#include "dpr/error.hpp"
#include "image/texture_lookup.hpp"
#include "image/texture_pyramid.hpp"
#include "image/texture_words.hpp"

namespace dpr::batch {
namespace {

constexpr std::array<std::string_view, 4> k_borders{"repeat", "mirror", "clamp", "zero"};  // as Border
constexpr std::array<std::string_view, 4> k_filters{"nearest", "bilinear", "trilinear",
                                                    "mipmap"};  // as Filter
constexpr std::size_t k_mipmap = 3;

void require_finite(const NamedArray& array) {
  const auto numbers = array.rows<const float>();
  checks::require_numbers(numbers, numbers.size(), argument(array));
}

/// Of a part of equal parts; none of nothing.
template <class Number>
std::span<Number> part_of(std::span<Number> numbers, std::size_t part, std::size_t parts) {
  return numbers.subspan(part * (numbers.size() / parts), numbers.size() / parts);
}

/// A texture for all images, or one for each, and where it is read.
class TextureCall {
 public:
  TextureCall(NamedArrays arrays, const char* wrap, const char* filter) : arrays_(arrays) {
    find_coordinates();
    const std::size_t border = position_of(wrap ? wrap : "repeat", k_borders, "wrap (texture)");
    lookup_.border = is_cube() ? Border::cube : static_cast<Border>(border);
    const std::size_t chosen = position_of(filter ? filter : "bilinear", k_filters, "filter (texture)");
    lookup_.is_level_rounded = chosen == k_mipmap;
    lookup_.filter = lookup_.is_level_rounded ? Filter::trilinear : static_cast<Filter>(chosen);
    lookup_.is_v_up = coordinates_->name == "texcoords";
    const std::size_t dimensions = lookup_.dimensions();
    const std::vector<std::size_t>& size = coordinates_->shape;
    const std::string like = ", as " + coordinates_->name;
    for (const NamedArray& array : arrays) {
      if (array.name == "steps")
        require_floats(array, {size[0], size[1], size[2], 2 * dimensions},
                       "[N, h, w, " + std::to_string(2 * dimensions) + "]" + like);
      if (array.name == "levels") require_floats(array, {size[0], size[1], size[2]}, "[N, h, w]" + like);
    }
    find_levels();
    for (const NamedArray& array : arrays) require_finite(array);
  }

  std::size_t channels() const { return lookup_.channels; }

  void require_values(const NamedArray& array) const {
    const std::vector<std::size_t>& size = coordinates_->shape;
    require_floats(array, {size[0], size[1], size[2], channels()},
                   "[N, h, w, " + std::to_string(channels()) + "], as " + coordinates_->name);
  }

  /// Throws unless these are named and shaped as what the call has.
  void require_own(NamedArrays others) const {
    for (const NamedArray& other : others) require_like(other, require(arrays_, other.name));
  }

  void values(std::span<float> to) const {
    for_each_part([&](std::size_t part, const TextureLookup& texture) {
      look_up(texture, places(arrays_, part), part_of(to, part, textures_));
    });
  }

  void backward(std::span<const float> grad_values, NamedArrays to) const {
    for (const NamedArray& gradient : to) std::ranges::fill(gradient.rows<float>(), 0.0F);
    const bool has_texels = std::ranges::any_of(
        to, [](const NamedArray& gradient) { return gradient.name.starts_with("texels["); });
    for_each_part([&](std::size_t part, const TextureLookup& texture) {
      const auto own = [&](const std::string& name) {
        const NamedArray* const array = find(to, name);
        return array ? part_of(array->rows<float>(), part, textures_) : std::span<float>();
      };
      LookupGradients gradients{{}, own(coordinates_->name), own("steps"), own("levels")};
      std::vector<std::vector<float>> spare(has_texels ? texture.levels.size() : 0);
      for (std::size_t level = 0; level < spare.size(); ++level) {
        std::span<float> texels = own(texels_name(level));
        if (texels.empty()) texels = spare[level] = std::vector<float>(texture.levels[level].texels.size());
        gradients.texels.push_back(texels);
      }
      look_up_backward(texture, places(arrays_, part), part_of(grad_values, part, textures_), gradients);
      if (has_texels && makes_levels_) pyramid().gather(gradients.texels);
    });
  }

  void tangent(NamedArrays moving, std::span<float> to) const {
    const bool has_texels = std::ranges::any_of(
        moving, [](const NamedArray& array) { return array.name.starts_with("texels["); });
    for_each_part([&](std::size_t part, const TextureLookup& texture) {
      std::vector<std::vector<float>> spare;
      std::vector<std::span<const float>> texels;
      for (std::size_t level = 0; has_texels && level < given_; ++level) {
        const NamedArray* const array = find(moving, texels_name(level));
        if (array) {
          texels.push_back(part_of(array->rows<const float>(), part, textures_));
        } else {
          texels.push_back(spare.emplace_back(texture.levels[level].texels.size()));
        }
      }
      std::vector<std::vector<float>> smaller;
      if (has_texels && makes_levels_) smaller = pyramid().smaller(texels[0]);
      texels.insert(texels.end(), smaller.begin(), smaller.end());
      look_up_tangent(texture, places(arrays_, part), places(moving, part), texels,
                      part_of(to, part, textures_));
    });
  }

 private:
  static std::string texels_name(std::size_t level) { return checks::element("texels", level); }
  bool is_cube() const { return coordinates_->name == "directions"; }

  void find_coordinates() {
    for (const NamedArray& array : arrays_) {
      const bool are_coordinates =
          array.name == "texcoords" || array.name == "places" || array.name == "directions";
      if (are_coordinates && coordinates_)
        throw InvalidArgument("coordinates (texture)", coordinates_->name + " and " + array.name,
                              "one of them");
      if (are_coordinates) coordinates_ = &array;
      if (!are_coordinates && array.name != "steps" && array.name != "levels" &&
          !array.name.starts_with("texels["))
        throw InvalidArgument("name (texture)", "'" + array.name + "'",
                              "texels[0], ..., texcoords, places, directions, steps or levels");
    }
    if (!coordinates_)
      throw InvalidArgument("coordinates (texture)", "none", "texcoords, places or directions");
    require_floats(*coordinates_, {k_any, k_any, k_any, is_cube() ? std::size_t{3} : 2},
                   is_cube() ? "[N, h, w, 3]" : "[N, h, w, 2]");
  }

  void find_levels() {
    const NamedArray& first = require(arrays_, texels_name(0));
    const std::string form = is_cube() ? "[6, S, S, C], or 6 N" : "[1 or N, H, W, C]";
    require_floats(first, {k_any, k_any, k_any, k_any}, form);
    const std::vector<std::size_t>& shape = first.shape;
    const std::size_t faces = is_cube() ? 6 : 1, images = coordinates_->shape[0];
    textures_ = shape[0] / faces;
    constexpr std::size_t k_most = checks::k_largest_side;
    const bool fits = shape[0] % faces == 0 && (textures_ == 1 || textures_ == images) && shape[3] > 0 &&
                      std::min(shape[1], shape[2]) > 0 && std::max(shape[1], shape[2]) <= k_most &&
                      (!is_cube() || shape[1] == shape[2]);
    if (!fits || textures_ == 0)
      throw InvalidArgument(
          argument(first), text_of(shape),
          form + ", sides up to " + std::to_string(k_most) + ", N: " + std::to_string(images));
    lookup_.channels = shape[3];
    for (given_ = 1; find(arrays_, texels_name(given_)); ++given_) {
      const NamedArray& level = require(arrays_, texels_name(given_));
      const auto side = [&](std::size_t i) { return std::max<std::size_t>(shape[i] >> given_, 1); };
      require_floats(level, {shape[0], side(1), side(2), shape[3]},
                     text_of({shape[0], side(1), side(2), shape[3]}));
    }
    for (const NamedArray& array : arrays_)
      if (array.name.starts_with("texels[") && !is_level(array.name))
        throw InvalidArgument("name (texture)", "'" + array.name + "'",
                              "levels from texels[0] on, one after the other");
    if (given_ > 1 && lookup_.filter != Filter::trilinear)
      throw InvalidArgument("filter (texture)", std::string(to_string(lookup_.filter)),
                            "trilinear or mipmap with " + texels_name(1));
    makes_levels_ = given_ == 1 && lookup_.filter == Filter::trilinear;
  }

  bool is_level(const std::string& name) const {
    for (std::size_t level = 0; level < given_; ++level)
      if (name == texels_name(level)) return true;
    return false;
  }

  /// Of one texture.
  TexturePyramid pyramid() const {
    const std::vector<std::size_t>& shape = require(arrays_, texels_name(0)).shape;
    return {static_cast<int>(shape[2]), static_cast<int>(shape[1]), is_cube() ? std::size_t{6} : 1, shape[3],
            makes_levels_};
  }

  /// What a texture is read at, or how fast that moves, by the arrays' names.
  TexturePlaces places(NamedArrays from, std::size_t part) const {
    const auto own = [&](const std::string& name) {
      const NamedArray* const array = find(from, name);
      return array ? part_of(array->rows<const float>(), part, textures_) : std::span<const float>();
    };
    return {own(coordinates_->name), own("steps"), own("levels")};
  }

  /// Calls a function for each texture and the images that show it.
  template <class Function>
  void for_each_part(const Function& function) const {
    for (std::size_t part = 0; part < textures_; ++part) {
      TextureLookup texture = lookup_;
      for (std::size_t level = 0; level < given_; ++level) {
        const NamedArray& texels = require(arrays_, texels_name(level));
        texture.levels.push_back({part_of(texels.rows<const float>(), part, textures_),
                                  static_cast<int>(texels.shape[2]), static_cast<int>(texels.shape[1])});
      }
      const TexturePyramid sizes = pyramid();
      const std::vector<std::vector<float>> smaller = sizes.smaller(texture.levels[0].texels);
      for (std::size_t level = 0; level < smaller.size(); ++level)
        texture.levels.push_back(
            {smaller[level], sizes.sizes()[level + 1].width, sizes.sizes()[level + 1].height});
      function(part, texture);
    }
  }

  NamedArrays arrays_;
  const NamedArray* coordinates_ = nullptr;
  TextureLookup lookup_{};
  std::size_t textures_ = 1;
  std::size_t given_ = 1;  // levels
  bool makes_levels_ = false;
};

}  // namespace
}  // namespace dpr::batch

using namespace dpr::c;
using dpr::batch::NamedArray;
using dpr::batch::TextureCall;
using dpr::batch::to_arrays;

dpr_status dpr_texture_map(const dpr_array* arrays, std::size_t count, const char* wrap, const char* filter,
                           const dpr_array* values) {
  return guarded([&] {
    const std::vector<NamedArray> given = to_arrays(arrays, count, "arrays"),
                                  to = to_arrays(values, 1, "values");
    const TextureCall call(given, wrap, filter);
    call.require_values(to[0]);
    call.values(to[0].rows<float>());
  });
}

dpr_status dpr_texture_map_backward(const dpr_array* arrays, std::size_t count, const char* wrap,
                                    const char* filter, const dpr_array* grad_values,
                                    const dpr_array* gradients, std::size_t gradient_count) {
  return guarded([&] {
    const std::vector<NamedArray> given = to_arrays(arrays, count, "arrays"),
                                  grad = to_arrays(grad_values, 1, "grad_values"),
                                  to = to_arrays(gradients, gradient_count, "gradients");
    const TextureCall call(given, wrap, filter);
    call.require_values(grad[0]);
    dpr::batch::require_finite(grad[0]);
    call.require_own(to);
    call.backward(grad[0].rows<const float>(), to);
  });
}

dpr_status dpr_texture_map_tangent(const dpr_array* arrays, std::size_t count, const char* wrap,
                                   const char* filter, const dpr_array* tangents, std::size_t tangent_count,
                                   const dpr_array* values) {
  return guarded([&] {
    const std::vector<NamedArray> given = to_arrays(arrays, count, "arrays"),
                                  moving = to_arrays(tangents, tangent_count, "tangents"),
                                  to = to_arrays(values, 1, "values");
    const TextureCall call(given, wrap, filter);
    call.require_values(to[0]);
    call.require_own(moving);
    for (const NamedArray& array : moving) dpr::batch::require_finite(array);
    call.tangent(moving, to[0].rows<float>());
  });
}
