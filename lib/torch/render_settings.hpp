// What a batch is rendered with beside its tensors, set by name.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dpr/camera.hpp"
#include "dpr/scene.hpp"
#include "dpr/smoothing_options.hpp"
#include "smoothing/option_fields.hpp"

namespace dpr::torch_op {

/// Size, smoothing, clipping, culling and shading. Errors are the library's.
class RenderSettings {
 public:
  RenderSettings(std::int64_t width, std::int64_t height);

  /// Any key of a scene's "smoothing", with a number or a word; "znear", "zfar" and "cull"; "shading" and
  /// "shininess" of lights. The smoothing is resolved from all that was set, in whatever order
  /// (dpr/smoothing_options.hpp).
  void set(const std::string& name, const OptionValue& value);
  /// Instead of what was set of the smoothing until now.
  void set_smoothing(const Smoothing& smoothing);

  int width() const { return width_; }
  int height() const { return height_; }
  const Smoothing& smoothing() const { return smoothing_; }
  Cull cull() const { return cull_; }
  /// How lights shade, without their numbers.
  const Lights& lights() const { return lights_; }
  /// Sets the camera's planes: as they were set, or else to powers of two around the depths of the points,
  /// the near one at least 1/1024 of the far one. Small motions leave these alone, so they have no
  /// derivatives.
  void set_clipping(Camera& camera, std::span<const glm::vec3> points) const;

 private:
  int width_, height_;
  SmoothingOptions options_;            // what was set
  std::optional<Smoothing> otherwise_;  // what they leave open
  Smoothing smoothing_;                 // what they come to
  std::optional<float> znear_, zfar_;
  Lights lights_;
  Cull cull_ = Cull::none;
};

/// Sets by "sigma=1e-3": a whole number, a number, or else a word.
void set_from_text(RenderSettings& settings, const std::string& text);
RenderSettings settings_from_texts(std::int64_t width, std::int64_t height,
                                   const std::vector<std::string>& texts);

}  // namespace dpr::torch_op
