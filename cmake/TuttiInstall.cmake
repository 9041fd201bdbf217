# What is installed beside the libraries: find_package(tutti COMPONENTS core frontend loopclosure backend slam dense), documents
# and configurations. Components of the installation are those of the Debian packages (TuttiPackages.cmake).
include(CMakePackageConfigHelpers)
configure_package_config_file(cmake/tuttiConfig.cmake.in
  "${PROJECT_BINARY_DIR}/tuttiConfig.cmake"
  INSTALL_DESTINATION "${CMAKE_INSTALL_LIBDIR}/cmake/tutti")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/tuttiConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/tuttiConfig.cmake" "${PROJECT_BINARY_DIR}/tuttiConfigVersion.cmake"
  DESTINATION "${CMAKE_INSTALL_LIBDIR}/cmake/tutti" COMPONENT core)
if(TUTTI_BUILD_APPS)
  install(DIRECTORY data/configs DESTINATION "${CMAKE_INSTALL_DATADIR}/tutti" COMPONENT program)
  # As in the source tree, so that links between documents hold.
  install(FILES LICENSE README.md CHANGELOG.md BENCHMARK.md CONTRIBUTING.md SECURITY.md CITATION.cff
    DESTINATION "${CMAKE_INSTALL_DOCDIR}" COMPONENT program)
  install(DIRECTORY docs DESTINATION "${CMAKE_INSTALL_DOCDIR}" COMPONENT program PATTERN Doxyfile EXCLUDE PATTERN pictures.py EXCLUDE)
  install(FILES data/README.md DESTINATION "${CMAKE_INSTALL_DOCDIR}/data" COMPONENT program)
  install(DIRECTORY apps/examples DESTINATION "${CMAKE_INSTALL_DOCDIR}/apps" COMPONENT program
    PATTERN CMakeLists.txt EXCLUDE)
else()
  install(FILES LICENSE DESTINATION "${CMAKE_INSTALL_DOCDIR}" COMPONENT core)
endif()
