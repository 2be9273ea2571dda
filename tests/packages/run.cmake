# Makes the Debian packages of the source tree DPR in BUILD, installs them into an empty root below WORK by dpkg,
# against the packages of this system, and builds and runs programs in C and C++20 with what is installed there; and the
# command, and with PYTHON the tests of the folder PYTHON_TESTS. GENERATOR and CXX are those of the build tree, CONSUMER and
# C_PROGRAM sources.
cmake_minimum_required(VERSION 3.25)
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

find_program(DPKG dpkg)
find_program(SHLIBDEPS dpkg-shlibdeps)
if(NOT DPKG OR NOT SHLIBDEPS)
  message(STATUS "skipped: no dpkg-shlibdeps")
  return()
endif()

run(${CMAKE_COMMAND} --preset packages -S ${DPR} -B ${BUILD} -G ${GENERATOR} -DCMAKE_CXX_COMPILER=${CXX})
run(${CMAKE_COMMAND} --build ${BUILD} --parallel 2)
file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} -E chdir ${BUILD} ${CMAKE_CPACK_COMMAND} -B ${WORK}/packages)
file(GLOB packages ${WORK}/packages/*.deb)

# dpkg refuses what depends on a package that is neither installed here nor one of these.
file(MAKE_DIRECTORY ${WORK}/root/var/lib/dpkg/info ${WORK}/root/var/lib/dpkg/updates)
file(COPY_FILE /var/lib/dpkg/status ${WORK}/root/var/lib/dpkg/status)
set(fakeroot "")
execute_process(COMMAND id -u OUTPUT_VARIABLE user OUTPUT_STRIP_TRAILING_WHITESPACE)
if(NOT user EQUAL 0)
  find_program(FAKEROOT fakeroot REQUIRED)
  set(fakeroot ${FAKEROOT})
endif()
# Its warnings, of packages whose files are not in the root, are shown where it fails.
execute_process(COMMAND ${fakeroot} ${DPKG} --root=${WORK}/root --force-not-root --force-script-chrootless --no-triggers
                        --install ${packages}
                RESULT_VARIABLE status ERROR_VARIABLE report)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "${report}")
endif()
foreach(package IN LISTS packages)
  execute_process(COMMAND ${DPKG} --field ${package} Package Depends OUTPUT_VARIABLE fields COMMAND_ERROR_IS_FATAL ANY)
  message(STATUS "${fields}")
  if(NOT fields MATCHES "Depends: .+")
    message(SEND_ERROR "a package without dependencies: ${package}")
  endif()
endforeach()

set(prefix ${WORK}/root/usr)
file(GLOB_RECURSE library ${prefix}/lib/*/libdpr.so)
get_filename_component(libraries ${library} DIRECTORY)
set(ENV{LD_LIBRARY_PATH} ${libraries})
set(ENV{PKG_CONFIG_PATH} ${libraries}/pkgconfig)
run(${CMAKE_COMMAND} -S ${CONSUMER} -B ${WORK}/consumer -G ${GENERATOR} -DCMAKE_CXX_COMPILER=${CXX}
    -DCMAKE_PREFIX_PATH=${prefix})
run(${CMAKE_COMMAND} --build ${WORK}/consumer)
run(${WORK}/consumer/main ${WORK}/cube.png ${WORK}/cube.exr)
run(${WORK}/consumer/embedder)

find_program(PKG_CONFIG pkg-config REQUIRED)
find_program(C_COMPILER NAMES cc gcc clang REQUIRED)
execute_process(COMMAND ${PKG_CONFIG} --cflags --libs dpr OUTPUT_VARIABLE flags COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${flags}")
run(${C_COMPILER} -std=c99 -pedantic -Wall -Wextra -Werror ${C_PROGRAM} -o ${WORK}/from_c ${flags})
run(${WORK}/from_c)

run(${prefix}/bin/dpr devices)
if(PYTHON)
  set(ENV{PYTHONPATH} ${prefix}/lib/python3/dist-packages)
  foreach(name numpy package)
    run(${PYTHON} ${PYTHON_TESTS}/${name}_test.py)
  endforeach()
endif()
