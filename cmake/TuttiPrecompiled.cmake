# tutti_precompile(target): with TUTTI_PRECOMPILE the headers below, which most files read, are read once for all libraries.
#
# Off by default, and in the builds that the tests and ./dev lint use: a file that lacks an include must not compile there
# because its neighbour's headers came along. Files with a target option of their own opt out (SKIP_PRECOMPILE_HEADERS).
function(tutti_precompile target)
  get_target_property(type ${target} TYPE)
  if(NOT TUTTI_PRECOMPILE OR type STREQUAL "EXECUTABLE") # -fPIE instead of -fPIC
    return()
  endif()
  if(NOT TARGET tutti_precompiled)
    find_package(Eigen3 3.3 REQUIRED NO_MODULE)
    find_package(OpenCV 4.5.4 REQUIRED COMPONENTS core)
    add_library(tutti_precompiled OBJECT "${PROJECT_SOURCE_DIR}/cmake/precompiled.cc")
    tutti_compile_options(tutti_precompiled)
    target_link_libraries(tutti_precompiled PRIVATE Eigen3::Eigen)
    target_include_directories(tutti_precompiled SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
    target_precompile_headers(tutti_precompiled PRIVATE
      <algorithm> <array> <cmath> <cstdint> <cstdio> <filesystem> <fstream> <functional> <map> <memory> <mutex> <optional>
      <set> <sstream> <string> <string_view> <thread> <utility> <vector>
      <Eigen/Core> <Eigen/Geometry> <Eigen/LU> <opencv2/core.hpp> <opencv2/imgproc.hpp>)
    if(TUTTI_BUILD_APPS)
      find_package(nlohmann_json REQUIRED)
      target_link_libraries(tutti_precompiled PRIVATE nlohmann_json::nlohmann_json)
      target_precompile_headers(tutti_precompiled PRIVATE <nlohmann/json.hpp>)
    endif()
  endif()
  target_precompile_headers(${target} REUSE_FROM tutti_precompiled)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE -fpch-preprocess) # for ccache
  endif()
endfunction()
