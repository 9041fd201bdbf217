#include "apps/tutti/configuration_of.h"

#include <cstdio>

#include "core/terminal.h"
#include "tutti/core/error.h"

namespace tutti::cli {

void SayFindings(const Recording& recording) {
  for (const std::string& finding : recording.findings)
    std::fputs(internal::Message("  " + finding).c_str(), internal::StandardError());
}

RunConfig ConfigurationOf(const std::string& config, const std::string& dataset,
                          const CameraRequest& camera) {
  if (!config.empty()) {
    RunConfig read = LoadConfig(config);
    SetCamera(dataset, camera, read);
    return read;
  }
  const Recording recording = Recognise(dataset, camera);
  if (recording.guessed_lens) {
    throw InputError(
        dataset +
        ": nothing here says what the camera is: give --calibration FILE, --camera or --fov, or put "
        "a calibration file into its folder (`tutti run` measures a focal length: camera_source "
        "in its summary.json)");
  }
  SayFindings(recording);
  return recording.config;
}

}  // namespace tutti::cli
