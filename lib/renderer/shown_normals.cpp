#include "renderer/shown_normals.hpp"

#include <utility>
#include <vector>

#include "renderer/renderer_impl.hpp"

namespace dpr {

ShownNormals::ShownNormals(Device::Impl& device, const Scene& scene) : antialias(device) {
  std::vector<cl_uint4> of_corners;
  std::vector<cl_float4> all{cl_float4{}};  // of meshes without
  std::vector<std::size_t> first(scene.meshes.size());
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const std::optional<std::size_t> instance_of = scene.meshes[m].instance_of;
    const Mesh& mesh = mesh_of(scene, m);
    first[m] = instance_of ? first[*instance_of] : all.size();
    if (!instance_of)
      for (const glm::vec3& normal : mesh.normals) all.push_back(to_cl(normal));
    for (const glm::uvec3& f : mesh.face_normals) {
      const glm::uvec3 rows = f + to_uint(first[m]);
      of_corners.push_back({{rows.x, rows.y, rows.z, 0}});
    }
    if (mesh.face_normals.empty()) of_corners.resize(of_corners.size() + mesh.faces.size());
  }
  faces.upload(device, of_corners);
  values.upload(device, all);
}

std::size_t ShownNormals::bytes() const {
  return faces.capacity_bytes() + values.capacity_bytes() + raster.capacity_bytes() + tangents.bytes() +
         antialias.bytes() + kept.bytes() + smoothed.capacity_bytes();
}

namespace {

/// The frame as crossings are found for the normals.
shared::FrameParams about_normals(shared::FrameParams p) {
  p.shading = DPR_NORMALS;
  return p;
}

ContourInputs with_frame(const ContourInputs& in, const shared::FrameParams& p) {
  return {p,         in.views,   in.geometry,     in.edges,  in.transform,
          in.facing, in.clipped, in.normal_faces, in.normals};
}

}  // namespace

/// Of the fragments that are there, in place of whose colours it leaves normals.
void Renderer::Impl::shade_normals() {
  shade.forward(shade_inputs(), shown_normals->at_corners());
  std::swap(aggregate.image, shown_normals->raster);
  aggregate.forward(aggregate_inputs(), glm::vec3(0));
  std::swap(aggregate.image, shown_normals->raster);
}

/// From the samples of the normals to their image.
void Renderer::Impl::blend_normals() {
  const shared::FrameParams p = about_normals(frame);
  ShownNormals& n = *shown_normals;
  n.antialias.cross(with_frame(contour_inputs(), p), pixel_noise->contour, pixel_noise->antialias);
  n.antialias.forward(p, pixel_noise->contour, n.raster, n.kept);
  pixel_noise->blur_forward(image_size(), n.raster, n.smoothed, false);
}

void Renderer::Impl::blend_normal_tangents(Buffer<cl_float4>& pixels) {
  const shared::FrameParams p = about_normals(frame);
  ShownNormals& n = *shown_normals;
  pixel_noise->tangent(with_frame(contour_inputs(), p), {n.antialias, n.kept, false}, image_size(), tangents,
                       n.tangents.rasters, pixels, aggregate.scratch(frame));
}

/// The tangents of the normals' samples along a group's directions, to images from the direction `first` on. Leaves
/// colours as they were.
void Renderer::Impl::move_normals(std::size_t first) {
  ImageTangents& moved = shown_normals->tangents;
  shade.forward(shade_inputs(), shown_normals->at_corners());
  shade.tangent(shade_inputs(), shown_normals->at_corners(), tangents);
  aggregate.tangent(aggregate_inputs(), glm::vec3(0), tangents, first,
                    pixel_noise ? moved.rasters : moved.images);
  shade.forward(shade_inputs());
}

}  // namespace dpr
