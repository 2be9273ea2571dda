// Sums over cells of an image from which the uncertainty of a pose is judged. Arrays are as normal_equations.cl has
// them.

/// Sums of a cell beside those of directions.
#define DPR_CELL_SUMS 6

/// Sums over square cells of an image, of one view: its scores w P^T r by direction, from which the host finds how
/// far they go together; then w and the mask's weight, each times the sum over directions of `units` |P|^2, which
/// tell how much of what the pose rests on the robust loss keeps; then w r by channel, and w^2 r^2, which tell how
/// far residuals go together. One work-item per cell and sum.
/// in   width   of the image
/// in   side    of a cell, pixels
/// in   cells   of the image, row by row
/// in   units   float[direction]  inverse squares
/// in   kinds   of what is measured, DPR_MEASURED_KINDS or 0; its residuals are in the scores alone
/// out  sums    float[directions + DPR_CELL_SUMS][cell]
kernel void normal_cells(const uint directions, const uint pixels, const uint width, const uint side,
                         const uint cells, const uint kinds, global const float* restrict units,
                         global const float* restrict weights, global const float* restrict residuals,
                         global const float* restrict measured, global const float* restrict left,
                         global const float* restrict moved, global float* restrict sums) {
  const uint i = (uint)get_global_id(0), part = i / cells, cell = i % cells;
  if (part >= directions + DPR_CELL_SUMS) return;
  const uint columns = (width + side - 1) / side;
  const uint first_row = cell / columns * side, first_column = cell % columns * side;
  const uint last_row = min(first_row + side, pixels / width), last_column = min(first_column + side, width);
  float sum = 0.0f;
  for (uint row = first_row; row < last_row; ++row) {
    for (uint column = first_column; column < last_column; ++column) {
      const uint pixel = row * width + column;
      const float weight = residuals[3 * (size_t)pixels + pixel];
      float product = 0.0f;
      if (part < directions) {
        for (uint c = 0; c < kinds; ++c)
          sum += measured[c * (size_t)pixels + pixel] * moved[(kinds * part + c) * (size_t)pixels + pixel];
        for (uint c = 0; c < 3; ++c)
          product += residuals[c * (size_t)pixels + pixel] * left[(3 * part + c) * (size_t)pixels + pixel];
      } else if (part >= directions + 5) {
        for (uint c = 0; c < 3; ++c)
          product += weight * residuals[c * (size_t)pixels + pixel] * residuals[c * (size_t)pixels + pixel];
      } else if (part >= directions + 2) {
        product = residuals[(part - directions - 2) * (size_t)pixels + pixel];
      } else {
        for (uint k = 0; k < 3 * directions; ++k)
          product += units[k / 3] * left[k * (size_t)pixels + pixel] * left[k * (size_t)pixels + pixel];
      }
      sum += (part == directions + 1 ? weights[pixel] : weight) * product;
    }
  }
  sums[i] = sum;
}
