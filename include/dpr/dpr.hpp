// Everything but the header with OpenCL types (dpr/opencl.hpp).
#pragma once

#include "dpr/adaptive_smoothing.hpp"
#include "dpr/annealed_smoothing.hpp"
#include "dpr/camera.hpp"
#include "dpr/device.hpp"
#include "dpr/error.hpp"
#include "dpr/image.hpp"
#include "dpr/light.hpp"
#include "dpr/loss.hpp"
#include "dpr/mesh.hpp"
#include "dpr/optimizer.hpp"
#include "dpr/perturbed_pose.hpp"
#include "dpr/pose.hpp"
#include "dpr/renderer.hpp"
#include "dpr/scene.hpp"
#include "dpr/smoothing.hpp"
