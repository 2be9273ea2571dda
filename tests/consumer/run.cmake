# Installs the build tree BUILD below WORK, then configures and builds the project SOURCE against it, and
# runs its programs.
# LAUNCHER, GENERATOR, CXX, CXX_FLAGS and BUILD_TYPE are those of the build tree.
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
run(${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/build -G ${GENERATOR} -DCMAKE_PREFIX_PATH=${WORK}/prefix
    -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${CXX_FLAGS} -DCMAKE_BUILD_TYPE=${BUILD_TYPE})
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${LAUNCHER} ${WORK}/build/main)
run(${LAUNCHER} ${WORK}/build/embedder)
