# Compiles every kernel with clang as strict OpenCL C 1.2, in every width and for every prior, and fails with all that it reports.
# Arguments: CLANG, the compiler (or ...-NOTFOUND); KERNELS, the folder, whose headers
# are included; MORE_KERNELS, another one.
if(NOT CLANG)
  message(STATUS "skipped: no clang")
  return()
endif()

set(flags -x cl -cl-std=CL1.2 -Xclang -finclude-default-header -fsyntax-only
          -Wall -Wextra -Wdouble-promotion -Werror -I ${KERNELS})
set(option_sets "" -DDPR_LANES=1 -DDPR_LANES=8 -DDPR_LANES=16 -DDPR_VARIABLE_WIDTH
                   -DDPR_PRIOR=1 -DDPR_PRIOR=2 -DDPR_PRIOR=3 -DDPR_PRIOR=4)
file(GLOB sources ${KERNELS}/*.cl)
set(failures 0)
file(GLOB more_sources ${MORE_KERNELS}/*.cl)
list(APPEND sources ${more_sources})
foreach(source IN LISTS sources)
  foreach(options IN LISTS option_sets)
    execute_process(COMMAND ${CLANG} ${flags} ${options} ${source}
                    RESULT_VARIABLE status ERROR_VARIABLE report)
    if(NOT status EQUAL 0)
      message("${source} [${options}]\n${report}")
      math(EXPR failures "${failures} + 1")
    endif()
  endforeach()
endforeach()
list(LENGTH sources count)
if(failures GREATER 0 OR count EQUAL 0)
  message(FATAL_ERROR "${count} kernels, ${failures} compilations failed")
endif()
message(STATUS "${count} kernels compiled")
