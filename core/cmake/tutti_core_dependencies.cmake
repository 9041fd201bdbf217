find_dependency(Eigen3 3.3 NO_MODULE)
find_dependency(ZLIB)
