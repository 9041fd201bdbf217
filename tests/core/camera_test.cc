#include "tutti/core/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tutti {
namespace {

PinholeCamera CameraWith(Distortion distortion) {
  PinholeCamera camera;
  camera.width = 752;
  camera.height = 480;
  camera.fx = 458.654;
  camera.fy = 457.296;
  camera.cx = 367.215;
  camera.cy = 248.375;
  camera.distortion = distortion;
  if (distortion == Distortion::kRadTan)
    camera.coefficients = {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0};
  if (distortion == Distortion::kEquidistant) camera.coefficients = {0.0034, 0.0007, -0.0020, 0.0002, 0};
  return camera;
}

TEST(PinholeCamera, UnprojectInvertsProjectForEveryDistortion) {
  for (Distortion distortion : {Distortion::kNone, Distortion::kRadTan, Distortion::kEquidistant}) {
    const PinholeCamera camera = CameraWith(distortion);
    for (double u = 0; u < camera.width; u += 47) {
      for (double v = 0; v < camera.height; v += 41) {
        const Eigen::Vector3d ray = camera.Unproject({u, v});
        EXPECT_EQ(ray.z(), 1.0);
        EXPECT_LT((camera.Project(3.7 * ray) - Eigen::Vector2d(u, v)).norm(), 1e-6) << u << " " << v;
      }
    }
  }
}

TEST(PinholeCamera, EquidistantWithoutCoefficientsIsTheAngleTimesTheFocalLength) {
  PinholeCamera camera = CameraWith(Distortion::kEquidistant);
  camera.coefficients = {};
  const double angle = 0.6;
  const Eigen::Vector2d pixel = camera.Project({std::tan(angle), 0, 1});
  EXPECT_NEAR(pixel.x(), camera.cx + camera.fx * angle, 1e-9);
}

TEST(PinholeCamera, RadialTangentialMatchesTheFormulaByHand) {
  PinholeCamera camera = CameraWith(Distortion::kRadTan);
  camera.coefficients = {0.1, 0.01, 0.001, 0.002, 0.003};
  const double x = 0.2, y = -0.1, r2 = 0.05;
  const double radial = 1 + 0.1 * r2 + 0.01 * r2 * r2 + 0.003 * r2 * r2 * r2;
  const Eigen::Vector2d pixel = camera.Project({2 * x, 2 * y, 2});
  EXPECT_NEAR(pixel.x(), camera.cx + camera.fx * (x * radial + 2 * 0.001 * x * y + 0.002 * (r2 + 2 * x * x)),
              1e-9);
  EXPECT_NEAR(pixel.y(), camera.cy + camera.fy * (y * radial + 0.001 * (r2 + 2 * y * y) + 2 * 0.002 * x * y),
              1e-9);
}

TEST(PinholeCamera, ContainsRespectsTheBorder) {
  const PinholeCamera camera = CameraWith(Distortion::kNone);
  EXPECT_TRUE(camera.Contains({0, 0}));
  EXPECT_TRUE(camera.Contains({751, 479}));
  EXPECT_FALSE(camera.Contains({751.5, 10}));
  EXPECT_FALSE(camera.Contains({5, 100}, 10));
}

TEST(PinholeCamera, ValidateSaysWhatIsWrong) {
  EXPECT_EQ(CameraWith(Distortion::kRadTan).Validate(), "");
  PinholeCamera camera = CameraWith(Distortion::kNone);
  camera.fx = 0;
  EXPECT_EQ(camera.Validate(), "camera.fx must be above 0 [px], not 0");
  camera = CameraWith(Distortion::kNone);
  camera.cx = 5000;
  EXPECT_NE(camera.Validate().find("principal point"), std::string::npos);
  camera = CameraWith(Distortion::kRadTan);
  camera.coefficients[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(camera.Validate().find("camera.coefficients"), std::string::npos);
}

}  // namespace
}  // namespace tutti
