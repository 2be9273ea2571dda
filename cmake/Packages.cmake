# Debian packages by `cpack`, from a build with BUILD_SHARED_LIBS and the prefix /usr, as the preset "packages" has it:
# libdprX.Y, the library; libdpr-image, what reads and writes image files; libdpr-dev; libdpr-torch and python3-dpr, the
# operator and the Python package, where they are built; dpr, the command. Dependencies on other libraries are those that
# dpkg-shlibdeps finds.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME dpr)
set(CPACK_PACKAGE_CONTACT "The dpr project")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENTS_ALL library image development)
if(TARGET dpr_torch)
  list(APPEND CPACK_COMPONENTS_ALL torch python)
endif()
if(TARGET dpr_cli)
  list(APPEND CPACK_COMPONENTS_ALL tools)
endif()

# dpr_package(COMPONENT PACKAGE SECTION SUMMARY [DEPENDENCY...])
function(dpr_package component package section summary)
  string(TOUPPER ${component} name)
  list(JOIN ARGN ", " dependencies)
  set(CPACK_DEBIAN_${name}_PACKAGE_NAME ${package} PARENT_SCOPE)
  set(CPACK_DEBIAN_${name}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_DEBIAN_${name}_DESCRIPTION "${PROJECT_DESCRIPTION}: ${summary}" PARENT_SCOPE)
  set(CPACK_DEBIAN_${name}_PACKAGE_DEPENDS "${dependencies}" PARENT_SCOPE)
endfunction()

set(library libdpr${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set(this_version "(= ${PROJECT_VERSION})")
dpr_package(library ${library} libs "the library")
dpr_package(image libdpr-image libs "image files")
dpr_package(development libdpr-dev libdevel "headers for C and C++" "${library} ${this_version}"
            "libdpr-image ${this_version}" ocl-icd-opencl-dev opencl-c-headers opencl-clhpp-headers libglm-dev)
dpr_package(torch libdpr-torch libs "the operator of libtorch")
dpr_package(python python3-dpr python "the Python package for PyTorch" "libdpr-torch ${this_version}" python3-torch)
dpr_package(tools dpr graphics "the command" "libdpr-image ${this_version}")
# Devices are the machine's choice.
set(CPACK_DEBIAN_LIBRARY_PACKAGE_RECOMMENDS "libdpr-image ${this_version}, pocl-opencl-icd | opencl-icd")
set(CPACK_DEBIAN_TOOLS_PACKAGE_RECOMMENDS "pocl-opencl-icd | opencl-icd, gnuplot-nox")
include(CPack)
