# What is built. As a part of another project tutti is libraries alone, and leaves every global setting as it is.
include(CMakeDependentOption)

# tutti_option(name "help" default "condition;..." "what it needs"): an option that is off, with a word about it, where it
# can't be on.
macro(tutti_option name help default conditions needs)
  cmake_dependent_option(${name} "${help}" ${default} "${conditions}" OFF)
  set(wanted "$CACHE{${name}}")
  if(wanted STREQUAL "")
    set(wanted ${default})
  endif()
  if(wanted AND NOT ${name})
    message(STATUS "tutti: ${name} is off: it needs ${needs}")
  endif()
endmacro()

option(TUTTI_BUILD_LOOPCLOSURE "Build the loop-closure library" ON)
option(TUTTI_BUILD_BACKEND "Build the pose-graph library (needs Ceres)" ON)
tutti_option(TUTTI_BUILD_SLAM "Build the SLAM library, and the front end for it" ON
  "TUTTI_BUILD_LOOPCLOSURE;TUTTI_BUILD_BACKEND" "TUTTI_BUILD_LOOPCLOSURE and TUTTI_BUILD_BACKEND")
tutti_option(TUTTI_BUILD_APPS "Build the tutti executable and the examples" ${PROJECT_IS_TOP_LEVEL}
  "TUTTI_BUILD_SLAM" "TUTTI_BUILD_SLAM")
if(PROJECT_IS_TOP_LEVEL)
  include(CTest) # defines BUILD_TESTING, ON by default
endif()
if(PROJECT_IS_TOP_LEVEL AND NOT BUILD_TESTING)
  set(TUTTI_BUILD_TESTS OFF)
else()
  tutti_option(TUTTI_BUILD_TESTS "Build the tests of what is built" ${PROJECT_IS_TOP_LEVEL} "NOT BUILD_SHARED_LIBS"
    "static libraries, since tests use private classes")
endif()
tutti_option(TUTTI_BUILD_BENCH "Build the programs under bench/" OFF
  "TUTTI_BUILD_APPS;NOT BUILD_SHARED_LIBS" "TUTTI_BUILD_APPS, and static libraries")
tutti_option(TUTTI_BUILD_FUZZERS "Build the libFuzzer programs under tests/fuzz (needs clang; see ./dev fuzz)" OFF
  "TUTTI_BUILD_LOOPCLOSURE;NOT BUILD_SHARED_LIBS" "TUTTI_BUILD_LOOPCLOSURE, and static libraries")
tutti_option(TUTTI_BUILD_PYTHON "Build the Python module (needs pybind11)" OFF
  "TUTTI_BUILD_SLAM;NOT BUILD_SHARED_LIBS" "TUTTI_BUILD_SLAM, and static libraries")
option(TUTTI_INSTALL "Install and package what is built" ${PROJECT_IS_TOP_LEVEL})
option(TUTTI_WERROR "Treat warnings as errors (./dev turns it on)" OFF)
option(TUTTI_NATIVE "Compile for this very machine (-march=native); never for packages" OFF)
option(TUTTI_PRECOMPILE "Read the headers of Eigen, of OpenCV and of the standard library once for all files" OFF)
set(TUTTI_SANITIZE "" CACHE STRING "Sanitizers, as -fsanitize= takes them: address,undefined or thread")

if(PROJECT_IS_TOP_LEVEL)
  find_program(CCACHE_PROGRAM ccache)
  if(CCACHE_PROGRAM AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
    set(CMAKE_CXX_COMPILER_LAUNCHER "${CCACHE_PROGRAM}")
    if(TUTTI_PRECOMPILE) # ccache's manual, "Precompiled headers"
      set(CMAKE_CXX_COMPILER_LAUNCHER "${CMAKE_COMMAND}" -E env CCACHE_SLOPPINESS=pch_defines,time_macros "${CCACHE_PROGRAM}")
    endif()
  endif()
  # Release is -O3: with -O2 compiling takes 7 % less, and runs take a quarter longer (three sequences, side by side).
  if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
    set(CMAKE_BUILD_TYPE Release CACHE STRING "Debug, Release, RelWithDebInfo" FORCE)
  endif()
endif()
