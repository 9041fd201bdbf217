#include "apps/run/camera_clocks.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "core/terminal.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

constexpr int kMostBeginnings = 4;
constexpr double kSureClock = 1e-3;     // standard deviation with which a run begins anew [s]
constexpr double kClockMatters = 4e-3;  // smaller times make little difference [s]
constexpr double kSureAgain = 7e-4, kMattersAgain = 2e-3;  // the same, of a second look at the delay [s]

}  // namespace

std::optional<ClocksFound> SureClocks(const ClocksFound& found, const RunResult& result) {
  if (result.begun_anew >= kMostBeginnings) return std::nullopt;
  const bool measured = result.clocks_used && result.clocks_used->depth_delay_sigma_s > 0;
  ClocksFound clocks = found;
  if (!(found.readout_sigma_s < kSureClock && found.readout_s > kClockMatters)) clocks.readout_s = 0;
  // A shutter that rolls bends what depth is compared with, and depth of another time the poses that it is
  // compared with: a second look is better.
  const bool straight =
      clocks.readout_s == 0 && (result.rig.readout_s > 0 || found.readout_sigma_s < kSureClock);
  const double off = std::abs(found.depth_delay_s - result.rig.depth_delay_s);
  const bool sure = measured ? found.depth_delay_sigma_s < kSureAgain && off > kMattersAgain
                             : found.depth_delay_sigma_s < kSureClock && off > kClockMatters;
  if (!straight || !sure || (!measured && result.rig.depth_delay_s != 0)) clocks.depth_delay_s = 0;
  if (clocks.readout_s == 0 && clocks.depth_delay_s == 0) return std::nullopt;
  return clocks;
}

std::unique_ptr<Dataset> BeginAnew(const RunRequest& request, const ClocksFound& found,
                                   const RunResult& blank, RunResult& result) {
  ClocksFound clocks = result.clocks_used.value_or(ClocksFound());
  DatasetOptions options = result.config.dataset;
  std::array<char, 120> text{};
  if (found.readout_s > 0) {
    clocks.readout_s = found.readout_s;
    clocks.readout_sigma_s = found.readout_sigma_s;
    // The option is of the rows as they were taken, before rectification.
    options.readout_s = found.readout_s;
    const double rectified = OpenDataset(request.dataset, options)->Rig().readout_s;
    options.readout_s *= found.readout_s / rectified;
    std::snprintf(text.data(), text.size(), "the camera reads its rows in %.1f ms (camera.readout_s)",
                  1e3 * found.readout_s);
  } else {
    clocks.depth_delay_s = options.depth_delay_s = found.depth_delay_s;
    clocks.depth_delay_sigma_s = found.depth_delay_sigma_s;
    std::snprintf(text.data(), text.size(),
                  "depth is %.1f ms older than its time stamps say (camera.depth_delay_s)",
                  1e3 * found.depth_delay_s);
  }
  if (!request.quiet) internal::Say("measured: %s; the run begins anew with that", text.data());
  RunResult anew = blank;
  anew.begun_anew = result.begun_anew + 1;
  anew.wall_s = result.wall_s;
  anew.cpu_s = result.cpu_s;
  anew.config.dataset = options;
  anew.clocks_used = clocks;
  result = std::move(anew);
  auto dataset = OpenDataset(request.dataset, options);
  result.rig = dataset->Rig();
  for (const auto& observer : request.observers) observer->OnRestart();
  return dataset;
}

}  // namespace tutti
