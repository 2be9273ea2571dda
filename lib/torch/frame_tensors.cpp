#include "torch/frame_tensors.hpp"

#include <ATen/ATen.h>

#include <utility>

#include "dpr/error.hpp"

namespace dpr::torch_op {
namespace {

struct FrameOwner {
  std::unique_ptr<Frame> frame;
  unsigned char byte = 0;
};

void delete_frame_owner(void* owner) { delete static_cast<FrameOwner*>(owner); }

}  // namespace

at::Tensor tensor_of(std::unique_ptr<Frame> frame) {
  auto* const owner = new FrameOwner{std::move(frame)};
  return at::for_blob(&owner->byte, {1}).context(owner, delete_frame_owner).options(at::kByte).make_tensor();
}

Frame& frame_of(const at::Tensor& tensor) {
  const c10::Storage& storage = tensor.storage();
  if (storage.data_ptr().get_deleter() != delete_frame_owner) {
    throw InvalidArgument("frame (dpr::render)", "a copy of it", "the tensor that dpr::_render returned");
  }
  return *static_cast<FrameOwner*>(storage.data_ptr().get_context())->frame;
}

}  // namespace dpr::torch_op
