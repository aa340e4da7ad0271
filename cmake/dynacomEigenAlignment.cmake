# How Eigen aligns what is compiled with the present CMAKE_CXX_FLAGS: the list of
# EIGEN_MAX_ALIGN_BYTES and EIGEN_MALLOC_ALREADY_ALIGNED, the former of what is on the stack, too.
# Eigen3::Eigen must be known.
function(dynacom_find_eigen_alignment result)
  string(MD5 flags "${CMAKE_CXX_COMPILER} ${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_DEBUG}")
  set(known DYNACOM_EIGEN_ALIGNMENT_${flags})
  if(NOT DEFINED ${known})
    set(folder ${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/dynacom_eigen_alignment)
    file(WRITE ${folder}.cpp [[
#include <Eigen/Core>
static_assert(EIGEN_MAX_STATIC_ALIGN_BYTES == EIGEN_MAX_ALIGN_BYTES, "");
#define TEXT_OF(macro) #macro
#define TEXT(macro) TEXT_OF(macro)
const char text[] =
    "alignment=" TEXT(EIGEN_MAX_ALIGN_BYTES) "," TEXT(EIGEN_MALLOC_ALREADY_ALIGNED) ".";
int main(int count, char**) { return text[count]; }
]])
    try_compile(compiles ${folder} ${folder}.cpp LINK_LIBRARIES Eigen3::Eigen
      CXX_STANDARD 17 COPY_FILE ${folder}.out COPY_FILE_ERROR error)
    set(found "unknown")
    if(compiles AND NOT error)
      file(STRINGS ${folder}.out text REGEX "alignment=[0-9]+,[0-9]+[.]" LIMIT_COUNT 1)
      string(REGEX REPLACE ".*alignment=([0-9]+),([0-9]+)[.].*" "\\1;\\2" found "${text}")
    endif()
    set(${known} "${found}" CACHE INTERNAL "How Eigen aligns with these flags")
  endif()
  set(${result} "${${known}}" PARENT_SCOPE)
endfunction()
