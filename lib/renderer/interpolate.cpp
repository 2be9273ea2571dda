// Numbers of vertices at samples, and what comes back.
#include "renderer/interpolate.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <string>

#include "base/checks.hpp"
#include "base/parallel.hpp"

namespace dpr {
namespace {

/// Attributes that fit samples, by the first number of a corner's channels.
class Table {
 public:
  Table(const SampleArrays& samples, const Attributes& attributes)
      : samples_(samples),
        attributes_(attributes),
        of_view_(samples.size().width * samples.size().height),
        views_(samples.size().count / std::max<std::size_t>(of_view_ * samples.size().layers, 1)) {
    if (views_ == 0) throw InvalidArgument("samples (interpolate)", "none", "some");
    checks::require_channels(attributes.channels, "channels (interpolate)");
    faces_ = attributes.faces_are_of_views ? rows_of_views(attributes.faces.size(), 1, "faces") : 0;
    row_stride_ =
        attributes.are_of_views ? rows_of_views(attributes.values.size(), attributes.channels, "values") : 0;
    const std::size_t faces = faces_ != 0 ? faces_ : attributes.faces.size();
    const std::size_t rows = row_stride_ != 0 ? row_stride_ : attributes.values.size() / attributes.channels;
    if (const std::size_t numbers = (attributes.are_of_views ? views_ : 1) * rows * attributes.channels;
        attributes.values.size() != numbers)
      throw InvalidArgument("attributes (interpolate)", std::to_string(attributes.values.size()) + " numbers",
                            std::to_string(numbers));
    require_faces(faces);
    for (std::size_t i = 0; i < attributes.faces.size(); ++i) {
      const uvec3& face = attributes.faces[i];
      const std::uint32_t largest = std::max({face.x, face.y, face.z});
      if (largest >= rows)
        throw InvalidArgument(checks::in(checks::element("faces", i), "interpolate"), std::to_string(largest),
                              "indices below " + std::to_string(rows) + ", the rows of attributes");
    }
    require_finite(attributes.values, "attributes (interpolate)");
  }

  /// Throws for numbers that are not finite at a sample with a face: of its corners' rows, or `of_sample` of its own.
  void require_finite(std::span<const float> numbers, const char* name, std::size_t of_sample = 0) const {
    if (checks::first_not_finite(numbers) == numbers.size()) return;
    const auto require = [&](std::size_t first, std::size_t count) {
      checks::require_numbers(numbers.subspan(first, count), count, name);
    };
    for (std::size_t i = 0; i < count(); ++i) {
      if (is_empty(i)) continue;
      if (of_sample != 0) {
        require(i * of_sample, of_sample);
      } else {
        for (const std::size_t corner : corners(i)) require(corner, channels());
      }
    }
  }

  std::size_t channels() const { return attributes_.channels; }
  std::size_t count() const { return samples_.count(); }
  bool is_empty(std::size_t sample) const { return samples_.face(sample) < 0; }

  /// The first of the numbers of a sample's corners.
  std::array<std::size_t, 3> corners(std::size_t sample) const {
    const std::size_t view = samples_.number(sample) / of_view_ % views_;
    const uvec3& face = attributes_.faces[view * faces_ + static_cast<std::size_t>(samples_.face(sample))];
    const std::size_t first = view * row_stride_;
    return {(first + face.x) * channels(), (first + face.y) * channels(), (first + face.z) * channels()};
  }

  /// Behind the samples after it that show the same face of the same view.
  std::size_t end_of_run(std::size_t sample) const {
    const std::size_t end = (samples_.number(sample) / of_view_ + 1) * of_view_;
    std::size_t last = sample + 1;
    while (last < count() && samples_.number(last) < end && samples_.face(last) == samples_.face(sample))
      ++last;
    return last;
  }

  void require_steps() const {
    if (!samples_.has_steps())
      throw InvalidArgument("samples (interpolate)", "no steps", "those of Renderer::samples(true)");
  }

 private:
  void require_faces(std::size_t faces) const {
    std::atomic<std::int64_t> wrong = -1;
    for_each_in_parallel(count(), [&](std::size_t i) {
      const std::int64_t face = samples_.face(i);
      if (face < -1 || face >= static_cast<std::int64_t>(faces)) wrong = static_cast<std::int64_t>(i);
    });
    if (wrong < 0) return;
    const std::int64_t face = samples_.face(static_cast<std::size_t>(wrong.load()));
    if (face < 0) throw InvalidArgument("face_id (interpolate)", std::to_string(face), "faces, or -1");
    throw InvalidArgument("faces (interpolate)", std::to_string(faces),
                          "more than " + std::to_string(face) + ", which a sample shows");
  }
  /// Of each view by itself.
  std::size_t rows_of_views(std::size_t numbers, std::size_t of_row, const char* name) const {
    const std::size_t rows = numbers / (of_row * views_);
    if (rows == 0 || rows * of_row * views_ != numbers)
      throw InvalidArgument(checks::in(name, "interpolate"), std::to_string(numbers),
                            "as many for each of " + std::to_string(views_) + " views");
    return rows;
  }

  const SampleArrays& samples_;
  const Attributes& attributes_;
  std::size_t of_view_, views_;
  std::size_t faces_ = 0, row_stride_ = 0;  // of a view; 0: all share them
};

/// Of corners 0, 1 and 2.
std::array<float, 3> weights_of(const vec2& barycentrics) {
  return {1 - barycentrics.x - barycentrics.y, barycentrics.x, barycentrics.y};
}
std::array<float, 3> changes_of(float first, float second) { return {-first - second, first, second}; }

/// sum of weights[k] values[corner k]
float mixed(std::span<const float> values, const std::array<std::size_t, 3>& corners, std::size_t channel,
            const std::array<float, 3>& weights) {
  return weights[0] * values[corners[0] + channel] + weights[1] * values[corners[1] + channel] +
         weights[2] * values[corners[2] + channel];
}

/// Writes what `write(sample, corners, numbers)` finds to the numbers of each sample with a face, and 0 to the others'.
template <class Write>
void fill(const Table& table, std::size_t of_sample, std::span<float> out, const char* name,
          const Write& write) {
  if (out.size() != table.count() * of_sample)
    throw InvalidArgument(checks::in(name, "interpolate"), std::to_string(out.size()),
                          std::to_string(table.count() * of_sample));
  for_each_in_parallel(table.count(), [&](std::size_t i) {
    const std::span<float> to = out.subspan(i * of_sample, of_sample);
    if (table.is_empty(i)) {
      std::ranges::fill(to, 0.0F);
    } else {
      write(i, table.corners(i), to);
    }
  });
}

}  // namespace

SampleArrays::SampleArrays(const Samples& samples)
    : size_{static_cast<std::size_t>(samples.width), static_cast<std::size_t>(samples.height),
            static_cast<std::size_t>(samples.layers), samples.faces.size()},
      count_(samples.faces.size()),
      faces_(samples.faces.data()),
      places_(samples.barycentrics.data()),
      steps_(samples.steps.empty() ? nullptr : samples.steps.data()) {
  const auto is_wrong = [&](std::size_t count) { return count != size_.count; };
  if (samples.layers < 1)
    throw InvalidArgument("layers (interpolate)", std::to_string(samples.layers), "at least 1");
  if (is_wrong(samples.barycentrics.size()) || (steps_ && is_wrong(samples.steps.size())))
    throw InvalidArgument("samples (interpolate)",
                          std::to_string(size_.count) + " faces, " +
                              std::to_string(samples.barycentrics.size()) + " barycentrics",
                          "what Renderer::samples() returns");
}

std::vector<float> interpolate(const Samples& samples, const Attributes& attributes) {
  std::vector<float> values(samples.faces.size() * attributes.channels);
  interpolate(SampleArrays(samples), attributes, values);
  return values;
}

void interpolate(const SampleArrays& samples, const Attributes& attributes, std::span<float> values) {
  const Table table(samples, attributes);
  fill(table, table.channels(), values, "values",
       [&](std::size_t i, const auto& corners, std::span<float> to) {
         const auto weights = weights_of(samples.place(i));
         for (std::size_t c = 0; c < to.size(); ++c) to[c] = mixed(attributes.values, corners, c, weights);
       });
}

std::vector<float> interpolate_steps(const Samples& samples, const Attributes& attributes) {
  std::vector<float> steps(2 * samples.faces.size() * attributes.channels);
  interpolate_steps(SampleArrays(samples), attributes, steps);
  return steps;
}

void interpolate_steps(const SampleArrays& samples, const Attributes& attributes, std::span<float> steps) {
  const Table table(samples, attributes);
  table.require_steps();
  fill(table, 2 * table.channels(), steps, "steps",
       [&](std::size_t i, const auto& corners, std::span<float> to) {
         const vec4 step = samples.step(i);
         const auto right = changes_of(step.x, step.z), down = changes_of(step.y, step.w);
         for (std::size_t c = 0; c < table.channels(); ++c) {
           to[2 * c] = mixed(attributes.values, corners, c, right);
           to[2 * c + 1] = mixed(attributes.values, corners, c, down);
         }
       });
}

namespace {

/// Parts of the samples, each of which adds to rows of its own: by the numbers alone, so that the sums are.
std::size_t parts_of(const Table& table, std::size_t numbers) {
  constexpr std::size_t k_most = 8;
  const std::size_t of_rows = table.count() * table.channels() / std::max<std::size_t>(numbers, 1);
  return std::clamp<std::size_t>(std::min(table.count() / k_least_of_thread, of_rows), 1, k_most);
}

/// Samples of one face beside each other: what they add to its corners, a few channels at a time.
class Run {
 public:
  Run(const Table& table, const SampleArrays& samples, const Attributes& attributes)
      : table_(table), samples_(samples), attributes_(attributes) {}

  /// To the rows of `values` and the gradients of the barycentrics, of samples from `first` up to `last`.
  void add(std::span<const float> grad_values, std::size_t first, std::size_t last, float* values,
           std::span<vec2> barycentrics) const {
    const std::size_t channels = table_.channels();
    const auto corners = table_.corners(first);
    for (std::size_t from = 0; from < channels; from += k_together) {
      const std::size_t count = std::min(channels - from, k_together);
      const float* const of = &attributes_.values[from];
      float by_first[k_together], by_second[k_together], sums[3][k_together] = {};
      for (std::size_t c = 0; c < count; ++c) {
        by_first[c] = of[corners[1] + c] - of[corners[0] + c];
        by_second[c] = of[corners[2] + c] - of[corners[0] + c];
      }
      for (std::size_t i = first; i < last; ++i) {
        const auto weights = weights_of(samples_.place(i));
        const float* const grad = &grad_values[i * channels + from];
        vec2 by_place(0);
        for (std::size_t c = 0; c < count; ++c) {
          for (std::size_t k = 0; k < 3; ++k) sums[k][c] += grad[c] * weights[k];
          by_place += grad[c] * vec2(by_first[c], by_second[c]);
        }
        barycentrics[i] += by_place;
      }
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t c = 0; c < count; ++c) values[corners[k] + from + c] += sums[k][c];
    }
  }

  void add_steps(std::span<const float> grad_steps, std::size_t first, std::size_t last, float* values,
                 std::span<vec4> steps) const {
    const std::size_t channels = table_.channels();
    const auto corners = table_.corners(first);
    const float* const of = attributes_.values.data();
    for (std::size_t i = first; i < last; ++i) {
      const vec4 step = samples_.step(i);
      const auto right = changes_of(step.x, step.z), down = changes_of(step.y, step.w);
      vec4 by_step(0);
      for (std::size_t c = 0; c < channels; ++c) {
        const float* const of_step = &grad_steps[2 * (i * channels + c)];
        for (std::size_t k = 0; k < 3; ++k)
          values[corners[k] + c] += of_step[0] * right[k] + of_step[1] * down[k];
        const float at_first = of[corners[0] + c];
        const vec2 grad(of_step[0], of_step[1]);
        by_step += vec4(grad * (of[corners[1] + c] - at_first), grad * (of[corners[2] + c] - at_first));
      }
      steps[i] = by_step;
    }
  }

 private:
  static constexpr std::size_t k_together = 16;

  const Table& table_;
  const SampleArrays& samples_;
  const Attributes& attributes_;
};

}  // namespace

InterpolateGradient interpolate_backward(const Samples& samples, const Attributes& attributes,
                                         std::span<const float> grad_values,
                                         std::span<const float> grad_steps) {
  return interpolate_backward(SampleArrays(samples), attributes, grad_values, grad_steps);
}

InterpolateGradient interpolate_backward(const SampleArrays& samples, const Attributes& attributes,
                                         std::span<const float> grad_values,
                                         std::span<const float> grad_steps) {
  const Table table(samples, attributes);
  const auto require = [&](std::span<const float> grads, std::size_t of_sample, const char* name) {
    if (grads.size() != table.count() * of_sample)
      throw InvalidArgument(name, std::to_string(grads.size()) + " numbers",
                            std::to_string(table.count() * of_sample));
    table.require_finite(grads, name, of_sample);
  };
  require(grad_values, table.channels(), "grad_values (interpolate)");
  if (!grad_steps.empty()) {
    table.require_steps();
    require(grad_steps, 2 * table.channels(), "grad_steps (interpolate)");
  }
  const std::size_t numbers = attributes.values.size(), parts = parts_of(table, numbers);
  InterpolateGradient found{std::vector<float>(numbers), std::vector<vec2>(table.count()),
                            std::vector<vec4>(grad_steps.empty() ? 0 : table.count())};
  std::vector<float> others((parts - 1) * numbers);
  const Run run(table, samples, attributes);
  const auto add_part = [&](std::size_t part) {
    float* const values = part == 0 ? found.values.data() : &others[(part - 1) * numbers];
    const std::size_t end = table.count() * (part + 1) / parts;
    for (std::size_t i = table.count() * part / parts, last; i < end; i = last) {
      last = std::min(table.end_of_run(i), end);
      if (table.is_empty(i)) continue;
      run.add(grad_values, i, last, values, found.barycentrics);
      if (!grad_steps.empty()) run.add_steps(grad_steps, i, last, values, found.steps);
    }
  };
  for_each_in_parallel(parts, add_part, 1);
  for_each_in_parallel(numbers, [&](std::size_t i) {
    for (std::size_t part = 0; part + 1 < parts; ++part) found.values[i] += others[part * numbers + i];
  });
  return found;
}

std::vector<float> interpolate_tangent(const Samples& samples, const Attributes& attributes,
                                       std::span<const float> value_tangents,
                                       std::span<const vec2> barycentric_tangents) {
  return interpolate_tangent(SampleArrays(samples), attributes, value_tangents, barycentric_tangents);
}

std::vector<float> interpolate_tangent(const SampleArrays& samples, const Attributes& attributes,
                                       std::span<const float> value_tangents,
                                       std::span<const vec2> barycentric_tangents) {
  const Table table(samples, attributes);
  if (!value_tangents.empty())
    checks::require_numbers(value_tangents, attributes.values.size(), "value_tangents (interpolate)");
  if (!barycentric_tangents.empty())
    checks::require_numbers(checks::floats_of(barycentric_tangents), 2 * table.count(),
                            "barycentric_tangents (interpolate)");
  std::vector<float> found(table.count() * table.channels());
  for (std::size_t i = 0; i < table.count(); ++i) {
    if (table.is_empty(i)) continue;
    const auto corners = table.corners(i);
    const auto weights = weights_of(samples.place(i));
    const vec2 moved = barycentric_tangents.empty() ? vec2(0) : barycentric_tangents[i];
    for (std::size_t c = 0; c < table.channels(); ++c) {
      float& tangent = found[i * table.channels() + c];
      if (!value_tangents.empty()) tangent += mixed(value_tangents, corners, c, weights);
      tangent += mixed(attributes.values, corners, c, changes_of(moved.x, moved.y));
    }
  }
  return found;
}

}  // namespace dpr
