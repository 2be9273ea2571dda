#include "stages/setup.hpp"

#include <array>

namespace dpr {

void Setup::forward(const shared::FrameParams& p, const DeviceViews& views, const Geometry& geometry,
                    const Buffer<cl_float4>& ndc, const Buffer<float>& hidden, Buffer<cl_uint>& counts) {
  const std::size_t count = std::size_t{p.views} * p.faces;
  facing.resize(device_, count);
  kept.resize(device_, count);
  counts.resize(device_, count + 1);
  triangles.resize(device_, count);
  const std::size_t faces_of_item = device_.info.lanes == 1 ? 1 : DPR_FACE_GROUP;
  launch_((count + faces_of_item - 1) / faces_of_item, kernel::setup_forward{.p = p,
                                                                             .views = views.cameras,
                                                                             .faces = geometry.face_vertices,
                                                                             .ndc = ndc,
                                                                             .hidden = hidden,
                                                                             .facing = facing,
                                                                             .kept = kept,
                                                                             .counts = counts,
                                                                             .triangles = triangles});
}

void Setup::measure(const Geometry& geometry, const Scene& scene, std::size_t mesh) {
  if (!has_volumes_) {
    std::vector<cl_uint> sources;
    for (std::size_t m = 0; m < scene.meshes.size(); ++m)
      sources.push_back(to_uint(scene.meshes[m].instance_of.value_or(m)));
    sources_.upload(device_, sources);
    volumes_.upload(device_, std::vector<float>(2 * scene.meshes.size(), 1.0F));
    has_volumes_ = true;
  }
  std::size_t first = 0;
  for (std::size_t m = 0; m < mesh; ++m) first += mesh_of(scene, m).faces.size();
  const std::size_t faces = scene.meshes[mesh].mesh.faces.size();
  const std::size_t runs = (faces + DPR_VOLUME_FACES - 1) / DPR_VOLUME_FACES;
  const MeshRange& range = geometry.meshes[mesh];
  const cl_uint4 place{{to_uint(first), to_uint(faces), to_uint(range.first_vertex - range.first_position),
                        to_uint(range.first_position)}};
  runs_.resize(device_, 2 * runs);
  launch_(runs, kernel::setup_volumes{.first = place,
                                      .runs = to_uint(runs),
                                      .faces = geometry.face_vertices,
                                      .positions = geometry.positions,
                                      .volumes = runs_});
  run_starts_.upload(device_, std::array<cl_uint, 2>{0, to_uint(runs)});
  reduce_.add({runs, 2, 1, 1, run_starts_, runs_}, volumes_, 2 * mesh);
}

const Buffer<float>& Setup::hide(const shared::FrameParams& p, const Buffer<float>& hidden) {
  hidden_.resize(device_, hidden.size());
  launch_(hidden.size(),
          kernel::setup_hidden{
              .p = p, .sources = sources_, .volumes = volumes_, .assumed = hidden, .hidden = hidden_});
  return hidden_;
}

}  // namespace dpr
