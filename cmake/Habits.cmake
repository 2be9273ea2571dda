# The targets `format`, which lays out every source that git tracks, and `tidy`, which needs a build without unity sources
# (the preset "debug"). Other versions of clang's tools lay out and warn otherwise.
find_package(Git QUIET)
find_program(DPR_CLANG_FORMAT clang-format-14)
find_program(DPR_RUN_CLANG_TIDY run-clang-tidy-14)
if(GIT_FOUND AND DPR_CLANG_FORMAT)
  add_custom_target(format VERBATIM WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
                    COMMAND sh -c "\"$0\" ls-files -z '*.c' '*.h' '*.cpp' '*.hpp' '*.cl' | xargs -0 \"$1\" -i"
                            ${GIT_EXECUTABLE} ${DPR_CLANG_FORMAT})
endif()
if(DPR_RUN_CLANG_TIDY AND NOT CMAKE_UNITY_BUILD)
  add_custom_target(tidy VERBATIM
                    COMMAND ${DPR_RUN_CLANG_TIDY} -quiet -p ${PROJECT_BINARY_DIR}
                            "^${PROJECT_SOURCE_DIR}/(lib|bench|tests)/")
endif()
