// Textures: images that are laid on a mesh by its texture coordinates.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "dpr/export.h"
#include "dpr/vectors.hpp"

namespace dpr {

/// Texture beyond [0, 1]: the image again, the image mirrored at every border, or its border's texels.
enum class Wrap { repeat, mirror, clamp };

/// Value between the centres of texels: the nearest texel; the four around it, by their
/// distance; or those of the two levels of a pyramid of ever smaller images whose texels are next in size to
/// the step between neighbouring pixels.
enum class Filter { nearest, bilinear, trilinear };

/// Texture coordinates (u, v) have v up: (0, 0) is the lower left corner of the image, (1, 1) the upper
/// right one, whatever its size. The texel of column c and row r of W x H has its centre at u = (c + 1/2) / W
/// and v = 1 - (r + 1/2) / H.
struct Texture {
  int width = 0, height = 0;
  std::vector<vec3> texels;  ///< [height * width] linear RGB, row-major, row 0 on top
  Wrap wrap = Wrap::repeat;
  Filter filter = Filter::bilinear;
  /// [height * width] from 0 to 1, or empty: opaque. They are multiplied by the opacities of the mesh, which says what
  /// they need (dpr/mesh.hpp), and are filtered as the texels are.
  std::vector<float> opacities{};
};

/// Throws InvalidArgument unless the texture has 1 to 16384 texels a side, as many texels as its sides say,
/// all of them finite, and as many opacities or none, from 0 to 1. `name` says in the message which texture it is.
DPR_API void validate(const Texture& texture, const std::string& name = "texture");

/// Reads any format of read_image(). 8- and 16-bit files hold sRGB (IEC 61966-2-1) and are decoded to linear
/// RGB; files of floats, EXR and the like, are taken as they are. An alpha channel with some pixel below 1 becomes the
/// opacities; what is beyond [0, 1] is clamped. Throws as read_image() does.
DPR_API Texture read_texture(const std::filesystem::path& file);

/// Writes by the extension, as write_image(): .exr keeps the linear floats, 8-bit formats are encoded to
/// sRGB. Opacities become alpha. Throws as write_image() does.
DPR_API void write_texture(const std::filesystem::path& file, const Texture& texture);

}  // namespace dpr
