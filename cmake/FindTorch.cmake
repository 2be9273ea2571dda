# Finds libtorch by its files. The package config that comes with it sets compiler flags and C++14 for whole projects, and
# looks for protobuf, CUDA and more that nothing here needs; and Debian's names libraries that do not exist.
find_path(Torch_INCLUDE_DIR torch/csrc/api/include/torch/torch.h)
find_library(Torch_LIBRARY torch)
find_library(Torch_CPU_LIBRARY torch_cpu)
find_library(Torch_C10_LIBRARY c10)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Torch
  REQUIRED_VARS Torch_LIBRARY Torch_CPU_LIBRARY Torch_C10_LIBRARY Torch_INCLUDE_DIR)
mark_as_advanced(Torch_LIBRARY Torch_CPU_LIBRARY Torch_C10_LIBRARY Torch_INCLUDE_DIR)

if(Torch_FOUND AND NOT TARGET Torch::Torch)
  add_library(Torch::Torch UNKNOWN IMPORTED)
  # Its headers count as the system's: they would not pass the warnings of this project.
  set_target_properties(Torch::Torch PROPERTIES
    IMPORTED_LOCATION ${Torch_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES "${Torch_INCLUDE_DIR};${Torch_INCLUDE_DIR}/torch/csrc/api/include"
    INTERFACE_LINK_LIBRARIES "${Torch_CPU_LIBRARY};${Torch_C10_LIBRARY}")
endif()
