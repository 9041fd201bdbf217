find_dependency(Ceres)
