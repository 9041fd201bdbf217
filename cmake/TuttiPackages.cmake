# Debian packages: `cpack` in the build folder. Each component of the installation is one. Libraries come as static ones.
if(BUILD_SHARED_LIBS)
  message(STATUS "tutti: no cpack: the Debian packages are made of static libraries")
  return()
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR "The tutti authors")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "") # or it would be the first line of every package's
set(CPACK_PACKAGE_VERSION "${PROJECT_VERSION}")
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_RESOURCE_FILE_LICENSE "${PROJECT_SOURCE_DIR}/LICENSE")
set(CPACK_STRIP_FILES ON)
set(CPACK_THREADS 0)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
# Who distributes them gives an address: cpack -D CPACK_DEBIAN_PACKAGE_MAINTAINER="Name <name@example.org>"
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "The tutti authors <tutti@localhost>")
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_PRE_BUILD_SCRIPTS "${PROJECT_SOURCE_DIR}/cmake/debian_files.cmake")
set(CPACK_COMPONENTS_ALL "")

# tutti_package(component name section description): what the package depends on was told by tutti_add_library.
function(tutti_package component name section description)
  string(TOUPPER ${component} upper)
  get_property(depends GLOBAL PROPERTY TUTTI_DEPENDS_${component})
  list(REMOVE_DUPLICATES depends)
  list(REMOVE_ITEM depends "${name} (= ${PROJECT_VERSION})") # one package may have two libraries
  list(JOIN depends ", " depends)
  set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} ${component} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${name} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_DEPENDS "${depends}" PARENT_SCOPE)
  set(CPACK_COMPONENT_${upper}_DESCRIPTION "${description}" PARENT_SCOPE)
endfunction()

tutti_package(core libtutti-core-dev libdevel "poses, cameras and trajectories
What the other libraries of tutti have in common, for C++ with CMake or pkg-config.")
if(TUTTI_BUILD_LOOPCLOSURE)
  tutti_package(loopclosure libtutti-loopclosure-dev libdevel "loop closure by an ensemble of Bayesian filters
A C++ library that says whether a place was seen before, from images or features.")
endif()
if(TUTTI_BUILD_BACKEND)
  tutti_package(backend libtutti-backend-dev libdevel "robust pose graphs and evaluation of trajectories
A C++ library that optimises pose graphs which may hold false loops, and measures the
errors of trajectories.")
endif()
if(TUTTI_BUILD_SLAM)
  tutti_package(slam libtutti-slam-dev libdevel "visual SLAM as a C++ library
Tracking, mapping and loop closure for one camera, stereo and RGB-D, as one class.")
  tutti_package(dense libtutti-dense-dev libdevel "dense maps from depth images with poses
A C++ library that makes coloured meshes, point clouds and occupancy grids.")
endif()
if(TUTTI_BUILD_APPS)
  tutti_package(program tutti science "visual SLAM with loop closure
Computes where a camera was, and a map, from its images: one camera, stereo or RGB-D.
Recognises places that were seen before by an ensemble of Bayesian filters.
Evaluates trajectories and loops, and makes reports for a browser.")
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
endif()
if(TUTTI_BUILD_PYTHON)
  tutti_package(python python3-tutti python "visual SLAM and loop closure for Python
Loop closure for any camera, visual SLAM, pose graphs and evaluation of trajectories
with numpy arrays.")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
endif()
include(CPack)
