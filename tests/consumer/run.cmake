# Installs the build tree BUILD below WORK, then configures and builds the project SOURCE against it, and
# runs its programs; compiles one of them as pkg-config has it; and configures a project that has the tree DPR as a part,
# and compiles a program of that.
# LAUNCHER, GENERATOR, CXX, CXX_FLAGS and BUILD_TYPE are those of the build tree, LIBDIR is the folder of its libraries.
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

set(options -G ${GENERATOR} -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${CXX_FLAGS} -DCMAKE_BUILD_TYPE=${BUILD_TYPE})
if(CXX_FLAGS MATCHES "-fsanitize=")
  # Sanitizers open libraries in the program's stead, without its run path.
  set(ENV{LD_LIBRARY_PATH} ${WORK}/prefix/${LIBDIR})
endif()

file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
run(${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/build ${options} -DCMAKE_PREFIX_PATH=${WORK}/prefix)
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${LAUNCHER} ${WORK}/build/main ${WORK}/cube.png ${WORK}/cube.exr)
run(${LAUNCHER} ${WORK}/build/embedder)

find_program(PKG_CONFIG pkg-config REQUIRED)
set(ENV{PKG_CONFIG_PATH} ${WORK}/prefix/${LIBDIR}/pkgconfig)
execute_process(COMMAND ${PKG_CONFIG} --cflags --libs dpr-image OUTPUT_VARIABLE flags COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${CXX_FLAGS} ${flags}")
run(${CXX} -std=c++20 ${SOURCE}/main.cpp -o ${WORK}/by_pkg_config ${flags})
if(EXISTS ${WORK}/prefix/${LIBDIR}/libdpr.so)
  set(ENV{LD_LIBRARY_PATH} ${WORK}/prefix/${LIBDIR})
endif()
run(${LAUNCHER} ${WORK}/by_pkg_config ${WORK}/cube.png ${WORK}/cube.exr)

run(${CMAKE_COMMAND} -S ${SOURCE}/subproject -B ${WORK}/subproject ${options} -DDPR=${DPR})
if(GENERATOR STREQUAL "Ninja")  # which builds parts of a target: the library was compiled once already
  run(${CMAKE_COMMAND} --build ${WORK}/subproject --target CMakeFiles/main.dir${SOURCE}/main.cpp.o)
endif()
