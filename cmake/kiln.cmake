# One folder, one target. The layers point one way (libs <- formats <- compiler <- tools): a folder may link
# its own layer and those before it; anything else stops here, before it could fail to link.
add_library(kiln_warnings INTERFACE)
target_compile_options(kiln_warnings INTERFACE
  -Wall -Wextra -Wshadow=local $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor>
  -ffp-contract=off      # the same bits whatever the compiler may fuse
  -fno-fast-math)
target_include_directories(kiln_warnings INTERFACE ${CMAKE_SOURCE_DIR})

set(KILN_LAYERS libs formats compiler tools)

function(kiln_layer_of path out)
  file(RELATIVE_PATH relative ${CMAKE_SOURCE_DIR} ${path})
  string(REGEX MATCH "^[^/]+" layer ${relative})
  list(FIND KILN_LAYERS ${layer} index)
  set(${out} ${index} PARENT_SCOPE)
endfunction()

# kiln_library(NAME SOURCES a.cpp ... [LINKS kiln_x ...] [PRIVATE_LINKS CGAL::CGAL ...])
# LINKS are public; PRIVATE_LINKS stay inside the folder's own .cpp files.
function(kiln_library name)
  cmake_parse_arguments(K "" "" "SOURCES;LINKS;PRIVATE_LINKS" ${ARGN})
  kiln_layer_of(${CMAKE_CURRENT_SOURCE_DIR} mine)
  foreach(dep ${K_LINKS} ${K_PRIVATE_LINKS})
    if(dep MATCHES "^kiln_")
      get_property(theirs GLOBAL PROPERTY KILN_LAYER_${dep})
      if(theirs AND theirs GREATER mine)
        message(FATAL_ERROR "${name} must not link ${dep}: the arrows are libs <- formats <- compiler <- tools")
      endif()
    endif()
  endforeach()
  set_property(GLOBAL PROPERTY KILN_LAYER_${name} ${mine})
  add_library(${name} STATIC ${K_SOURCES})
  target_link_libraries(${name} PUBLIC ${K_LINKS} PRIVATE kiln_warnings ${K_PRIVATE_LINKS})
  target_include_directories(${name} PUBLIC ${CMAKE_SOURCE_DIR})
endfunction()

# For libraries whose time is arithmetic: innermost loops laid out side by side, square roots and rounding without a call. The same bits. What
# Embree asks of a processor at the least may be used.
function(kiln_arithmetic name)
  target_compile_options(${name} PRIVATE "$<$<CONFIG:Release>:-O3;-fno-math-errno;-fno-trapping-math>")
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-msse4.2>)
    if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
      target_compile_options(${name} PRIVATE "$<$<CONFIG:Release>:-mmemset-strategy=unrolled_loop:256:noalign,libcall:-1:noalign>")
    endif()
  endif()
endfunction()

# kiln_test(NAME SOURCES ... LINKS ...): a GoogleTest program; each of its cases is one ctest entry.
function(kiln_test name)
  cmake_parse_arguments(K "" "" "SOURCES;LINKS" ${ARGN})
  add_executable(${name} ${K_SOURCES})
  target_link_libraries(${name} PRIVATE ${K_LINKS} kiln_warnings GTest::gmock GTest::gtest_main)
  target_compile_definitions(${name} PRIVATE
    KILN_SOURCE_DIR="${CMAKE_SOURCE_DIR}" KILN_BINARY_DIR="${CMAKE_BINARY_DIR}")
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 120 PROPERTIES TIMEOUT 600)
endfunction()
include(GoogleTest)
