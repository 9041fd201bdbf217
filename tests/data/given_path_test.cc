#include "data/synthetic/given_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>

#include "data/synthetic/imu_sensor.h"
#include "data/synthetic/synthetic_world.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

using synthetic::PoseSpline;

// A body that flies on a wavy circle of 2 m and turns about all axes; its z axis is forward.
Trajectory Flight(double seconds, double rate_hz = 20) {
  Trajectory poses;
  for (int i = 0; i <= seconds * rate_hz; ++i) {
    const double t = i / rate_hz, a = 0.4 * t;
    const Eigen::Quaterniond level(Eigen::AngleAxisd(-M_PI / 2, Eigen::Vector3d::UnitX()));
    const Eigen::Quaterniond q = Eigen::AngleAxisd(a, Eigen::Vector3d::UnitZ()) * level *
                                 Eigen::AngleAxisd(0.2 * std::sin(1.3 * t), Eigen::Vector3d::UnitX()) *
                                 Eigen::AngleAxisd(0.3 * std::sin(0.9 * t), Eigen::Vector3d::UnitZ());
    poses.push_back({100 + t, Pose(q, {2 * std::cos(a), 2 * std::sin(a), 1.5 + 0.3 * std::sin(2 * t)})});
  }
  return poses;
}

SyntheticOptions Along(const Trajectory& poses, SyntheticSensor sensor) {
  SyntheticOptions o;
  o.scene = SyntheticScene::kRoom;
  o.sensor = sensor;
  synthetic::GivenPath path{PoseSpline(poses), synthetic::FrameStamps(poses, 0), synthetic::EurocCameras()};
  for (synthetic::MountedCamera& mounted : path.cameras) {  // a quarter as many pixels
    PinholeCamera& c = mounted.camera;
    c.width /= 2, c.height /= 2, c.fx /= 2, c.fy /= 2;
    c.cx = 0.5 * (c.cx + 0.5) - 0.5, c.cy = 0.5 * (c.cy + 0.5) - 0.5;
  }
  o.path = std::make_shared<const synthetic::GivenPath>(std::move(path));
  return o;
}

TEST(PoseSpline, GoesThroughThePosesAndKnowsItsOwnDerivatives) {
  const Trajectory poses = Flight(6);
  const PoseSpline spline(poses);
  for (const StampedPose& p : poses) {
    const Pose error = spline.At(p.stamp_s - spline.Begin()).Inverse() * p.pose;
    EXPECT_LT(error.translation.norm() + error.Angle(), 1e-9);
  }
  const double h = 1e-4;
  for (double t = 1; t < 5; t += 0.313) {
    const Pose before = spline.At(t - h), at = spline.At(t), after = spline.At(t + h);
    const Eigen::Vector3d turn = LogSO3(before.rotation.conjugate() * after.rotation) / (2 * h);
    EXPECT_LT((turn - spline.AngularVelocity(t)).norm(), 1e-5);
    const Eigen::Vector3d pull = (after.translation - 2 * at.translation + before.translation) / (h * h);
    EXPECT_LT((pull - spline.Acceleration(t)).norm(), 1e-2);
  }
}

TEST(PoseSpline, RefusesStampsThatDoNotGrow) {
  Trajectory poses = Flight(1);
  std::swap(poses[3], poses[4]);
  EXPECT_THROW(PoseSpline{poses}, InputError);
  EXPECT_THROW(PoseSpline{Trajectory(2)}, InputError);
}

TEST(SampleImu, OfAPerfectSensorIsTheMotion) {
  const PoseSpline spline(Flight(6));
  synthetic::ImuSensor perfect;
  const std::vector<ImuSample> samples = synthetic::SampleImu(spline, perfect, 1);
  ASSERT_EQ(samples.size(), 1201U);
  Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
  Eigen::Vector3d world = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i + 1 < samples.size(); ++i) {
    turned = turned * ExpSO3(0.5 * 0.005 * (samples[i].gyro + samples[i + 1].gyro));
    world += spline.At(0.005 * static_cast<double>(i)).rotation * samples[i].acceleration / 1200;
  }
  const Eigen::Quaterniond truth = spline.At(0).rotation.conjugate() * spline.At(6).rotation;
  EXPECT_LT(turned.angularDistance(truth), 1e-4);
  EXPECT_NEAR(world.z(), 9.81, 0.2);
}

TEST(SampleImu, HasTheNoiseAndTheClockOfItsSensor) {
  Trajectory still;
  for (int i = 0; i < 400; ++i) still.push_back({i * 0.05, Pose()});
  const synthetic::ImuSensor phone = synthetic::ImuSensorOf("phone");
  const std::vector<ImuSample> samples = synthetic::SampleImu(PoseSpline(still), phone, 3);
  EXPECT_NEAR(samples[0].stamp_s, phone.late_s, 1e-12);
  double sum = 0;
  for (std::size_t i = 1; i < samples.size(); ++i)
    sum += (samples[i].gyro - samples[i - 1].gyro).squaredNorm() / 6;
  const double sigma = std::sqrt(sum / static_cast<double>(samples.size() - 1));
  EXPECT_NEAR(sigma, phone.gyro_noise * std::sqrt(phone.rate_hz), 0.1 * sigma);
  const std::vector<ImuSample> again = synthetic::SampleImu(PoseSpline(still), phone, 3);
  EXPECT_EQ(synthetic::EurocImuCsv(samples), synthetic::EurocImuCsv(again));
  EXPECT_NE(synthetic::EurocImuCsv(samples),
            synthetic::EurocImuCsv(synthetic::SampleImu(PoseSpline(still), phone, 4)));
  EXPECT_THROW(synthetic::ImuSensorOf("toaster"), InputError);
}

TEST(GivenPath, NeverLeadsThroughAWallOrAnythingElse) {
  for (const SyntheticScene scene : {SyntheticScene::kRoom, SyntheticScene::kHall}) {
    SyntheticOptions o = Along(Flight(14, 2), SyntheticSensor::kMono);
    o.scene = scene;
    o.supersample = 1;
    const SyntheticWorld world(o);
    for (std::size_t i = 0; i < world.Size(); i += 3) {
      double least = 0;
      cv::minMaxLoc(world.ExactDepth(i), &least);
      EXPECT_GT(least, 0.25) << i;  // 0: a gap that shows nothing
    }
  }
}

TEST(GivenPath, IsWrittenAsAEurocDatasetWhosePairsAreRectified) {
  const std::filesystem::path folder = testing::FreshFolder();
  SyntheticOptions o = Along(Flight(0.5), SyntheticSensor::kStereo);
  o.frames = 3;
  const SyntheticWorld world(o);
  ASSERT_EQ(WriteSyntheticDataset(world, folder), 3U);
  DatasetOptions read;
  read.sensor = Sensor::kStereo;
  const std::unique_ptr<Dataset> dataset = OpenDataset(folder, read);
  ASSERT_EQ(dataset->Size(), 3U);
  EXPECT_NEAR(dataset->Rig().baseline_m, 0.110, 0.002);
  const Trajectory truth = dataset->ReadGroundTruth(*dataset->GroundTruthFile(), nullptr);
  ASSERT_EQ(truth.size(), 3U);
  EXPECT_LT((truth[2].pose.translation - Flight(0.5)[2].pose.translation).norm(), 1e-6);
  const ReadResult pair = dataset->Read(1);
  ASSERT_TRUE(pair.frame);
  // Shifted by the disparity of what is where, the right image is the left one.
  const PinholeCamera camera = dataset->Rig().camera;
  const Pose T_rectified_left = dataset->Rig().T_body_camera.Inverse() * o.path->cameras[0].T_body_camera;
  const cv::Mat depth = world.ExactDepth(1);
  double difference = 0, unshifted = 0;
  int count = 0;
  for (int v = 30; v < depth.rows - 30; v += 3) {
    for (int u = 60; u < depth.cols - 60; u += 3) {
      const double z = depth.at<float>(v, u);
      const Eigen::Vector3d p = T_rectified_left * (z * o.path->cameras[0].camera.Unproject({u, v}));
      const Eigen::Vector2d at = camera.Project(p);
      const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
      const int shift = static_cast<int>(std::lround(camera.fx * dataset->Rig().baseline_m / p.z()));
      if (y < 0 || y >= pair.frame->image.rows || x >= pair.frame->image.cols || x - shift < 0) continue;
      const int left = pair.frame->image.at<std::uint8_t>(y, x);
      difference += std::abs(left - pair.frame->right.at<std::uint8_t>(y, x - shift));
      unshifted += std::abs(left - pair.frame->right.at<std::uint8_t>(y, x));
      ++count;
    }
  }
  ASSERT_GT(count, 3000);
  EXPECT_LT(difference / count, 8);
  EXPECT_LT(difference, 0.5 * unshifted);
}

TEST(GivenPath, HasDepthOfItsColourImagesAndIsTheSameWithSeveralThreads) {
  const std::filesystem::path folder = testing::FreshFolder();
  SyntheticOptions o = Along(Flight(0.5), SyntheticSensor::kRgbd);
  o.frames = 3;
  o.noise_sigma = 2;
  o.motion_blur_s = 0.02;
  const SyntheticWorld world(o);
  SyntheticWriteOptions threads;
  threads.threads = 3;
  WriteSyntheticDataset(world, folder, threads);
  DatasetOptions read;
  read.sensor = Sensor::kRgbd;
  const std::unique_ptr<Dataset> dataset = OpenDataset(folder, read);
  const ReadResult frame = dataset->Read(2);
  ASSERT_TRUE(frame.frame);
  ASSERT_FALSE(frame.frame->depth_m.empty());
  EXPECT_GT(cv::mean(frame.frame->depth_m)[0], 0.5);
  const ColourImage stored = dataset->ReadColour(2);
  EXPECT_FALSE(stored.image.empty());
  EXPECT_EQ(cv::norm(SyntheticWorld(o).Render(2).image, world.Render(2).image, cv::NORM_INF), 0);
}

TEST(GivenPath, SaysWhatDoesNotGoWithIt) {
  SyntheticOptions o = Along(Flight(1), SyntheticSensor::kMono);
  o.scene = SyntheticScene::kTown;
  EXPECT_NE(o.Validate().find("a room or a hall"), std::string::npos);
  o.scene = SyntheticScene::kHall;
  EXPECT_EQ(o.Validate(), "");
  o.dusk = true;
  EXPECT_NE(o.Validate(), "");
  o = SyntheticOptions();
  o.scene = SyntheticScene::kHall;
  EXPECT_NE(o.Validate().find("path"), std::string::npos);
  EXPECT_THROW(synthetic::FrameStamps(Flight(1, 100), 0), InputError);
  EXPECT_EQ(synthetic::FrameStamps(Flight(1, 100), 10).size(), 11U);
}

}  // namespace
}  // namespace tutti
