find_dependency(OpenCV 4.5.4 COMPONENTS core imgproc)
