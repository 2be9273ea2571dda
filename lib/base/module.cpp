#include "base/module.hpp"

#include <dlfcn.h>
#ifdef __APPLE__
#include <mach-o/dyld.h>
#else
#include <sys/auxv.h>
#endif

#include <climits>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "dpr/version.hpp"

namespace dpr {
namespace {

/// The library or the program that an address lies in; zeros if there is none.
Dl_info object_at(const void* address) {
  Dl_info info{};
  return dladdr(address, &info) != 0 ? info : Dl_info{};
}

/// The folder of the library or the program that holds this code.
std::filesystem::path own_folder() {
  const Dl_info own = object_at(reinterpret_cast<const void*>(&module_function));
  std::filesystem::path name = own.dli_fname != nullptr ? own.dli_fname : "";
#ifndef __APPLE__
  // The linker calls the program itself by the first word of its command line, which need be no path.
  const Dl_info program = object_at(reinterpret_cast<const void*>(getauxval(AT_PHDR)));
  if (own.dli_fbase == program.dli_fbase) name = running_program();
#endif
  std::error_code error;
  const std::filesystem::path file = std::filesystem::canonical(name, error);
  return error ? std::filesystem::path() : file.parent_path();
}

void* open_module(const std::string& file) {
  const std::filesystem::path own = own_folder();
  for (const std::filesystem::path& folder : {own, own / DPR_LIBRARY_FOLDER}) {
    std::error_code error;
    if (!own.empty() && std::filesystem::exists(folder / file, error))
      return dlopen((folder / file).c_str(), RTLD_LAZY | RTLD_LOCAL);
  }
  return dlopen(file.c_str(), RTLD_LAZY | RTLD_LOCAL);
}

std::string last_error() {
  const char* reason = dlerror();
  return reason ? reason : "no reason is given";
}

}  // namespace

std::filesystem::path running_program() {
#ifdef __APPLE__
  char path[PATH_MAX];
  std::uint32_t size = sizeof path;
  if (_NSGetExecutablePath(path, &size) != 0) throw std::runtime_error("the program's path is too long");
  return path;
#else
  return "/proc/self/exe";
#endif
}

void* module_function(const char* name, const char* function) {
  const std::string file = std::string("libdpr_") + name + "-" + DPR_VERSION + ".so";
  void* module = open_module(file);
  void* found = module ? dlsym(module, function) : nullptr;
  if (!found) {
    throw std::runtime_error("a part of dpr cannot be loaded: " + last_error() +
                             " (programs that read or write images link dpr::image too)");
  }
  return found;
}

std::filesystem::path command_file() {
  const std::filesystem::path own = own_folder();
  for (const std::filesystem::path& folder : {own, own / DPR_PROGRAM_FOLDER, own / "../bin"}) {
    std::error_code error;
    if (!own.empty() && std::filesystem::is_regular_file(folder / "dpr", error)) return folder / "dpr";
  }
  return {};
}

}  // namespace dpr
