// Sums with Neumaier's compensation: sensitivities cancel heavily, and a plain sum would lose what is left.
#ifndef DPR_COMPENSATED_H
#define DPR_COMPENSATED_H

/// Adds x to a sum and its running error (Neumaier 1974). Adding zero changes no bit of either. The
/// comparison of vectors is all ones where it holds, as select() wants it, and that of scalars 1. Not
/// contracted: x may be a product, of which both lines have to see the same rounded value.
#define DPR_COMPENSATED_ADD(name, type)                                      \
  static inline void name(type* sum, type* error, type x) {                  \
    _Pragma("OPENCL FP_CONTRACT OFF") const type t = *sum + x;               \
    *error += select((x - t) + *sum, (*sum - t) + x, fabs(*sum) >= fabs(x)); \
    *sum = t;                                                                \
  }

#endif
