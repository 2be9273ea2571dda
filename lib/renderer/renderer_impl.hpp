// State of a Renderer: the scene, its geometry on the device, and the stages with their buffers.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "dpr/renderer.hpp"
#include "renderer/clip_planes.hpp"
#include "renderer/gradient_map.hpp"
#include "renderer/mesh_arrays.hpp"
#include "renderer/pixel_noise.hpp"
#include "renderer/shown_normals.hpp"
#include "stages/aggregate.hpp"
#include "stages/attribute.hpp"
#include "stages/auxiliary.hpp"
#include "stages/bin.hpp"
#include "stages/clip.hpp"
#include "stages/exchange.hpp"
#include "stages/gather.hpp"
#include "stages/geometry.hpp"
#include "stages/occupancy.hpp"
#include "stages/opacity.hpp"
#include "stages/rasterize.hpp"
#include "stages/reduce.hpp"
#include "stages/samples.hpp"
#include "stages/setup.hpp"
#include "stages/shade.hpp"
#include "stages/texels.hpp"
#include "stages/transform.hpp"

namespace dpr {

/// The device, a base before that of the views: whatever holds its buffers goes before it does.
struct OnDevice {
  Device device;
};

/// The views on the host and on the device, and what the kernels read of every frame of theirs.
struct ViewSet {
  std::vector<View> views;
  DeviceViews device_views;
  Buffer<cl_uint> view_normal_starts;  // [view * mesh + 1] runs of [view][given normal]
  shared::FrameParams frame{};
  bool has_device_poses = false, has_device_cameras = false;  // which the host does not know

  std::size_t bytes() const;
};

/// The smoothing of every stage.
struct SmoothingSetting {
  Smoothing smoothing;
  Occupancy::Setting occupancy;
  Aggregate::Setting aggregate;
  float blur_distance;
  Raster raster;
  std::shared_ptr<PixelNoise> pixel_noise;  // none: the triangles'
  Blur::Setting blur;
  std::shared_ptr<BlurSampled> blur_sampled;  // none: exact
};

/// Adds a gradient of the positions ([vertex], object space) to the one that is there.
using AddToGradient = std::function<void(const Buffer<cl_float4>& positions, Buffer<cl_float4>& grad)>;

/// Destination of the counts of a frame whose sizes are not measured first: the host, which will want them
/// soon; or none, until it asks.
enum class FrameSizes { read, kept };

class RowReads;

/// Values that the caller has shaded, packed: of all samples, or of those with these numbers, where the others are 0.
struct SampleValues {
  std::span<const float> values;
  std::size_t channels;
  const std::vector<cl_uint>* numbers = nullptr;  // none: all
  bool are_kept = false;  // values are left out: they are those that resolve() took last
};

/// Elements of a buffer.
struct DeviceGradient {
  const Buffer<cl_float4>& values;
  std::size_t first, count;
};

/// Rows that are on the way between the host's three floats and the device's four at a time: 2 MiB of these.
inline constexpr std::size_t k_rows_of_piece = std::size_t{1} << 17;

/// Setters come in two halves: the first prepares everything that can fail beside what is in force, the
/// second swaps it in and cannot fail. What it replaced is freed or kept for the next.
struct Renderer::Impl : OnDevice, ViewSet {
  explicit Impl(Device device);

  /// The setters' arguments are checked already.
  /// `views_of_faces`: above 1, the faces of the scene, of one mesh then, are those of so many views, as many of each,
  /// one view after the other, and so are opacities of vertices. All frames have these views, with shapes of their own,
  /// and colours of faces of their own. Such a mesh gives no normals.
  void set_scene(const Scene& scene, std::size_t views_of_faces = 1);
  void set_views(std::span<const View> views, std::size_t first_view);
  /// All that depends on each other in one step: none need suit what was there of the others.
  void set_views(std::span<const View> views, std::size_t first_view, const Smoothing& smoothing,
                 const std::optional<Lights>& lights);
  void set_shapes(std::span<const glm::vec3> positions, std::span<const glm::vec3> colors);
  void set_cull(Cull cull) noexcept;
  void set(const ArrayRef& at, const ArrayValues& values);
  /// As Shade::prepare() takes them; of every view, before the views are set.
  void set_lights(std::span<const Lights> lights);
  /// An array of `count` elements from the device, in place: the host's copy stays what it was.
  void take(const ArrayRef& at, std::size_t count, const FloatVectors& from);
  /// Either may be left out, and then is the scene's.
  void take_shapes(const std::optional<FloatVectors>& positions, const std::optional<FloatVectors>& colors);
  void take_transforms(const FloatVectors& from);
  void take_view_matrices(const FloatVectors& from);
  /// Prepares a smoothing for images of the scene's size, and so many views.
  SmoothingSetting prepare(const Smoothing& smoothing, const Scene& of, std::size_t its_views,
                           std::size_t views_of_faces) const;
  SmoothingSetting prepare(const Smoothing& smoothing) const {
    return prepare(smoothing, scene, views.size(), geometry->views_of_faces);
  }
  void set(SmoothingSetting&& prepared) noexcept;
  /// Enqueues the whole frame where it can be expected to fit into the buffers that the last one left; else
  /// blocks to read the sizes to allocate, as it does where sizes are kept and an earlier frame turns out to
  /// have been emptied.
  void forward(FrameSizes sizes = FrameSizes::read);
  SceneGradient backward(const BufferRef<cl_float4>& grad_images, const AddToGradient& add_to_positions = {});
  /// Its two halves: what the device does, and what the host reads of it.
  void enqueue_backward(const BufferRef<cl_float4>& grad_images, const AddToGradient& add_to_positions = {});
  SceneGradient read_gradient();
  /// Leaves the gradients on the device: `transform.grad_positions`, `grad_colors`, `grad_texcoords`,
  /// `texels->grad`, and `grad_numbers`. Works on the last frame as it is, even if that has been emptied.
  void backward_on_device(const BufferRef<cl_float4>& grad_images);
  /// Throws InvalidArgument unless images have derivatives along the directions.
  void require_tangents(std::span<const SceneTangent> directions) const;
  /// Fills `tangents.shown.images` with the derivatives of the last frame's images. After require_forward() and
  /// require_tangents().
  void tangent(std::span<const SceneTangent> directions);
  std::size_t tangent_bytes() const;
  void cut_for_tangents(std::size_t directions);
  /// Directions that share a pass, of so many.
  std::size_t tangents_together(std::size_t directions) const;
  /// Calls a function of a group's first direction and its number of directions, for groups of those that share a
  /// pass, while vertices and outlines move along the group's.
  void move_in_groups(std::span<const SceneTangent> directions,
                      const std::function<void(std::size_t, std::size_t)>& function);
  void set_layers(cl_uint count) noexcept;
  /// Throws InvalidArgument unless the last frame has samples for shading of the caller's own.
  void require_samples(const char* caller);
  void find_samples();
  /// Writes the gradients of all samples' places, as float4[layer][pixel]: see samples_backward of the kernels.
  using WritePlaces = std::function<void(std::span<cl_float4>)>;
  SceneGradient samples_backward(const WritePlaces& write);
  void require_values(std::span<const float> samples, std::size_t channels) const;
  void resolve(const SampleValues& samples, std::span<float> pixels);
  /// Kept values only after holds_resolved().
  SceneGradient resolve_backward(const SampleValues& samples, std::span<const float> grad_pixels,
                                 std::span<float> grad_samples);
  /// True if what resolve_backward() needs of the last values is there.
  bool holds_resolved() const;
  SamplesTangent samples_tangent(std::span<const SceneTangent> directions);
  void resolve_tangent(std::span<const float> samples, std::size_t channels,
                       std::span<const float> sample_tangents, std::span<const SceneTangent> directions,
                       std::span<float> pixels);
  /// Room for at least so much in all frames of the scene.
  void reserve(const FrameCounts& counts);
  /// Frames like the next one have been found to take so much.
  void expect(const FrameCounts& counts);
  /// Frames of kept sizes that forward() has found emptied since the last call.
  std::size_t take_emptied() { return std::exchange(found_emptied_, 0); }
  /// Fills `aov` for the last frame, if it does not hold that already, emptied or not.
  void render_aov();
  /// Shapes of the views are those of another's views, `copies` times: how their faces wind is what that knows of it.
  void take_windings(const Impl& of, std::size_t copies);
  /// The device alone knows where the mesh's vertices are.
  void forget_positions(std::size_t mesh) noexcept;
  /// Texture coordinates of all meshes' corners; none where a mesh has none.
  std::shared_ptr<CornerTexcoords> corner_texcoords_in_force();

  /// Throws InvalidArgument unless there is an image to work with; `caller` says who wants it. An image is
  /// known to be complete after that: where the last frame's buffers were too small, the frame is rendered
  /// again, and what forward() throws is thrown here.
  void require_scene(const char* caller) const;
  void require_rendered(const char* caller) const;
  void require_forward(const char* caller);
  /// Renders the last frame again if its samples are in bands, so that they are whole: whatever the budget.
  void require_whole();
  std::size_t pixel_count() const {
    return views.size() * static_cast<std::size_t>(scene.width) * static_cast<std::size_t>(scene.height);
  }
  /// Frames of noise on the pixel have no image until it is asked for: samples(), and resolve(), do without.
  bool wants_samples_alone = false;
  bool defers_image() const { return wants_samples_alone && pixel_noise; }
  /// Renders the image of the last frame, if it has none.
  void require_image();
  /// Image of the last frame: [view][height][width] RGBA.
  const Buffer<cl_float4>& image() const { return pixel_noise ? pixel_noise->image : aggregate.image; }
  /// Held in buffers.
  std::size_t bytes() const;

  Scene scene;
  bool has_moved = true;  // vertices have, since the edges were joined; or which of them the frame reads
  bool rendered = false;  // the stages hold the frame of the current scene, or it is on the way
  std::optional<FrameCounts> capacity;      // of the last frame, until it is known to fit
  std::optional<FrameCounts> last_counts;   // of a frame like the next one; none: nothing is to be expected
  std::optional<FrameCounts> reserved;      // by the caller
  std::optional<FrameCounts> known_counts;  // of the last frame whose counts are known: what to launch for
  std::uint64_t frame_number = 0;           // which frame that is, among all renderers'

  float hidden_reach = 0;  // normalised depth behind a triangle from where on nothing is seen; or infinite
  /// Some opacity is, or may be, below 1: nothing is hidden then.
  bool is_see_through = false;
  bool has_device_opacities = false;  // which the host does not know
  cl_uint layers = 1;                 // surfaces of a sample that shading of the caller's own sees

  std::optional<Geometry> geometry;
  std::vector<Band> bands;          // of the last forward()
  std::vector<Range> sample_bands;  // of its samples, rows of tiles; none: they are whole

  Transform transform;
  Setup setup;
  ClipPlanes clip_planes;
  Clip clip;  // of frames with faces that may cross the near plane or the far one
  Bin bin;
  Rasterize rasterize;
  Shade shade;
  std::optional<GeometryColors> geometry_colors;  // of views' own shapes, in place of those that are set
  Occupancy occupancy;
  Opacity opacity;
  Aggregate aggregate;
  std::optional<Texels> texels;           // of textured scenes: made for the first of them
  std::optional<Texels> texel_opacities;  // made for the first scene whose textures have some
  Gather gather;
  Reduce reduce;
  Tangents tangents;
  std::optional<ShownNormals> shown_normals;          // beside colours: see show_normals()
  std::optional<SampledSurface> surface_samples;      // made when first asked for
  std::optional<Exchange> exchange;                   // made when first asked for
  Raster raster;                                      // around the frame
  std::shared_ptr<PixelNoise> pixel_noise;            // made when first asked for; none: the triangles' noise
  std::optional<Auxiliary> aov;                       // made when first asked for
  std::uint64_t aov_frame = 0;                        // the frame it holds
  std::shared_ptr<CornerTexcoords> corner_texcoords;  // of the scene, made when first asked for
  Buffer<cl_float4> aov_surface, aov_coverage;        // of noise on the pixel: Auxiliary::weigh(), as pixels

  Buffer<cl_float4> grad_vertices;          // [view][vertex] by NDC, then by world position; see spare_for()
  Buffer<cl_float4> grad_lit;               // [view][vertex] what shading adds to those by world position
  Buffer<cl_float4> grad_colors;            // [color]
  Buffer<cl_float4> grad_texcoords;         // [texcoord]
  Buffer<float> material_channels;          // [channel][face] in the order of the materials
  Buffer<cl_float4> grad_materials;         // [material] of backward_on_device(), as Geometry's
  Buffer<cl_float4> grad_opacities;         // [opacity] in the first component
  Buffer<float> grad_numbers;               // as GradientMap has them
  std::uint64_t device_gradient_frame = 0;  // the frame of backward_on_device()
  std::optional<GradientMap> gradient_map;  // of the scene and views as they are
  std::vector<SceneGradient> grad_lights;   // of every view's own lights, after read_gradient()

  /// Memory for the gradient of the last frame's images, until the next backward pass, which uses it again.
  Buffer<cl_float4>& room_for_grad_images(std::size_t pixels);
  Exchange& made_exchange();
  /// The gradient of zero sums: all arrays of the last backward pass but those of vertices, colours, texels.
  SceneGradient empty_gradient() const;
  /// True if the gradient of the meshes' arrays is asked for, and a mesh has one.
  bool wants(ArrayId id) const;
  /// Place of a row's gradient after the last backward pass: of a mesh's array, of one of its textures, or of all
  /// views' own shapes. None: not asked for, or not there.
  std::optional<DeviceGradient> mesh_gradient(const GradientRow& row, std::size_t mesh,
                                              std::size_t texture = 0);

 private:
  void fill(ViewSet& prepared, const Scene& of, const Geometry& its, std::span<const View> its_views,
            std::size_t first_view) const;
  void set(ViewSet& prepared) noexcept;
  template <class Element>
  void replace(const ArrayRef& at, std::vector<Element>& held, std::span<const Element> elements);
  Buffer<cl_float4>& spare_for(const Buffer<cl_float4>& buffer);

  ShadeInputs shade_inputs() {
    return {frame, device_views, *geometry, transform, setup.triangles, clip.faces, bin, rasterize};
  }
  /// True if gradients are asked for to which every pixel adds its share.
  bool sums_pixels() const { return scene.gradients.smoothing || scene.gradients.background; }
  ContourInputs contour_inputs() const;
  Blur::Size image_size() const;
  AggregateInputs aggregate_inputs() { return {frame, device_views, bin, rasterize}; }

  void build_pyramids();
  void find_edges();
  void hide_back_faces();
  void set_up();
  std::size_t fragment_bytes() const;
  std::size_t fragment_budget() const;
  std::optional<FrameCounts> expected_capacity() const;
  FrameCounts likely_counts(const FrameCounts& room) const;
  FrameNote learn();
  void forward_within(const FrameCounts& expected, FrameSizes sizes);
  void forward_measured(bool is_whole = false);
  void settle();
  void render_again(bool is_whole = false);
  void follow_opacities();
  /// True if what lies behind the last frame's surfaces has a part in it.
  bool wants_opacities() const { return wants(ArrayId::opacities) || wants(ArrayId::texel_opacities); }
  bool sees_through() const { return is_see_through || opacity.is_bounded(); }
  /// Bands of samples of the next frame; none where the budget holds all of them.
  std::vector<Range> cut_samples() const;
  std::size_t sample_bytes() const;
  std::size_t fragments_of_band() const;
  void forward_in_bands();
  void render_samples(const Range& rows);

  /// The stages from the fragments on: of a band, and backward of the one rendered last.
  void render(const Band& band);
  void find_contours(const std::optional<FrameCounts>& expected);
  void finish_image();
  void shade_and_aggregate();
  void shade_normals();
  void blend_normals();
  void move_normals(std::size_t first);
  void blend_normal_tangents(Buffer<cl_float4>& pixels);
  std::vector<ImageTangents*> shown_tangents();
  void smooth_tangents();
  void differentiate(const BufferRef<cl_float4>& grad_images);
  void differentiate_in_bands(const BufferRef<cl_float4>& grad_images);
  void add_pixel_channels(const Range& rows);

  SceneGradient finish_geometric_gradient();
  void see_layers(cl_uint count);
  void take_group(const SampleValues& samples, std::size_t first);
  void give_group(const SampleValues& samples, std::size_t first, std::span<float> grad);
  /// For Antialias::find_front() of the library's own shading.
  cl_uint front_layers() const { return sees_through() ? 0 : 1; }
  void upload_directions(std::span<const SceneTangent> directions);
  void gather_mesh_gradients(const AddToGradient& add_to_positions);
  void sum_gradients();
  void read_mesh_gradients(SceneGradient& gradient, RowReads& rows);
  /// Adds what was summed to the gradients of the meshes' arrays.
  SceneGradient finish_summed_gradients(std::span<const float> sums, SceneGradient gradient = {}) const;
  GradientMap make_gradient_map() const;
  /// From the sums of all to `grad_lights`.
  void read_lights_of_views(std::span<const float> sums);
  /// From sums by channel to `grad_materials`.
  void join_material_gradients();

  std::size_t found_emptied_ = 0;
  bool follows_opacities_ = false;  // while a frame is rendered again for tangents along them
  cl_uint seen_layers_ = 1;         // through which the last frame's contours are seen: see find_front()
  Buffer<float> own_samples_, own_pixels_, own_tangents_;  // of the caller's shading, packed
  Buffer<cl_float4> own_group_, own_image_, grad_group_;   // four of their channels
  std::uint64_t resolved_ = 0;     // PixelNoise::smoothed() of the last resolve() of at most so many
  Buffer<cl_float4> grad_images_;  // of the triangles' noise: see room_for_grad_images()
  Buffer<float> hidden_;           // [view][mesh] BackFaces::hidden()
  std::vector<float> uploaded_hidden_;
  std::vector<glm::vec3> shape_positions_;  // of views' own shapes, until their windings are known
  std::vector<int> shape_windings_;         // [view][mesh] BackFaces::windings_of()
  bool hides_by_device_ = false;            // Setup::hide() has the last word

  Buffer<float> gradient_sums_;  // of sum_gradients()
  GradientSums summed_;          // what they are

  /// All of `count` elements as a segment of a sum.
  struct Segment {
    const Buffer<cl_uint>& of(Device::Impl& device, std::size_t wanted);

    Buffer<cl_uint> starts;  // [2]
    std::size_t count = 0;
  };
  Segment all_pixels_, all_views_;
  Buffer<float> pixel_parts_;  // of bands of samples: what their pixels' channels add up to

  // Buffers in which the next setter prepares its values.
  ViewSet spare_views_;
  Buffer<cl_float4> spare_values_, spare_view_positions_, spare_view_colors_;
  Buffer<float> packed_;                  // vectors as the host has them
  std::vector<glm::vec3> spare_vectors_;  // of the host
};

}  // namespace dpr
