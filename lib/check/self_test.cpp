#include "check/self_test.hpp"

#include <array>
#include <exception>

#include "check/check_log.hpp"

namespace dpr::check {
namespace {

struct Part {
  const char* stages;
  void (*run)(const Device&, CheckLog&);
};

constexpr std::array k_parts{
    Part{"scan, sort, reduce", check_lists},
    Part{"transform to aggregate", check_frame},
    Part{"shade", check_microfacets},
    Part{"clip", check_clipping},
    Part{"aggregate", check_aggregation},
    Part{"sampled stages", check_sampling},
    Part{"contour, antialias, blur", check_pixel_noise},
    Part{"tangents", check_tangents},
    Part{"losses", check_losses},
};

}  // namespace

void self_test(const Device& device, const std::function<void(const CheckRow&)>& on_row) {
  CheckLog log(on_row);
  for (const Part& part : k_parts) {
    try {
      part.run(device, log);
    } catch (const std::exception& error) {
      // Not the library's errors alone: a count that a kernel left wrong may ask for any memory.
      log.add_failure(part.stages, error.what());
    }
  }
}

}  // namespace dpr::check
