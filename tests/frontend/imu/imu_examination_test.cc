#include "frontend/imu/imu_examination.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/numbers.h"
#include "core/state_archive.h"
#include "frontend/dataset/imu_file.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

const Eigen::Quaterniond kMounting =
    ExpSO3({0.3, -1.1, 0.7});  // R_camera_imu, as nobody would mount it on purpose
const Eigen::Vector3d kBias(0.02, -0.05, 0.01);

// Of a body that turns about all axes.
Eigen::Quaterniond TurnedAt(double t) {
  return ExpSO3({0, 0, 0.5 * t}) * ExpSO3({0.3 * std::sin(1.7 * t), 0, 0}) *
         ExpSO3({0, 0.4 * std::sin(2.3 * t), 0});
}

struct TurnRecording {
  std::vector<ImuSample> samples;
  std::vector<double> times;                       // of frames
  std::vector<Eigen::Quaterniond> R_world_camera;  // of each
};

// 200 Hz and 20 frames a second; the IMU's stamps say so much more than the camera's clock.
TurnRecording RecordTurns(double seconds, double late_s = 0) {
  TurnRecording recording;
  const double h = 1e-4;
  for (int i = 0; i * 0.005 < seconds; ++i) {
    const double t = i * 0.005;
    ImuSample sample;
    sample.stamp_s = t + late_s;
    sample.gyro = LogSO3(TurnedAt(t - h).conjugate() * TurnedAt(t + h)) / (2 * h) + kBias;
    sample.acceleration = TurnedAt(t).conjugate() * Eigen::Vector3d(0, 0, 9.81);
    recording.samples.push_back(sample);
  }
  for (double t = 0.5; t < seconds - 0.5; t += 0.05) {
    recording.times.push_back(t);
    recording.R_world_camera.push_back(TurnedAt(t) * kMounting.conjugate());
  }
  return recording;
}

ImuExamination Examined(const TurnRecording& recording, const ImuCalibration& known = {}) {
  ImuExamination examination(known);
  examination.Add(recording.samples);
  for (std::size_t i = 1; i < recording.times.size(); ++i)
    examination.AddStep(recording.times[i - 1], recording.times[i],
                        recording.R_world_camera[i - 1].conjugate() * recording.R_world_camera[i]);
  examination.Examine();
  return examination;
}

std::string FindingsOf(const ImuExamination& examination) {
  std::string text;
  for (const ImuFinding& f : examination.report().findings) text += f.measured + "; " + f.advice + "\n";
  return text;
}

ImuCalibration Mounted() {
  ImuCalibration known;
  known.T_camera_imu = Pose(kMounting, Eigen::Vector3d::Zero());
  return known;
}

TEST(ImuExamination, SaysWhatItFoundOnTheWay) {
  const ImuExamination examination = Examined(RecordTurns(30));
  const std::vector<ImuTurn> turns = examination.Turns();
  ASSERT_GT(turns.size(), 500U);
  for (const ImuTurn& turn : turns) {
    EXPECT_NEAR(turn.camera_deg_s, turn.gyro_deg_s, 0.1);
    EXPECT_LT(turn.apart_deg, 0.01);
  }
  const std::vector<ImuMoment> moments = examination.report().moments;
  ASSERT_GT(moments.size(), 8U);
  EXPECT_LT((moments.back().gyro_bias - kBias).norm(), 1e-3);
  EXPECT_LT(moments.front().stamp_s, moments.back().stamp_s);
}

TEST(ImuExamination, FindsMountingBiasAndTimeOffsetOfAnUnknownImu) {
  for (const double late_s : {0.0, 0.005, 0.02, 0.05}) {
    const ImuExamination examination = Examined(RecordTurns(20, late_s));
    const ImuReport& report = examination.report();
    EXPECT_TRUE(report.trusted) << FindingsOf(examination);
    ASSERT_TRUE(report.R_camera_imu);
    EXPECT_LT(report.R_camera_imu->angularDistance(kMounting) * internal::kDegrees, 0.05);
    EXPECT_NEAR(report.time_offset_s, -late_s, 0.0005);
    EXPECT_LT((report.gyro_bias - kBias).norm(), 0.0005);
    EXPECT_LT(report.residual_deg, 0.01);
    const auto turn = examination.CameraTurn(10.02, 10.62);
    ASSERT_TRUE(turn);
    const Eigen::Quaterniond truth =
        (TurnedAt(10.62) * kMounting.conjugate()).conjugate() * (TurnedAt(10.02) * kMounting.conjugate());
    EXPECT_LT(turn->angularDistance(truth) * internal::kDegrees, 0.05);
    EXPECT_FALSE(examination.CameraTurn(10, 12));
  }
}

TEST(ImuExamination, BelievesPosesWithNoiseAndLeavesOutWrongOnes) {
  TurnRecording recording = RecordTurns(30);
  std::uint64_t state = 1;
  const auto noise = [&] {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return (static_cast<double>(state >> 40U) / (1U << 24U) - 0.5) * 2e-3;
  };
  for (std::size_t i = 0; i < recording.R_world_camera.size(); ++i) {
    const double x = noise(), y = noise(), z = noise();
    recording.R_world_camera[i] = recording.R_world_camera[i] * ExpSO3({x, y, z});
    if (i % 40 == 7) recording.R_world_camera[i] = recording.R_world_camera[i] * ExpSO3({0.1, 0, 0});
  }
  const ImuReport report = Examined(recording).report();
  EXPECT_TRUE(report.trusted);
  ASSERT_TRUE(report.R_camera_imu);
  EXPECT_LT(report.R_camera_imu->angularDistance(kMounting) * internal::kDegrees, 0.3);
  EXPECT_NEAR(report.time_offset_s, 0, 0.002);
}

TEST(ImuExamination, NamesEachContradiction) {
  const TurnRecording good = RecordTurns(20);
  const auto with = [&](const auto& change) {
    TurnRecording recording = good;
    for (ImuSample& sample : recording.samples) change(sample);
    return Examined(recording, Mounted());
  };
  EXPECT_EQ(FindingsOf(with([](ImuSample&) {})), "");
  EXPECT_NE(FindingsOf(with([](ImuSample& s) { s.gyro *= internal::kDegrees; })).find("deg/s"),
            std::string::npos);
  EXPECT_NE(FindingsOf(with([](ImuSample& s) { std::swap(s.gyro.x(), s.gyro.y()); })).find("left-handed"),
            std::string::npos);
  EXPECT_NE(FindingsOf(with([](ImuSample& s) {
              s.gyro = {s.gyro.y(), s.gyro.z(), s.gyro.x()};
            })).find("mounted otherwise"),
            std::string::npos);
  EXPECT_NE(FindingsOf(with([](ImuSample& s) { s.stamp_s += 0.1; })).find("off by -100 ms"),
            std::string::npos);
  EXPECT_NE(FindingsOf(with([](ImuSample& s) { s.stamp_s += 0.1; })).find("time_offset_s: -0.100"),
            std::string::npos);
  EXPECT_NE(
      FindingsOf(with([](ImuSample& s) { s.gyro = Eigen::Vector3d(0.001, 0, 0); })).find("does not turn"),
      std::string::npos);
  TurnRecording other = good;
  for (std::size_t i = 0; i < other.samples.size(); ++i) {
    const double t = 7 + 1.31 * other.samples[i].stamp_s;
    other.samples[i].gyro = LogSO3(TurnedAt(t).conjugate() * TurnedAt(t + 1e-4)) / 1e-4;
  }
  const ImuExamination foreign = Examined(other, Mounted());
  EXPECT_NE(FindingsOf(foreign).find("does not turn as the images do"), std::string::npos);
  EXPECT_FALSE(foreign.report().trusted);
  EXPECT_FALSE(foreign.CameraTurn(10, 10.05));
}

TEST(ImuExamination, SaysNothingWithoutTurning) {
  TurnRecording still = RecordTurns(20);
  for (ImuSample& sample : still.samples) sample.gyro = kBias;
  for (Eigen::Quaterniond& R : still.R_world_camera) R.setIdentity();
  const ImuExamination examination = Examined(still, Mounted());
  EXPECT_EQ(FindingsOf(examination), "");
  EXPECT_FALSE(examination.report().trusted);
}

TEST(ImuExamination, AboutOneAxisBelievesTheCalibration) {
  TurnRecording car = RecordTurns(20);
  const auto heading = [](double t) { return ExpSO3({0, 0, 0.6 * std::sin(0.8 * t)}); };
  for (ImuSample& s : car.samples) s.gyro = Eigen::Vector3d(0, 0, 0.48 * std::cos(0.8 * s.stamp_s)) + kBias;
  for (std::size_t i = 0; i < car.times.size(); ++i)
    car.R_world_camera[i] = heading(car.times[i]) * kMounting.conjugate();
  EXPECT_FALSE(Examined(car).report().trusted);
  const ImuExamination known = Examined(car, Mounted());
  EXPECT_TRUE(known.report().trusted) << FindingsOf(known);
}

TEST(ImuExamination, GoesOnFromItsState) {
  const TurnRecording recording = RecordTurns(20);
  ImuExamination before = Examined(recording);
  internal::SharedObjectsOut out_shared;
  internal::StateWriter out(&out_shared);
  out(before);
  const std::string bytes = out.Take();
  EXPECT_FALSE(bytes.empty());
}

// Real gyroscopes against real poses; the six sequences of euroc_imu.
TEST(ImuExamination, OfRealRecordingsExplainsTheirPoses) {
  TUTTI_REQUIRE_DATA(data, "euroc_imu");
  for (const char* name : {"MH03", "MH04", "V102", "V103", "V201", "V202"}) {
    const std::vector<ImuSample> samples = ReadImuFile(data / (std::string(name) + "_imu.csv"));
    const Trajectory poses = ReadTrajectory(data / (std::string(name) + "_body.tum"), TrajectoryFormat::kTum);
    ImuExamination examination;
    examination.Add(samples);
    for (std::size_t i = 1; i < poses.size(); ++i)
      examination.AddStep(poses[i - 1].stamp_s, poses[i].stamp_s,
                          poses[i - 1].pose.rotation.conjugate() * poses[i].pose.rotation);
    examination.Examine();
    const ImuReport& report = examination.report();
    EXPECT_TRUE(report.trusted) << name << FindingsOf(examination);
    EXPECT_LT(report.residual_deg, 0.02) << name;
    EXPECT_LT(std::abs(report.time_offset_s), 0.002) << name;
    ASSERT_TRUE(report.R_camera_imu);
    EXPECT_LT(report.R_camera_imu->angularDistance(Eigen::Quaterniond::Identity()) * internal::kDegrees, 0.3)
        << name;
    std::printf("%s residual %.4f deg, offset %.2f ms, mounting %.3f deg, bias %.5f %.5f %.5f\n", name,
                report.residual_deg, 1000 * report.time_offset_s,
                report.R_camera_imu->angularDistance(Eigen::Quaterniond::Identity()) * internal::kDegrees,
                report.gyro_bias.x(), report.gyro_bias.y(), report.gyro_bias.z());
  }
}

}  // namespace
}  // namespace tutti
