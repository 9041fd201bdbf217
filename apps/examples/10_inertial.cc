// Example 10: an IMU of one's own beside the images: its measurements travel with the frames.
//
//   10_inertial CONFIG.yaml FOLDER IMU.txt     # IMU.txt: time, angular velocity x y z, acceleration x y z
//
//   tutti generate --out flight --sensor stereo --trajectory body.tum --imu bmi055     # data to try it with
#include <cstdio>
#include <exception>
#include <fstream>
#include <memory>
#include <string>

#include "tutti/frontend/dataset.h"
#include "tutti/slam/config.h"
#include "tutti/slam/slam_system.h"

namespace {

// Stands for a driver's thread: rad/s and m/s^2 with gravity, stamps by the camera's clock [s].
void Drive(const std::string& file, tutti::ImuBuffer* measurements) {
  std::ifstream in(file);
  tutti::ImuSample s;
  while (in >> s.stamp_s >> s.gyro.x() >> s.gyro.y() >> s.gyro.z() >> s.acceleration.x() >>
         s.acceleration.y() >> s.acceleration.z())
    measurements->Push(s);
}

int Run(const std::string& config_file, const std::string& folder, const std::string& imu_file) {
  tutti::RunConfig config = tutti::LoadConfig(config_file);
  config.dataset.imu = false;  // we bring our own
  const std::unique_ptr<tutti::Dataset> dataset = tutti::OpenDataset(folder, config.dataset);
  tutti::ImuBuffer measurements;
  Drive(imu_file, &measurements);
  tutti::SlamSystem slam(config, dataset->Rig());  // the mounting is measured; CameraRig::imu would tell it
  for (std::size_t i = 0; i < dataset->Size(); ++i) {
    tutti::ReadResult read = dataset->Read(i);
    if (!read.frame) continue;
    read.frame->imu = measurements.TakeUntil(read.frame->stamp_s);
    slam.Track(*read.frame);
  }
  slam.Finish();
  const std::optional<tutti::ImuReport> imu = slam.odometry()->Report().imu;
  if (!imu) {
    std::printf("no measurements\n");
    return 1;
  }
  for (const tutti::ImuFinding& finding : imu->findings)
    std::printf("%s; %s\n", finding.measured.c_str(), finding.advice.c_str());
  std::printf("%s; its clock is off by %.1f ms\n", imu->trusted ? "it agrees with the images" : "not used",
              1000 * imu->time_offset_s);
  if (imu->up) std::printf("the world's z axis points up\n");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s CONFIG.yaml FOLDER IMU.txt\n", argv[0]);
    return 1;
  }
  try {
    return Run(argv[1], argv[2], argv[3]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
