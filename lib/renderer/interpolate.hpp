// Numbers of vertices at samples, of whoever has them in whatever layout, into the caller's memory.
#pragma once

#include <algorithm>
#include <cstdint>

#include "dpr/interpolate.hpp"

namespace dpr {

/// What samples show, [layer][view][height][width], in one of three layouts, or some of them; valid as long as the
/// arrays.
class SampleArrays {
 public:
  struct Size {
    std::size_t width, height, layers, count;  ///< of all samples
  };

  /// As Renderer::samples() returns them. Throws InvalidArgument for arrays of other sizes.
  explicit SampleArrays(const Samples& samples);
  /// As dpr_frame_samples() writes them. steps: or null.
  SampleArrays(const Size& size, const std::int64_t* face_id, const vec3* barycentrics, const vec4* steps)
      : size_(size), count_(size.count), face_id_(face_id), barycentrics_(barycentrics), steps_(steps) {}
  /// As dpr_clip_space_rast() writes them. rast_db: or null.
  SampleArrays(const Size& size, const vec4* rast, const vec4* rast_db)
      : size_(size), count_(size.count), steps_(rast_db), rast_(rast) {}

  /// Those with these numbers, in ascending order, of as many as `size` says; each shows a face.
  SampleArrays(const Size& size, std::span<const std::uint32_t> numbers, const std::int32_t* faces,
               const vec2* places)
      : size_(size), count_(numbers.size()), numbers_(numbers.data()), faces_(faces), places_(places) {}

  const Size& size() const { return size_; }  ///< with those that are left out
  std::size_t count() const { return count_; }
  /// Among all that there are.
  std::size_t number(std::size_t i) const { return numbers_ ? numbers_[i] : i; }
  bool has_steps() const { return steps_ != nullptr; }

  /// Below 0 where nothing is.
  std::int64_t face(std::size_t i) const {
    if (faces_) return faces_[i];
    if (face_id_) return face_id_[i];
    const float number = rast_[i].w;
    return number > 0 ? static_cast<std::int64_t>(std::min(number, k_most_of_rast)) - 1 : -1;
  }
  /// Barycentrics of corners 1 and 2, and their steps as Samples has them.
  vec2 place(std::size_t i) const {
    if (places_) return places_[i];
    if (barycentrics_) return {barycentrics_[i].y, barycentrics_[i].z};
    return {rast_[i].y, 1 - rast_[i].x - rast_[i].y};
  }
  vec4 step(std::size_t i) const {
    const vec4& s = steps_[i];
    return rast_ ? vec4(s.z, s.w, -s.x - s.z, -s.y - s.w) : s;
  }

 private:
  static constexpr float k_most_of_rast = 1U << 25U;  // more than it can count to

  Size size_;
  std::size_t count_;
  const std::uint32_t* numbers_ = nullptr;
  const std::int32_t* faces_ = nullptr;
  const vec2* places_ = nullptr;
  const std::int64_t* face_id_ = nullptr;
  const vec3* barycentrics_ = nullptr;
  const vec4* steps_ = nullptr;
  const vec4* rast_ = nullptr;
};

/// As the functions of Samples. Throw InvalidArgument for another size, too.
void interpolate(const SampleArrays& samples, const Attributes& attributes, std::span<float> values);
void interpolate_steps(const SampleArrays& samples, const Attributes& attributes, std::span<float> steps);
InterpolateGradient interpolate_backward(const SampleArrays& samples, const Attributes& attributes,
                                         std::span<const float> grad_values,
                                         std::span<const float> grad_steps);
std::vector<float> interpolate_tangent(const SampleArrays& samples, const Attributes& attributes,
                                       std::span<const float> value_tangents,
                                       std::span<const vec2> barycentric_tangents);

}  // namespace dpr
