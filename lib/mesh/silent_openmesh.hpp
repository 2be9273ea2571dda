// Keeps OpenMesh from writing to std::cerr and std::clog what it finds strange.
#pragma once

#include <OpenMesh/Core/System/omstream.hh>

namespace dpr {

/// Silence as long as it lives.
class SilentOpenMesh {
 public:
  SilentOpenMesh() {
    omerr().disable();
    omlog().disable();
  }
  ~SilentOpenMesh() {
    if (errors_were_on_) omerr().enable();
    if (log_was_on_) omlog().enable();
  }
  SilentOpenMesh(const SilentOpenMesh&) = delete;
  SilentOpenMesh& operator=(const SilentOpenMesh&) = delete;

 private:
  bool errors_were_on_ = omerr().is_enabled(), log_was_on_ = omlog().is_enabled();
};

}  // namespace dpr
