// tutti calibrate-check: can the calibration be right?
#include <cstdio>
#include <memory>
#include <string>

#include "apps/tutti/commands.h"
#include "apps/tutti/recording_options.h"
#include "core/terminal.h"
#include "tutti/frontend/calibration_check.h"
#include "tutti/slam/config.h"

namespace tutti::cli {
namespace {

struct CheckArguments {
  std::string config, dataset;
  CameraRequest camera;
};

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
  if (report.findings.empty()) std::printf("  nothing speaks against this calibration\n");
  return report.findings.empty() ? 0 : 1;
}

}  // namespace

void SetUpCalibrateCheck(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<CheckArguments>();
  command.add_option("dataset,--dataset", arguments->dataset, "the recording, as for `tutti run`")
      ->required();
  command.add_option("--config", arguments->config,
                     "YAML file, as for `tutti run`; without it, what is found in the recording is checked");
  AddCameraOptions(command, arguments->camera);
  command.callback([arguments, &exit_code] { exit_code = Check(*arguments); });
}

}  // namespace tutti::cli
