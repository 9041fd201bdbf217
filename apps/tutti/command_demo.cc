// tutti demo: a short synthetic town with a loop, SLAM with and without the ensemble, and what the ensemble
// bought.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include "apps/report/page.h"
#include "apps/run/interrupt.h"
#include "apps/run/progress.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/run_with_report.h"
#include "core/terminal.h"
#include "data/synthetic/synthetic_world.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

// A lap around one block and a bit more, so that the start is driven again.
SyntheticOptions DemoWorld() {
  SyntheticOptions options;
  options.sensor = SyntheticSensor::kStereo;
  options.blocks_x = 1;
  options.blocks_y = 1;
  options.width = 512;
  options.height = 256;
  options.block_m = 26;
  options.laps = 1.15;
  options.rate_hz = 4.5;
  options.supersample = 1;
  options.noise_sigma = 4;  // an odometry without drift would need no loop
  return options;
}

RunConfig DemoConfig() {
  RunConfig config;
  config.dataset.type = DatasetType::kKitti;
  config.dataset.sensor = Sensor::kStereo;
  config.odometry.features = 1000;
  return config;
}

int Demo(const fs::path& out) {
  const fs::path data = out / "town";
  std::error_code ignored;
  fs::create_directories(out, ignored);
  const SyntheticWorld world(DemoWorld());
  const int threads = std::max(1, std::min(4, static_cast<int>(std::thread::hardware_concurrency())));
  internal::Say("rendering a synthetic town, %zu stereo pairs, into %s", world.Size(), data.c_str());
  {
    const InterruptGuard guard;
    Progress progress("rendering", world.Size());
    SyntheticWriteOptions write;
    write.threads = threads;
    write.force = true;
    write.progress = [&](std::size_t done, std::size_t) {
      progress.Update(done, "");
      return !InterruptGuard::Requested();
    };
    WriteSyntheticDataset(world, data, write);
    if (InterruptGuard::Requested()) {
      internal::Say("interrupted while rendering; nothing was run");
      return 130;
    }
  }
  internal::Say("SLAM with the ensemble of SURF, SIFT and ORB, beside the odometry alone");
  RunRequest request;
  request.config = "tutti demo";
  request.dataset = data;
  request.out = out / "run";
  const RunResult result = RunAndPrint(request, DemoConfig());
  std::printf("\n  plot:       %s and .svg\n", (result.folder / "trajectory.png").c_str());
  if (ReportsAvailable()) std::printf("  report:     %s\n", (result.folder / "report.html").c_str());
  std::printf("  results:    %s\n", (result.folder / "summary.json").c_str());
  std::printf("  the images: %s (KITTI layout)\n", data.c_str());
  return StatusOf(result);
}

}  // namespace

void SetUpDemo(CLI::App& command, int& exit_code) {
  const auto out = std::make_shared<std::string>("demo-out");
  command.add_option("--out", *out, "folder for the images and the results")->capture_default_str();
  command.callback([out, &exit_code] { exit_code = Demo(*out); });
}

}  // namespace tutti::cli
