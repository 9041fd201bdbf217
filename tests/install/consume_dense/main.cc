// Dense maps alone, from an installed tutti: a wall becomes a surface.
#include <tutti/dense/dense_map.h>

#include <cstdio>

int main() {
  tutti::PinholeCamera camera;
  camera.width = 80, camera.height = 60;
  camera.fx = camera.fy = 70;
  camera.cx = 39.5, camera.cy = 29.5;
  tutti::DenseMap map({});
  for (int i = 0; i < 3; ++i)
    map.Integrate(cv::Mat(60, 80, CV_32FC1, cv::Scalar(1)), {}, tutti::Pose(), camera);
  const tutti::TriangleMesh mesh = map.Mesh();
  std::printf("%zu triangles\n", mesh.triangles.size());
  return mesh.triangles.size() > 100 ? 0 : 1;
}
