// The attribute as the colours of a renderer of its own: its images, and its gradients on the host.
#include "dpr/attribute_images.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "base/checks.hpp"
#include "base/name_list.hpp"
#include "base/require.hpp"
#include "renderer/attribute_images_impl.hpp"
#include "renderer/frame.hpp"
#include "renderer/setter_checks.hpp"
#include "scene/gradient_table.hpp"

namespace dpr {
namespace {

constexpr std::array<std::string_view, 4> k_attribute_names{"depth", "position", "normal", "texcoords"};

std::vector<glm::vec3> at_corners(std::span<const glm::vec3> positions,
                                  const std::vector<glm::uvec3>& faces) {
  std::vector<glm::vec3> values;
  for (const glm::uvec3& face : faces) {
    for (int corner = 0; corner < 3; ++corner) values.push_back(positions[face[corner]]);
  }
  return values;
}

/// The scene's faces in the dark, with a colour for every number of the domain. What instances show differs:
/// each is a mesh.
Scene shown_scene(const Scene& source, AttributeDomain domain) {
  Scene scene;
  scene.width = source.width;
  scene.height = source.height;
  scene.camera = source.camera;
  scene.smoothing = source.smoothing;
  scene.perspective_correct = source.perspective_correct;
  scene.cull = source.cull;
  for (std::size_t m = 0; m < source.meshes.size(); ++m)
    scene.meshes.push_back({shown_mesh(mesh_of(source, m), domain), source.meshes[m].transform});
  return scene;
}

/// Of views with shapes of their own the device's positions are read.
void require_known_places(const Renderer::Impl& source) {
  bool are_known = !source.has_device_poses;
  for (std::size_t m = 0; source.frame.position_stride == 0 && m < source.scene.meshes.size(); ++m)
    are_known = are_known && source.near_plane.knows(m);
  if (are_known) return;
  throw InvalidArgument("renderer (AttributeImages::forward)", "positions or transforms from a buffer",
                        "those of Renderer's own setters: the host computes what surfaces show");
}

/// What the renderer's backward pass has to find.
GradientRequest request_of(const GradientRequest& wanted, std::optional<Attribute> attribute) {
  GradientRequest request = no_gradients();
  request.positions = wanted.positions;
  request.transform = wanted.transform;
  request.camera = wanted.camera;
  request.distortion = wanted.distortion;
  request.smoothing = wanted.smoothing;
  request.colors = !attribute || (attribute == Attribute::texcoords
                                      ? wanted.texcoords
                                      : wanted.positions || wanted.transform || wanted.camera);
  return request;
}

}  // namespace

std::string_view to_string(Attribute attribute) {
  return k_attribute_names[static_cast<std::size_t>(attribute)];
}

Attribute parse_attribute(std::string_view word, std::string_view where) {
  return static_cast<Attribute>(position_of(word, k_attribute_names, std::string(where)));
}

void AttributeImages::Impl::require_forward(const char* caller) const {
  if (views == 0) throw InvalidArgument(caller, "no images of an attribute", "forward() first");
}

AttributeImages::Impl::Impl(const Device& device, std::optional<Attribute> attribute_, std::size_t channels_)
    : attribute(attribute_),
      channels(channels_),
      renderer(device),
      weigh_(device.impl(), "attribute.cl", "attribute_weigh_forward"),
      weigh_backward_(device.impl(), "attribute.cl", "attribute_weigh_backward") {}

bool AttributeImages::Impl::shows_faces_of(const Scene& scene) const {
  const Scene& own = renderer.scene();
  if (own.width != scene.width || own.height != scene.height ||
      own.perspective_correct != scene.perspective_correct || meshes_.size() != scene.meshes.size())
    return false;
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    const SourceMesh& mesh = meshes_[m];
    const Mesh& other = mesh_of(scene, m);
    if (mesh.mesh != scene.meshes[m].instance_of.value_or(m) || mesh.vertices != other.positions.size() ||
        mesh.texcoords != other.texcoords.size() || mesh.faces != other.faces ||
        mesh.face_texcoords != other.face_texcoords)
      return false;
  }
  return true;
}

/// Brings the renderer's scene and views up to the source's.
void AttributeImages::Impl::follow(const Renderer::Impl& source) {
  const Scene& scene = source.scene;
  views = 0;  // until everything is there
  if (!shows_faces_of(scene)) {
    meshes_.clear();
    renderer.set_scene(shown_scene(scene, domain()));
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      const Mesh& mesh = mesh_of(scene, m);
      meshes_.push_back({scene.meshes[m].instance_of.value_or(m), source.geometry->meshes[m].first_position,
                         mesh.positions.size(), mesh.texcoords.size(), mesh.faces, mesh.face_texcoords});
    }
  }
  take_positions(source);
  if (renderer.scene().cull != scene.cull) renderer.set_cull(scene.cull);
  if (renderer.scene().smoothing != scene.smoothing) renderer.set_smoothing(scene.smoothing);
  std::vector<View> of_passes;
  for (std::size_t pass = 0; pass < passes(); ++pass)
    of_passes.insert(of_passes.end(), source.views.begin(), source.views.end());
  renderer.set_views(of_passes);
  wanted_ = scene.gradients;
  renderer.set_gradients(request_of(wanted_, attribute));
}

void AttributeImages::Impl::take_positions(const Renderer::Impl& source) {
  positions_.clear();
  has_own_shapes_ = source.frame.position_stride != 0;
  const bool by_corner = domain() == AttributeDomain::corners;
  const auto append = [&](std::span<const glm::vec3> positions, const SourceMesh& mesh) {
    const std::vector<glm::vec3> corners =
        by_corner ? at_corners(positions, mesh.faces) : std::vector<glm::vec3>();
    if (by_corner) positions = corners;
    positions_.insert(positions_.end(), positions.begin(), positions.end());
  };
  if (!has_own_shapes_) {
    for (std::size_t m = 0; m < meshes_.size(); ++m) {
      const std::size_t first = positions_.size();
      append(mesh_of(source.scene, m).positions, meshes_[m]);
      const std::span<const glm::vec3> moved = std::span(positions_).subspan(first);
      if (!std::ranges::equal(renderer.scene().meshes[m].mesh.positions, moved))
        renderer.set_positions(m, moved);
    }
    return;
  }
  std::vector<glm::vec3> shapes;
  for (const cl_float4& v : source.geometry->view_positions.download())
    shapes.emplace_back(v.s[0], v.s[1], v.s[2]);
  for (std::size_t view = 0; view < source.views.size(); ++view) {
    const auto of_view = std::span(shapes).subspan(view * source.geometry->position_count);
    for (const SourceMesh& mesh : meshes_) append(of_view.subspan(mesh.first_position, mesh.vertices), mesh);
  }
}

ShownView AttributeImages::Impl::shown(std::size_t view) const {
  const std::span<const glm::vec3> all(positions_);
  const std::size_t source_views = renderer.views().size() / passes();
  const std::size_t count = has_own_shapes_ ? all.size() / source_views : all.size();
  return {renderer.scene(), renderer.views()[view], all.subspan(has_own_shapes_ ? view * count : 0, count)};
}

std::vector<glm::vec3> AttributeImages::Impl::values_of(const Scene& source, std::size_t group,
                                                        std::size_t view) const {
  if (attribute) {
    return attribute == Attribute::texcoords ? texcoord_values(source)
                                             : attribute_values(*attribute, shown(view));
  }
  std::vector<glm::vec3> result(values.size() / channels, glm::vec3(0));
  for (std::size_t vertex = 0; vertex < result.size(); ++vertex) {
    for (std::size_t c = 3 * group; c < std::min(channels, 3 * group + 3); ++c)
      result[vertex][static_cast<int>(c % 3)] = values[vertex * channels + c];
  }
  return result;
}

void AttributeImages::Impl::forward(const Renderer::Impl& source) {
  require_known_places(source);
  if (!attribute && values.size() != channels * source.geometry->vertices) {
    throw InvalidArgument(
        "values (attribute images)", std::to_string(values.size()),
        std::to_string(channels * source.geometry->vertices) + ", vertices of the scene x channels");
  }
  follow(source);
  const bool shows_texcoords = attribute == Attribute::texcoords;
  const Scene texcoords = shows_texcoords ? texcoords_in_force(source) : Scene();
  const Scene& scene = shows_texcoords ? texcoords : source.scene;
  std::vector<glm::vec3> colors, positions;
  for (std::size_t pass = 0; pass < passes(); ++pass) {
    for (std::size_t view = 0; view < source.views.size(); ++view) {
      const std::vector<glm::vec3> shown = pass < groups()
                                               ? values_of(scene, pass, view)
                                               : std::vector(renderer.impl().geometry->colors, glm::vec3(1));
      colors.insert(colors.end(), shown.begin(), shown.end());
    }
    if (has_own_shapes_) positions.insert(positions.end(), positions_.begin(), positions_.end());
  }
  renderer.set_shapes(positions, colors);
  renderer.forward();
  Renderer::Impl& r = renderer.impl();
  r.require_forward("AttributeImages::forward");
  if (shows_weights()) {
    const std::size_t pixels = r.image().size() / passes(), count = groups() * pixels;
    weighed_.resize(r.device.impl(), count);
    weigh_(count, static_cast<cl_uint>(groups()), static_cast<cl_uint>(pixels), r.image(), weighed_);
  }
  views = source.views.size();
}

SceneGradient AttributeImages::Impl::backward(const Buffer<cl_float4>& grad_images) {
  Renderer::Impl& r = renderer.impl();
  if (!shows_weights()) return folded(r.backward(grad_images));
  const std::size_t pixels = r.image().size() / passes();
  grad_rendered_.resize(r.device.impl(), r.image().size());
  weigh_backward_(pixels, static_cast<cl_uint>(groups()), static_cast<cl_uint>(pixels), grad_images,
                  grad_rendered_);
  return folded(r.backward(grad_rendered_));
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

/// The gradients of a mesh's corners, where each was a vertex.
std::vector<glm::vec3> at_vertices(std::span<const glm::dvec3> of_corners,
                                   const std::vector<glm::uvec3>& faces, std::size_t vertices) {
  std::vector<glm::dvec3> sums(vertices, glm::dvec3(0.0));
  for (std::size_t i = 0; i < of_corners.size(); ++i)
    sums[faces[i / 3][static_cast<int>(i % 3)]] += of_corners[i];
  return {sums.begin(), sums.end()};
}

void add_pose(const PoseGradient& from, PoseGradient& to) {
  to.rotation += from.rotation;
  to.translation += from.translation;
}

}  // namespace

SceneGradient AttributeImages::Impl::folded(SceneGradient&& of_passes) {
  SceneGradient gradient;
  gradient.sigma = of_passes.sigma;
  gradient.gamma = of_passes.gamma;
  gradient.alpha = of_passes.alpha;
  gradient.meshes.resize(meshes_.size());
  gradient.views.resize(views);
  for (ViewGradient& view : gradient.views) view.transforms.resize(meshes_.size());
  fold_views(of_passes, gradient);
  std::vector<glm::dvec3> positions(positions_.size(), glm::dvec3(0.0));
  if (wanted_.positions) add_positions(of_passes, positions);
  const std::vector<glm::vec3>& grad_values_shown = of_passes.shapes.colors;
  if (!attribute) {
    sum_grad_values(grad_values_shown);
  } else if (!grad_values_shown.empty() && attribute == Attribute::texcoords) {
    set_texcoords(grad_values_shown, gradient);
  } else if (!grad_values_shown.empty()) {
    add_by_geometry(grad_values_shown, positions, gradient);
  }
  if (wanted_.positions) add_to_positions(positions, gradient);
  return gradient;
}

/// Those of the renderer, over its passes.
void AttributeImages::Impl::add_positions(const SceneGradient& of_passes,
                                          std::vector<glm::dvec3>& positions) const {
  if (has_own_shapes_) {
    const std::vector<glm::vec3>& shapes = of_passes.shapes.positions;
    for (std::size_t i = 0; i < shapes.size(); ++i) positions[i % positions.size()] += glm::dvec3(shapes[i]);
    return;
  }
  std::size_t next = 0;
  for (const MeshGradient& mesh : of_passes.meshes) {
    for (const glm::vec3& g : mesh.positions) positions[next++] = glm::dvec3(g);
  }
}

/// What the values say of the geometry, from their gradients [pass][view][number].
void AttributeImages::Impl::add_by_geometry(std::span<const glm::vec3> grad,
                                            std::vector<glm::dvec3>& positions,
                                            SceneGradient& gradient) const {
  const std::size_t count = grad.size() / (passes() * views);
  for (std::size_t view = 0; view < views; ++view) {
    ViewGradient by_values;
    by_values.transforms.resize(meshes_.size());
    const ShownView geometry = shown(view);
    const std::size_t first = has_own_shapes_ ? view * geometry.positions.size() : 0;
    add_geometry_gradient(*attribute, geometry, grad.subspan(view * count, count),
                          {std::span(positions).subspan(first, geometry.positions.size()), by_values});
    ViewGradient& out = gradient.views[view];
    if (wanted_.camera) add_pose(by_values.camera.view, out.camera.view);
    for (std::size_t m = 0; wanted_.transform && m < meshes_.size(); ++m)
      add_pose(by_values.transforms[m], out.transforms[m]);
  }
}

void AttributeImages::Impl::sum_grad_values(std::span<const glm::vec3> grad) {
  const std::size_t vertices = values.size() / channels;
  std::vector<double> sums(values.size());
  for (std::size_t group = 0; group < groups(); ++group) {
    for (std::size_t i = 0; i < views * vertices; ++i) {
      for (std::size_t c = 3 * group; c < std::min(channels, 3 * group + 3); ++c) {
        const float g = grad[group * views * vertices + i][static_cast<int>(c % 3)];
        sums[i % vertices * channels + c] += static_cast<double>(g);
      }
    }
  }
  grad_values.assign(sums.begin(), sums.end());
}

void AttributeImages::Impl::set_texcoords(std::span<const glm::vec3> grad, SceneGradient& gradient) const {
  const std::size_t corners = grad.size() / (passes() * views);
  std::size_t first = 0;
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    const SourceMesh& mesh = meshes_[m];
    std::vector<glm::dvec2> sums(mesh.texcoords, glm::dvec2(0.0));
    for (std::size_t i = 0; i < 3 * mesh.face_texcoords.size(); ++i) {
      glm::dvec2& sum = sums[mesh.face_texcoords[i / 3][static_cast<int>(i % 3)]];
      for (std::size_t view = 0; view < views; ++view) sum += glm::dvec2(grad[view * corners + first + i]);
    }
    std::vector<glm::vec2>& out = gradient.meshes[mesh.mesh].texcoords;
    out.resize(sums.size(), glm::vec2(0));
    for (std::size_t i = 0; i < sums.size(); ++i) out[i] += glm::vec2(sums[i]);
    first += 3 * mesh.face_texcoords.size();
  }
}

/// From the shown vertices to those of the source's meshes, or of its views' shapes.
void AttributeImages::Impl::add_to_positions(std::span<const glm::dvec3> positions,
                                             SceneGradient& gradient) const {
  const bool by_corner = domain() == AttributeDomain::corners;
  for (std::size_t first = 0, of_view = 0; first < positions.size();) {
    const std::size_t in_shapes = of_view;
    for (std::size_t m = 0; m < meshes_.size(); ++m) {
      const SourceMesh& mesh = meshes_[m];
      const std::size_t count = by_corner ? 3 * mesh.faces.size() : mesh.vertices;
      const std::span<const glm::dvec3> own = positions.subspan(first, count);
      const std::vector<glm::vec3> found = by_corner ? at_vertices(own, mesh.faces, mesh.vertices)
                                                     : std::vector<glm::vec3>(own.begin(), own.end());
      std::vector<glm::vec3>& out =
          has_own_shapes_ ? gradient.shapes.positions : gradient.meshes[mesh.mesh].positions;
      const std::size_t place = has_own_shapes_ ? in_shapes + mesh.first_position : 0;
      out.resize(std::max(out.size(), place + mesh.vertices), glm::vec3(0));
      for (std::size_t i = 0; i < found.size(); ++i) out[place + i] += found[i];
      of_view = std::max(of_view, place + mesh.vertices);
      first += count;
    }
  }
}

AttributeImages::AttributeImages(const Device& device, Attribute attribute)
    : impl_(std::make_unique<Impl>(device, attribute,
                                   attribute == Attribute::depth       ? 1
                                   : attribute == Attribute::texcoords ? 2
                                                                       : 3)) {}

AttributeImages::AttributeImages(const Device& device, std::size_t channels, std::span<const float> values) {
  if (channels == 0) throw InvalidArgument("channels (attribute images)", "0", "at least 1");
  impl_ = std::make_unique<Impl>(device, std::nullopt, channels);
  set_values(values);
}

AttributeImages::~AttributeImages() = default;
AttributeImages::AttributeImages(AttributeImages&&) noexcept = default;
AttributeImages& AttributeImages::operator=(AttributeImages&&) noexcept = default;

void AttributeImages::set_values(std::span<const float> values) {
  if (impl_->attribute) {
    throw InvalidArgument("values (attribute images)",
                          "them for the " + std::string(to_string(*impl_->attribute)),
                          "an attribute of the caller's own: the scene says what this one is");
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) checks::require_finite(values[i], checks::element("values", i));
  }
  impl_->values.assign(values.begin(), values.end());
}

void AttributeImages::forward(const Renderer& of) {
  require_same_device(impl_->renderer.device(), of.device(), "AttributeImages::forward");
  of.impl().require_forward("AttributeImages::forward");
  impl_->forward(of.impl());
}

std::size_t AttributeImages::channels() const { return impl_->channels; }
std::size_t AttributeImages::groups() const { return impl_->groups(); }

Image AttributeImages::image(std::size_t view, std::size_t group) const {
  const Impl& m = *impl_;
  m.require_forward("AttributeImages::image");
  require(view < m.views, "view", view, ("below " + std::to_string(m.views)).c_str());
  require(group < m.groups(), "group", group, ("below " + std::to_string(m.groups())).c_str());
  const Scene& scene = m.renderer.scene();
  Image image(scene.width, scene.height);
  std::vector<cl_float4> pixels(image.pixels.size());
  m.images().download(pixels, (group * m.views + view) * pixels.size());
  std::ranges::transform(pixels, image.pixels.begin(),
                         [](const cl_float4& p) { return glm::vec4(p.s[0], p.s[1], p.s[2], p.s[3]); });
  return image;
}

SceneGradient AttributeImages::backward(std::span<const Image> grad_images) {
  Impl& m = *impl_;
  m.require_forward("AttributeImages::backward");
  const Scene& scene = m.renderer.scene();
  if (grad_images.size() != m.groups() * m.views) {
    throw InvalidArgument("grad_images", std::to_string(grad_images.size()) + " images",
                          std::to_string(m.groups() * m.views) + ", groups x views");
  }
  const std::vector<cl_float4> pixels = checked_pixels(grad_images, scene.width, scene.height);
  m.host_grad_images.upload(m.renderer.device().impl(), pixels);
  return m.backward(m.host_grad_images);
}

std::span<const float> AttributeImages::grad_values() const { return impl_->grad_values; }

}  // namespace dpr
