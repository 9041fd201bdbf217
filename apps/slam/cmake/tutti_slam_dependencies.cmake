find_dependency(yaml-cpp)
