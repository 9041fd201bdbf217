find_dependency(yaml-cpp)
find_dependency(nlohmann_json)
find_dependency(OpenCV COMPONENTS core imgproc imgcodecs)
