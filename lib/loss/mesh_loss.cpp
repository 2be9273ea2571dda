// Regularisers of a mesh's shape on the device.
#include "dpr/mesh_loss.hpp"

#include <array>
#include <cmath>

#include "base/checks.hpp"
#include "loss/mesh_loss_impl.hpp"
#include "mesh/adjacency.hpp"
#include "renderer/frame.hpp"

namespace dpr {
namespace {

/// A mean's weight for a sum over `count`; a mean of nothing is 0.
float per_item(float weight, std::size_t count) {
  return count > 0 ? weight / static_cast<float>(count) : 0.0F;
}

}  // namespace

void check_mesh_loss(const MeshLossWeights& weights, const Mesh& mesh) {
  for (const float value : {weights.laplacian, weights.edge_length, weights.normal_consistency,
                            weights.flatness, weights.edge_target}) {
    if (value >= 0 && std::isfinite(value)) continue;
    throw InvalidArgument("weight (mesh loss)", checks::text(value), "a finite number, at least 0");
  }
  validate(mesh);
}

MeshLoss::Impl::Impl(const Device& device_, const MeshLossWeights& weights_, const Mesh& mesh)
    : device(device_), weights(weights_), launch(impl_of(device)), reduce(impl_of(device)) {
  const Adjacency adjacency = make_adjacency(mesh);
  const std::size_t vertices = mesh.positions.size(), hinge_count = adjacency.hinges.size();
  edges = adjacency.edges();
  params.laplacian = weights.laplacian;
  params.edge_length = per_item(weights.edge_length, edges);
  params.normal_consistency = per_item(weights.normal_consistency, hinge_count);
  params.flatness = per_item(weights.flatness, hinge_count);
  params.edge_target = weights.edge_target;
  params.vertices = static_cast<cl_uint>(vertices);
  params.hinges = static_cast<cl_uint>(hinge_count);

  std::vector<cl_uint4> corners;
  std::vector<cl_uint> starts(vertices + 1, 0), places(4 * hinge_count);
  for (const Hinge& h : adjacency.hinges) {
    corners.push_back({{h.across[0], h.across[1], h.edge[0], h.edge[1]}});
    for (const cl_uint vertex : corners.back().s) ++starts[vertex + 1];
  }
  for (std::size_t v = 0; v < vertices; ++v) starts[v + 1] += starts[v];
  std::vector<cl_uint> next(starts.begin(), starts.end() - 1);
  for (std::size_t place = 0; place < places.size(); ++place)
    places[next[corners[place / 4].s[place % 4]]++] = static_cast<cl_uint>(place);

  Device::Impl& d = impl_of(device);
  ring_starts.upload(d, adjacency.ring_starts);
  ring.resize(d, 1);  // soup may have no edge; a kernel's argument must be some buffer
  ring.upload(d, adjacency.ring);
  hinges.resize(d, 1);
  hinge_places.resize(d, 1);
  hinges.upload(d, corners);
  hinge_starts.upload(d, starts);
  hinge_places.upload(d, places);
  all_vertices.upload(d, std::array<cl_uint, 2>{0, params.vertices});
  all_hinges.upload(d, std::array<cl_uint, 2>{0, params.hinges});
  laplacians.resize(d, vertices);
  vertex_channels.resize(d, DPR_MESH_LOSS_CHANNELS * vertices);
  partial.resize(d, 4 * std::max<std::size_t>(hinge_count, 1));
  hinge_channels.resize(d, DPR_MESH_LOSS_CHANNELS * std::max<std::size_t>(hinge_count, 1));
}

double MeshLoss::Impl::evaluate(const Buffer<cl_float4>& at, std::size_t first_vertex) {
  params.first_vertex = static_cast<cl_uint>(first_vertex);
  launch(params.vertices, kernel::mesh_loss_vertices{.p = params,
                                                     .ring_starts = ring_starts,
                                                     .ring = ring,
                                                     .positions = at,
                                                     .laplacians = laplacians,
                                                     .channels = vertex_channels});
  launch(params.hinges,
         kernel::mesh_loss_hinges{
             .p = params, .hinges = hinges, .positions = at, .channels = hinge_channels, .partial = partial});
  const std::size_t hinge_sums = params.hinges > 0 ? DPR_MESH_LOSS_CHANNELS : 0;
  const auto sums =
      reduce.read({{params.vertices, DPR_MESH_LOSS_CHANNELS, 1, 1, all_vertices, vertex_channels},
                   {params.hinges, hinge_sums, 1, 1, all_hinges, hinge_channels}});
  const auto mean = [](double sum, std::size_t count) {
    return count > 0 ? sum / static_cast<double>(count) : 0.0;
  };
  terms = {sums[0][0], mean(sums[0][1], edges), 0, 0};
  if (hinge_sums > 0) {
    terms.normal_consistency = mean(sums[1][0], params.hinges);
    terms.flatness = mean(sums[1][1], params.hinges);
  }
  return weights.laplacian * terms.laplacian + weights.edge_length * terms.edge_length +
         weights.normal_consistency * terms.normal_consistency + weights.flatness * terms.flatness;
}

void MeshLoss::Impl::add_gradient(const Buffer<cl_float4>& at, Buffer<cl_float4>& grad) {
  launch(params.vertices, kernel::mesh_loss_gather{.p = params,
                                                   .ring_starts = ring_starts,
                                                   .ring = ring,
                                                   .positions = at,
                                                   .laplacians = laplacians,
                                                   .hinge_starts = hinge_starts,
                                                   .hinge_places = hinge_places,
                                                   .partial = partial,
                                                   .grad = grad});
}

MeshLoss::MeshLoss(const Device& device, const MeshLossWeights& weights, const Mesh& mesh) {
  check_mesh_loss(weights, mesh);
  impl_ = std::make_unique<Impl>(device, weights, mesh);
}

MeshLoss::~MeshLoss() = default;
MeshLoss::MeshLoss(MeshLoss&&) noexcept = default;
MeshLoss& MeshLoss::operator=(MeshLoss&&) noexcept = default;

double MeshLoss::evaluate(const Renderer& renderer, std::size_t mesh) {
  Impl& m = *impl_;
  require_same_device(m.device, renderer.device(), "MeshLoss::evaluate");
  const Frame frame = last_frame(renderer, "MeshLoss::evaluate");
  if (frame.has_own_shapes) {
    throw InvalidArgument("mesh (mesh loss)", "a shape of its own for every view", "one for all views");
  }
  if (mesh >= frame.meshes.size()) {
    throw InvalidArgument("mesh (mesh loss)", std::to_string(mesh),
                          "below " + std::to_string(frame.meshes.size()));
  }
  const MeshRange& range = frame.meshes[mesh];
  if (range.vertices != m.params.vertices) {
    throw InvalidArgument("vertices (mesh loss)", std::to_string(range.vertices) + " in the scene",
                          std::to_string(m.params.vertices));
  }
  m.frame_number = 0;  // until everything of this one is there
  const double loss = m.evaluate(frame.positions, range.first_position);
  m.frame_number = frame.number;
  return loss;
}

const MeshLossTerms& MeshLoss::terms() const { return impl_->terms; }

}  // namespace dpr
