find_dependency(OpenCV 4.5.4 COMPONENTS core imgproc imgcodecs features2d calib3d video videoio)
find_dependency(BZip2)
find_dependency(SQLite3)
