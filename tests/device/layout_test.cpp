// The structs that host and kernels share have one layout: a kernel writes every size and offset, and the
// host compares them with its own.
#include <doctest/doctest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "shared_types.h"
#include "support/probe.hpp"

namespace layout_test {

namespace {

namespace shared = dpr::shared;

/// A struct or a field: its OpenCL C expression, and the host's value.
struct Entry {
  std::string expression;
  std::size_t host;
};

/// OpenCL C has no offsetof: the address of a field of an object, less the object's.
std::string offset_expression(const std::string& type, const std::string& field) {
  return "offset_of(" + type + ", " + field + ")";
}

#define DPR_SIZE(type) \
  Entry { "(uint)sizeof(" #type ")", sizeof(shared::type) }
#define DPR_FIELD(type, field) \
  Entry { offset_expression(#type, #field), offsetof(shared::type, field) }

std::vector<Entry> entries() {
  return {DPR_SIZE(FrameParams),
          DPR_FIELD(FrameParams, views),
          DPR_FIELD(FrameParams, meshes),
          DPR_FIELD(FrameParams, vertices),
          DPR_FIELD(FrameParams, faces),
          DPR_FIELD(FrameParams, position_stride),
          DPR_FIELD(FrameParams, color_stride),
          DPR_FIELD(FrameParams, own_faces),
          DPR_FIELD(FrameParams, first_view),
          DPR_FIELD(FrameParams, width),
          DPR_FIELD(FrameParams, height),
          DPR_FIELD(FrameParams, tiles_x),
          DPR_FIELD(FrameParams, tiles_y),
          DPR_FIELD(FrameParams, pixel_size),
          DPR_FIELD(FrameParams, blur_distance),
          DPR_FIELD(FrameParams, euclidean),
          DPR_FIELD(FrameParams, perspective_correct),
          DPR_FIELD(FrameParams, sharp),
          DPR_FIELD(FrameParams, culled),
          DPR_FIELD(FrameParams, clips),
          DPR_FIELD(FrameParams, orthographic),
          DPR_FIELD(FrameParams, distorts),
          DPR_FIELD(FrameParams, normals),
          DPR_FIELD(FrameParams, color_faces),
          DPR_FIELD(FrameParams, normal_faces),
          DPR_FIELD(FrameParams, texcoord_faces),
          DPR_FIELD(FrameParams, opacity_faces),
          DPR_FIELD(FrameParams, texels),
          DPR_FIELD(FrameParams, levels),
          DPR_FIELD(FrameParams, has_base),
          DPR_FIELD(FrameParams, fragments),
          DPR_FIELD(FrameParams, grad_fragments),
          DPR_FIELD(FrameParams, pairs),
          DPR_FIELD(FrameParams, last_pair),
          DPR_FIELD(FrameParams, mesh_edges),
          DPR_FIELD(FrameParams, edges),
          DPR_FIELD(FrameParams, shading),
          DPR_FIELD(FrameParams, depth_reach),
          DPR_FIELD(FrameParams, first_sample),
          DPR_FIELD(FrameParams, absent_samples),
          DPR_FIELD(FrameParams, first_tile),
          DPR_FIELD(FrameParams, begin_tile),
          DPR_FIELD(FrameParams, last_tile),
          DPR_SIZE(MeshPlace),
          DPR_FIELD(MeshPlace, vertex_shift),
          DPR_FIELD(MeshPlace, normal_shift),
          DPR_FIELD(MeshPlace, is_instance),
          DPR_FIELD(MeshPlace, next),
          DPR_SIZE(ViewParams),
          DPR_FIELD(ViewParams, row),
          DPR_FIELD(ViewParams, projection),
          DPR_FIELD(ViewParams, eye),
          DPR_FIELD(ViewParams, znear),
          DPR_FIELD(ViewParams, zfar),
          DPR_FIELD(ViewParams, inverse_range),
          DPR_FIELD(ViewParams, distorts),
          DPR_FIELD(ViewParams, radial),
          DPR_FIELD(ViewParams, largest_radius2),
          DPR_FIELD(ViewParams, tangential),
          DPR_SIZE(Triangle),
          DPR_FIELD(Triangle, x0),
          DPR_FIELD(Triangle, y0),
          DPR_FIELD(Triangle, x1),
          DPR_FIELD(Triangle, y1),
          DPR_FIELD(Triangle, x2),
          DPR_FIELD(Triangle, y2),
          DPR_FIELD(Triangle, z0),
          DPR_FIELD(Triangle, z1),
          DPR_FIELD(Triangle, z2),
          DPR_FIELD(Triangle, orientation),
          DPR_FIELD(Triangle, first_sample),
          DPR_FIELD(Triangle, last_sample),
          DPR_SIZE(ClippedFace),
          DPR_FIELD(ClippedFace, corner),
          DPR_FIELD(ClippedFace, cut),
          DPR_FIELD(ClippedFace, orientation),
          DPR_FIELD(ClippedFace, corners),
          DPR_FIELD(ClippedFace, first),
          DPR_SIZE(LightingParams),
          DPR_FIELD(LightingParams, lights),
          DPR_FIELD(LightingParams, light),
          DPR_FIELD(LightingParams, stride),
          DPR_FIELD(LightingParams, shininess),
          DPR_SIZE(Environment),
          DPR_FIELD(Environment, ambient),
          DPR_FIELD(Environment, harmonics),
          DPR_SIZE(Light),
          DPR_FIELD(Light, position),
          DPR_FIELD(Light, diffuse),
          DPR_FIELD(Light, specular),
          DPR_FIELD(Light, axis),
          DPR_FIELD(Light, cos_outer),
          DPR_FIELD(Light, inverse_edge),
          DPR_SIZE(Texture),
          DPR_FIELD(Texture, first),
          DPR_FIELD(Texture, width),
          DPR_FIELD(Texture, height),
          DPR_FIELD(Texture, levels),
          DPR_FIELD(Texture, wrap),
          DPR_FIELD(Texture, filter),
          DPR_SIZE(Sampling),
          DPR_FIELD(Sampling, samples),
          DPR_FIELD(Sampling, draws),
          DPR_FIELD(Sampling, baseline),
          DPR_FIELD(Sampling, leave_out),
          DPR_FIELD(Sampling, seed_low),
          DPR_FIELD(Sampling, seed_high),
          DPR_SIZE(OpacityParams),
          DPR_FIELD(OpacityParams, least),
          DPR_FIELD(OpacityParams, largest),
          DPR_FIELD(OpacityParams, is_sampled),
          DPR_FIELD(OpacityParams, is_textured),
          DPR_SIZE(OccupancyParams),
          DPR_FIELD(OccupancyParams, sigma),
          DPR_FIELD(OccupancyParams, noise_width),
          DPR_FIELD(OccupancyParams, sampling),
          DPR_FIELD(OccupancyParams, width),
          DPR_FIELD(OccupancyParams, faces),
          DPR_FIELD(OccupancyParams, first_view),
          DPR_FIELD(OccupancyParams, fragments),
          DPR_FIELD(OccupancyParams, grad_fragments),
          DPR_SIZE(AggregateParams),
          DPR_FIELD(AggregateParams, background),
          DPR_FIELD(AggregateParams, sigma),
          DPR_FIELD(AggregateParams, gamma),
          DPR_FIELD(AggregateParams, alpha),
          DPR_FIELD(AggregateParams, background_depth),
          DPR_FIELD(AggregateParams, sampling),
          DPR_FIELD(AggregateParams, pixels_per_view),
          DPR_FIELD(AggregateParams, first_pixel),
          DPR_FIELD(AggregateParams, pixels),
          DPR_FIELD(AggregateParams, last_pixel),
          DPR_FIELD(AggregateParams, faces),
          DPR_FIELD(AggregateParams, first_view),
          DPR_FIELD(AggregateParams, fragments),
          DPR_FIELD(AggregateParams, grad_fragments),
          DPR_SIZE(Slot),
          DPR_FIELD(Slot, beta),
          DPR_FIELD(Slot, occupancy),
          DPR_FIELD(Slot, grad),
          DPR_FIELD(Slot, fragment),
          DPR_SIZE(MeshLossParams),
          DPR_FIELD(MeshLossParams, laplacian),
          DPR_FIELD(MeshLossParams, edge_length),
          DPR_FIELD(MeshLossParams, normal_consistency),
          DPR_FIELD(MeshLossParams, flatness),
          DPR_FIELD(MeshLossParams, edge_target),
          DPR_FIELD(MeshLossParams, first_vertex),
          DPR_FIELD(MeshLossParams, vertices),
          DPR_FIELD(MeshLossParams, hinges),
          DPR_SIZE(ViewTangent),
          DPR_FIELD(ViewTangent, rotation),
          DPR_FIELD(ViewTangent, translation),
          DPR_FIELD(ViewTangent, projection),
          DPR_FIELD(ViewTangent, lens),
          DPR_FIELD(ViewTangent, eye),
          DPR_SIZE(ModelTangent),
          DPR_FIELD(ModelTangent, rotation),
          DPR_FIELD(ModelTangent, translation),
          DPR_SIZE(FrameTangent),
          DPR_FIELD(FrameTangent, background),
          DPR_FIELD(FrameTangent, sigma),
          DPR_FIELD(FrameTangent, gamma),
          DPR_FIELD(FrameTangent, alpha),
          DPR_SIZE(TangentParams),
          DPR_FIELD(TangentParams, directions),
          DPR_FIELD(TangentParams, planes),
          DPR_FIELD(TangentParams, positions),
          DPR_FIELD(TangentParams, colors),
          DPR_FIELD(TangentParams, lit),
          DPR_FIELD(TangentParams, base_plane),
          DPR_SIZE(BlurPass),
          DPR_FIELD(BlurPass, lines),
          DPR_FIELD(BlurPass, width),
          DPR_FIELD(BlurPass, out_length),
          DPR_FIELD(BlurPass, in_length),
          DPR_FIELD(BlurPass, out_step),
          DPR_FIELD(BlurPass, in_step),
          DPR_FIELD(BlurPass, offset),
          DPR_FIELD(BlurPass, taps),
          DPR_FIELD(BlurPass, tile_rows),
          DPR_FIELD(BlurPass, views),
          DPR_FIELD(BlurPass, image_lines),
          DPR_FIELD(BlurPass, along_step),
          DPR_FIELD(BlurPass, along_first),
          DPR_FIELD(BlurPass, along_end),
          DPR_FIELD(BlurPass, across_step),
          DPR_FIELD(BlurPass, across_first),
          DPR_FIELD(BlurPass, across_end),
          DPR_FIELD(BlurPass, items),
          DPR_FIELD(BlurPass, first_row),
          DPR_FIELD(BlurPass, last_row),
          DPR_FIELD(BlurPass, in_shift),
          DPR_FIELD(BlurPass, out_shift),
          DPR_FIELD(BlurPass, has_sums),
          DPR_SIZE(ShiftParams),
          DPR_FIELD(ShiftParams, sampling),
          DPR_FIELD(ShiftParams, views),
          DPR_FIELD(ShiftParams, first_view),
          DPR_FIELD(ShiftParams, width),
          DPR_FIELD(ShiftParams, height),
          DPR_FIELD(ShiftParams, supersampling),
          DPR_FIELD(ShiftParams, margin),
          DPR_FIELD(ShiftParams, radius),
          DPR_FIELD(ShiftParams, unused),
          DPR_SIZE(OpenEdge),
          DPR_FIELD(OpenEdge, side),
          DPR_FIELD(OpenEdge, texture),
          DPR_FIELD(OpenEdge, material),
          DPR_FIELD(OpenEdge, is_periodic),
          DPR_FIELD(OpenEdge, places),
          DPR_SIZE(SecondCrossing),
          DPR_FIELD(SecondCrossing, step),
          DPR_FIELD(SecondCrossing, contour),
          DPR_FIELD(SecondCrossing, reference),
          DPR_FIELD(SecondCrossing, cut),
          DPR_FIELD(SecondCrossing, slope2)};
}

/// Offsets and sizes of every entry on the device.
std::vector<cl_uint> device_values(const std::vector<Entry>& all, const std::string& header) {
  std::string text =
      header +
      "#define offset_of(type, field) (uint)((size_t)&((type*)&storage)->field - (size_t)&storage)\n"
      "kernel void probe(global uint* restrict out) {\n  float4 storage[32];\n";
  for (std::size_t i = 0; i < all.size(); ++i) {
    text += "  out[" + std::to_string(i) + "] = " + all[i].expression + ";\n";
  }
  dpr::test::Probe probe({}, text + "}\n");
  dpr::Buffer<cl_uint> out;
  dpr::test::poison(out, all.size(), 0xdeadbeefU);
  probe(1, out);
  return out.download();
}

std::vector<std::string> differences(const std::string& header) {
  const std::vector<Entry> all = entries();
  const std::vector<cl_uint> values = device_values(all, header);
  std::vector<std::string> wrong;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (values[i] != all[i].host) wrong.push_back(all[i].expression + " is " + std::to_string(values[i]));
  }
  return wrong;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("shared structs have the same layout on the device") {
    CHECK(differences(dpr::test::header_text("shared_types.h")) == std::vector<std::string>{});
  }

  TEST_CASE("a field that only the device has is noticed") {
    std::string header = dpr::test::header_text("shared_types.h");
    const std::string field = "  uint lights, light;";
    const std::size_t at = header.find(field);
    REQUIRE(at != std::string::npos);
    header.insert(at, "  uint surplus;\n");
    const std::vector<std::string> wrong = differences(header);
    REQUIRE(wrong.size() == 5);
    CHECK(wrong[0] == "(uint)sizeof(LightingParams) is 20");
    CHECK(wrong[1] == "offset_of(LightingParams, lights) is 4");
    CHECK(wrong[2] == "offset_of(LightingParams, light) is 8");
    CHECK(wrong[3] == "offset_of(LightingParams, stride) is 12");
    CHECK(wrong[4] == "offset_of(LightingParams, shininess) is 16");
  }
}

}  // namespace layout_test
