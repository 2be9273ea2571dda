# For a wheel: the PyTorch beside which it is being installed. Python's -I leaves out the environment that pip makes for
# the build, in which there is none.
find_package(Python COMPONENTS Interpreter REQUIRED)
execute_process(
  COMMAND ${Python_EXECUTABLE} -I -c
          "import importlib.util; print(importlib.util.find_spec('torch').submodule_search_locations[0])"
  OUTPUT_VARIABLE torch_of_python OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE status ERROR_QUIET)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "There is no PyTorch beside ${Python_EXECUTABLE}: install torch first, then dpr for it")
endif()
list(PREPEND CMAKE_PREFIX_PATH ${torch_of_python})
