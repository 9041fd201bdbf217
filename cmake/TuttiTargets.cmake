# Helpers that give every target the same language level, warnings and install rules.

include(TuttiDependencies)
include(TuttiPrecompiled)

# tutti_compile_options(target): C++17, strict warnings, optional sanitizers. -march=native stays off
# unless asked for, for all targets alike (Eigen's alignment must agree between libraries). What a library exports is what
# stands between "#pragma GCC visibility push(default)" and "pop" in its headers (and is tutti's own: exports.map).
function(tutti_compile_options target)
  target_compile_features(${target} PUBLIC cxx_std_17)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wold-style-cast -Wcast-qual
    -Woverloaded-virtual -Wunused -Wformat=2 -Wimplicit-fallthrough)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # GCC 12 sees uninitialised reads inside Eigen's and OpenCV's inlined kernels that are not there.
    target_compile_options(${target} PRIVATE -Wno-maybe-uninitialized -Wno-array-bounds
      -Wno-stringop-overflow -Wno-stringop-overread -Wlogical-op -Wduplicated-cond)
  endif()
  if(TUTTI_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(TUTTI_NATIVE)
    target_compile_options(${target} PUBLIC -march=native)
  endif()
  if(TUTTI_SANITIZE)
    # A check that ends the program when it fails needs no way back into the code: less of it, and faster.
    target_compile_options(${target} PUBLIC -fsanitize=${TUTTI_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${TUTTI_SANITIZE})
    if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
      target_compile_options(${target} PUBLIC "-fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/cmake/sanitizers/ubsan.ignore")
      if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64") # in place of TUTTI_CLONES, which sanitizers do not get along with
        target_compile_options(${target} PUBLIC -mpopcnt)
      endif()
    endif()
  endif()
endfunction()

# tutti_pure(file...): files of this folder that only compute on their arguments and on the object that they are called
# for, in one thread (tests/configure/pure_sources_test.py). The thread sanitizer does not follow each pixel and descriptor
# through them, which is most of what it costs; what is handed to and by them it sees in their callers.
function(tutti_pure)
  list(TRANSFORM ARGN PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/" OUTPUT_VARIABLE files)
  set_property(GLOBAL APPEND PROPERTY TUTTI_PURE_SOURCES ${files})
  if(TUTTI_SANITIZE STREQUAL "thread")
    set_property(SOURCE ${ARGN} APPEND PROPERTY COMPILE_OPTIONS -fno-sanitize=thread)
  endif()
endfunction()

# tutti_compile_quickly(target): -O1 for code that reads words and writes texts, and for tests; the templates of CLI11, of
# the JSON library and of GTest take half as long again with -O3. Never for code that computes.
function(tutti_compile_quickly target)
  target_compile_options(${target} PRIVATE "$<$<CONFIG:Release>:-O1>")
  set_target_properties(${target} PROPERTIES TUTTI_QUICKLY ON)
endfunction()

# tutti_unity_groups(target [folder...]): with CMAKE_UNITY_BUILD the files of a folder are compiled together; with
# TUTTI_PRECOMPILE those of all these folders are, as each unit pays a second for what was precompiled. Not where
# Eigen's templates abound (see core/CMakeLists.txt). Files that can't be, as their neighbours have the same names for
# other things, are to be given SKIP_UNITY_BUILD_INCLUSION.
function(tutti_unity_groups target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD_MODE GROUP)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    get_source_file_property(group "${source}" UNITY_GROUP)
    if(NOT group)
      get_filename_component(folder "${source}" DIRECTORY)
      get_filename_component(folder "${folder}" NAME)
      if(TUTTI_PRECOMPILE AND NOT folder STREQUAL "" AND folder IN_LIST ARGN)
        set(folder together)
      endif()
      set_source_files_properties("${source}" PROPERTIES UNITY_GROUP "${target}_${folder}")
    endif()
  endforeach()
endfunction()

# tutti_see_private_headers(target): headers that no package installs are included by their path from the project's root.
function(tutti_see_private_headers target)
  target_include_directories(${target} PRIVATE "${PROJECT_SOURCE_DIR}")
endfunction()

# tutti_share_imported(): what find_package made in this folder is known in all others, too: in those that link our static
# libraries, a parent project's as well.
function(tutti_share_imported)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    set_target_properties(${target} PROPERTIES IMPORTED_GLOBAL TRUE)
  endforeach()
endfunction()

# tutti_add_library(name SOURCES ... [PUBLIC libs...] [PRIVATE libs...] [TOGETHER folders...] [PACKAGE component])
# Makes tutti_<name>, its alias tutti::<name>, its include folder, and installs and exports it with a pkg-config file.
# PACKAGE: the Debian package that it belongs to, where that has another name. TOGETHER: see tutti_unity_groups.
function(tutti_add_library name)
  cmake_parse_arguments(ARG "" "PACKAGE" "SOURCES;PUBLIC;PRIVATE;TOGETHER" ${ARGN})
  set(target tutti_${name})
  add_library(${target} ${ARG_SOURCES})
  add_library(tutti::${name} ALIAS ${target})
  tutti_share_imported()
  tutti_compile_options(${target})
  tutti_unity_groups(${target} ${ARG_TOGETHER})
  tutti_precompile(${target})
  target_include_directories(${target} PUBLIC
    "$<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>"
    "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
  tutti_see_private_headers(${target})
  target_link_libraries(${target} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  # No definition that only shared libraries are compiled with: objects are the same, and a compiler cache finds them.
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} DEFINE_SYMBOL "" INSTALL_RPATH "$ORIGIN"
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  if(BUILD_SHARED_LIBS AND CMAKE_SYSTEM_NAME STREQUAL "Linux")
    set(exports "${PROJECT_SOURCE_DIR}/cmake/exports.map")
    target_link_options(${target} PRIVATE "LINKER:--version-script=${exports}")
    set_target_properties(${target} PROPERTIES LINK_DEPENDS "${exports}")
  endif()
  if(NOT TUTTI_INSTALL)
    return()
  endif()
  if(NOT ARG_PACKAGE)
    set(ARG_PACKAGE ${name})
  endif()
  install(TARGETS ${target} EXPORT tutti_${name}_targets
    ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT ${ARG_PACKAGE}
    LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT ${ARG_PACKAGE})
  install(DIRECTORY include/ DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" COMPONENT ${ARG_PACKAGE})
  install(EXPORT tutti_${name}_targets NAMESPACE tutti:: FILE tutti_${name}_targets.cmake
    DESTINATION "${CMAKE_INSTALL_LIBDIR}/cmake/tutti" COMPONENT ${ARG_PACKAGE})
  install(FILES cmake/tutti_${name}_dependencies.cmake DESTINATION "${CMAKE_INSTALL_LIBDIR}/cmake/tutti"
    COMPONENT ${ARG_PACKAGE})
  tutti_describe_library(${name} PACKAGE ${ARG_PACKAGE} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
endfunction()

# tutti_add_test(name SOURCES ... LIBS ...): one GTest program per module; ctest sees each test, or each suite.
function(tutti_add_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS" ${ARGN})
  set(target tutti_${name}_tests)
  add_executable(${target} ${ARG_SOURCES})
  tutti_compile_options(${target})
  tutti_compile_quickly(${target})
  tutti_see_private_headers(${target})
  target_link_libraries(${target} PRIVATE ${ARG_LIBS} tutti_test_support GTest::gtest GTest::gmock GTest::gtest_main)
  set(timeout 600)
  if(TUTTI_SANITIZE) # a test takes ten to twenty times as long
    set(timeout 1800)
  endif()
  get_directory_property(before TEST_INCLUDE_FILES)
  gtest_discover_tests(${target} TEST_PREFIX "${name}." DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 120
    PROPERTIES TIMEOUT ${timeout} ENVIRONMENT "TUTTI_DATA=$ENV{TUTTI_DATA}")
  get_directory_property(one_by_one TEST_INCLUDE_FILES)
  list(REMOVE_ITEM one_by_one ${before})
  set(program "${CMAKE_CURRENT_BINARY_DIR}/${target}")
  math(EXPR suite_timeout "3 * ${timeout}")
  configure_file("${PROJECT_SOURCE_DIR}/cmake/tests_by_suite.cmake.in" "${target}_by_suite.cmake" @ONLY)
  set_property(DIRECTORY PROPERTY TEST_INCLUDE_FILES ${before} "${CMAKE_CURRENT_BINARY_DIR}/${target}_by_suite.cmake")
endfunction()
