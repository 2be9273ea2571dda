// Embedding in programs with OpenCL objects of their own, by OpenCL's C handles: everything that changes in a
// scene comes from buffers on the device, images and gradients stay in buffers there, and no call waits
// unless it says so. dpr/opencl.hpp does the same with the C++ bindings.
#pragma once

#include <CL/cl.h>

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "dpr/aov.hpp"
#include "dpr/attribute_images.hpp"
#include "dpr/device.hpp"
#include "dpr/export.h"
#include "dpr/renderer.hpp"
#include "dpr/scene_batch.hpp"

namespace dpr {

/// Uses the caller's context and in-order queue instead of making its own. Both are retained. Given an
/// out-of-order queue, it makes an in-order queue of its own for the queue's device and context: what the
/// caller enqueues is ordered with the library's work by events alone, in both directions. Throws
/// InvalidArgument for a queue of another context, DeviceError for what is no queue.
DPR_API Device adopt_device(cl_context context, cl_command_queue queue);

/// Vectors of floats in a buffer of the caller's: a whole one or a sub-buffer, of the device's context. What
/// takes one throws InvalidArgument for a null handle, an image, a buffer of another context, one that
/// kernels may not read or write, one that is too small, and for an offset or stride that is no multiple of
/// 4, is smaller than a vector or is 2^34 or more.
struct BufferSpan {
  cl_mem buffer = nullptr;
  std::size_t offset = 0;  ///< bytes before the first vector
  /// Bytes from one vector to the next; 0: they are packed, 12 bytes for three floats.
  std::size_t stride = 0;
};

/// Vectors of floats in a buffer of the library's. The handle is not retained for the caller; the buffer is
/// replaced where the function that gives the view says so.
struct BufferView {
  cl_mem buffer = nullptr;
  std::size_t offset = 0, stride = 0;  ///< bytes
  std::size_t count = 0;               ///< vectors
  std::size_t components = 0;          ///< floats of each; what lies between a vector and the next is unused

  BufferSpan span() const { return {buffer, offset, stride}; }
};

/// Events that a call's work waits for, and the place of its own event. On an in-order queue of the caller's
/// own neither is needed for what is enqueued there before and after the call. Events of other queues have to
/// be flushed there, as OpenCL asks for. Throws InvalidArgument for an event of another context.
struct Events {
  std::span<const cl_event> wait = {};
  cl_event* done = nullptr;  ///< receives one that the caller releases: the call's work has run
};

// The setters of Renderer, from buffers. They enqueue a copy into the renderer, which no later change of the
// buffer reaches before the next call. Numbers that are not finite count as 0. Renderer::scene() and views()
// keep the values that the host has given. The host does not know where vertices are then: every frame is
// prepared for faces that cross the near or far plane, and noise on the pixel keeps the faces that look away in a
// closed mesh: until Renderer::set_positions() of each such mesh, and Renderer::set_views() for matrices.
// Faces with vertices of their own are one surface where these coincide, found anew on the device.

/// Renderer::set_array().
DPR_API void set_array(Renderer& renderer, const ArrayRef& array, const BufferSpan& values,
                       const Events& events = {});
/// Positions of a mesh of the scene: [vertex] of three floats, object space.
inline void set_positions(Renderer& renderer, std::size_t mesh, const BufferSpan& positions,
                          const Events& events = {}) {
  set_array(renderer, {ArrayId::positions, mesh}, positions, events);
}
/// [vertex] or [face], as the mesh has them, of three floats.
inline void set_colors(Renderer& renderer, std::size_t mesh, const BufferSpan& colors,
                       const Events& events = {}) {
  set_array(renderer, {ArrayId::colors, mesh}, colors, events);
}
/// [height * width] of three floats, linear RGB.
inline void set_texels(Renderer& renderer, std::size_t mesh, std::size_t texture, const BufferSpan& texels,
                       const Events& events = {}) {
  set_array(renderer, {ArrayId::texels, mesh, texture}, texels, events);
}
/// [texcoord] of two floats. Noise on the pixel goes on with the seams of the last coordinates that the host
/// has given.
inline void set_texcoords(Renderer& renderer, std::size_t mesh, const BufferSpan& texcoords,
                          const Events& events = {}) {
  set_array(renderer, {ArrayId::texcoords, mesh}, texcoords, events);
}
/// [normal] of three floats, object space, of any length. Noise on the pixel goes on with the edges at which
/// the last normals that the host has given jump.
inline void set_normals(Renderer& renderer, std::size_t mesh, const BufferSpan& normals,
                        const Events& events = {}) {
  set_array(renderer, {ArrayId::normals, mesh}, normals, events);
}
/// [material] of four floats: RGB of the specular coefficient, and the shininess; one below 1 is the lights'.
inline void set_materials(Renderer& renderer, std::size_t mesh, const BufferSpan& materials,
                          const Events& events = {}) {
  set_array(renderer, {ArrayId::materials, mesh}, materials, events);
}
/// [vertex] or [face], as the mesh has them; from 0 to 1, which is not checked.
inline void set_opacities(Renderer& renderer, std::size_t mesh, const BufferSpan& opacities,
                          const Events& events = {}) {
  set_array(renderer, {ArrayId::opacities, mesh}, opacities, events);
}
/// [height * width] of a texture that has some; from 0 to 1, which is not checked.
inline void set_texel_opacities(Renderer& renderer, std::size_t mesh, std::size_t texture,
                                const BufferSpan& opacities, const Events& events = {}) {
  set_array(renderer, {ArrayId::texel_opacities, mesh, texture}, opacities, events);
}
/// Renderer::set_shapes(): [view][vertex] and [view][color] of three floats. One without a buffer is the
/// scene's.
DPR_API void set_shapes(Renderer& renderer, const BufferSpan& positions, const BufferSpan& colors,
                        const Events& events = {});
/// Object to world, [view][mesh] of twelve floats: the upper three rows of a matrix that acts on columns, row
/// by row. A stride of 64 skips the last row. Until the next Renderer::set_views().
DPR_API void set_transforms(Renderer& renderer, const BufferSpan& transforms, const Events& events = {});

/// World to camera, [view] of twelve floats as set_transforms() has them; the rest of the cameras stays what
/// it is, until the next Renderer::set_views(). Backward passes throw InvalidArgument for the gradient of
/// cameras in lit scenes then.
DPR_API void set_view_matrices(Renderer& renderer, const BufferSpan& matrices, const Events& events = {});

/// Room of frames: at most 3435973832 of each, which with the headroom of buffers are fewer than
/// 2^32.
struct FrameRoom {
  std::size_t pairs = 0, fragments = 0;  ///< as RenderStatistics counts them
  /// With noise on the pixel: (8x8 tile, contour) pairs. An edge becomes a contour where colours that are
  /// optimized part on its two sides.
  std::size_t contours = 0;
};

/// Makes frames of forward_on_device() certain that need no more than this; until the next set_scene().
/// Throws InvalidArgument for more than FrameRoom can say.
DPR_API void reserve(Renderer& renderer, const FrameRoom& room);

/// Renderer::forward() for a program that keeps everything on the device: enqueues the frame, and neither
/// waits nor reads. What the host cannot count, it makes room for: as much as reserve() asks for, and a
/// quarter more than the last frame took of which it knows the counts. A frame that exceeds its room is
/// emptied: it has the image and the gradients of one in which nothing is visible.
///
/// The host learns the counts from the first frame of a scene, and of another number of views, unless there
/// is reserve(); and from whatever needs a whole frame: Renderer::image(), statistics(), frame_history(), ...
/// That waits for the device, as do a frame in several bands and the first with noise on the pixel. Every
/// frame's counts, 16 bytes, also follow it without a wait: the first call after they have arrived makes room
/// for them. A program that enqueues frames faster than the device renders them has the room of earlier
/// frames; one that lets the device finish at times loses none to growth of less than a quarter in between.
///
/// @return how many frames are known by now to have been emptied that no call has returned yet. Where there
/// are any, this frame is not one of them: the call waits for the device to count it.
DPR_API std::size_t forward_on_device(Renderer& renderer, const Events& events = {});

/// Room that frames of forward_on_device() took since the last call.
struct FrameHistory {
  std::size_t emptied = 0;  ///< frames that exceeded the room
  FrameRoom largest;        ///< exceeding or not; fragments of frames whose pairs fitted
};

/// Waits for the device. Later frames have room for the largest, and a quarter more. Emptied frames that it
/// returns are in no later result of forward_on_device().
DPR_API FrameHistory frame_history(Renderer& renderer);
/// The same for kernels: four unsigned numbers, pairs, fragments, contours and frames emptied. Valid as long
/// as the renderer.
DPR_API BufferView frame_history_view(Renderer& renderer);

/// Enqueues the backward pass of the last frame as it is, emptied or not, for gradients that stay on the
/// device: what GradientRequest asks for, to single precision, not checked for being finite. Neither waits
/// nor reads, but for the first after a change of the views, lights, smoothing or request by the host.
/// `grad_images`: d loss / d image, [view][height][width] of four floats; packed and at offset 0 it is
/// not copied, except with noise on the pixel wider than eight samples
DPR_API void backward_on_device(Renderer& renderer, const BufferSpan& grad_images, const Events& events = {});

/// The images, float4 RGBA [view][height][width]. An emptied frame's image is valid too. Valid until the
/// next set_scene(), set_views() or set_smoothing(); written by forward() and forward_on_device().
DPR_API BufferView image_view(Renderer& renderer);
/// Copies them, four floats each.
DPR_API void copy_images(Renderer& renderer, const BufferSpan& images, const Events& events = {});

/// A gradient of the last backward_on_device() by the name that gradient files and messages have for it:
/// "meshes[0].positions", "meshes[0].colors", "meshes[0].texcoords", "meshes[0].textures[0]",
/// "meshes[0].normals", "meshes[0].specular", "meshes[0].shininess", "shapes.positions",
/// "views[0].meshes[0].rotation", "views[0].camera.translation", "lights.point[0].diffuse", "sigma",
/// "background", ... Arrays are [vertex] and so on as SceneGradient has them. Numbers are packed, and those
/// of one name lie side by side in the order of views, then meshes or lights. Valid until the next
/// set_scene(), set_views(), set_shapes(), set_lights(), set_smoothing() or set_gradients(); written by
/// backward_on_device(). Throws InvalidArgument for a gradient that the scene does not have or did not ask
/// for, and before the first backward_on_device(). Of what an entry of Scene::meshes that is an instance
/// shares with others, the gradients are the mesh's; its rotation and translation are its own.
DPR_API BufferView gradient_view(Renderer& renderer, const std::string& name);
/// Copies one.
DPR_API void copy_gradient(Renderer& renderer, const std::string& name, const BufferSpan& gradient,
                           const Events& events = {});

/// An auxiliary output of the last frame as it is, [view][height][width] of as many floats as
/// AuxiliaryOutputs has it, but for face_id, which are int32. Enqueues an aggregation backward pass where
/// none of the outputs of that frame was asked for before; neither waits nor reads, but for the first of a
/// scene with texture coordinates, and frames in several bands. Alpha is that of image_view(). Valid until
/// the next frame whose outputs are asked for. They have no gradients: AttributeImages have. Throws
/// InvalidArgument for uv of meshes without texture coordinates.
DPR_API BufferView aov_view(Renderer& renderer, Aov aov, const Events& events = {});
/// Copies one, face_id as int32 too.
DPR_API void copy_aov(Renderer& renderer, Aov aov, const BufferSpan& outputs, const Events& events = {});

// Images of attributes without the host: what AttributeImages has, as the functions above have what Renderer
// has, and with the same rules for frames that exceed their room. The room is that of a frame with one view
// for each view and three channels, in the barrier composition one more; contours are where numbers jump.

/// AttributeImages::set_values(): [vertex] of `channels` floats, of all meshes one after the other.
DPR_API void set_values(AttributeImages& images, const BufferSpan& values, std::size_t vertices,
                        const Events& events = {});
DPR_API void reserve(AttributeImages& images, const FrameRoom& room);
/// AttributeImages::forward(), of the renderer's scene as it is now, wherever its parts have come from. The
/// first, and one after a change of the scene, views, smoothing or request by the host, waits to follow it.
DPR_API std::size_t forward_on_device(AttributeImages& images, const Renderer& renderer,
                                      const Events& events = {});
DPR_API FrameHistory frame_history(AttributeImages& images);
/// The images, float4 [group][view][height][width]: RGB, and A. Valid until the next forward pass.
DPR_API BufferView image_view(const AttributeImages& images);
DPR_API void copy_images(AttributeImages& images, const BufferSpan& to, const Events& events = {});
/// `grad_images`: d loss / d image, [group][view][height][width] of four floats
DPR_API void backward_on_device(AttributeImages& images, const BufferSpan& grad_images,
                                const Events& events = {});
/// Those of AttributeImages::backward(), by the names of gradient_view(renderer): "meshes[0].positions",
/// "meshes[0].texcoords", "shapes.positions", "views[0].meshes[0].rotation", "views[0].camera.translation",
/// "sigma", ...; and "values", [vertex] of `channels` floats, the caller's.
DPR_API BufferView gradient_view(AttributeImages& images, const std::string& name);
DPR_API void copy_gradient(AttributeImages& images, const std::string& name, const BufferSpan& gradient,
                           const Events& events = {});

/// The rendered images, float4 RGBA [view][height][width], as forward() leaves them on the device. Not
/// retained: valid until the next forward() that needs a larger buffer. Work enqueued on the device's queue
/// after forward() sees the finished image. Blocks where it is not known that the frame fitted its room.
/// Throws InvalidArgument where there is no image.
DPR_API cl_mem image_handle(const Renderer& renderer);

/// Runs the backward pass from a buffer of d loss / d image, float4 RGBA [view][height][width], on the
/// device's context, and waits for it. Throws InvalidArgument for a buffer of another context, or one that is
/// too small.
DPR_API SceneGradient backward(Renderer& renderer, cl_mem grad_images);

/// The same of the images of all scenes. The view is valid until the batch's next forward(); blocks where it
/// is not known that the frames fitted their room.
DPR_API BufferView image_view(SceneBatch& batch);
DPR_API std::vector<SceneGradient> backward(SceneBatch& batch, cl_mem grad_images);

}  // namespace dpr
