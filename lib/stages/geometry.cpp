#include "stages/geometry.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include "mesh/face_texture.hpp"
#include "mesh/opacity.hpp"

namespace dpr {
namespace {

/// Cuts runs of corners if some are longer than one work-item is to add.
void add_parts(Device::Impl& device, std::span<const cl_uint> starts, Incidence& incidence) {
  const auto is_long = [](cl_uint first, cl_uint last) { return last - first > DPR_RUN_CHUNK; };
  if (std::ranges::adjacent_find(starts, is_long) == starts.end()) return;
  std::vector<cl_uint> part_starts{0}, parts{0};
  for (std::size_t target = 0; target + 1 < starts.size(); ++target) {
    for (cl_uint first = starts[target]; first < starts[target + 1];) {
      first = std::min(first + DPR_RUN_CHUNK, starts[target + 1]);
      part_starts.push_back(first);
    }
    parts.push_back(to_uint(part_starts.size() - 1));
  }
  incidence.part_count = part_starts.size() - 1;
  incidence.part_starts.upload(device, part_starts);
  incidence.parts.upload(device, parts);
}

/// Of targets that are numbered by view: of `views` views that each have as many of the faces, [view][target].
Incidence make_incidence(Device::Impl& device, std::span<const cl_uint4> faces, std::size_t targets,
                         std::size_t views = 1) {
  const std::size_t of_view = faces.size() / views;
  std::vector<cl_uint> starts(views * targets + 1, 0), corners(faces.size() * 3);
  const auto target_of = [&](std::size_t face, std::size_t corner) {
    return (views == 1 ? 0 : face / of_view * targets) + faces[face].s[corner];
  };
  for (std::size_t face = 0; face < faces.size(); ++face) {
    for (std::size_t corner = 0; corner < 3; ++corner) ++starts[target_of(face, corner) + 1];
  }
  for (std::size_t target = 0; target < views * targets; ++target) starts[target + 1] += starts[target];
  std::vector<cl_uint> next(starts.begin(), starts.end() - 1);
  for (std::size_t face = 0; face < faces.size(); ++face) {
    for (std::size_t corner = 0; corner < 3; ++corner)
      corners[next[target_of(face, corner)]++] = to_uint(face * 3 + corner);
  }
  Incidence incidence;
  incidence.starts.upload(device, starts);
  incidence.corners.upload(device, corners);
  add_parts(device, starts, incidence);
  return incidence;
}

/// The colours of a mesh: per vertex, per face, or one white.
std::vector<glm::vec3> mesh_colors(const Mesh& mesh) {
  if (!mesh.vertex_colors.empty()) return mesh.vertex_colors;
  if (!mesh.face_colors.empty()) return mesh.face_colors;
  return {glm::vec3(1.0F)};
}

std::size_t material_count(const Mesh& mesh) { return std::max<std::size_t>(mesh.materials.size(), 1); }

/// The opacities of a mesh: per vertex, per face, or one.
std::vector<float> mesh_opacities(const Mesh& mesh) {
  if (!mesh.vertex_opacities.empty()) return mesh.vertex_opacities;
  if (!mesh.face_opacities.empty()) return mesh.face_opacities;
  return {1.0F};
}

/// Where a face's corners look in a list that is one of the vertices, of the faces, or has one element.
cl_uint4 corner_elements(const Mesh& mesh, std::size_t face, std::size_t first, bool of_vertices,
                         bool of_faces, cl_uint w) {
  const cl_uint base = to_uint(first);
  if (of_vertices) {
    const glm::uvec3& f = mesh.faces[face];
    return {{base + f.x, base + f.y, base + f.z, w}};
  }
  const cl_uint element = of_faces ? to_uint(first + face) : base;
  return {{element, element, element, w}};
}

cl_uint4 corner_texcoords(const Mesh& mesh, std::size_t face, cl_uint first_texcoord, cl_uint first_texture) {
  if (mesh.textures.empty()) return {{0, 0, 0, DPR_NO_TEXTURE}};
  const std::uint32_t texture = texture_of(mesh, face);
  const glm::uvec3& f = mesh.face_texcoords[face];
  return {{first_texcoord + f.x, first_texcoord + f.y, first_texcoord + f.z,
           texture == k_no_texture ? DPR_NO_TEXTURE : first_texture + texture}};
}

shared::Texture device_texture(const Texture& texture, std::size_t first_texel) {
  shared::Texture t{};
  t.first = to_uint(first_texel);
  t.width = to_uint(static_cast<std::size_t>(texture.width));
  t.height = to_uint(static_cast<std::size_t>(texture.height));
  if (texture.filter == Filter::trilinear) {
    t.levels = to_uint(static_cast<std::size_t>(std::bit_width(std::max(t.width, t.height))));
  } else {
    t.levels = 1;
  }
  t.wrap = static_cast<cl_uint>(texture.wrap);
  t.filter = static_cast<cl_uint>(texture.filter);
  return t;
}

std::size_t texels_of_smaller_levels(const shared::Texture& t) {
  std::size_t count = 0;
  for (cl_uint level = 1; level < t.levels; ++level)
    count += std::size_t{std::max(t.width >> level, 1U)} * std::max(t.height >> level, 1U);
  return count;
}

}  // namespace

bool is_textured(const Scene& scene) {
  return std::ranges::any_of(scene.meshes, [](const Instance& i) { return !i.mesh.textures.empty(); });
}

std::size_t material_of(const Mesh& mesh, std::size_t face) {
  return mesh.face_materials.empty() ? 0 : mesh.face_materials[face];
}

bool gives_normals(const Scene& scene) {
  return std::ranges::any_of(scene.meshes, [](const Instance& i) { return !i.mesh.face_normals.empty(); });
}

bool has_materials(const Scene& scene) {
  return std::ranges::any_of(scene.meshes, [](const Instance& i) { return !i.mesh.materials.empty(); });
}

cl_float4 to_cl(const glm::vec3& v) { return {{v.x, v.y, v.z, 0.0F}}; }

std::vector<cl_float4> to_cl(std::span<const glm::vec3> vectors) {
  std::vector<cl_float4> rows;
  rows.reserve(vectors.size());
  for (const glm::vec3& v : vectors) rows.push_back(to_cl(v));
  return rows;
}

cl_float4 to_cl(const Material& material) {
  cl_float4 row = to_cl(material.specular);
  row.s[3] = material.shininess.value_or(0.0F);
  return row;
}

void write_range(Device::Impl& device, const Buffer<cl_float4>& buffer, std::size_t first,
                 std::span<const cl_float4> values) {
  if (values.empty()) return;
  device.write(buffer.cl_buffer(), first * sizeof(cl_float4), std::as_bytes(values));
}

Geometry::Geometry(Device::Impl& device, const Scene& scene, std::size_t views) : views_of_faces(views) {
  std::vector<cl_float4> all_positions;
  std::vector<cl_uint> all_mesh;
  std::vector<cl_uint4> all_faces;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    const cl_uint base = to_uint(vertices);
    if (const auto source = scene.meshes[m].instance_of) {
      meshes.push_back(meshes[*source]);
    } else {
      meshes.push_back({.vertices = mesh.positions.size(),
                        .first_position = all_positions.size(),
                        .first_material = materials.count,
                        .materials = material_count(mesh)});
      materials.count += meshes[m].materials;
      for (const glm::vec3& position : mesh.positions) all_positions.push_back(to_cl(position));
    }
    meshes[m].first_vertex = vertices;
    vertices += meshes[m].vertices;
    for (const glm::uvec3& f : mesh.faces)
      all_faces.push_back({{base + f.x, base + f.y, base + f.z, to_uint(m)}});
    all_mesh.resize(vertices, to_uint(m));
  }
  position_count = all_positions.size();
  if (all_faces.size() > std::numeric_limits<cl_uint>::max() / 3) {
    throw InvalidArgument("faces (scene)", std::to_string(all_faces.size()), "at most 2^32 / 3");
  }
  faces = all_faces.size() / views_of_faces;
  positions.upload(device, all_positions);
  vertex_mesh.upload(device, all_mesh);
  vertex_corners = make_incidence(device, all_faces, vertices, views_of_faces);
  add_colors(device, scene, all_faces);
  if (is_textured(scene)) add_textures(device, scene, all_faces);
  if (gives_normals(scene)) add_normals(device, scene, all_faces);
  if (std::ranges::any_of(scene.meshes, has_opacities, &Instance::mesh) || textures.has_opacities())
    add_opacities(device, scene, all_faces);
  face_vertices.upload(device, all_faces);
  add_materials(device, scene);
  add_places(device, scene);
}

/// Once everything that meshes have is there.
void Geometry::add_places(Device::Impl& device, const Scene& scene) {
  std::vector<shared::MeshPlace> all(meshes.size());
  std::size_t first_given = 0;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    if (const auto source = scene.meshes[m].instance_of) {
      const std::size_t first_vertex = meshes[m].first_vertex;
      meshes[m] = meshes[*source];  // colours, textures and all
      meshes[m].first_vertex = first_vertex;
    }
    all[m].vertex_shift = to_uint(meshes[m].first_vertex - meshes[m].first_position);
    all[m].normal_shift = to_uint(first_given - meshes[m].first_normal);
    all[m].is_instance = scene.meshes[m].instance_of ? 1 : 0;
    first_given += meshes[m].normals;
  }
  std::vector<cl_uint> next(meshes.size(), to_uint(meshes.size()));  // [mesh] the first of those seen so far
  for (std::size_t m = meshes.size(); m-- > 0;)
    all[m].next = std::exchange(next[scene.meshes[m].instance_of.value_or(m)], to_uint(m));
  places.upload(device, all);
}

void Geometry::add_colors(Device::Impl& device, const Scene& scene, std::vector<cl_uint4>& all_faces) {
  std::vector<cl_float4> all_colors;
  // With a material a mesh, the number of the mesh is that of its material. Instances have no colours.
  const bool by_vertex = std::ranges::all_of(scene.meshes, [](const Instance& i) {
    return !i.mesh.vertex_colors.empty() && material_count(i.mesh) == 1;
  });
  const bool numbers_by_view = has_own_faces() && scene.meshes[0].mesh.vertex_colors.empty();
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    const MeshRange& source = meshes[scene.meshes[m].instance_of.value_or(m)];
    if (!scene.meshes[m].instance_of) {
      meshes[m].first_color = all_colors.size();
      for (const glm::vec3& color : mesh_colors(mesh)) all_colors.push_back(to_cl(color));
      if (numbers_by_view) all_colors.resize(faces);
      meshes[m].colors = all_colors.size() - meshes[m].first_color;
    }
    for (std::size_t face = 0; face < mesh.faces.size() && !by_vertex; ++face)
      all_faces.push_back(corner_elements(mesh, numbers_by_view ? face % faces : face, source.first_color,
                                          !mesh.vertex_colors.empty(), !mesh.face_colors.empty(),
                                          to_uint(source.first_material + material_of(mesh, face))));
  }
  colors = all_colors.size();
  color_values.upload(device, all_colors);
  if (by_vertex) return;
  color_faces = all_faces.size() - rows();
  color_corners_ = make_incidence(device, std::span(all_faces).subspan(color_faces), colors, views_of_faces);
}

/// Faces without a texture refer to the first coordinate, which adds nothing to its gradient.
void Geometry::add_textures(Device::Impl& device, const Scene& scene, std::vector<cl_uint4>& all_faces) {
  std::vector<cl_float4> all_texcoords, all_texels, all_opacities;
  const bool has_opacities = std::ranges::any_of(scene.meshes, has_texel_opacities, &Instance::mesh);
  texcoord_faces = all_faces.size();
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    const bool adds = !mesh.textures.empty() && !scene.meshes[m].instance_of;
    const MeshRange& source = meshes[scene.meshes[m].instance_of.value_or(m)];
    if (adds) {
      meshes[m].first_texture = textures.list.size();
      meshes[m].first_texcoord = all_texcoords.size();
      meshes[m].texcoords = mesh.texcoords.size();
    }
    for (std::size_t face = 0; face < mesh.faces.size(); ++face)
      all_faces.push_back(
          corner_texcoords(mesh, face, to_uint(source.first_texcoord), to_uint(source.first_texture)));
    if (!adds) continue;
    for (const glm::vec2& uv : mesh.texcoords) all_texcoords.push_back(to_cl(glm::vec3(uv, 0)));
    for (const Texture& texture : mesh.textures) {
      textures.list.push_back(device_texture(texture, all_texels.size()));
      for (const glm::vec3& texel : texture.texels) all_texels.push_back(to_cl(texel));
      all_texels.resize(all_texels.size() + texels_of_smaller_levels(textures.list.back()));
      if (!has_opacities) continue;
      for (const float opacity : texture.opacities) all_opacities.push_back(to_cl(glm::vec3(opacity, 0, 0)));
      all_opacities.resize(all_texels.size(), to_cl(glm::vec3(1, 0, 0)));
    }
  }
  constexpr std::size_t k_most = 1U << 30U;  // of which four sums each can be counted
  if (all_texels.size() >= k_most) {
    throw InvalidArgument("texels (scene)", std::to_string(all_texels.size()), "fewer than 2^30");
  }
  textures.texcoords = all_texcoords.size();
  textures.texels = all_texels.size();
  textures.texcoord_values.upload(device, all_texcoords);
  textures.textures.upload(device, textures.list);
  textures.texel_values.upload(device, all_texels);
  textures.opacities.upload(device, all_opacities);
  textures.texcoord_corners =
      make_incidence(device, std::span(all_faces).subspan(texcoord_faces), textures.texcoords);
}

/// Vertices of meshes that give normals have some of their own all the same, which no corner looks at.
void Geometry::add_normals(Device::Impl& device, const Scene& scene, std::vector<cl_uint4>& all_faces) {
  std::vector<cl_float4> all_normals;
  std::vector<cl_uint> all_mesh;
  normal_faces = all_faces.size();
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    const bool gives = !mesh.face_normals.empty();
    const cl_uint base = to_uint(gives ? vertices + all_mesh.size() : meshes[m].first_vertex);
    for (const glm::uvec3& f : gives ? mesh.face_normals : mesh.faces)
      all_faces.push_back({{base + f.x, base + f.y, base + f.z, 0}});
    if (!gives) continue;
    meshes[m].first_normal = all_normals.size();
    meshes[m].normals = mesh.normals.size();
    for (const glm::vec3& normal : scene.meshes[m].mesh.normals) all_normals.push_back(to_cl(normal));
    all_mesh.resize(all_mesh.size() + mesh.normals.size(), to_uint(m));
  }
  given_normals.count = all_mesh.size();
  given_normals.values.upload(device, all_normals);
  given_normals.mesh.upload(device, all_mesh);
  given_normals.corners = make_incidence(device, std::span(all_faces).subspan(normal_faces), normals());
}

void Geometry::add_opacities(Device::Impl& device, const Scene& scene, std::vector<cl_uint4>& all_faces) {
  std::vector<cl_float4> values;
  opacity_faces = all_faces.size();
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    if (!scene.meshes[m].instance_of) {
      meshes[m].first_opacity = values.size();
      for (const float opacity : mesh_opacities(mesh)) values.push_back(to_cl(glm::vec3(opacity, 0, 0)));
    }
    const std::size_t first = meshes[scene.meshes[m].instance_of.value_or(m)].first_opacity;
    const std::size_t of_view = has_own_faces() && !mesh.vertex_opacities.empty() ? vertices : 0;
    for (std::size_t face = 0; face < mesh.faces.size(); ++face)
      all_faces.push_back(corner_elements(mesh, face, first + face / faces * of_view,
                                          !mesh.vertex_opacities.empty(), !mesh.face_opacities.empty(), 0));
  }
  opacities.values.upload(device, values);
  opacities.corners = make_incidence(device, std::span(all_faces).subspan(opacity_faces), values.size());
}

void Geometry::add_materials(Device::Impl& device, const Scene& scene) {
  std::vector<cl_float4> values;
  for (const Instance& instance : scene.meshes) {
    for (const Material& material : instance.mesh.materials) values.push_back(to_cl(material));
    if (instance.mesh.materials.empty() && !instance.instance_of) values.push_back(to_cl(glm::vec3(1)));
  }
  materials.values.upload(device, values);
  if (!has_materials(scene)) return;
  std::vector<std::vector<cl_uint>> by_material(materials.count);
  for (std::size_t m = 0, face = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    for (std::size_t i = 0; i < mesh.faces.size(); ++i)
      by_material[meshes[m].first_material + material_of(mesh, i)].push_back(to_uint(face++));
  }
  std::vector<cl_uint> ordered, starts{0};
  for (const std::vector<cl_uint>& of_one : by_material) {
    ordered.insert(ordered.end(), of_one.begin(), of_one.end());
    starts.push_back(to_uint(ordered.size()));
  }
  materials.faces.upload(device, ordered);
  materials.starts.upload(device, starts);
}

std::size_t GivenNormals::bytes() const {
  return values.capacity_bytes() + mesh.capacity_bytes() + corners.bytes();
}

std::size_t SurfaceMaterials::bytes() const {
  return values.capacity_bytes() + faces.capacity_bytes() + starts.capacity_bytes();
}

std::size_t Opacities::bytes() const { return values.capacity_bytes() + corners.bytes(); }

std::size_t Textures::bytes() const {
  return texcoord_values.capacity_bytes() + textures.capacity_bytes() + texel_values.capacity_bytes() +
         opacities.capacity_bytes() + texcoord_corners.bytes();
}

std::size_t Geometry::bytes() const {
  return positions.capacity_bytes() + places.capacity_bytes() + vertex_mesh.capacity_bytes() +
         face_vertices.capacity_bytes() + color_values.capacity_bytes() + view_positions.capacity_bytes() +
         view_colors.capacity_bytes() + textures.bytes() + given_normals.bytes() + materials.bytes() +
         opacities.bytes() + vertex_corners.bytes() + color_corners_.bytes();
}

}  // namespace dpr
