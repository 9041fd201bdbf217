#include "apps/tutti/view_options.h"

#include <cstdio>
#include <utility>

#include "apps/tutti/checks.h"
#include "core/terminal.h"
#include "tutti/core/error.h"

namespace tutti::cli {

void AddViewOptions(CLI::App& command, ViewOptions& options) {
  command.add_flag("--view", options.view,
                   "serve a page to look at it while it goes on, at 127.0.0.1 (through a tunnel: ssh -L "
                   "8077:127.0.0.1:8077 robot)");
  command.add_option("--view-port", options.live.port, "of that page; 0: any free one")
      ->check(
          NumberThat([](double value) { return value >= 0 && value <= 65535; }, "of 0 to 65535", "0..65535"))
      ->capture_default_str();
  command.add_option(
      "--view-address", options.live.address,
      "serve it at this address of the machine (0.0.0.0: all); the address that is printed has a "
      "token, without which nothing is answered");
  command
      .add_option("--view-wait", options.live.idle_s,
                  "wait at most this long for a browser before the first frame [s]")
      ->check(NotNegative())
      ->capture_default_str();
}

std::shared_ptr<RunObserver> StartView(const CLI::App& command, const ViewOptions& options, bool quiet) {
  if (!options.view && command.count("--view-address") == 0) return nullptr;
  const std::string problem = options.live.Validate();
  if (!problem.empty()) throw InputError("--view: " + problem);
  LiveView view = OpenLiveView(options.live);
  const bool known = options.live.port != 0 && command.count("--view-address") == 0;  // as it was asked for
  if (!quiet || !known) internal::Say("look at %s", view.url.c_str());
  return std::move(view.observer);
}

}  // namespace tutti::cli
