#include "stages/exchange.hpp"

namespace dpr {
namespace {

cl_uint4 layout(const FloatVectors& v) {
  return {{to_uint(v.first), to_uint(v.stride), to_uint(v.rows), to_uint(v.components)}};
}

bool are_packed(const FloatVectors& v) { return v.rows == 1 && v.components >= 1 && v.components <= 4; }
/// Elements of a buffer of vectors.
bool are_rows(const FloatVectors& v) {
  return v.rows == 1 && v.components == 4 && v.stride == 4 && v.first % 4 == 0;
}

}  // namespace

FloatVectors vectors_of(const Buffer<cl_float4>& buffer, std::size_t first, std::size_t components) {
  return {buffer.cl_buffer()(), 4 * first, 4, components};
}

FloatVectors vectors_of(const Buffer<float>& buffer, std::size_t first, std::size_t components) {
  return {buffer.cl_buffer()(), first, components, components};
}

void Exchange::take(const FloatVectors& from, std::size_t count, Buffer<cl_float4>& to, std::size_t first) {
  copy(from, count, vectors_of(to, first, 4), true);
}

void Exchange::take(const FloatVectors& from, std::size_t count, Buffer<float>& to, std::size_t components) {
  copy(from, count, vectors_of(to, 0, components), true);
}

void Exchange::take_cameras(const FloatVectors& from, std::size_t count, bool orthographic,
                            Buffer<shared::ViewParams>& cameras) {
  launch_(count, kernel::exchange_cameras{.count = to_uint(count),
                                          .from = layout(from),
                                          .orthographic = cl_uint{orthographic},
                                          .source = BufferRef<float>(from.buffer),
                                          .views = cameras});
}

void Exchange::give(const FloatVectors& from, std::size_t count, const FloatVectors& to) {
  copy(from, count, to, false);
}

void Exchange::copy(const FloatVectors& from, std::size_t count, const FloatVectors& to, bool clean) {
  if (are_packed(from) && are_rows(to)) {
    launch_(count, kernel::exchange_unpack{.count = to_uint(count),
                                           .first = to_uint(to.first / 4),
                                           .layout = layout(from),
                                           .clean = cl_uint{clean},
                                           .packed = BufferRef<cl_uint>(from.buffer),
                                           .rows = BufferRef<cl_uint4>(to.buffer)});
    return;
  }
  if (are_rows(from) && are_packed(to) && !clean) {
    launch_(count, kernel::exchange_pack{.count = to_uint(count),
                                         .first = to_uint(from.first / 4),
                                         .layout = layout(to),
                                         .rows = BufferRef<cl_uint4>(from.buffer),
                                         .packed = BufferRef<cl_uint>(to.buffer)});
    return;
  }
  launch_(count, kernel::exchange_vectors{.vectors = to_uint(count),
                                          .from = layout(from),
                                          .to = layout(to),
                                          .clean = cl_uint{clean},
                                          .source = BufferRef<cl_uint>(from.buffer),
                                          .target = BufferRef<cl_uint>(to.buffer)});
}

void Exchange::map(const SparseMap& map, const Buffer<float>& sums, Buffer<float>& numbers) {
  numbers.resize(device_, map.numbers);
  launch_(map.numbers, kernel::exchange_map{.numbers = to_uint(map.numbers),
                                            .starts = map.starts,
                                            .terms = map.terms,
                                            .factors = map.factors,
                                            .sums = sums,
                                            .values = numbers});
}

}  // namespace dpr
