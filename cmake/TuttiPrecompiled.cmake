# tutti_precompile(target): with TUTTI_PRECOMPILE the headers below, which most files read, are read once for all targets.
# To be called after tutti_compile_quickly, where that is.
#
# Off by default, and in the builds that the tests and ./dev lint use: a file that lacks an include must not compile there
# because its neighbour's headers came along. Files with compile options of their own opt out (SKIP_PRECOMPILE_HEADERS), as
# do small ones: a second goes by before the first line is read.
# Not CLI11, which costs each file that reads it seconds, precompiled or not.
function(tutti_precompile target)
  if(NOT TUTTI_PRECOMPILE)
    return()
  endif()
  # A set for each level of optimisation: with that of another level GCC needs half as long again, and says nothing.
  get_target_property(quickly ${target} TUTTI_QUICKLY)
  if(quickly)
    tutti_precompiled_headers(tutti_precompiled_quickly)
    target_precompile_headers(${target} REUSE_FROM tutti_precompiled_quickly)
  else()
    tutti_precompiled_headers(tutti_precompiled)
    target_precompile_headers(${target} REUSE_FROM tutti_precompiled)
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # -fPIC of an executable, too: else what was precompiled is none of its. -fpch-preprocess: for ccache. The last one: what
    # was precompiled is 160 MB that GCC looks through whenever it collects garbage, hence not before 1 GB has come.
    target_compile_options(${target} PRIVATE -fPIC -fpch-preprocess --param=ggc-min-heapsize=1048576)
  endif()
endfunction()

# The target that has them; "_quickly" at its end: with -O1.
function(tutti_precompiled_headers target)
  if(TARGET ${target})
    return()
  endif()
  find_package(Eigen3 3.3 REQUIRED NO_MODULE)
  find_package(OpenCV 4.5.4 REQUIRED COMPONENTS core)
  add_library(${target} OBJECT "${PROJECT_SOURCE_DIR}/cmake/precompiled.cc")
  tutti_compile_options(${target})
  target_link_libraries(${target} PRIVATE Eigen3::Eigen)
  target_include_directories(${target} SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
  target_precompile_headers(${target} PRIVATE
    <algorithm> <array> <chrono> <cmath> <condition_variable> <cstdint> <cstdio> <deque> <filesystem> <fstream> <functional>
    <future> <map> <memory> <mutex> <numeric> <optional> <random> <set> <sstream> <string> <string_view> <thread> <utility>
    <vector> <Eigen/Core> <Eigen/Geometry> <Eigen/LU> <opencv2/calib3d.hpp> <opencv2/core.hpp> <opencv2/imgproc.hpp>)
  if(target MATCHES "_quickly$")
    tutti_compile_quickly(${target})
    find_package(nlohmann_json REQUIRED)
    target_link_libraries(${target} PRIVATE nlohmann_json::nlohmann_json)
    target_precompile_headers(${target} PRIVATE <nlohmann/json.hpp>)
  endif()
endfunction()
