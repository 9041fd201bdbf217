// Images and an IMU, from their making to the run, as a user goes through it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "core/numbers.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::ReadAll;
using testing::RunTutti;

// Of the body; world z is up.
Eigen::Quaterniond TurnedOnTheWay(double t) {
  return ExpSO3({0, 0, 0.3 * t}) * ExpSO3({0.15 * std::sin(1.7 * t), 0.15 * std::sin(2.3 * t), 0});
}

// Twelve seconds in a room, looking ahead, with a BMI055.
class RenderedFlight : public ::testing::Test {
 protected:
  // Rendered once.
  static const fs::path& Folder() {
    static const fs::path folder = Render(testing::FreshFolder());
    return folder;
  }
  const fs::path folder_ = Folder();

 private:
  static fs::path Render(const fs::path& root) {
    fs::path folder = root / "flight";
    std::ofstream path(root / "body.tum");
    for (int i = 0; i <= 240; ++i) {
      const double t = 0.05 * i;
      const Eigen::Quaterniond q = TurnedOnTheWay(t);
      path << 100 + t << ' ' << std::sin(0.5 * t) << ' ' << 0.8 * std::cos(0.4 * t) << ' '
           << 1.4 + 0.3 * std::sin(0.9 * t) << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' ' << q.w()
           << '\n';
    }
    path.close();
    std::vector<std::string> command = {"generate",     "--out",           folder,  "--sensor", "stereo",
                                        "--trajectory", root / "body.tum", "--imu", "bmi055",   "--width",
                                        "320",          "--height",        "240",   "--rate",   "15",
                                        "--body-camera"};
    for (const char* number : {"0", "0", "1", "0.05", "-1", "0", "0", "0.06", "0", "-1", "0", "0"})
      command.emplace_back(number);
    Done(RunTutti(command));
    return folder;
  }
};

TEST_F(RenderedFlight, TheRunSaysWhatTheImuDidAndItsWorldIsUpright) {
  const fs::path out = folder_.parent_path() / "run";
  EXPECT_THAT(Done(RunTutti({"run", folder_, "--out", out, "--no-report"})),
              AllOf(HasSubstr("the IMU agrees with the images"), HasSubstr("z axis points up")));
  const nlohmann::json imu = nlohmann::json::parse(ReadAll(out / "summary.json")).at("imu");
  EXPECT_TRUE(imu.at("used"));
  EXPECT_NEAR(imu.at("gravity").at("up").at(2).get<double>(), 1, 1e-6);
  for (const char* file : {"trajectory.txt", "trajectory_odometry.txt"}) {
    const Trajectory poses = ReadTrajectory(out / file, TrajectoryFormat::kTum);
    ASSERT_GT(poses.size(), 150U) << file;
    const double t = poses.back().stamp_s - 100;
    const Eigen::Quaterniond truth = TurnedOnTheWay(t);
    const Eigen::Vector3d up = poses.back().pose.rotation * (truth.conjugate() * Eigen::Vector3d::UnitZ());
    EXPECT_LT(std::acos(std::min(1.0, up.z())) * internal::kDegrees, 1) << file;
  }
}

TEST_F(RenderedFlight, WithoutItTheWorldIsThatOfTheFirstFrame) {
  const fs::path out = folder_.parent_path() / "without";
  EXPECT_THAT(Done(RunTutti({"run", folder_, "--out", out, "--no-report", "--no-imu"})),
              Not(HasSubstr("the IMU")));
  EXPECT_FALSE(nlohmann::json::parse(ReadAll(out / "summary.json")).contains("imu"));
}

TEST_F(RenderedFlight, CalibrateCheckFindsTheMounting) {
  EXPECT_THAT(Done(RunTutti({"calibrate-check", folder_})),
              AllOf(HasSubstr("IMU: 2401 measurements, 200 Hz"), HasSubstr("deg from the calibration"),
                    HasSubstr("nothing speaks against")));
}

TEST_F(RenderedFlight, AnImuOfOnesOwnIsAsGood) {
  const fs::path own = folder_.parent_path() / "imu.txt";
  std::ifstream csv(folder_ / "mav0/imu0/data.csv");
  std::ofstream text(own);
  for (std::string line; std::getline(csv, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::size_t comma = line.find(',');
    std::string rest = line.substr(comma);
    for (char& c : rest) c = c == ',' ? ' ' : c;
    text << std::to_string(1e-9 * std::stod(line.substr(0, comma))) << rest << '\n';
  }
  text.close();
  EXPECT_THAT(
      testing::RunProgramAndSignal(TUTTI_EXAMPLE_10, {folder_ / "config.yaml", folder_, own}, "", 0).output,
      AllOf(HasSubstr("it agrees with the images"), HasSubstr("z axis points up")));
}

// Walls are ten metres away, and the drone rises by centimetres: what the first views show looks nearly the
// same where near is far and the camera went the opposite way.
TEST(RenderedHall, OneCameraDoesNotBeginWithTheOppositeMotion) {
  TUTTI_REQUIRE_DATA(flights, "euroc_imu");
  const fs::path root = testing::FreshFolder();
  Done(RunTutti({"generate", "--out", root / "hall", "--sensor", "mono", "--world", "hall", "--trajectory",
                 flights / "MH04_body.tum", "--lens", "euroc", "--supersample", "1", "--frames", "60"}));
  Done(RunTutti({"run", root / "hall", "--out", root / "run", "--no-loops", "--no-report", "--no-map",
                 "--require", "failed"}));
  const nlohmann::json errors =
      nlohmann::json::parse(ReadAll(root / "run" / "summary.json")).at("evaluation");
  EXPECT_LT(errors.at("odometry").at("ate_rotation_rmse_deg").get<double>(), 60) << "178 if it does";
  EXPECT_LT(errors.at("odometry").at("ate_rmse_m").get<double>(), 0.03 * errors.at("path_m").get<double>());
}

}  // namespace
}  // namespace tutti
