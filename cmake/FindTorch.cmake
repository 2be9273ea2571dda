# Finds libtorch by its files: that of CMAKE_PREFIX_PATH, which may be torch.utils.cmake_prefix_path of a Python, or else
# the system's. The package config that comes with it sets compiler flags and C++14 for whole projects, and looks for
# protobuf, CUDA and more that nothing here needs; and Debian's names libraries that do not exist.
#
# Torch_VERSION is its release, as 1.13.0. Torch_CXX11_ABI is 0 where its strings are those of before C++11, as in PyPI's
# wheels until some 2.6: then the whole project must be compiled so.
set(torch_hints ${CMAKE_PREFIX_PATH})
list(TRANSFORM torch_hints APPEND /../..)  # from share/cmake
find_path(Torch_INCLUDE_DIR torch/csrc/api/include/torch/torch.h HINTS ${torch_hints} PATH_SUFFIXES include)
find_library(Torch_LIBRARY torch HINTS ${torch_hints})
find_library(Torch_CPU_LIBRARY torch_cpu HINTS ${torch_hints})
find_library(Torch_C10_LIBRARY c10 HINTS ${torch_hints})

set(Torch_VERSION "")
foreach(header torch/headeronly/version.h torch/csrc/api/include/torch/version.h)
  if(NOT Torch_VERSION AND EXISTS ${Torch_INCLUDE_DIR}/${header})
    file(STRINGS ${Torch_INCLUDE_DIR}/${header} torch_numbers REGEX "define TORCH_VERSION_(MAJOR|MINOR|PATCH) [0-9]+")
    list(TRANSFORM torch_numbers REPLACE ".* " "")
    list(JOIN torch_numbers "." Torch_VERSION)
  endif()
endforeach()
set(Torch_CXX11_ABI 1)
if(Torch_C10_LIBRARY)
  # c10::Error(SourceLocation, std::string)
  file(STRINGS ${Torch_C10_LIBRARY} torch_old_strings REGEX "^_ZN3c105ErrorC2ENS_14SourceLocationESs")
  if(torch_old_strings)
    set(Torch_CXX11_ABI 0)
  endif()
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Torch
  REQUIRED_VARS Torch_LIBRARY Torch_CPU_LIBRARY Torch_C10_LIBRARY Torch_INCLUDE_DIR
  VERSION_VAR Torch_VERSION)
mark_as_advanced(Torch_LIBRARY Torch_CPU_LIBRARY Torch_C10_LIBRARY Torch_INCLUDE_DIR)

if(Torch_FOUND AND NOT TARGET Torch::Torch)
  add_library(Torch::Torch UNKNOWN IMPORTED)
  # Its headers count as the system's: they would not pass the warnings of this project.
  set_target_properties(Torch::Torch PROPERTIES
    IMPORTED_LOCATION ${Torch_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES "${Torch_INCLUDE_DIR};${Torch_INCLUDE_DIR}/torch/csrc/api/include"
    INTERFACE_LINK_LIBRARIES "${Torch_CPU_LIBRARY};${Torch_C10_LIBRARY}")
endif()
