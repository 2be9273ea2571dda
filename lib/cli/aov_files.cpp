#include "cli/aov_files.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "dpr/error.hpp"
#include "dpr/image.hpp"

namespace dpr::cli {
namespace {

constexpr std::string_view k_standard_error = "standard_error";
constexpr std::string_view k_gradient_standard_error = "gradient_standard_error";

Aov parse(const std::string& name) {
  try {
    return parse_aov(name, "--aov");
  } catch (const InvalidArgument& error) {
    constexpr std::string_view k_before_last = " or ";
    std::string names(error.expected());
    names.replace(names.rfind(k_before_last), k_before_last.size(), ", ");
    throw InvalidArgument(
        error.argument(), error.got(),
        names.append(", ").append(k_standard_error).append(k_before_last).append(k_gradient_standard_error));
  }
}

/// Gradient of the mean over pixels and colour channels, which is differentiated where there is no target.
Image mean_gradient(const Scene& scene) {
  const float share = 1.0F / (3.0F * static_cast<float>(scene.width) * static_cast<float>(scene.height));
  return {scene.width, scene.height, glm::vec4(share, share, share, 0)};
}

Image grey(const std::vector<float>& values, const Scene& scene) {
  Image image(scene.width, scene.height);
  for (std::size_t i = 0; i < values.size(); ++i) image.pixels[i] = glm::vec4(glm::vec3(values[i]), 1);
  return image;
}

}  // namespace

AovFiles::AovFiles(const std::vector<std::string>& names, const std::string& output, const Scene& scene)
    : output_(output) {
  for (const std::string& name : names) {
    if (name == k_standard_error) {
      standard_error_ = true;
    } else if (name == k_gradient_standard_error) {
      gradient_standard_error_ = true;
    } else {
      aovs_.push_back(parse(name));
    }
  }
  if (std::ranges::find(aovs_, Aov::uv) == aovs_.end()) return;
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    if (!mesh_of(scene, i).face_texcoords.empty()) continue;
    throw InvalidArgument("uv (--aov)", "mesh " + std::to_string(i) + ", which has no texture coordinates",
                          "meshes that have some, as OBJ files with vt");
  }
}

std::vector<std::filesystem::path> AovFiles::files() const {
  std::vector<std::filesystem::path> files;
  for (const Aov aov : aovs_) files.emplace_back(file_name(to_string(aov)));
  if (standard_error_) files.emplace_back(file_name(k_standard_error));
  if (gradient_standard_error_) files.emplace_back(file_name(k_gradient_standard_error));
  return files;
}

bool AovFiles::is_name(std::string_view name) {
  constexpr Aov k_last = Aov::effective_faces;
  for (int aov = 0; aov <= static_cast<int>(k_last); ++aov)
    if (name == to_string(static_cast<Aov>(aov))) return true;
  return name == k_standard_error || name == k_gradient_standard_error;
}

std::string AovFiles::file_name(std::string_view name) const {
  return std::filesystem::path(output_).replace_extension("." + std::string(name) + ".exr").string();
}

const SamplingError& AovFiles::sampling_error(Renderer& renderer) const {
  if (!sampling_error_) {
    const Image gradient = mean_gradient(renderer.scene());
    sampling_error_ = estimate_sampling_error(renderer, std::span(&gradient, 1));
  }
  return *sampling_error_;
}

std::vector<std::string> AovFiles::write(Renderer& renderer, const Scene& scene,
                                         const SubdividedScene& drawn) const {
  std::vector<std::string> files;
  const auto write = [&](std::string_view name, const Image& image) {
    write_image(files.emplace_back(file_name(name)), image);
  };
  if (!aovs_.empty()) {
    AuxiliaryOutputs outputs = auxiliary_outputs(renderer);
    name_old_faces(scene, drawn, outputs);
    for (const Aov aov : aovs_) write(to_string(aov), aov_image(outputs, aov));
  }
  if (gradient_standard_error_ && sampling_error(renderer).pixel_gradients.empty()) {
    throw InvalidArgument("gradient_standard_error (--aov)",
                          "noise of the pixel, or a frame in bands of the memory budget",
                          "noise of the triangles, and an image whose fragments fit the device's memory");
  }
  if (standard_error_) write(k_standard_error, sampling_error(renderer).images.front());
  if (gradient_standard_error_) {
    write(k_gradient_standard_error,
          grey(sampling_error(renderer).pixel_gradients.front(), renderer.scene()));
  }
  return files;
}

void AovFiles::print_sampling_error(Renderer& renderer) const {
  if (!is_sampled(renderer.scene().smoothing)) return;
  constexpr double k_wanted = 1.0 / 255;  // a step of eight-bit images
  const SamplingError& error = sampling_error(renderer);
  std::printf("standard error of the colours: %.2g (RMS over the pixels, %u samples); %u samples for 1/255\n",
              error.image_rms(), error.samples, suggest_samples(error.image_rms(), error.samples, k_wanted));
}

}  // namespace dpr::cli
