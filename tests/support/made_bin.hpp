// The pairs of frames that tests make by hand.
#pragma once

#include <vector>

#include "stages/bin.hpp"
#include "support/probe.hpp"

namespace dpr::test {

/// Fills a bin with pairs of these faces, whose number the device knows too.
inline void make_pairs(Bin& bin, const std::vector<cl_uint>& faces) {
  bin.pairs = bin.launched = faces.size();
  bin.pair_count.upload(device_impl(), std::vector<cl_uint>{static_cast<cl_uint>(faces.size())});
  bin.pair_face.upload(device_impl(), faces);
}

}  // namespace dpr::test
