// Everything but the header with OpenCL types (dpr/opencl.hpp).
#pragma once

// Refused by name: a program whose containers have another layout than the library's links, and crashes.
#if defined(_GLIBCXX_DEBUG)
#error "dpr needs the standard library without _GLIBCXX_DEBUG (_GLIBCXX_ASSERTIONS, and dpr/dpr.h, go with it)"
#endif

#include "dpr/adaptive_smoothing.hpp"
#include "dpr/annealed_smoothing.hpp"
#include "dpr/aov.hpp"
#include "dpr/attribute_images.hpp"
#include "dpr/camera.hpp"
#include "dpr/clip_space.hpp"
#include "dpr/device.hpp"
#include "dpr/error.hpp"
#include "dpr/image.hpp"
#include "dpr/image_loss.hpp"
#include "dpr/light.hpp"
#include "dpr/mesh.hpp"
#include "dpr/mesh_loss.hpp"
#include "dpr/multi_device.hpp"
#include "dpr/notes.hpp"
#include "dpr/optimizer.hpp"
#include "dpr/photographs.hpp"
#include "dpr/pose.hpp"
#include "dpr/pose_tracker.hpp"
#include "dpr/pose_views.hpp"
#include "dpr/renderer.hpp"
#include "dpr/sampling_error.hpp"
#include "dpr/scene.hpp"
#include "dpr/scene_batch.hpp"
#include "dpr/shape.hpp"
#include "dpr/smoothing.hpp"
#include "dpr/smoothing_options.hpp"
#include "dpr/subdivision.hpp"
#include "dpr/texture.hpp"
#include "dpr/version.hpp"
#include "dpr/voxels.hpp"
