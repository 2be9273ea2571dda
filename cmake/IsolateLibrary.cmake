# Makes the static library ARCHIVE one object that shows what exports.map lists and nothing of other libraries: programs
# that use these libraries too, with other settings or versions, would share the functions that both compiled from
# headers. What it shows is hidden, so that a shared library that links it does not show it again. AR, READELF, LINKER and
# OBJCOPY are GNU's; CXX assembles.
cmake_minimum_required(VERSION 3.25)
function(run)
  execute_process(COMMAND ${ARGV} WORKING_DIRECTORY ${work} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

set(work ${ARCHIVE}.dir)
file(MAKE_DIRECTORY ${work})

file(STRINGS ${CMAKE_CURRENT_LIST_DIR}/exports.map patterns REGEX "^ +[_d].*[*];")
list(TRANSFORM patterns REPLACE "^ +(.*)[*];.*" "\\1")
list(JOIN patterns "|" patterns)
execute_process(COMMAND ${READELF} --symbols --wide ${ARCHIVE} OUTPUT_VARIABLE table COMMAND_ERROR_IS_FATAL ANY)
# list_symbols(VARIABLE FILE REGEX): those whose row of the table ends as REGEX has it, the name last.
function(list_symbols variable file regex)
  string(REGEX MATCHALL "${regex}[^ \n]*" rows "${table}")
  list(TRANSFORM rows REPLACE ".* " "")
  list(REMOVE_DUPLICATES rows)
  list(JOIN rows "\n" lines)
  file(WRITE ${work}/${file} "${lines}\n")
  set(${variable} ${rows} PARENT_SCOPE)
endfunction()
list_symbols(shown shown.txt "(GLOBAL|WEAK) +DEFAULT +[0-9]+ +(${patterns})")
list_symbols(unique unique.txt "UNIQUE +[A-Z]+ +[0-9]+ +")
# A linker takes the narrowest of the visibilities that objects ask for.
list(TRANSFORM shown REPLACE "(.+)" ".hidden \\1\n.long \\1\n")
list(JOIN shown "" references)
file(WRITE ${work}/hidden.s ".section .note.GNU-stack,\"\",@progbits\n.section .hide\n${references}")

run(${CXX} -c hidden.s -o hidden.o)
run(${LINKER} -r --force-group-allocation --whole-archive ${ARCHIVE} --no-whole-archive hidden.o -o linked.o)
# A unique symbol cannot be made local before it is an ordinary one.
run(${OBJCOPY} --weaken-symbols=unique.txt linked.o)
run(${OBJCOPY} --keep-global-symbols=shown.txt --remove-section=.hide linked.o dpr.o)
file(REMOVE ${ARCHIVE})
run(${AR} qcs ${ARCHIVE} dpr.o)
file(REMOVE_RECURSE ${work})
