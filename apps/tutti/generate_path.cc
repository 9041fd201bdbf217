#include "apps/tutti/generate_path.h"

#include <algorithm>
#include <memory>

#include "apps/tutti/files.h"
#include "core/replaced_file.h"
#include "data/synthetic/given_path.h"
#include "data/synthetic/imu_sensor.h"
#include "frontend/dataset/imu_file.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

std::optional<Pose> TransformOf(const std::vector<double>& rows) {
  if (rows.empty()) return std::nullopt;
  if (rows.size() != 12 && rows.size() != 16)
    throw InputError("--body-camera takes a matrix of 12 or 16 numbers, row by row; these are " +
                     std::to_string(rows.size()));
  TransformRows all = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
  std::copy(rows.begin(), rows.end(), all.begin());
  return RigidTransform(all);
}

std::vector<synthetic::MountedCamera> CamerasOf(const PathArguments& arguments, const SyntheticOptions& o) {
  const std::optional<Pose> mounting = TransformOf(arguments.T_body_camera);
  std::vector<synthetic::MountedCamera> cameras = synthetic::EurocCameras();
  if (arguments.lens == "plain") {
    PinholeCamera& c = cameras[0].camera;
    c = PinholeCamera();
    c.width = o.width, c.height = o.height;
    c.fx = c.fy = o.focal_px;
    c.cx = 0.5 * (o.width - 1), c.cy = 0.5 * (o.height - 1);
    cameras[0].T_body_camera = Pose();
    cameras[1].camera = c;
    cameras[1].T_body_camera = Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(o.baseline_m, 0, 0));
  }
  if (mounting) {
    const Pose T_left_right = cameras[0].T_body_camera.Inverse() * cameras[1].T_body_camera;
    cameras[0].T_body_camera = *mounting;
    cameras[1].T_body_camera = *mounting * T_left_right;
  }
  if (o.sensor != SyntheticSensor::kStereo) cameras.resize(1);
  return cameras;
}

}  // namespace

void AddPathOptions(CLI::App& c, PathArguments& a) {
  CLI::Option* way =
      c.add_option(
           "--trajectory", a.trajectory,
           "render a room or hall along these poses (TUM, or EuRoC's csv; of the body in the world, z "
           "up), a frame at each or --rate; written in EuRoC's layout")
          ->type_name("FILE");
  c.add_option("--lens", a.lens,
               "with --trajectory: plain, or euroc (both cameras of EuRoC, where they are on its body, with "
               "their distortion)")
      ->check(CLI::IsMember({"plain", "euroc"}))
      ->type_name("NAME")
      ->needs(way);
  c.add_option(
       "--body-camera", a.T_body_camera,
       "with --trajectory: 12 numbers, row by row, of the (left) camera's place on the body (default: "
       "EuRoC's with its lens, else none: the camera is the body)")
      ->expected(12, 16)
      ->type_name("R11 R12 ...")
      ->needs(way);
  CLI::Option* imu =
      c.add_option("--imu", a.imu,
                   "with --trajectory: add what an IMU measures on that way: bmi055, adis16448 "
                   "(EuRoC's) or phone")
          ->check(CLI::IsMember({"bmi055", "adis16448", "phone"}))
          ->type_name("NAME")
          ->needs(way);
  c.add_option("--imu-file", a.imu_file,
               "with --trajectory: add what an IMU really measured there (EuRoC's csv)")
      ->type_name("FILE")
      ->needs(way)
      ->excludes(imu);
  AddDefaulted(c, "--imu-delay", a.imu_delay_ms, "with --trajectory: the IMU's stamps say so much more [ms]")
      ->needs(way);
  c.add_option("--exposure-ms", a.exposure_ms,
               "exposure time [ms], for motion blur; as --blur, which has it in s");
}

void SetPath(const PathArguments& a, bool scene_given, SyntheticOptions* options) {
  if (a.exposure_ms) options->motion_blur_s = *a.exposure_ms / 1000;
  if (a.trajectory.empty()) return;
  const fs::path file = a.trajectory;
  const Trajectory poses = ReadTrajectory(file, GuessTrajectoryFormat(file));
  if (poses.size() < 3 || !HasRotations(poses))
    throw InputError(file.string() + ": a path needs three poses or more, with rotations");
  if (!scene_given) options->scene = SyntheticScene::kRoom;
  const double rate = options->rate_hz;
  *options = options->Resolved();
  options->path = std::make_shared<const synthetic::GivenPath>(synthetic::GivenPath{
      synthetic::PoseSpline(poses), synthetic::FrameStamps(poses, rate), CamerasOf(a, *options)});
}

std::size_t WriteImu(const PathArguments& a, const SyntheticOptions& options, const fs::path& folder) {
  if (a.imu.empty() && a.imu_file.empty()) return 0;
  synthetic::ImuSensor sensor;
  std::vector<ImuSample> samples;
  if (!a.imu.empty()) {
    sensor = synthetic::ImuSensorOf(a.imu);
    samples = synthetic::SampleImu(options.path->spline, sensor, options.seed);
  } else {
    samples = ReadImuFile(a.imu_file);
    sensor.name = fs::path(a.imu_file).filename().string();
    if (samples.size() > 1)
      sensor.rate_hz = std::round(static_cast<double>(samples.size() - 1) /
                                  (samples.back().stamp_s - samples.front().stamp_s));
  }
  for (ImuSample& sample : samples) sample.stamp_s += a.imu_delay_ms / 1000;
  const fs::path imu = folder / "mav0" / "imu0";
  MakeFolder(imu);
  internal::WriteFile(imu / "data.csv", synthetic::EurocImuCsv(samples));
  internal::WriteFile(imu / "sensor.yaml", synthetic::EurocImuYaml(sensor));
  return samples.size();
}

}  // namespace tutti::cli
