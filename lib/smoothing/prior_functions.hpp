// The noise's distributions on the host, in double precision.
#pragma once

#include "dpr/smoothing.hpp"

namespace dpr {

/// x with P(X > x) = tail, for tail in (0, 1/2].
double upper_quantile(Prior prior, double tail);

/// The inverse CDF of u in (0, 1).
double quantile(Prior prior, double u);

/// nu'(z) of the density exp(-nu). `prior` is not uniform, which has none.
double score(Prior prior, double z);

}  // namespace dpr
