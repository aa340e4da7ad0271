# What the lanes' flags make must stay in their shared objects: cmake -DLIBRARY=… -DLANES=… -P …
#
# The library has no register that an ordinary processor of its kind lacks, and a shared object of
# lanes shows one function and nothing else that the linker could take for something of others.
find_program(OBJDUMP objdump REQUIRED)
find_program(NM nm REQUIRED)
execute_process(COMMAND ${OBJDUMP} -d --no-show-raw-insn ${LIBRARY}
  OUTPUT_VARIABLE code COMMAND_ERROR_IS_FATAL ANY)
if(code MATCHES "%([yz]mm[0-9]|k[0-7][^0-9a-z]|xmm(1[6-9]|[23][0-9]))")
  message(FATAL_ERROR "${LIBRARY} uses ${CMAKE_MATCH_0}")
endif()
foreach(object ${LANES})
  execute_process(COMMAND ${NM} -D --defined-only --format=posix ${object}
    OUTPUT_VARIABLE shown COMMAND_ERROR_IS_FATAL ANY)
  if(NOT shown MATCHES "^dynacom_lanes T [^\n]*\n$")
    message(FATAL_ERROR "${object} shows more than one function:\n${shown}")
  endif()
endforeach()
