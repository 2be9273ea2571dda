// Settings of a batch beside its arrays, set by name.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "batch/named_arrays.hpp"
#include "dpr/camera.hpp"
#include "dpr/scene.hpp"
#include "dpr/smoothing_options.hpp"
#include "dpr/texture.hpp"
#include "renderer/depth_range.hpp"
#include "smoothing/option_fields.hpp"

namespace dpr::batch {

/// Size, smoothing, clipping, culling, shading and layers. Errors are the library's.
class RenderSettings {
 public:
  RenderSettings(std::int64_t width, std::int64_t height);

  /// Any of setting_names(), with a number or a word; "wrap" and "filter" with a word, or one a texture:
  /// "repeat,clamp". The smoothing is resolved from all that was set, in whatever order
  /// (dpr/smoothing_options.hpp).
  void set(const std::string& name, const OptionValue& value);
  /// Instead of what was set of the smoothing until now.
  void set_smoothing(const Smoothing& smoothing);
  /// Fails for a number or a word that was set and has no part in the smoothing: alpha in the joint
  /// composition, say. The seed may always be set.
  void require_parts() const;

  int width() const { return width_; }
  int height() const { return height_; }
  const Smoothing& smoothing() const { return smoothing_; }
  int layers() const { return layers_; }
  Cull cull() const { return cull_; }
  /// Shading of the lights, without their numbers.
  const Lights& lights() const { return lights_; }
  /// One of each texture, or of all; none: those of a Texture.
  const std::vector<Wrap>& wraps() const { return wraps_; }
  const std::vector<Filter>& filters() const { return filters_; }
  /// True if both planes were set.
  bool has_clipping() const { return znear_ && zfar_; }
  /// Sets the camera's planes: as they were set, or else to powers of two around the depths of a box, if
  /// there is one, the near one at least 1/1024 of the far one. Small motions leave these alone, so they have
  /// no derivatives.
  void set_clipping(Camera& camera, const std::optional<BoxCorners>& box) const;

 private:
  int width_, height_;
  SmoothingOptions options_;            // what was set
  std::optional<Smoothing> otherwise_;  // what they leave open
  Smoothing smoothing_;                 // what they come to
  std::optional<float> znear_, zfar_;
  Lights lights_;
  Cull cull_ = Cull::none;
  int layers_ = 1;
  std::vector<Wrap> wraps_;
  std::vector<Filter> filters_;
};

/// The keys of a scene's "smoothing"; "znear", "zfar" and "cull"; "shading" and "shininess" of lights; "wrap"
/// and "filter" of textures; "layers" of samples.
std::vector<std::string_view> setting_names();
/// Throws InvalidArgument for gradients that are wanted of what is neither among the arrays nor a setting.
void require_numbers_of(std::span<const std::string> gradients, NamedArrays arrays);

/// Sets by "sigma=1e-3": a whole number, a number, or else a word.
void set_from_text(RenderSettings& settings, const std::string& text);
RenderSettings settings_from_texts(std::int64_t width, std::int64_t height,
                                   const std::vector<std::string>& texts);

}  // namespace dpr::batch
