// Options of the commands that can be looked at in a browser while they go on.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

#include "apps/view/live_view.h"

namespace tutti::cli {

struct ViewOptions {
  bool view = false;
  LiveViewOptions live;
};

/// --view, --view-port, --view-address, --view-wait.
void AddViewOptions(CLI::App& command, ViewOptions& options);

/// Serves the page and prints its address (`quiet`: only one that can't be known before: a free port, or a
/// token); null: it was not asked for. Throws InputError if it can't.
std::shared_ptr<RunObserver> StartView(const CLI::App& command, const ViewOptions& options, bool quiet);

}  // namespace tutti::cli
