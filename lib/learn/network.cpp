#include "learn/network.hpp"

#include "learn/batch_norm.hpp"

namespace dpr::learn {
namespace {

namespace nn = torch::nn;

constexpr std::int64_t k_features = 512;
constexpr std::int64_t k_vertices = 642;
constexpr std::int64_t k_hidden = 1024;       // of encoder and position decoder
constexpr std::int64_t k_color_hidden = 512;  // of the colour decoder's branches
constexpr std::int64_t k_block = 4;           // pixels a side that are averaged before a palette is chosen
constexpr std::int64_t k_blocks = (64 / k_block) * (64 / k_block);

nn::Conv2d convolution(std::int64_t in, std::int64_t out) {
  return nn::Conv2d(nn::Conv2dOptions(in, out, 5).stride(2).padding(2));
}

}  // namespace

Mesh template_mesh() { return make_icosphere(3); }

EncoderImpl::EncoderImpl()
    : convolutions_(convolution(4, 64), BatchNorm(64), nn::ReLU(), convolution(64, 128), BatchNorm(128),
                    nn::ReLU(), convolution(128, 256), BatchNorm(256), nn::ReLU()),
      linear_(nn::Linear(256 * 8 * 8, k_hidden), nn::ReLU(), nn::Linear(k_hidden, k_hidden), nn::ReLU(),
              nn::Linear(k_hidden, k_features), nn::ReLU()) {
  register_module("convolutions", convolutions_);
  register_module("linear", linear_);
}

void EncoderImpl::share_batches(const RankGroupPtr& ranks) {
  for (const auto& layer : convolutions_->children()) {
    if (auto* const normalisation = layer->as<BatchNormImpl>()) normalisation->share_batches(ranks);
  }
}

at::Tensor EncoderImpl::forward(at::Tensor images) {
  return linear_->forward(convolutions_->forward(images).flatten(1));
}

PositionDecoderImpl::PositionDecoderImpl()
    : linear_(nn::Linear(k_features, k_hidden), nn::ReLU(), nn::Linear(k_hidden, k_hidden), nn::ReLU(),
              nn::Linear(k_hidden, 3 * k_vertices)) {
  register_module("linear", linear_);
  const Mesh sphere = template_mesh();
  at::Tensor vertices = torch::empty({k_vertices, 3});
  std::memcpy(vertices.data_ptr<float>(), sphere.positions.data(), sizeof(float) * 3 * k_vertices);
  base_ = register_buffer("base", torch::atanh(0.5 * vertices));
}

at::Tensor PositionDecoderImpl::forward(const at::Tensor& features) {
  const at::Tensor moved = base_ + linear_->forward(features).view({-1, k_vertices, 3});
  return 0.5 * torch::tanh(moved);
}

ColorDecoderImpl::ColorDecoderImpl(const NetworkOptions& options)
    : palette_(options.palette),
      sampling_(nn::Linear(k_features, k_color_hidden), nn::ReLU(),
                nn::Linear(k_color_hidden, palette_ * k_blocks)),
      selection_(nn::Linear(k_features, k_color_hidden), nn::ReLU(),
                 nn::Linear(k_color_hidden, k_vertices * palette_)) {
  register_module("sampling", sampling_);
  register_module("selection", selection_);
}

at::Tensor ColorDecoderImpl::forward(const at::Tensor& features, const at::Tensor& images) {
  constexpr double k_least_coverage = 1e-4;  // blocks without any of the object cannot be chosen
  const at::Tensor blocks = torch::avg_pool2d(images, k_block).flatten(2);        // [image, 4, block]
  const at::Tensor coverage = blocks.slice(1, 3, 4).clamp_min(k_least_coverage);  // [image, 1, block]
  const at::Tensor colors = (blocks.slice(1, 0, 3) / coverage).clamp_max(1.0);    // images are over black
  const at::Tensor logits = sampling_->forward(features).view({-1, palette_, k_blocks});
  const at::Tensor weights = torch::softmax(logits + torch::log(coverage), 2);
  const at::Tensor palette = weights.matmul(colors.transpose(1, 2));  // [image, palette, 3]
  const at::Tensor mixture =
      torch::softmax(selection_->forward(features).view({-1, k_vertices, palette_}), 2);
  return mixture.matmul(palette);
}

NetworkImpl::NetworkImpl(const NetworkOptions& options) : colors_(options) {
  register_module("encoder", encoder_);
  register_module("positions", positions_);
  register_module("colors", colors_);
}

Reconstruction NetworkImpl::forward(const at::Tensor& images) {
  const at::Tensor features = encoder_->forward(images);
  return {positions_->forward(features), colors_->forward(features, images)};
}

}  // namespace dpr::learn
