// CMake needs a file to precompile headers for: see TuttiPrecompiled.cmake.
