// What a command that reads a recording starts from.
#pragma once

#include <string>

#include "apps/run/recording.h"
#include "tutti/slam/config.h"

namespace tutti::cli {

/// What Recognise found, a line each on stderr.
void SayFindings(const Recording& recording);

/// The configuration in the file `config`; without one (empty), what the recording itself says, which is
/// printed on stderr. `camera`: what the command line says of it, which goes before both. Throws InputError
/// as LoadConfig and Recognise do, and where nothing says what the camera is.
RunConfig ConfigurationOf(const std::string& config, const std::string& dataset, const CameraRequest& camera);

}  // namespace tutti::cli
