# tutti_npm_install without Node, without a network, and with both. An npm of our own stands for the real one.
# usage: cmake -DMODULE=.../TuttiWebAssets.cmake -DWORK=folder -P web_assets_test.cmake
file(REMOVE_RECURSE "${WORK}")
file(MAKE_DIRECTORY "${WORK}/source")
file(WRITE "${WORK}/source/package.json" "{}")
file(WRITE "${WORK}/source/package-lock.json" "{}")
file(WRITE "${WORK}/source/CMakeLists.txt" "
cmake_minimum_required(VERSION 3.22)
project(web LANGUAGES NONE)
include(\"${MODULE}\")
tutti_npm_install(\"${WORK}/source\" \"${WORK}/packages\" ready)
message(NOTICE \"ready=\${ready} why=\${ready_missing}\")
")

function(write_npm text)
  file(WRITE "${WORK}/npm" "#!/bin/sh\n${text}\n")
  file(CHMOD "${WORK}/npm" PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
endfunction()

# expect(what it says, options of cmake...)
function(expect wanted)
  execute_process(COMMAND "${CMAKE_COMMAND}" -S "${WORK}/source" -B "${WORK}/build" ${ARGN}
    RESULT_VARIABLE result OUTPUT_QUIET ERROR_VARIABLE said)
  if(NOT result EQUAL 0 OR NOT said MATCHES "${wanted}")
    message(SEND_ERROR "cmake ${ARGN}: ${result}, wanted '${wanted}', said: ${said}")
  endif()
endfunction()

expect("ready=FALSE why=no Node or npm; Debian: apt-get install nodejs npm" -DTUTTI_NODE= -DTUTTI_NPM=)

write_npm("echo 'npm warn Unknown user config' >&2
echo 'npm error code ECONNREFUSED' >&2
echo 'npm error request to http://127.0.0.1:9/x failed, reason: \"refused\"' >&2
exit 1")
expect("ready=FALSE why=npm could not fetch it .1: npm error request to http://127.0.0.1:9/x failed, reason: 'refused'"
  "-DTUTTI_NODE=${WORK}/npm" "-DTUTTI_NPM=${WORK}/npm")

write_npm("echo called >> '${WORK}/calls'")
expect("ready=TRUE why=\n" "-DTUTTI_NODE=${WORK}/npm" "-DTUTTI_NPM=${WORK}/npm")
expect("ready=TRUE why=\n")
file(STRINGS "${WORK}/calls" calls)
if(NOT calls STREQUAL "called")
  message(SEND_ERROR "the same lock file is fetched once, not: ${calls}")
endif()
