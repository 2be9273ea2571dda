# Installs the build tree BUILD below WORK, then configures and builds the project SOURCE against it, runs its programs and
# looks at what its plugin shows; the same for a project in C; compiles a program of each as pkg-config has it; and
# configures a project that has the tree DPR as a part and takes warnings for errors, and compiles a program of that.
# GENERATOR, CXX, CXX_FLAGS and BUILD_TYPE are those of the build tree, LIBDIR is the folder of its libraries.
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

set(options -G ${GENERATOR} -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${CXX_FLAGS} -DCMAKE_BUILD_TYPE=${BUILD_TYPE})

file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
run(${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/build ${options} -DCMAKE_PREFIX_PATH=${WORK}/prefix)
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${WORK}/build/main ${WORK}/cube.png ${WORK}/cube.exr)
run(${WORK}/build/embedder)
run(${WORK}/build/eigen_host)
execute_process(COMMAND ${NM} -D --defined-only ${WORK}/build/plugin.so OUTPUT_VARIABLE shown COMMAND_ERROR_IS_FATAL ANY)
if(NOT shown MATCHES "^[0-9a-f]+ T plugin_alpha\n$")
  message(FATAL_ERROR "the plugin shows more than its function:\n${shown}")
endif()
run(${CMAKE_COMMAND} -S ${SOURCE}/c -B ${WORK}/c -G ${GENERATOR} -DCMAKE_PREFIX_PATH=${WORK}/prefix)
run(${CMAKE_COMMAND} --build ${WORK}/c)

find_program(PKG_CONFIG pkg-config REQUIRED)
set(ENV{PKG_CONFIG_PATH} ${WORK}/prefix/${LIBDIR}/pkgconfig)
execute_process(COMMAND ${PKG_CONFIG} --cflags --libs dpr-image OUTPUT_VARIABLE flags COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${CXX_FLAGS} ${flags}")
run(${CXX} -std=c++20 ${SOURCE}/main.cpp -o ${WORK}/by_pkg_config ${flags})
if(EXISTS ${WORK}/prefix/${LIBDIR}/libdpr.so)
  set(ENV{LD_LIBRARY_PATH} ${WORK}/prefix/${LIBDIR})
endif()
run(${WORK}/by_pkg_config ${WORK}/cube.png ${WORK}/cube.exr)
run(${WORK}/c/from_c)
find_program(C_COMPILER NAMES cc gcc clang REQUIRED)
execute_process(COMMAND ${PKG_CONFIG} --static --cflags --libs dpr OUTPUT_VARIABLE flags COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${flags}")
run(${C_COMPILER} ${SOURCE}/../../include/examples/from_c.c -o ${WORK}/c_by_pkg_config ${flags})

run(${CMAKE_COMMAND} -S ${SOURCE}/subproject -B ${WORK}/subproject ${options} "-DCMAKE_CXX_FLAGS=${CXX_FLAGS} -Wall -Werror"
    -DDPR=${DPR})
if(GENERATOR STREQUAL "Ninja")  # which builds parts of a target: the library was compiled once already
  run(${CMAKE_COMMAND} --build ${WORK}/subproject --target CMakeFiles/main.dir${SOURCE}/main.cpp.o
      dpr/lib/CMakeFiles/dpr.dir/base/json_node.cpp.o)
endif()
