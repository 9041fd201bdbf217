// Options of the commands that read a recording: its camera, which of its frames, a page to look at it.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/run/recording.h"
#include "apps/tutti/options.h"
#include "apps/view/live_view.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/config.h"

namespace tutti::cli {

/// --calibration, --camera, --fov and --sensor.
void AddCameraOptions(CLI::App& command, CameraRequest& camera);

/// What Recognise found, a line each on stderr.
void SayFindings(const Recording& recording);

/// The configuration in the file `config`; without one (empty), what the recording itself says, which is
/// printed on stderr. `camera`: what the command line says of it, which goes before both. Throws InputError
/// as LoadConfig and Recognise do, and where nothing says what the camera is.
RunConfig ConfigurationOf(const std::string& config, const std::string& dataset, const CameraRequest& camera);

/// --mask.
void AddMaskOption(CLI::App& command, std::string& mask);
/// The mask as a program in another folder finds it: the configuration is kept with maps and checkpoints.
void SetMask(const std::string& mask, DatasetOptions& options);

/// --threads; the help shows no default, as the configuration has one.
template <class Number>
void AddThreads(CLI::App& command, Number& threads) {
  AddOption(command, "--threads", threads, "most threads; the result is the same for any number", Positive());
}
/// --seed.
void AddSeed(CLI::App& command, std::optional<std::uint64_t>& seed);
/// --start; `what`: "frame" or "image".
void AddStart(CLI::App& command, const std::string& what, std::optional<int>& start);
/// --end and --stride.
void AddEndAndStride(CLI::App& command, const std::string& what, std::optional<int>& end,
                     std::optional<int>& stride);

/// A page that shows the command at work.
struct ViewOptions {
  bool view = false;
  LiveViewOptions live;
};

/// --view, --view-port, --view-address, --view-wait.
void AddViewOptions(CLI::App& command, ViewOptions& options);

/// Serves the page, if it was asked for, and prints its address (`quiet`: only one that can't be known
/// before: a free port, or a token). The view becomes one of the observers. Throws InputError if it can't.
void StartView(const CLI::App& command, const ViewOptions& options, bool quiet,
               std::vector<std::shared_ptr<RunObserver>>& observers);

}  // namespace tutti::cli
