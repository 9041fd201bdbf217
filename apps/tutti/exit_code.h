// How a run ended, for the shell.
#pragma once

#include "apps/run/run_result.h"

namespace tutti::cli {

/// 130: ended by Ctrl-C, as shells say it; 1: no frame has a pose. Says why on standard error.
int ExitCode(const RunResult& result);

}  // namespace tutti::cli
