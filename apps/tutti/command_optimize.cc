#include "commands.h"

namespace tutti::cli {
void AddOptimizeCommand(CLI::App&, int&) {}
}  // namespace tutti::cli
