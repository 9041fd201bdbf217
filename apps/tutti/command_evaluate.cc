// tutti evaluate: how far are trajectories from the reference?
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/tutti/commands.h"
#include "apps/tutti/evaluation_input.h"
#include "apps/tutti/evaluation_output.h"
#include "apps/tutti/files.h"
#include "apps/tutti/options.h"
#include "core/replaced_file.h"
#include "core/terminal.h"

namespace tutti::cli {
namespace {

constexpr int kLimitNotMet = 3;  // 1 is bad input, 2 an internal error

struct EvaluateArguments {
  EvaluationInput input;
  std::string json, errors;
  TableFormat format = TableFormat::kText;
  Against against;
  double max_ate_m = std::numeric_limits<double>::infinity();
  double min_coverage = 0;
};

/// Says on standard error which limits an estimate does not meet.
bool MeetsLimits(const EvaluatedEstimate& estimate, const EvaluateArguments& arguments) {
  const double ate = estimate.report.ate.rmse, coverage = estimate.report.coverage.share();
  const bool accurate = ate <= arguments.max_ate_m, covers = coverage >= arguments.min_coverage;
  if (!accurate) {
    internal::Say("%s: the ATE of %g m is above --max-ate %g", estimate.name.c_str(), ate,
                  arguments.max_ate_m);
  }
  if (!covers) {
    internal::Say("%s: the coverage of %g is below --min-coverage %g", estimate.name.c_str(), coverage,
                  arguments.min_coverage);
  }
  return accurate && covers;
}

int RunEvaluate(const EvaluateArguments& arguments) {
  const TableFormat format = arguments.format;
  const EvaluationInput input = Resolved(arguments.input);
  const bool against = !arguments.against.benchmark.empty();
  if (against && input.reference.empty() && input.estimates.empty()) {
    std::fputs(DescribePublished(arguments.against.benchmark, format).c_str(), stdout);
    return 0;
  }
  RequireFiles(input);
  CheckFiles(FilesOf(input), {arguments.json, arguments.errors});
  std::optional<PublishedComparison> published;
  if (against) published.emplace(arguments.against, input);
  const std::vector<EvaluatedEstimate> estimates = EvaluateInput(input);
  std::string text = estimates.size() == 1 ? DescribeEvaluation(estimates.front(), format)
                                           : CompareEvaluations(estimates, format);
  if (published) text += published->Describe(estimates, format);
  std::fputs(internal::Printable(text, internal::Breaks::kAll).c_str(), stdout);
  if (!arguments.json.empty()) {
    nlohmann::ordered_json json = EvaluationJson(input.reference, estimates);
    if (published) json["published"] = published->ToJson();
    internal::WriteFile(arguments.json, JsonText(json));
  }
  if (!arguments.errors.empty()) internal::WriteFile(arguments.errors, ErrorsCsv(estimates));
  bool met = true;
  for (const EvaluatedEstimate& estimate : estimates) met = MeetsLimits(estimate, arguments) && met;
  return met ? 0 : kLimitNotMet;
}

}  // namespace

void SetUpEvaluate(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<EvaluateArguments>();
  AddEvaluationOptions(command, arguments->input);
  AddTableFormatOption(command, arguments->format);
  command.add_option("--json", arguments->json, "Write every figure to this file");
  command.add_option("--errors", arguments->errors, "Write the errors pose by pose to this file (CSV)");
  AddOption(command, "--against", arguments->against.benchmark,
            "Print the published errors of other systems beside these; without files, those alone",
            OneOf(PublishedBenchmarks()));
  command.add_option("--sequence", arguments->against.sequence,
                     "--against: which sequence it is, if the names of the files don't say it");
  AddOption(command, "--sensor", arguments->against.sensor, "--against: what the estimates were made with",
            OneOf({"mono", "stereo", "rgbd", "stereo-inertial"}));
  AddOption(command, "--max-ate", arguments->max_ate_m,
            "Exit status 3 if the ATE (rmse) of an estimate is above this [m]", NotNegative());
  AddOption(command, "--min-coverage", arguments->min_coverage,
            "Exit status 3 if an estimate covers less of the reference's time than this share, 0 to 1",
            NumberThat([](double value) { return value >= 0 && value <= 1; }, "of 0 to 1", "0..1"));
  command.footer(
      R"(ATE is the distance between associated positions after the alignment: is the map where it should be? RPE compares
motions over a short distance: how fast does the odometry drift? 'full' is the norm of E - I, with E the 4x4 error
matrix. t_rel and r_rel are KITTI's odometry errors; drift is the same over 10 to 50 % of the path, so that short
paths have one too. Figures agree with evo's (evo_ape, evo_rpe) and with KITTI's development kit.
Coverage is the share of frames within the reference's time that have a pose.
Exit status: 0; 1 for bad input; 3 if --max-ate or --min-coverage is not met.
Examples:
  tutti evaluate groundtruth.txt out/trajectory.txt --align sim3
  tutti evaluate --run out --max-ate 0.05 --min-coverage 0.95
  tutti evaluate MH_01/gt.csv out/trajectory.txt --against euroc --sensor stereo
  tutti evaluate --reference poses/00.txt --times 00/times.txt --estimate out/trajectory.txt
  tutti evaluate gt.txt a.txt b.txt c.txt --table-format latex
  tutti evaluate gt.txt a.txt --rpe-delta 2 --rpe-unit seconds --rpe-all-pairs
Options of evo that mean the same: -a, -s, --align_origin, --n_to_align, --t_max_diff, --t_offset, -d/--delta,
-u/--delta_unit, -t/--delta_tol, --all_pairs, --downsample, --motion_filter, --project_to_plane, and the words
tum, kitti and euroc before the files.)");
  command.callback([arguments, &exit_code] { exit_code = RunEvaluate(*arguments); });
}

}  // namespace tutti::cli
