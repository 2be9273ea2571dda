// The priors that tests walk.
#pragma once

#include <vector>

#include "dpr/smoothing.hpp"
#include "smoothing/priors.hpp"

namespace dpr::test {

/// Those whose gradients can be sampled.
inline const std::vector<Prior> k_sampled_priors = [] {
  std::vector<Prior> list;
  for (const PriorRow& row : priors()) {
    if (row.has_score()) list.push_back(row.prior);
  }
  return list;
}();

}  // namespace dpr::test
