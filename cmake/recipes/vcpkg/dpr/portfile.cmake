# The checkout that holds this port, as an overlay: vcpkg install dpr --overlay-ports=cmake/recipes/vcpkg
set(SOURCE_PATH ${CURRENT_PORT_DIR}/../../../..)
vcpkg_check_features(OUT_FEATURE_OPTIONS features FEATURES tools DPR_BUILD_CLI)
vcpkg_cmake_configure(
  SOURCE_PATH ${SOURCE_PATH}
  OPTIONS ${features} -DDPR_BUILD_BENCH=OFF -DDPR_BUILD_LEARN=OFF -DDPR_BUILD_PYTHON=OFF -DDPR_BUILD_TESTS=OFF
          -DDPR_BUILD_TORCH=OFF)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/dpr)
vcpkg_fixup_pkgconfig()
if("tools" IN_LIST FEATURES)
  vcpkg_copy_tools(TOOL_NAMES dpr AUTO_CLEAN)
endif()
file(REMOVE_RECURSE ${CURRENT_PACKAGES_DIR}/debug/include)
set(VCPKG_POLICY_SKIP_COPYRIGHT_CHECK enabled)  # no licence has been chosen yet
