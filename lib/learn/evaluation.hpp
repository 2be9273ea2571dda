// Between the data set, the network and meshes; how good a reconstruction is.
#pragma once

#include <torch/torch.h>

#include <functional>
#include <utility>
#include <vector>

#include "learn/dataset.hpp"
#include "learn/network.hpp"

namespace dpr::learn {

/// An object and one of its views.
using ViewOfObject = std::pair<std::size_t, std::size_t>;

/// [image, 4, 64, 64] in [0, 1].
at::Tensor load_images(const Dataset& dataset, const std::vector<ViewOfObject>& which);

/// A mesh of a reconstructed batch, with vertex colours.
Mesh to_mesh(const Reconstruction& batch, std::int64_t index);

/// IoU of the reconstruction of every listed image with its object's voxels. The network is put into
/// evaluation mode and back. `progress` is told how many are done.
std::vector<double> reconstruction_iou(Network& network, const Dataset& dataset,
                                       const std::vector<ViewOfObject>& which,
                                       const std::function<void(std::size_t)>& progress);

/// `views` views, evenly spread, of every object.
std::vector<ViewOfObject> spread_views(const Dataset& dataset, std::size_t views);

}  // namespace dpr::learn
