// tutti-images: the commands of tutti that read or make images. Users call `tutti`, which becomes this
// program.
#include "apps/tutti/commands.h"
#include "apps/tutti/program.h"

int main(int argc, char** argv) {
  const std::map<std::string, tutti::cli::SetUp> own = {
      {"run", tutti::cli::SetUpRun},           {"calibrate-check", tutti::cli::SetUpCalibrateCheck},
      {"compare", tutti::cli::SetUpCompare},   {"loops", tutti::cli::SetUpLoops},
      {"generate", tutti::cli::SetUpGenerate}, {"demo", tutti::cli::SetUpDemo},
      {"map", tutti::cli::SetUpMap},           {"localize", tutti::cli::SetUpLocalize},
      {"export", tutti::cli::SetUpExport},     {"merge", tutti::cli::SetUpMerge},
      {"close", tutti::cli::SetUpClose},
  };
  return tutti::cli::RunProgram(argc, argv, own, nullptr);
}
