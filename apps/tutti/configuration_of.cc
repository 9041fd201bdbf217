#include "apps/tutti/configuration_of.h"

#include <cstdio>

#include "apps/run/recording.h"
#include "tutti/core/error.h"

namespace tutti::cli {

RunConfig ConfigurationOf(const std::string& config, const std::string& dataset) {
  if (!config.empty()) return LoadConfig(config);
  const Recording recording = Recognise(dataset, {});
  if (recording.guessed_lens) {
    throw InputError(
        dataset +
        ": nothing here says what the camera is: give --config FILE with a section camera, or put "
        "the file of a calibration beside the images (`tutti run` measures a focal length: "
        "camera_source in its summary.json)");
  }
  for (const std::string& finding : recording.findings) std::fprintf(stderr, "  %s\n", finding.c_str());
  return recording.config;
}

}  // namespace tutti::cli
