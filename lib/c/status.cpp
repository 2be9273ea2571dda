// Failures of the C interface's calls, their messages, and the list of its handles.
#include <mutex>
#include <new>
#include <string_view>
#include <unordered_map>

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

struct Handles {
  std::mutex mutex;
  std::unordered_map<const void*, const char*> kinds;
};

/// Lives as long as the process: handles may be destroyed by destructors of the caller's static objects.
Handles& handles() {
  static Handles& all = *new Handles;
  return all;
}

std::unordered_map<const void*, const char*>::iterator found(Handles& all, const void* handle,
                                                             std::string_view kind, const char* argument) {
  const auto it = all.kinds.find(handle);
  if (it != all.kinds.end() && it->second == kind) return it;
  throw InvalidArgument(
      argument,
      it != all.kinds.end() ? std::string("a ") + it->second : "no handle, or one that is destroyed already",
      "a " + std::string(kind));
}

}  // namespace

void remember_handle(const void* handle, const char* kind) {
  const std::lock_guard lock(handles().mutex);
  handles().kinds.insert_or_assign(handle, kind);
}

void require_handle(const void* handle, const char* kind, const char* argument) {
  const std::lock_guard lock(handles().mutex);
  found(handles(), handle, kind, argument);
}

void forget_handle(const void* handle, const char* kind) {
  const std::lock_guard lock(handles().mutex);
  handles().kinds.erase(found(handles(), handle, kind, kind));
}

void require_none_emptied(std::size_t frames) {
  if (frames == 0) return;
  throw FramesEmptied("frames on the device: " + std::to_string(frames) +
                      " needed more room than they had and were emptied; this one has it");
}

dpr_status status_of_exception() noexcept {
  try {
    throw;
  } catch (const FramesEmptied& emptied) {
    return fail(DPR_FRAME_EMPTIED, emptied.what());
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
