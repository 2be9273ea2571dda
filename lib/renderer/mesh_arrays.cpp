#include "renderer/mesh_arrays.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <type_traits>

#include "base/checks.hpp"
#include "mesh/bounding_box.hpp"
#include "renderer/on_device.hpp"
#include "scene/see_through.hpp"

namespace dpr {
namespace {

using Impl = Renderer::Impl;
using Request = GradientRequest;
using Params = shared::FrameParams;

template <auto list>
HostArray host_array(Mesh& mesh, std::size_t) {
  return &(mesh.*list);
}

template <std::size_t MeshRange::*first>
std::size_t first_of(const Geometry& geometry, const ArrayRef& at) {
  return geometry.meshes[at.mesh].*first;
}

std::size_t first_texel(const Geometry& geometry, const ArrayRef& at) {
  return geometry.textures.list[geometry.meshes[at.mesh].first_texture + at.texture].first;
}

HostArray host_colors(Mesh& mesh, std::size_t) {
  return mesh.vertex_colors.empty() ? &mesh.face_colors : &mesh.vertex_colors;
}

HostArray host_opacities(Mesh& mesh, std::size_t) {
  return mesh.vertex_opacities.empty() ? &mesh.face_opacities : &mesh.vertex_opacities;
}

/// Those that the device alone knows may be any.
void find_see_through(Impl& m, std::size_t, bool on_host) {
  m.has_device_opacities = m.has_device_opacities || !on_host;
  m.is_see_through = m.has_device_opacities || is_see_through(m.scene);
}

bool has_colors(const Mesh& mesh) { return !mesh.vertex_colors.empty() || !mesh.face_colors.empty(); }
bool has_textures(const Mesh& mesh) { return !mesh.textures.empty(); }

void move_positions(Impl& m, std::size_t mesh, bool on_host) {
  if (!on_host) return m.forget_positions(mesh);
  m.clip_planes.move(mesh);
  m.has_moved = true;
  if (m.pixel_noise && m.pixel_noise->edges) m.pixel_noise->back_faces.move(mesh);
}

/// Edges know the seams and the jumps of normals that the host knows.
void forget_edges(Impl& m, std::size_t, bool on_host) {
  if (on_host && m.pixel_noise) m.pixel_noise->edges.reset();
}

/// The joined buffers of all meshes' arrays.
struct DeviceArray {
  static Buffer<cl_float4>& positions(Geometry& g) { return g.positions; }
  static Buffer<cl_float4>& colors(Geometry& g) { return g.color_values; }
  static Buffer<cl_float4>& texels(Geometry& g) { return g.textures.texel_values; }
  static Buffer<cl_float4>& texcoords(Geometry& g) { return g.textures.texcoord_values; }
  static Buffer<cl_float4>& normals(Geometry& g) { return g.given_normals.values; }
  static Buffer<cl_float4>& materials(Geometry& g) { return g.materials.values; }
  static Buffer<cl_float4>& opacities(Geometry& g) { return g.opacities.values; }
  static Buffer<cl_float4>& texel_opacities(Geometry& g) { return g.textures.opacities; }
};

/// The gradients of them that a backward pass leaves.
struct Gradients {
  static const Buffer<cl_float4>& positions(const Impl& m) { return m.transform.grad_positions; }
  static const Buffer<cl_float4>& colors(const Impl& m) { return m.grad_colors; }
  static const Buffer<cl_float4>& texels(const Impl& m) { return m.texels->grad; }
  static const Buffer<cl_float4>& texcoords(const Impl& m) { return m.grad_texcoords; }
  static const Buffer<cl_float4>& normals(const Impl& m) { return m.shade.grad_given_normals; }
  static const Buffer<cl_float4>& materials(const Impl& m) { return m.grad_materials; }
  static const Buffer<cl_float4>& opacities(const Impl& m) { return m.grad_opacities; }
  static const Buffer<cl_float4>& texel_opacities(const Impl& m) { return m.texel_opacities->grad; }
};

HostArray host_texels(Mesh& mesh, std::size_t texture) { return &mesh.textures[texture].texels; }
HostArray host_texel_opacities(Mesh& mesh, std::size_t texture) { return &mesh.textures[texture].opacities; }
bool has_normals(const Mesh& mesh) { return !mesh.face_normals.empty(); }
bool has_materials(const Mesh& mesh) { return !mesh.materials.empty(); }
void forget_levels(Impl& m, std::size_t, bool) { m.geometry->textures.has_levels = false; }
void forget_levels_of_opacities(Impl& m, std::size_t mesh, bool on_host) {
  forget_levels(m, mesh, on_host);
  find_see_through(m, mesh, on_host);
}

constexpr MeshArray k_positions{.name = "positions",
                                .components = 3,
                                .wanted = &Request::positions,
                                .host = host_array<&Mesh::positions>,
                                .device = DeviceArray::positions,
                                .first = first_of<&MeshRange::first_position>,
                                .gradient = Gradients::positions,
                                .stride = &Params::position_stride,
                                .changed = move_positions};
constexpr MeshArray k_colors{.name = "colors",
                             .components = 3,
                             .wanted = &Request::colors,
                             .host = host_colors,
                             .device = DeviceArray::colors,
                             .first = first_of<&MeshRange::first_color>,
                             .gradient = Gradients::colors,
                             .stride = &Params::color_stride,
                             .exists = has_colors,
                             .may_be_empty = true,
                             .what = "colours"};
constexpr MeshArray k_texels{.name = "texels",
                             .components = 3,
                             .wanted = &Request::texture,
                             .host = host_texels,
                             .device = DeviceArray::texels,
                             .first = first_texel,
                             .gradient = Gradients::texels,
                             .changed = forget_levels,
                             .exists = has_textures,
                             .what = "textures"};
constexpr MeshArray k_texcoords{.name = "texcoords",
                                .components = 2,
                                .wanted = &Request::texcoords,
                                .host = host_array<&Mesh::texcoords>,
                                .device = DeviceArray::texcoords,
                                .first = first_of<&MeshRange::first_texcoord>,
                                .gradient = Gradients::texcoords,
                                .changed = forget_edges,
                                .exists = has_textures,
                                .what = "textures"};
constexpr MeshArray k_normals{.name = "normals",
                              .components = 3,
                              .wanted = &Request::normals,
                              .is_lit = true,
                              .host = host_array<&Mesh::normals>,
                              .device = DeviceArray::normals,
                              .first = first_of<&MeshRange::first_normal>,
                              .gradient = Gradients::normals,
                              .changed = forget_edges,
                              .exists = has_normals,
                              .what = "normals of its own"};
constexpr MeshArray k_materials{.name = "materials",
                                .components = DPR_MATERIAL_CHANNELS,
                                .wanted = &Request::materials,
                                .is_lit = true,
                                .host = host_array<&Mesh::materials>,
                                .device = DeviceArray::materials,
                                .first = first_of<&MeshRange::first_material>,
                                .gradient = Gradients::materials,
                                .exists = has_materials,
                                .what = "materials"};
constexpr MeshArray k_opacities{.name = "opacities",
                                .components = 1,
                                .wanted = &Request::opacities,
                                .host = host_opacities,
                                .device = DeviceArray::opacities,
                                .first = first_of<&MeshRange::first_opacity>,
                                .gradient = Gradients::opacities,
                                .changed = find_see_through,
                                .exists = has_opacities,
                                .what = "opacities"};
constexpr MeshArray k_texel_opacities{.name = "texel_opacities",
                                      .components = 1,
                                      .wanted = &Request::texel_opacities,
                                      .host = host_texel_opacities,
                                      .device = DeviceArray::texel_opacities,
                                      .first = first_texel,
                                      .gradient = Gradients::texel_opacities,
                                      .changed = forget_levels_of_opacities,
                                      .exists = has_texel_opacities,
                                      .what = "textures with opacities"};
/// In the order of ArrayId.
constexpr std::array k_arrays{k_positions, k_colors,    k_texels,    k_texcoords,
                              k_normals,   k_materials, k_opacities, k_texel_opacities};

[[noreturn]] void refuse_mesh(const ArrayRef& at) {
  throw InvalidArgument("mesh (" + setter_of(at) + ")", std::string("a mesh without ") + row_of(at.id).what,
                        "one that has some");
}

}  // namespace

const MeshArray& row_of(ArrayId id) {
  const auto row = static_cast<std::size_t>(id);
  if (row >= k_arrays.size()) throw InvalidArgument("array (set_array)", std::to_string(row), "an ArrayId");
  return k_arrays[row];
}

std::string setter_of(const ArrayRef& at) { return std::string("set_") + row_of(at.id).name; }

ArrayId id_of(bool GradientRequest::*wanted) {
  return static_cast<ArrayId>(std::ranges::find(k_arrays, wanted, &MeshArray::wanted) - k_arrays.begin());
}

HostArray require_array(Scene& scene, const ArrayRef& at) {
  if (at.mesh >= scene.meshes.size())
    throw InvalidArgument("mesh", std::to_string(at.mesh), "below " + std::to_string(scene.meshes.size()));
  if (const auto source = scene.meshes[at.mesh].instance_of) {
    throw InvalidArgument("mesh",
                          std::to_string(at.mesh) + ", an instance of mesh " + std::to_string(*source),
                          std::to_string(*source) + ": what is set there is its instances' too");
  }
  Mesh& mesh = scene.meshes[at.mesh].mesh;
  const MeshArray& row = row_of(at.id);
  if (is_of_texture(at.id) && at.texture >= mesh.textures.size())
    throw InvalidArgument("texture", std::to_string(at.texture),
                          "below " + std::to_string(mesh.textures.size()));
  if (!row.may_be_empty && !row.exists(mesh)) refuse_mesh(at);
  return row.host(mesh, at.texture);
}

HostArray require_array(Scene& scene, const ArrayRef& at, const ArrayValues& values) {
  const HostArray array = require_array(scene, at);
  const MeshArray& row = row_of(at.id);
  if (array.index() != values.index())
    throw InvalidArgument(row.name, "elements of another type", "the type that Mesh holds");
  require_count(row.name, values, count_of(array));
  if (const auto* const opacities = std::get_if<std::span<const float>>(&values)) {
    if (std::ranges::any_of(*opacities, [](float opacity) { return opacity < 1; }))
      require_sees_through(scene.smoothing);
  }
  return array;
}

std::size_t count_of(const HostArray& array) {
  return std::visit([](const auto* list) { return list->size(); }, array);
}

ArrayValues values_of(const HostArray& array) {
  return std::visit([](const auto* list) -> ArrayValues { return std::span(*list); }, array);
}

void assign(const HostArray& array, const ArrayValues& values) {
  const auto copy = [&]<class Element>(std::span<const Element> from) {
    std::ranges::copy(from, std::get<std::vector<Element>*>(array)->begin());
  };
  std::visit(copy, values);
}

void require_count(const char* name, const ArrayValues& values, std::size_t expected) {
  const auto check = [&]<class Element>(std::span<const Element> list) {
    if (list.size() == expected) return;
    constexpr bool is_vector = !std::is_same_v<Element, Material> && !std::is_same_v<Element, float>;
    throw InvalidArgument(name, std::to_string(list.size()) + (is_vector ? " vectors" : ""),
                          std::to_string(expected));
  };
  std::visit(check, values);
}

void check_values(const char* name, const ArrayValues& values) {
  const auto check = [&]<class Element>(std::span<const Element> list) {
    if constexpr (std::is_same_v<Element, Material>) {
      for (std::size_t i = 0; i < list.size(); ++i) validate(list[i], checks::element(name, i));
    } else {
      require_valid(name, list, 0);
    }
  };
  std::visit(check, values);
}

namespace {

/// Vectors of which the host makes rows of four floats; of more the device does.
constexpr std::size_t k_most_rows_made = k_rows_of_piece;

/// A checked copy of vectors, and of positions the box around them, in one pass over memory.
template <class Vector>
void copy_checked(const char* name, std::span<const Vector> from, std::vector<Vector>& to, Bounds* box) {
  constexpr std::size_t k_block = 1024;
  to.clear();
  to.reserve(from.size());
  for (std::size_t first = 0; first < from.size(); first += k_block) {
    const std::span<const Vector> block = from.subspan(first, std::min(k_block, from.size() - first));
    require_valid(name, block, first);
    to.insert(to.end(), block.begin(), block.end());
    if constexpr (std::is_same_v<Vector, glm::vec3>) {
      if (box == nullptr) continue;
      const Bounds of_block = bounding_box(block);
      *box = first == 0 ? of_block
                        : Bounds{glm::min(box->low, of_block.low), glm::max(box->high, of_block.high)};
    }
  }
}

template <class Element>
std::vector<cl_float4> rows_of(std::span<const Element> elements) {
  std::vector<cl_float4> rows;
  rows.reserve(elements.size());
  for (const Element& e : elements) {
    if constexpr (std::is_same_v<Element, Material>) {
      rows.push_back(to_cl(e));
    } else {
      rows.push_back(to_cl(to_vec3(e)));
    }
  }
  return rows;
}

}  // namespace

/// Buffer in which the copy that takes a buffer's place is prepared: one that nothing reads between a
/// backward pass and the next, if that is as long.
Buffer<cl_float4>& Renderer::Impl::spare_for(const Buffer<cl_float4>& buffer) {
  const std::size_t vertices = std::size_t{frame.views} * frame.vertices;
  Buffer<cl_float4>& spare = buffer.size() == vertices ? grad_vertices : spare_values_;
  spare.resize(impl_of(device), buffer.size());
  return spare;
}

/// Puts elements in the place of an array's. Many go to the device as they are, where they become rows of four floats,
/// while the host copies them.
template <class Element>
void Renderer::Impl::replace(const ArrayRef& at, std::vector<Element>& held,
                             std::span<const Element> elements) {
  constexpr bool is_vector = !std::is_same_v<Element, Material>;
  const MeshArray& row = row_of(at.id);
  Buffer<cl_float4>& buffer = row.device(*geometry);
  const std::size_t first = row.first(*geometry, at);
  const bool has_box = at.id == ArrayId::positions;
  Bounds box{};
  std::vector<Element> copy;
  Buffer<cl_float4>& spare = spare_for(buffer);
  if (elements.size() < buffer.size()) buffer.copy_to(spare);
  if constexpr (is_vector) {
    if constexpr (std::is_same_v<Element, glm::vec3>) {
      if (spare_vectors_.size() == elements.size()) copy = std::move(spare_vectors_);
    }
    std::optional<LentWrite> write;
    if (elements.size() > k_most_rows_made) {
      const std::span<const float> numbers = checks::floats_of(elements);
      packed_.resize(impl_of(device), numbers.size());
      write.emplace(impl_of(device), packed_.cl_buffer(), std::as_bytes(numbers));
      made_exchange().give(vectors_of(packed_, 0, sizeof(Element) / sizeof(float)), elements.size(),
                           vectors_of(spare, first, 4));
    }
    copy_checked(row.name, elements, copy, has_box ? &box : nullptr);
  } else {
    check_values(row.name, elements);
    copy.assign(elements.begin(), elements.end());
  }
  if (!is_vector || elements.size() <= k_most_rows_made)
    write_range(impl_of(device), spare, first, rows_of(elements));

  std::swap(buffer, spare);
  std::swap(held, copy);
  if constexpr (std::is_same_v<Element, glm::vec3>) spare_vectors_ = std::move(copy);
  row.changed(*this, at.mesh, /*on_host*/ true);
  if (has_box && !elements.empty()) clip_planes.set_box(at.mesh, box_corners(box));
}

void Renderer::Impl::set(const ArrayRef& at, const ArrayValues& values) {
  const HostArray held = row_of(at.id).host(scene.meshes[at.mesh].mesh, at.texture);
  const auto replace_with = [&]<class Element>(std::span<const Element> elements) {
    replace(at, *std::get<std::vector<Element>*>(held), elements);
  };
  std::visit(replace_with, values);
  rendered = false;
}

void Renderer::set_array(const ArrayRef& array, const ArrayValues& values) {
  impl_->require_scene(("Renderer::" + setter_of(array)).c_str());
  require_array(impl_->scene, array, values);
  impl_->set(array, values);  // checks the values as it copies them
}

void set_array(Renderer& renderer, const ArrayRef& at, const BufferSpan& values, const Events& events) {
  Impl& m = impl_of(renderer);
  m.require_scene(setter_of(at).c_str());
  const MeshArray& row = row_of(at.id);
  const VectorShape shape{count_of(require_array(m.scene, at)), row.components};
  if (shape.count == 0) refuse_mesh(at);
  if (is_of_opacity(at.id)) require_sees_through(m.scene.smoothing);
  const FloatVectors from = require_vectors(impl_of(m.device), values, shape, Access::read, row.name);
  enqueue(impl_of(m.device), events, [&] { m.take(at, shape.count, from); });
}

}  // namespace dpr
