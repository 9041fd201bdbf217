// tutti calibrate-check: can the calibration be right?
#include <cstdio>
#include <memory>
#include <string>

#include "apps/tutti/commands.h"
#include "apps/tutti/recording_options.h"
#include "core/numbers.h"
#include "core/terminal.h"
#include "frontend/dataset/imu_file.h"
#include "frontend/imu/imu_examination.h"
#include "tutti/frontend/calibration_check.h"
#include "tutti/slam/config.h"

namespace tutti::cli {
namespace {

struct CheckArguments {
  std::string config, dataset, poses;
  CameraRequest camera;
};

// Adds what poses of the body say of the IMU: a line for each minute, and the findings of the last one.
void CompareWithPoses(const Dataset& dataset, const std::vector<ImuSample>& samples, const Trajectory& poses,
                      ImuReport* report) {
  constexpr std::size_t kMinute = 1200;  // poses
  const CameraRig& rig = dataset.Rig();
  ImuExamination examination(rig.imu.value_or(ImuCalibration()));
  std::size_t next = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    std::vector<ImuSample> until;
    while (next < samples.size() && samples[next].stamp_s <= poses[i].stamp_s + 1)
      until.push_back(samples[next++]);
    examination.Add(until);
    const auto camera = [&](const Pose& body) { return body.rotation * rig.T_body_camera.rotation; };
    examination.AddStep(poses[i - 1].stamp_s, poses[i].stamp_s,
                        camera(poses[i - 1].pose).conjugate() * camera(poses[i].pose));
    if (i % kMinute != 0 && i + 1 < poses.size()) continue;
    examination.Examine();
    const ImuReport& found = examination.report();
    if (!(found.agreement > 0)) continue;
    std::printf(
        "  against the poses until %.1f s: %.0f deg turned, of which it explains %.2f %% and leaves %.4f deg "
        "a step;\n    clock off by %.2f ms (sigma %.2f), gyroscope's bias %.4f %.4f %.4f rad/s\n",
        poses[i].stamp_s - poses[0].stamp_s, found.turned_deg, 100 * found.agreement, found.residual_deg,
        1000 * found.time_offset_s, 1000 * found.time_offset_sigma_s, found.gyro_bias.x(),
        found.gyro_bias.y(), found.gyro_bias.z());
    if (!found.R_camera_imu) continue;
    const Eigen::Quaterniond q = *found.R_camera_imu;
    std::printf("    mounting, IMU to camera (x y z w): %.5f %.5f %.5f %.5f (sigma %.3f deg)", q.x(), q.y(),
                q.z(), q.w(), found.mounting_sigma_deg);
    if (rig.imu && rig.imu->T_camera_imu)
      std::printf(", %.3f deg from the calibration",
                  internal::kDegrees * q.angularDistance(rig.imu->T_camera_imu->rotation));
    std::printf("\n");
  }
  const std::vector<ImuFinding>& found = examination.report().findings;
  report->findings.insert(report->findings.end(), found.begin(), found.end());
}

// The findings of the IMU beside the images; none if there is no IMU.
std::vector<ImuFinding> CheckImu(const CheckArguments& arguments, const DatasetOptions& options,
                                 const Dataset& dataset) {
  std::optional<ImuReport> report = dataset.Imu();
  if (!report) return {};
  std::printf("  %s, median acceleration %.2f m/s^2\n", ImuText(*report).c_str(), report->acceleration_mps2);
  if (report->noise)
    std::printf("    at rest for %.1f s: noise %.2g rad/s/sqrt(Hz), %.2g m/s^2/sqrt(Hz), of the worst axis\n",
                report->noise->rest_s, report->noise->gyro_density, report->noise->acceleration_density);
  std::optional<std::filesystem::path> file = dataset.GroundTruthFile();
  if (!arguments.poses.empty()) file = arguments.poses;
  if (report->findings.empty() && file) {
    std::vector<std::string> notes;
    const Trajectory poses = dataset.ReadGroundTruth(*file, &notes);
    if (HasRotations(poses))
      CompareWithPoses(dataset, ReadImu(*FindImu(arguments.dataset, options.imu_topic)), poses, &*report);
  }
  return report->findings;
}

int Check(const CheckArguments& arguments) {
  const RunConfig config = ConfigurationOf(arguments.config, arguments.dataset, arguments.camera);
  const std::unique_ptr<Dataset> dataset = OpenDataset(arguments.dataset, config.dataset);
  const CameraRig& rig = dataset->Rig();
  for (const std::string& warning : dataset->Warnings())
    std::printf("  note: %s\n", internal::Printable(warning).c_str());
  if (!rig.calibrated) {
    std::printf("  no calibration: nothing to check\n");
    return 1;
  }
  const CalibrationReport report = CheckCalibration(*dataset);
  const PinholeCamera& c = rig.camera;
  std::printf("  image %dx%d px, after rectification fx %.2f, fy %.2f, cx %.2f, cy %.2f px\n", c.width,
              c.height, c.fx, c.fy, c.cx, c.cy);
  std::printf("  field of view %.1f deg; principal point %.1f %% of the side from the middle\n",
              report.view_deg, 100 * report.centre_offset);
  if (rig.sensor == Sensor::kStereo) {
    std::printf(
        "  baseline %.4f m; %d matches between left and right: %.0f %% in the same row, median %.2f px "
        "apart; %.0f %% with a negative disparity\n",
        rig.baseline_m, report.stereo_matches, 100 * report.same_row, report.row_error_px,
        100 * report.swapped);
    if (report.stereo_matches < CalibrationCheckOptions().min_matches)
      std::printf("  too few matches to tell whether the pairs are rectified\n");
  }
  if (rig.sensor == Sensor::kRgbd) {
    std::printf("  depth at %.0f %% of the pixels, median %.2f m\n", 100 * report.depth_share,
                report.depth_median_m);
  }
  for (const CalibrationFinding& finding : report.findings)
    std::printf("  can't be right: %s\n    what to do: %s\n", internal::Printable(finding.measured).c_str(),
                finding.advice.c_str());
  const std::vector<ImuFinding> imu = CheckImu(arguments, config.dataset, *dataset);
  for (const ImuFinding& finding : imu)
    std::printf("  the IMU can't be right: %s\n    what to do: %s\n", finding.measured.c_str(),
                finding.advice.c_str());
  const bool clear = report.findings.empty() && imu.empty();
  if (clear) std::printf("  nothing speaks against this calibration\n");
  return clear ? 0 : 1;
}

}  // namespace

void SetUpCalibrateCheck(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<CheckArguments>();
  command.add_option("dataset,--dataset", arguments->dataset, "the recording, as for `tutti run`")
      ->required();
  command.add_option("--config", arguments->config,
                     "YAML file, as for `tutti run`; without it, what is found in the recording is checked");
  command
      .add_option("--poses", arguments->poses,
                  "poses of the body (TUM, EuRoC), for an IMU beside the images: also trajectory.txt of a "
                  "run; default: the recording's ground truth")
      ->type_name("FILE");
  AddCameraOptions(command, arguments->camera);
  command.callback([arguments, &exit_code] { exit_code = Check(*arguments); });
}

}  // namespace tutti::cli
