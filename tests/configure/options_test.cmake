# Options that need each other: what can't be on is off, with a message, and nothing that is off is looked for. And the
# preset of ./dev demo.
# usage: cmake -DTUTTI=source -DWORK=folder -DGENERATOR=... -DCXX=compiler -P options_test.cmake
file(REMOVE_RECURSE "${WORK}")

# configure(options...): what cmake says.
function(configure)
  execute_process(COMMAND "${CMAKE_COMMAND}" -S "${TUTTI}" -B "${WORK}" -G "${GENERATOR}" "-DCMAKE_CXX_COMPILER=${CXX}"
    -DTUTTI_REPORTS=OFF ${ARGN} OUTPUT_VARIABLE said ERROR_VARIABLE said RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "cmake ${ARGN}: ${said}")
  endif()
  set(said "${said}" PARENT_SCOPE)
endfunction()
function(expect pattern)
  if(NOT said MATCHES "${pattern}")
    message(SEND_ERROR "wanted '${pattern}', said: ${said}")
  endif()
endfunction()
function(expect_not pattern)
  if(said MATCHES "${pattern}")
    message(SEND_ERROR "said '${pattern}': ${said}")
  endif()
endfunction()

configure(-DBUILD_SHARED_LIBS=ON -DTUTTI_BUILD_BACKEND=OFF -DTUTTI_BUILD_APPS=ON -DTUTTI_BUILD_PYTHON=ON -DCMAKE_DISABLE_FIND_PACKAGE_Ceres=ON
  -DCMAKE_DISABLE_FIND_PACKAGE_GTest=ON -DCMAKE_DISABLE_FIND_PACKAGE_CLI11=ON)
expect("TUTTI_BUILD_SLAM is off: it needs TUTTI_BUILD_LOOPCLOSURE and TUTTI_BUILD_BACKEND")
expect("TUTTI_BUILD_APPS is off: it needs TUTTI_BUILD_SLAM")
expect("TUTTI_BUILD_TESTS is off: it needs static libraries")
expect("TUTTI_BUILD_PYTHON is off: it needs TUTTI_BUILD_SLAM, and static libraries")
expect("no cpack: the Debian packages are made of static libraries")

# What was off comes back, when what it needs does, and what was switched off by hand does not speak.
configure(-DBUILD_SHARED_LIBS=OFF -DTUTTI_BUILD_BACKEND=ON -DBUILD_TESTING=OFF -DTUTTI_BUILD_PYTHON=OFF
  -DCMAKE_DISABLE_FIND_PACKAGE_Ceres=OFF -DCMAKE_DISABLE_FIND_PACKAGE_CLI11=OFF)
expect_not("is off")
expect_not("no cpack")
file(STRINGS "${WORK}/CMakeCache.txt" apps REGEX "^TUTTI_BUILD_(SLAM|APPS):BOOL=ON")
list(LENGTH apps count)
if(NOT count EQUAL 2)
  message(SEND_ERROR "SLAM and the programs should be built again: ${apps}")
endif()

# As ./dev demo does it, which builds otherwise than the tests.
execute_process(COMMAND "${CMAKE_COMMAND}" --preset demo -B "${WORK}/demo" WORKING_DIRECTORY "${TUTTI}"
  OUTPUT_VARIABLE said ERROR_VARIABLE said RESULT_VARIABLE result)
if(NOT result EQUAL 0)
  message(SEND_ERROR "cmake --preset demo: ${said}")
endif()
