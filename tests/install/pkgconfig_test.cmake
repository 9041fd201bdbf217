# Compiles a program with what pkg-config says, and runs it.
# usage: cmake -DPKG_CONFIG=... -DCXX=... -DPREFIX=... -DLIBDIR=lib -DPACKAGE=tutti-... -DSOURCE=main.cc -DWORK=folder
#        -P pkgconfig_test.cmake
set(ENV{PKG_CONFIG_PATH} "${PREFIX}/${LIBDIR}/pkgconfig:$ENV{PKG_CONFIG_PATH}")
execute_process(COMMAND "${PKG_CONFIG}" --cflags --libs "${PACKAGE}" OUTPUT_VARIABLE flags
  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${flags}")
file(MAKE_DIRECTORY "${WORK}")
execute_process(COMMAND "${CXX}" -std=c++17 "${SOURCE}" ${flags} "-Wl,-rpath,${PREFIX}/${LIBDIR}" -o "${WORK}/consumer"
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND "${WORK}/consumer" WORKING_DIRECTORY "${WORK}" COMMAND_ERROR_IS_FATAL ANY)
