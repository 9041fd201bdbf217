#include "frontend/map/window_solver.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "tests/support/plain_camera.h"

namespace tutti {
namespace {

// A camera that drives forward between points and turns by `turn_rad` a metre; the last three of five poses
// are unknown. Its pixels have the error of a lens.
Window DriveForward(const Eigen::Vector2d& lens, double turn_rad = 0.03) {
  const PinholeCamera camera = testing::PlainCamera(450);
  std::mt19937 generator(5);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(generator() % 100000) / 1e5;
  };
  Window window;
  window.moving = 3;
  for (const double z : {2.0, 3.0, 4.0, 0.0, 1.0})
    window.T_camera_world.push_back(Pose(ExpSO3({0, turn_rad * z, 0}), {0, 0, z}).Inverse());
  window.first_observation.push_back(0);
  for (int i = 0; i < 200; ++i) {
    const double z = uniform(8, 20), y = uniform(-4, 4), x = uniform(-6, 6);
    const Eigen::Vector3d point(x, y, z);
    window.points.push_back(point);
    for (std::size_t c = 0; c < window.T_camera_world.size(); ++c) {
      WindowObservation o;
      o.camera = static_cast<int>(c);
      const Eigen::Vector2d pixel = camera.Project(window.T_camera_world[c] * point);
      o.measured.pixel = LensError::Uncorrect(camera, lens, pixel);
      if (camera.Contains(pixel)) window.observations.push_back(o);
    }
    window.first_observation.push_back(window.observations.size());
  }
  return window;
}

double WorstPose(const Window& a, const Window& b) {
  double worst = 0;
  for (std::size_t c = 0; c < a.T_camera_world.size(); ++c)
    worst = std::max(worst, LogSE3(a.T_camera_world[c] * b.T_camera_world[c].Inverse()).norm());
  return worst;
}

void Disturb(Window* window) {
  for (int c = 0; c < window->moving; ++c) {
    Pose& T = window->T_camera_world[static_cast<std::size_t>(c)];
    T = T * Pose(ExpSO3({0.01, -0.005, 0.003}), {0.05, -0.02, 0.04});
  }
  for (Eigen::Vector3d& p : window->points) p *= 1.02;
}

TEST(WindowSolver, FindsPosesAndPoints) {
  const Window truth = DriveForward({0, 0});
  Window window = truth;
  Disturb(&window);
  const WindowReport report = SolveWindow(testing::PlainCamera(450), 30, &window);
  EXPECT_TRUE(report.usable);
  EXPECT_LT(report.final_cost, 1e-6 * report.initial_cost);
  EXPECT_LT(WorstPose(window, truth), 1e-4);
}

TEST(WindowSolver, FixedPointsStayAndPosesAreFoundByThem) {
  const Window truth = DriveForward({0, 0});
  Window window = truth;
  Disturb(&window);
  window.fixed_points = 50;
  for (std::size_t i = 0; i < window.fixed_points; ++i) window.points[i] = truth.points[i];
  EXPECT_TRUE(SolveWindow(testing::PlainCamera(450), 30, &window).usable);
  for (std::size_t i = 0; i < window.fixed_points; ++i) EXPECT_EQ(window.points[i], truth.points[i]);
  EXPECT_LT(WorstPose(window, truth), 1e-4);
  for (std::size_t i = 0; i < truth.points.size(); ++i)
    EXPECT_LT((window.points[i] - truth.points[i]).norm(), 1e-3);
}

TEST(WindowSolver, FindsTheErrorOfTheLens) {
  const Eigen::Vector2d lens(0.02, -0.01);
  const Window truth = DriveForward(lens);
  Window window = truth;
  Disturb(&window);
  window.lens.information = Eigen::Matrix2d::Identity();
  EXPECT_TRUE(SolveWindow(testing::PlainCamera(450), 50, &window).usable);
  EXPECT_NEAR(window.lens.value.x(), lens.x(), 1e-3);
  EXPECT_NEAR(window.lens.value.y(), lens.y(), 2e-3);
  EXPECT_LT(WorstPose(window, truth), 2e-3);
  EXPECT_GT(window.lens.information(0, 0), 1e3);  // far more than before
}

TEST(WindowSolver, LeavesALensAloneThatIsKnownToHaveNoError) {
  Window window = DriveForward({0.02, -0.01});
  EXPECT_TRUE(SolveWindow(testing::PlainCamera(450), 20, &window).usable);
  EXPECT_LT(window.lens.value.norm(), 1e-5);
}

TEST(ObserveLens, SeesTheErrorThatTheFixedPosesHide) {
  const Eigen::Vector2d lens(0.004, -0.002);
  Window window = DriveForward(lens);
  ASSERT_TRUE(SolveWindow(testing::PlainCamera(450), 20, &window).usable);  // with a lens without error
  const std::optional<LensError> seen = ObserveLens(testing::PlainCamera(450), window);
  ASSERT_TRUE(seen.has_value());
  EXPECT_NEAR(seen->value.x(), lens.x(), 5e-4);
  EXPECT_NEAR(seen->value.y(), lens.y(), 1e-3);
}

// With every pose fixed, a straight drive would tell the lens as well as a turning one.
TEST(ObserveLens, KnowsThatAStraightDriveSaysLittle) {
  const auto known = [](double turn_rad) {
    const std::optional<LensError> seen =
        ObserveLens(testing::PlainCamera(450), DriveForward({0, 0}, turn_rad));
    return seen ? 1 / seen->information.inverse()(0, 0) : 0;
  };
  EXPECT_GT(known(0.03), 0);
  EXPECT_LT(known(0), 0.5 * known(0.03));
}

TEST(ObserveLens, NeedsTwoCameras) {
  Window window = DriveForward({0, 0});
  window.T_camera_world.resize(1);
  window.observations.clear();
  window.first_observation.assign(window.points.size() + 1, 0);
  EXPECT_FALSE(ObserveLens(testing::PlainCamera(450), window).has_value());
}

// A long drive: far cameras have no point in common, so the solver is the sparse one.
Window LongDrive() {
  const PinholeCamera camera = testing::PlainCamera(450);
  std::mt19937 generator(7);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(generator() % 100000) / 1e5;
  };
  Window window;
  window.moving = 98;
  for (int c = 2; c < 102; ++c) {
    const double z = c < 100 ? c : c - 100;  // the first two are fixed, and so come last
    window.T_camera_world.push_back(Pose(ExpSO3({0, 0.005 * z, 0}), {0, 0, z}).Inverse());
  }
  window.first_observation.push_back(0);
  for (int i = 0; i < 3000; ++i) {
    const double z = uniform(5, 115), y = uniform(-4, 4), x = uniform(-30, 60);
    const Eigen::Vector3d point(x, y, z);
    std::vector<WindowObservation> seen;
    for (std::size_t c = 0; c < window.T_camera_world.size(); ++c) {
      const Eigen::Vector3d p = window.T_camera_world[c] * point;
      WindowObservation o;
      o.camera = static_cast<int>(c);
      o.measured.pixel = camera.Project(p);
      if (p.z() > 3 && p.z() < 15 && camera.Contains(o.measured.pixel)) seen.push_back(o);
    }
    if (seen.size() < 2) continue;
    window.points.push_back(point);
    window.observations.insert(window.observations.end(), seen.begin(), seen.end());
    window.first_observation.push_back(window.observations.size());
  }
  return window;
}

TEST(WindowSolver, FindsManyPosesAndPoints) {
  const Window truth = LongDrive();
  Window window = truth;
  Disturb(&window);
  const WindowReport report = SolveWindow(testing::PlainCamera(450), 60, &window);
  EXPECT_TRUE(report.usable);
  EXPECT_LT(report.final_cost, 1e-6 * report.initial_cost);
  EXPECT_LT(WorstPose(window, truth), 1e-2);
}

TEST(WindowSolver, EndsWhenToldTo) {
  Window window = LongDrive();
  Disturb(&window);
  const std::atomic<bool> stop{true};
  const WindowReport report = SolveWindow(testing::PlainCamera(450), 60, &window, &stop);
  EXPECT_EQ(report.iterations, 0);
  EXPECT_EQ(report.final_cost, report.initial_cost);
}

TEST(WindowSolver, FixedCamerasStay) {
  const Window truth = DriveForward({0, 0});
  Window window = truth;
  Disturb(&window);
  SolveWindow(testing::PlainCamera(450), 5, &window);
  for (std::size_t c = 3; c < 5; ++c)
    EXPECT_EQ(window.T_camera_world[c].Matrix(), truth.T_camera_world[c].Matrix());
}

TEST(WindowSolver, PointsBehindTheCamerasDoNoHarm) {
  const Window truth = DriveForward({0, 0});
  Window window = truth;
  Disturb(&window);
  for (std::size_t i = 0; i < 5; ++i) window.points[i].z() = -3;
  EXPECT_TRUE(SolveWindow(testing::PlainCamera(450), 30, &window).usable);
  EXPECT_LT(WorstPose(window, truth), 1e-3);
  for (const Eigen::Vector3d& p : window.points) EXPECT_TRUE(p.allFinite());
}

}  // namespace
}  // namespace tutti
