// How calls of the C interface fail, and what they said.
#include <new>

#include "c/handles.hpp"
#include "dpr/version.hpp"

namespace dpr::c {
namespace {

thread_local std::string last_error;

dpr_status fail(dpr_status status, const char* message) noexcept {
  try {
    last_error = message;
  } catch (...) {
    last_error.clear();  // no memory for the message
  }
  return status;
}

}  // namespace

dpr_status status_of_exception() noexcept {
  try {
    throw;
  } catch (const InvalidArgument& error) {
    return fail(DPR_INVALID_ARGUMENT, error.what());
  } catch (const IoError& error) {
    return fail(DPR_IO_ERROR, error.what());
  } catch (const DeviceError& error) {
    return fail(DPR_DEVICE_ERROR, error.what());
  } catch (const BuildError& error) {
    return fail(DPR_BUILD_ERROR, error.what());
  } catch (const std::bad_alloc&) {
    return fail(DPR_OUT_OF_MEMORY, "out of memory");
  } catch (const std::exception& error) {
    return fail(DPR_INTERNAL_ERROR, error.what());
  } catch (...) {
    return fail(DPR_INTERNAL_ERROR, "an error without a description");
  }
}

}  // namespace dpr::c

const char* dpr_last_error() { return dpr::c::last_error.c_str(); }
const char* dpr_version() { return DPR_VERSION; }
