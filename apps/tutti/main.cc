// tutti: visual SLAM with an ensemble of Bayesian loop-closure filters. Parses, calls, prints.
#include <cstdio>
#include <exception>
#include <string>

#include "apps/tutti/commands.h"
#include "apps/tutti/describe.h"
#include "tutti/core/error.h"
#include "tutti/slam/version.h"

int main(int argc, char** argv) {
  CLI::App app{"tutti: visual SLAM with an ensemble of Bayesian loop-closure filters", "tutti"};
  app.require_subcommand(1);
  app.set_version_flag("--version", std::string("tutti ") + tutti::kVersion);
  int exit_code = 0;
  tutti::cli::AddRunCommand(app, exit_code);
  tutti::cli::AddCalibrateCheckCommand(app, exit_code);
  tutti::cli::AddEvaluateCommand(app, exit_code);
  tutti::cli::AddConvertCommand(app, exit_code);
  tutti::cli::AddPlotCommand(app, exit_code);
  tutti::cli::AddCompareCommand(app, exit_code);
  tutti::cli::AddCollectCommand(app, exit_code);
  tutti::cli::AddLoopsCommand(app, exit_code);
  tutti::cli::AddCompareLoopsCommand(app, exit_code);
  tutti::cli::AddOptimizeCommand(app, exit_code);
  tutti::cli::AddGenerateCommand(app, exit_code);
  tutti::cli::AddDemoCommand(app, exit_code);
  tutti::cli::AddDescribeFlag(app);
  for (CLI::App* command : app.get_subcommands({})) tutti::cli::AddDescribeFlag(*command);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 1;  // --help comes this way, too
  } catch (const tutti::InputError& e) {
    std::fprintf(stderr, "tutti: %s\n", e.what());
    return 1;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "tutti: internal error: %s; please report it with the command line\n", e.what());
    return 2;
  }
  return exit_code;
}
