// The network that reconstructs a coloured mesh from one image: Le Lidec et al. 2021, Figure 12, in the sizes
// of Liu et al. 2019 (SoftRas).
#pragma once

#include <torch/torch.h>

#include <cstdint>

#include "dpr/mesh.hpp"
#include "learn/rank_group.hpp"

namespace dpr::learn {

struct NetworkOptions {
  std::int64_t palette = 16;  ///< colours of a palette, N_p
  bool operator==(const NetworkOptions&) const = default;
};

/// A batch of meshes with the sphere's faces.
struct Reconstruction {
  at::Tensor vertices;  ///< [image, 642, 3] within [-0.5, 0.5]^3
  at::Tensor colors;    ///< [image, 642, 3] in [0, 1]
};

/// The sphere of 642 vertices that is deformed, of radius 1.
Mesh template_mesh();

/// Convolutions of 64, 128 and 256 channels, 5x5, stride 2, with batch normalisation; then 1024, 1024, 512.
class EncoderImpl : public torch::nn::Module {
 public:
  EncoderImpl();
  void share_batches(const RankGroupPtr& ranks);
  /// [image, 4, 64, 64] to [image, 512].
  at::Tensor forward(at::Tensor images);

 private:
  torch::nn::Sequential convolutions_, linear_;
};
TORCH_MODULE(Encoder);

/// Moves the vertices of a sphere of half the size of the box, by a hyperbolic tangent that keeps them in it.
class PositionDecoderImpl : public torch::nn::Module {
 public:
  PositionDecoderImpl();
  /// [image, 512] to [image, 642, 3].
  at::Tensor forward(const at::Tensor& features);

 private:
  torch::nn::Sequential linear_;
  at::Tensor base_;
};
TORCH_MODULE(PositionDecoder);

/// Chooses a palette, each colour a mean over the object's pixels in the image, and mixes it at each vertex.
class ColorDecoderImpl : public torch::nn::Module {
 public:
  explicit ColorDecoderImpl(const NetworkOptions& options);
  /// [image, 512] and [image, 4, 64, 64] to [image, 642, 3].
  at::Tensor forward(const at::Tensor& features, const at::Tensor& images);

 private:
  std::int64_t palette_;
  torch::nn::Sequential sampling_, selection_;
};
TORCH_MODULE(ColorDecoder);

class NetworkImpl : public torch::nn::Module {
 public:
  explicit NetworkImpl(const NetworkOptions& options);
  /// From now on it is trained with batches of which each rank has a part: learn/batch_norm.hpp.
  void share_batches(const RankGroupPtr& ranks) { encoder_->share_batches(ranks); }
  /// [image, 4, 64, 64], RGBA over black in [0, 1].
  Reconstruction forward(const at::Tensor& images);

 private:
  Encoder encoder_;
  PositionDecoder positions_;
  ColorDecoder colors_;
};
TORCH_MODULE(Network);

}  // namespace dpr::learn
