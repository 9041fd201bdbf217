// tutti: visual SLAM with an ensemble of Bayesian loop-closure filters. The commands that read no images; the
// others are in images_main.cc.
#include "apps/tutti/commands.h"
#include "apps/tutti/hand_over.h"
#include "apps/tutti/program.h"

int main(int argc, char** argv) {
  const std::map<std::string, tutti::cli::SetUp> own = {
      {"evaluate", tutti::cli::SetUpEvaluate},
      {"convert", tutti::cli::SetUpConvert},
      {"plot", tutti::cli::SetUpPlot},
      {"collect", tutti::cli::SetUpCollect},
      {"compare-loops", tutti::cli::SetUpCompareLoops},
      {"optimize", tutti::cli::SetUpOptimize},
  };
  return tutti::cli::RunProgram(argc, argv, own, tutti::cli::HandOver);
}
