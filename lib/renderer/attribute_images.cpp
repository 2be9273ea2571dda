// The attribute as the colours of a renderer of its own: its images, and its gradients.
#include "dpr/attribute_images.hpp"

#include <algorithm>
#include <iterator>
#include <string>

#include "base/checks.hpp"
#include "renderer/attribute_images_impl.hpp"
#include "renderer/on_device.hpp"
#include "scene/gradient_table.hpp"

namespace dpr {
namespace {

/// Those of the corners of a view's faces, face after face.
std::vector<glm::vec3> positions_of_corners(const Mesh& mesh, std::size_t views_of_faces = 1) {
  std::vector<glm::vec3> positions;
  for (const glm::uvec3& face : std::span(mesh.faces).first(mesh.faces.size() / views_of_faces)) {
    for (int corner = 0; corner < 3; ++corner) positions.push_back(mesh.positions[face[corner]]);
  }
  return positions;
}

/// The mesh with a colour for every number of the domain, and the faces of its views `passes` times. Corners become
/// vertices, face after face.
Mesh shown_mesh(const Mesh& mesh, AttributeDomain domain, std::size_t views_of_faces, std::size_t passes) {
  Mesh shown;
  std::vector<glm::uvec3> faces = mesh.faces;
  if (domain == AttributeDomain::corners) {
    shown.positions = positions_of_corners(mesh, views_of_faces);
    const auto corners = to_uint(shown.positions.size());
    for (cl_uint i = 0; i < faces.size(); ++i) faces[i] = glm::uvec3(3 * i) % corners + glm::uvec3(0, 1, 2);
  } else {
    shown.positions = mesh.positions;
  }
  for (std::size_t pass = 0; pass < passes; ++pass)
    shown.faces.insert(shown.faces.end(), faces.begin(), faces.end());
  const bool of_faces = domain == AttributeDomain::faces;
  (of_faces ? shown.face_colors : shown.vertex_colors)
      .resize(of_faces ? shown.faces.size() : shown.positions.size());
  return shown;
}

/// The scene's faces in the dark, with a colour for every number of the domain. What instances show differs:
/// each is a mesh.
Scene shown_scene(const Scene& source, AttributeDomain domain, std::size_t views_of_faces,
                  std::size_t passes) {
  Scene scene;
  scene.width = source.width;
  scene.height = source.height;
  scene.camera = source.camera;
  scene.smoothing = source.smoothing;
  scene.perspective_correct = source.perspective_correct;
  scene.cull = source.cull;
  for (std::size_t m = 0; m < source.meshes.size(); ++m)
    scene.meshes.push_back(
        {shown_mesh(mesh_of(source, m), domain, views_of_faces, passes), source.meshes[m].transform});
  return scene;
}

/// Vertices of the scene that are shown, in order, of views with faces of their own view after view; `first` is the
/// number of a mesh's first, of `count` in a view.
std::vector<cl_uint> vertices_shown(const Scene& scene, AttributeDomain domain, const Geometry& geometry,
                                    std::size_t MeshRange::*first, std::size_t count) {
  std::vector<cl_uint> vertices;
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    const std::size_t faces = mesh.faces.size() / geometry.views_of_faces;
    for (std::size_t view = 0; view < geometry.views_of_faces; ++view) {
      const cl_uint first_vertex = to_uint(view * count + geometry.meshes[m].*first);
      if (domain == AttributeDomain::corners) {
        for (const glm::uvec3& face : std::span(mesh.faces).subspan(view * faces, faces))
          vertices.insert(vertices.end(),
                          {first_vertex + face.x, first_vertex + face.y, first_vertex + face.z});
      } else {
        for (cl_uint vertex = 0; vertex < mesh.positions.size(); ++vertex)
          vertices.push_back(first_vertex + vertex);
      }
    }
  }
  return vertices;
}

/// Gradients that the renderer's backward pass has to find.
GradientRequest request_of(const GradientRequest& wanted, std::optional<Attribute> attribute) {
  GradientRequest request = no_gradients();
  request.positions = wanted.positions;
  request.transform = wanted.transform;
  request.camera = wanted.camera;
  request.distortion = wanted.distortion;
  request.smoothing = wanted.smoothing;
  request.colors = !attribute || (attribute == Attribute::texcoords && wanted.texcoords);
  return request;
}

}  // namespace

AttributeImages::Impl::Impl(const Device& device, std::optional<Attribute> attribute_, std::size_t channels_)
    : attribute(attribute_),
      channels(channels_),
      renderer(device),
      rows_(impl_of(device)),
      launch_(impl_of(device)) {
  if (!has_rows()) impl_of(renderer).geometry_colors.emplace(impl_of(device), *attribute);
}

AttributeDomain AttributeImages::Impl::domain() const {
  if (attribute == Attribute::normal) return AttributeDomain::faces;
  return attribute == Attribute::texcoords ? AttributeDomain::corners : AttributeDomain::vertices;
}

void AttributeImages::Impl::require_forward(const char* caller) const {
  if (views == 0) throw InvalidArgument(caller, "no images of an attribute", "forward() first");
}

void AttributeImages::Impl::require_values(Renderer::Impl& source) const {
  const std::size_t expected = channels * source.geometry->views_of_faces * source.geometry->vertices;
  if (!attribute && value_count_ != expected) {
    throw InvalidArgument("values (attribute images)", std::to_string(value_count_),
                          std::to_string(expected) + ", vertices of the scene x channels");
  }
  if (attribute == Attribute::texcoords && source.corner_texcoords_in_force()->empty()) {
    throw InvalidArgument("texcoords (attribute images)", "a mesh that has no texture coordinates",
                          "texture coordinates on all meshes");
  }
}

std::size_t AttributeImages::Impl::views_of_faces(const Renderer::Impl& source) const {
  const Geometry& geometry = *source.geometry;
  return geometry.has_own_faces() ? passes(source.scene.smoothing) * geometry.views_of_faces : 1;
}

bool AttributeImages::Impl::shows_faces_of(const Renderer::Impl& source) const {
  const Scene &scene = source.scene, &own = renderer.scene();
  if (meshes_.empty() || impl_of(renderer).geometry->views_of_faces != views_of_faces(source) ||
      own.width != scene.width || own.height != scene.height ||
      own.perspective_correct != scene.perspective_correct || meshes_.size() != scene.meshes.size())
    return false;
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    if (meshes_[m].instance_of != scene.meshes[m].instance_of ||
        meshes_[m].vertices != mesh.positions.size() || meshes_[m].faces != mesh.faces)
      return false;
  }
  return true;
}

void AttributeImages::Impl::show_faces_of(const Renderer::Impl& source) {
  const Scene& scene = source.scene;
  const Geometry& geometry = *source.geometry;
  Device::Impl& device = impl_of(renderer.device());
  meshes_.clear();
  fold_.reset();
  views_of_rows_ = geometry.views_of_faces;
  const std::size_t of_all = views_of_faces(source);
  impl_of(renderer).set_scene(shown_scene(scene, domain(), geometry.views_of_faces, of_all / views_of_rows_),
                              of_all);
  if (room) impl_of(renderer).reserve(*room);
  const auto map = [&](std::size_t MeshRange::*first, std::size_t count) {
    return RowMap(device, vertices_shown(scene, domain(), geometry, first, count),
                  geometry.views_of_faces * count);
  };
  positions_ = map(&MeshRange::first_position, geometry.position_count);
  vertices_ = map(&MeshRange::first_vertex, geometry.vertices);
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = mesh_of(scene, m);
    meshes_.push_back({scene.meshes[m].instance_of, mesh.positions.size(), mesh.faces});
  }
}

/// Brings the renderer's scene and views up to the source's.
void AttributeImages::Impl::follow(Renderer::Impl& source) {
  const Scene& scene = source.scene;
  if (!shows_faces_of(source)) show_faces_of(source);
  if (renderer.scene().cull != scene.cull) renderer.set_cull(scene.cull);
  follow_views(source);
  has_own_shapes_ = source.frame.position_stride != 0;
  has_own_shapes_ ? follow_shapes(source) : follow_positions(source);
  wanted_ = scene.gradients;
  const GradientRequest request = request_of(wanted_, attribute);
  if (renderer.scene().gradients != request) renderer.set_gradients(request);
}

void AttributeImages::Impl::follow_views(const Renderer::Impl& source) {
  Renderer::Impl& r = impl_of(renderer);
  const Smoothing& smoothing = source.scene.smoothing;
  std::vector<View> of_passes;
  for (std::size_t pass = 0; pass < passes(smoothing); ++pass)
    of_passes.insert(of_passes.end(), source.views.begin(), source.views.end());
  const bool has_left_device = (r.has_device_poses && !source.has_device_poses) ||
                               (r.has_device_cameras && !source.has_device_cameras);
  if (of_passes != r.views || has_left_device) {
    // Together: the new smoothing need not suit the old views, nor the old one the new views.
    r.set_views(of_passes, 0, smoothing, r.scene.lights);
    fold_.reset();
  } else if (r.scene.smoothing != smoothing) {
    renderer.set_smoothing(smoothing);
  }
  for (std::size_t pass = 0; source.has_device_poses && pass < passes(); ++pass) {
    const DeviceViews& from = source.device_views;
    from.models.copy_to(r.device_views.models, pass * from.models.size());
    from.cameras.copy_to(r.device_views.cameras, pass * from.cameras.size());
  }
  r.has_device_poses = source.has_device_poses;
  r.has_device_cameras = source.has_device_cameras;
}

void AttributeImages::Impl::follow_positions(const Renderer::Impl& source) {
  Renderer::Impl& r = impl_of(renderer);
  r.has_moved = r.has_moved || r.frame.position_stride != 0;
  r.frame.position_stride = 0;
  r.clip_planes.set_boxes_of_views({});
  const bool by_corner = domain() == AttributeDomain::corners;
  bool all_are_known = true;
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    if (!source.clip_planes.knows(meshes_[m].instance_of.value_or(m))) {
      r.forget_positions(m);
      all_are_known = false;
      continue;
    }
    const Mesh& mesh = mesh_of(source.scene, m);
    const std::vector<glm::vec3> of_corners =
        by_corner ? positions_of_corners(mesh) : std::vector<glm::vec3>();
    const std::vector<glm::vec3>& positions = by_corner ? of_corners : mesh.positions;
    if (!r.clip_planes.knows(m) || r.scene.meshes[m].mesh.positions != positions)
      renderer.set_positions(m, positions);
  }
  if (!all_are_known) rows_.move(positions_, 1, source.geometry->positions, 1, r.geometry->positions);
}

void AttributeImages::Impl::follow_shapes(const Renderer::Impl& source) {
  Renderer::Impl& r = impl_of(renderer);
  rows_.move(positions_, of_rows(source.views.size()), source.geometry->view_positions,
             of_rows(r.views.size()), r.geometry->view_positions);
  r.frame.position_stride = r.frame.vertices;
  r.has_moved = true;
  std::vector<BoxCorners> boxes;
  for (std::size_t pass = 0; pass < passes(); ++pass)
    std::ranges::copy(source.clip_planes.boxes_of_views(), std::back_inserter(boxes));
  r.clip_planes.set_boxes_of_views(std::move(boxes));
  if (!source.clip_planes.knows_views()) r.clip_planes.forget_views();
  r.take_windings(source, passes());
}

void AttributeImages::Impl::forward(Renderer::Impl& source, FrameSizes sizes) {
  require_values(source);
  if (source.is_see_through)
    throw InvalidArgument("opacities (attribute images)", "some below 1", "an opaque scene: 1, or none");
  views = 0;  // until everything is there
  if (attribute == Attribute::texcoords) texcoords_ = source.corner_texcoords;
  follow(source);
  Renderer::Impl& r = impl_of(renderer);
  r.frame.color_stride = to_uint(r.geometry->colors);
  if (has_rows()) {
    rows_.forward(row_map(), channels, row_values(), passes(), of_rows(source.views.size()),
                  r.geometry->view_colors);
  } else {
    r.geometry_colors->shown_views = source.views.size();
  }
  r.forward(sizes);
  if (sizes == FrameSizes::read) r.require_forward("AttributeImages::forward");
  if (shows_weights()) {
    const std::size_t pixels = r.image().size() / passes(), count = groups() * pixels;
    weighed_.resize(impl_of(r.device), count);
    launch_(count, kernel::attribute_weigh_forward{.groups = to_uint(groups()),
                                                   .pixels = to_uint(pixels),
                                                   .rendered = r.image(),
                                                   .images = weighed_});
  }
  views = source.views.size();
}

BufferRef<cl_float4> AttributeImages::Impl::grad_of_rendered(const BufferRef<cl_float4>& grad_images) {
  if (!shows_weights()) return grad_images;
  Renderer::Impl& r = impl_of(renderer);
  const std::size_t pixels = r.image().size() / passes();
  grad_rendered_.resize(impl_of(r.device), r.image().size());
  launch_(pixels, kernel::attribute_weigh_backward{.groups = to_uint(groups()),
                                                   .pixels = to_uint(pixels),
                                                   .grad_images = grad_images,
                                                   .grad_rendered = grad_rendered_});
  return grad_rendered_;
}

/// From what the renderer's backward pass left of positions and colours to those of the source's.
void AttributeImages::Impl::gather() {
  Renderer::Impl& r = impl_of(renderer);
  if (wanted_.positions) {
    const std::size_t sources = has_own_shapes_ ? of_rows(views) : 1,
                      copies = has_own_shapes_ ? of_rows(r.views.size()) : 1;
    rows_.move_backward(positions_, sources, r.transform.grad_positions, copies, grad_positions_);
  }
  if (has_rows() && r.wants(ArrayId::colors))
    rows_.backward(row_map(), channels, of_rows(views), r.grad_colors, grad_rows_);
}

SceneGradient AttributeImages::Impl::backward(const BufferRef<cl_float4>& grad_images) {
  SceneGradient of_passes = impl_of(renderer).backward(grad_of_rendered(grad_images));
  gather();
  return folded(std::move(of_passes));
}

void AttributeImages::Impl::backward_on_device(const BufferRef<cl_float4>& grad_images) {
  Renderer::Impl& r = impl_of(renderer);
  r.backward_on_device(grad_of_rendered(grad_images));
  gather();
  if (!fold_) {
    SceneGradient of_passes = r.empty_gradient(), of_views = empty_gradient();
    fold_ = make_fold(impl_of(r.device), of_passes, of_views);
  }
  r.made_exchange().map(*fold_, r.grad_numbers, grad_numbers_);
}

SceneGradient AttributeImages::Impl::empty_gradient() const {
  SceneGradient gradient;
  gradient.meshes.resize(meshes_.size());
  gradient.views.resize(views);
  for (ViewGradient& view : gradient.views) view.transforms.resize(meshes_.size());
  return gradient;
}

namespace {

/// Adds the gradients of the views' cameras and transforms, [pass][view], to those of the views.
void fold_views(SceneGradient& of_passes, SceneGradient& gradient) {
  const std::size_t views = gradient.views.size();
  for_each_array(of_passes, [&](const GradientRow& row, GradientIndex i, const GradientArray& array) {
    if (row.of != GradientOf::view && row.of != GradientOf::mesh_in_view) return;
    add_numbers(row.array(gradient, {i.view % views, i.item}), array);
  });
}

}  // namespace

SceneGradient AttributeImages::Impl::folded(SceneGradient&& of_passes) {
  SceneGradient gradient = empty_gradient();
  gradient.sigma = of_passes.sigma;
  gradient.gamma = of_passes.gamma;
  gradient.alpha = of_passes.alpha;
  fold_views(of_passes, gradient);
  if (wanted_.positions) {
    std::vector<glm::vec3> positions;
    for (const cl_float4& g : grad_positions_.download()) positions.emplace_back(g.s[0], g.s[1], g.s[2]);
    auto next = positions.begin();
    for (std::size_t m = 0; !has_own_shapes_ && m < meshes_.size(); ++m) {
      if (meshes_[m].instance_of) continue;
      const auto first = std::exchange(next, next + static_cast<std::ptrdiff_t>(meshes_[m].vertices));
      gradient.meshes[m].positions.assign(first, next);
    }
    if (has_own_shapes_) gradient.shapes.positions = std::move(positions);
  }
  if (!attribute) grad_values = grad_rows_.download();
  if (attribute == Attribute::texcoords && wanted_.texcoords) {
    const std::vector<float> uv = grad_rows_.download();
    for (std::size_t m = 0; m < meshes_.size(); ++m) {
      for (std::size_t i = texcoords_->first[m]; i < texcoords_->first[m + 1]; ++i)
        gradient.meshes[m].texcoords.emplace_back(uv[2 * i], uv[2 * i + 1]);
    }
  }
  return gradient;
}

void AttributeImages::Impl::require_own_values() const {
  if (!attribute) return;
  throw InvalidArgument("values (attribute images)", "them for the " + std::string(to_string(*attribute)),
                        "an attribute of the caller's own: the scene says what this one is");
}

void AttributeImages::Impl::set_values(std::span<const float> values) {
  values_.upload(impl_of(renderer.device()), values);
  value_count_ = values.size();
}

void AttributeImages::Impl::take_values(const FloatVectors& from, std::size_t count) {
  values_.resize(impl_of(renderer.device()), count * channels);
  impl_of(renderer).made_exchange().take(from, count, values_, channels);
  value_count_ = count * channels;
}

}  // namespace dpr
