// Code shared by the functions of dpr/opencl_handles.hpp.
#pragma once

#include <optional>
#include <string>

#include "renderer/buffer_span.hpp"
#include "renderer/renderer_impl.hpp"

namespace dpr {

/// Runs `work` after what it waits for, and before its event.
template <class Work>
void enqueue(const Device::Impl& device, const Events& events, const Work& work) {
  require_events(device, events);
  begin(device, events);
  work();
  end(device, events);
}

/// Copies a view to the caller's buffer, which messages call `name`.
void copy_view(Renderer::Impl& m, const BufferView& view, const BufferSpan& to, const Events& events,
               const char* name);

/// `count` pixels of d loss / d image where kernels can read them as they are, or in a copy of ours.
BufferRef<cl_float4> gradient_of_images(Renderer::Impl& m, const FloatVectors& from, std::size_t count);

/// Throws InvalidArgument for texture coordinates of a scene in which a mesh has none.
void require_shown(const Scene& scene, Aov aov);

/// Throws InvalidArgument for more than can be counted.
FrameCounts counts_of(const FrameRoom& room);
/// Waits for the device.
FrameHistory history_of(Renderer::Impl& m);

/// The array of that name among numbers in the order of the summed arrays of a gradient; none if there is no
/// such array that the renderer's scene has and asks for.
std::optional<BufferView> summed_view(SceneGradient& arrays, const Renderer::Impl& m,
                                      const Buffer<float>& numbers, const std::string& name);

}  // namespace dpr
