#include "base/module.hpp"

#include <dlfcn.h>
#include <link.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "dpr/version.hpp"

namespace dpr {
namespace {

/// The folder of the library or the program that holds this code.
std::filesystem::path own_folder() {
  Dl_info info{};
  link_map* map = nullptr;
  if (dladdr1(reinterpret_cast<const void*>(&module_function), &info, reinterpret_cast<void**>(&map),
              RTLD_DL_LINKMAP) == 0) {
    return {};
  }
  // The linker knows no file of the program itself.
  const char* name = map->l_name[0] == '\0' ? "/proc/self/exe" : map->l_name;
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

}  // namespace dpr
