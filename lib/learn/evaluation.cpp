#include "learn/evaluation.hpp"

#include <algorithm>

#include "dpr/error.hpp"
#include "dpr/renderer.hpp"
#include "learn/checkpoint.hpp"
#include "solve/resample.hpp"

namespace dpr::learn {
namespace {

constexpr std::size_t k_evaluation_batch = 32;

/// Puts a network into evaluation mode for its life.
class EvaluationMode {
 public:
  explicit EvaluationMode(Network& network) : network_(network), was_training_(network->is_training()) {
    network_->eval();
  }
  ~EvaluationMode() { network_->train(was_training_); }
  EvaluationMode(const EvaluationMode&) = delete;
  EvaluationMode& operator=(const EvaluationMode&) = delete;

 private:
  Network& network_;
  bool was_training_;
  torch::NoGradGuard no_gradients_;
};

double iou_with_object(const Mesh& mesh, const Dataset& dataset, std::size_t object) {
  return iou(voxelize(mesh, k_voxel_resolution, voxel_bounds()), dataset.voxels(object));
}

/// The sphere as the network starts from it: half the size of the box.
Mesh start_mesh() {
  Mesh mesh = template_mesh();
  for (glm::vec3& p : mesh.positions) p *= 0.25F;
  return mesh;
}

/// A reconstruction from some sides, at twice the size of the input.
std::vector<Image> portraits(Renderer& renderer, const Mesh& mesh, std::size_t input_view) {
  constexpr std::size_t k_portraits = 4;
  constexpr int k_side = 2 * k_image_size, k_supersampling = 4;
  Scene scene;
  scene.width = scene.height = k_supersampling * k_side;
  scene.camera = dataset_camera(0);
  scene.background = glm::vec3(1);
  scene.smoothing = rigid_smoothing();
  scene.meshes.push_back({mesh});
  renderer.set_scene(scene);
  std::vector<View> views;
  for (std::size_t i = 0; i < k_portraits; ++i) {
    views.push_back({dataset_camera((input_view + i * k_views / k_portraits) % k_views), {glm::mat4(1.0F)}});
  }
  renderer.set_views(views);
  renderer.forward();
  std::vector<Image> images;
  for (std::size_t i = 0; i < k_portraits; ++i) images.push_back(resample(renderer.image(i), k_side, k_side));
  return images;
}

/// The input over white, every pixel four times.
Image enlarged_input(const Image& input) {
  Image image(2 * input.width, 2 * input.height);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const glm::vec4& pixel = input.at(x / 2, y / 2);
      image.at(x, y) = glm::vec4(glm::vec3(pixel) + (1 - pixel.a), 1);
    }
  }
  return image;
}

}  // namespace

at::Tensor load_images(const Dataset& dataset, const std::vector<ViewOfObject>& which) {
  at::Tensor bytes =
      torch::empty({static_cast<std::int64_t>(which.size()), 4, k_image_size, k_image_size}, torch::kUInt8);
  std::uint8_t* out = bytes.data_ptr<std::uint8_t>();
  for (const auto& [object, view] : which) out = std::ranges::copy(dataset.image(object, view), out).out;
  return bytes.to(torch::kFloat) / 255.0;
}

Mesh to_mesh(const Reconstruction& batch, std::int64_t index) {
  Mesh mesh = template_mesh();
  const auto copy = [&](const at::Tensor& from, std::vector<glm::vec3>& to) {
    const at::Tensor rows = from[index].contiguous();
    const auto* values = reinterpret_cast<const glm::vec3*>(rows.data_ptr<float>());
    to.assign(values, values + rows.size(0));
  };
  copy(batch.vertices, mesh.positions);
  copy(batch.colors, mesh.vertex_colors);
  return mesh;
}

std::vector<double> reconstruction_iou(Network& network, const Dataset& dataset,
                                       const std::vector<ViewOfObject>& which,
                                       const std::function<void(std::size_t)>& progress) {
  const EvaluationMode mode(network);
  std::vector<double> result;
  while (result.size() < which.size()) {
    const auto first = which.begin() + static_cast<std::ptrdiff_t>(result.size());
    const std::size_t count = std::min(k_evaluation_batch, which.size() - result.size());
    const std::vector<ViewOfObject> part(first, first + static_cast<std::ptrdiff_t>(count));
    const Reconstruction batch = network->forward(load_images(dataset, part));
    for (std::size_t i = 0; i < count; ++i) {
      result.push_back(iou_with_object(to_mesh(batch, static_cast<std::int64_t>(i)), dataset, part[i].first));
    }
    progress(result.size());
  }
  return result;
}

std::vector<ViewOfObject> spread_views(const Dataset& dataset, std::size_t views) {
  std::vector<ViewOfObject> which;
  for (std::size_t object = 0; object < dataset.size(); ++object) {
    for (std::size_t v = 0; v < views; ++v) which.emplace_back(object, v * k_views / views);
  }
  return which;
}

Evaluation evaluate(const std::filesystem::path& checkpoint, const Dataset& dataset, std::size_t views,
                    const std::function<void(std::size_t, std::size_t)>& progress) {
  if (views < 1 || views > k_views) {
    throw InvalidArgument("views (dpr learn)", std::to_string(views), "1 to " + std::to_string(k_views));
  }
  LoadedCheckpoint loaded = load_checkpoint(checkpoint, TrainingOptions{}.learning_rate);
  const std::vector<ViewOfObject> which = spread_views(dataset, views);
  const std::vector<double> found = reconstruction_iou(
      loaded.network, dataset, which, [&](std::size_t done) { progress(done, which.size()); });
  const Mesh sphere = start_mesh();
  const Checkpoint& trained = loaded.checkpoint;
  Evaluation result{trained.method, trained.seed, trained.steps.size(), 0, 0, {}};
  const auto classes = static_cast<double>(dataset.classes().size());
  for (std::size_t c = 0; c < dataset.classes().size(); ++c) {
    ClassIou row{dataset.classes()[c], 0, 0, 0};
    const std::size_t first = dataset.first_object(c), last = dataset.first_object(c + 1);
    for (std::size_t i = first * views; i < last * views; ++i) row.iou += found[i];
    for (std::size_t object = first; object < last; ++object)
      row.sphere += iou_with_object(sphere, dataset, object);
    row.images = (last - first) * views;
    row.iou /= static_cast<double>(row.images);
    row.sphere /= static_cast<double>(last - first);
    result.iou += row.iou / classes;
    result.sphere += row.sphere / classes;
    result.classes.push_back(row);
  }
  return result;
}

Image show(const Device& device, const std::filesystem::path& checkpoint, const Dataset& dataset,
           std::size_t number) {
  LoadedCheckpoint loaded = load_checkpoint(checkpoint, TrainingOptions{}.learning_rate);
  const EvaluationMode mode(loaded.network);
  Renderer renderer(device);
  std::vector<Image> rows;
  for (std::size_t c = 0; c < dataset.classes().size(); ++c) {
    const std::size_t first = dataset.first_object(c), count = dataset.first_object(c + 1) - first;
    if (number >= count) {
      throw InvalidArgument("object (dpr learn)", std::to_string(number), "below " + std::to_string(count));
    }
    const ViewOfObject which{first + number, (2 + 5 * c) % k_views};  // from another side in every row
    const at::Tensor images = load_images(dataset, {which});
    std::vector<Image> row{enlarged_input(to_image(dataset.image(which.first, which.second)))};
    const Mesh mesh = to_mesh(loaded.network->forward(images), 0);
    std::ranges::move(portraits(renderer, mesh, which.second), std::back_inserter(row));
    rows.push_back(hstack(row));
  }
  return vstack(rows, /*gap=*/0);
}

}  // namespace dpr::learn
