// tutti evaluate: how far are trajectories from the reference?
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "apps/tutti/commands.h"
#include "apps/tutti/evaluation_input.h"
#include "apps/tutti/evaluation_output.h"
#include "apps/tutti/files.h"

namespace tutti::cli {
namespace {

struct EvaluateArguments {
  EvaluationInput input;
  std::string json, errors, table_format = "text";
};

void RunEvaluate(const EvaluateArguments& arguments) {
  const TableFormat format = ParseTableFormat(arguments.table_format);
  const std::vector<EvaluatedEstimate> estimates = EvaluateInput(arguments.input);
  const std::string text = estimates.size() == 1 ? DescribeEvaluation(estimates.front(), format)
                                                 : CompareEvaluations(estimates, format);
  std::fputs(text.c_str(), stdout);
  if (!arguments.json.empty())
    WriteText(arguments.json, JsonText(EvaluationJson(arguments.input.reference, estimates)));
  if (!arguments.errors.empty()) WriteText(arguments.errors, ErrorsCsv(estimates));
}

}  // namespace

void SetUpEvaluate(CLI::App& command, int&) {
  const auto arguments = std::make_shared<EvaluateArguments>();
  AddEvaluationOptions(command, arguments->input);
  AddTableFormatOption(command, arguments->table_format);
  command.add_option("--json", arguments->json, "Write every figure to this file");
  command.add_option("--errors", arguments->errors, "Write the errors pose by pose to this file (CSV)");
  command.footer(
      "ATE is the distance between associated positions after the alignment: is the map where it should be? "
      "RPE compares\n"
      "motions over a short distance: how fast does the odometry drift? 'full' is the norm of E - I, with E "
      "the 4x4 error\n"
      "matrix. t_rel and r_rel are KITTI's odometry errors; drift is the same over 10 to 50 % of the path, "
      "so "
      "that short\n"
      "paths have one too. Figures agree with evo's (evo_ape, evo_rpe) and with KITTI's development kit.\n"
      "Examples:\n"
      "  tutti evaluate --reference groundtruth.txt --estimate out/trajectory.txt --align sim3\n"
      "  tutti evaluate --reference poses/00.txt --times 00/times.txt --estimate out/trajectory.txt\n"
      "  tutti evaluate --reference gt.txt --estimate a.txt b.txt c.txt --table-format latex\n"
      "  tutti evaluate --reference gt.txt --estimate a.txt --rpe-delta 2 --rpe-unit seconds "
      "--rpe-all-pairs");
  command.callback([arguments] { RunEvaluate(*arguments); });
}

}  // namespace tutti::cli
