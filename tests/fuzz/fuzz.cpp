// libFuzzer's entry; DPR_FUZZ_TARGET is the name of the target that the program is for.
#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "fuzz/targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const dpr::fuzz::Target& target =
      *std::ranges::find(dpr::fuzz::targets(), DPR_FUZZ_TARGET, &dpr::fuzz::Target::name);
  dpr::fuzz::accepts(target, {reinterpret_cast<const char*>(data), size});
  return 0;
}
