# Configures subproject/ and looks at what would be built and installed; nothing is built.
# usage: cmake -DTUTTI=source -DWORK=folder -DGENERATOR=... -DCXX=compiler -P subproject_test.cmake
file(REMOVE_RECURSE "${WORK}")
execute_process(COMMAND "${CMAKE_COMMAND}" -S "${CMAKE_CURRENT_LIST_DIR}/subproject" -B "${WORK}/build" -G "${GENERATOR}"
  "-DTUTTI_SOURCE=${TUTTI}" "-DCMAKE_CXX_COMPILER=${CXX}" RESULT_VARIABLE result OUTPUT_QUIET
  ERROR_VARIABLE error)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "${error}")
endif()
file(READ "${WORK}/build/CMakeCache.txt" cache)
if(NOT cache MATCHES "\nCMAKE_BUILD_TYPE:STRING=\n" OR cache MATCHES "\nBUILD_TESTING:")
  message(FATAL_ERROR "tutti sets the build type or BUILD_TESTING of the project that it is a part of")
endif()
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${WORK}/build" --prefix "${WORK}/prefix" OUTPUT_QUIET
  COMMAND_ERROR_IS_FATAL ANY)
file(GLOB_RECURSE installed "${WORK}/prefix/*")
if(installed)
  message(FATAL_ERROR "tutti installs itself with the project that it is a part of: ${installed}")
endif()
