// tutti compare: what did the ensemble buy me? The same SLAM with each way to find loops.
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "commands.h"
#include "comparison.h"
#include "files.h"
#include "run_with_report.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"
#include "tutti/pipeline/config.h"
#include "tutti/pipeline/interrupt.h"
#include "tutti/pipeline/outputs.h"
#include "tutti/pipeline/runner.h"
#include "tutti/report/page.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct CompareArguments {
  std::string config, dataset, out, ground_truth, table_format = "text";
  std::vector<std::string> variants = {"odometry", "surf",    "sift",     "orb",
                                       "naive",    "product", "majority", "ensemble"};
  std::uint64_t seeds = 3;
  int threads = 2;
  std::int64_t max_frames = 0;
};

// The configuration of a variant. Throws InputError for a word that is none.
RunConfig VariantConfig(RunConfig config, const std::string& variant, bool odometry_too) {
  if (variant == "odometry") {
    config.run.loops = false;
    return config;
  }
  try {
    SetRule(variant == "ensemble" ? "mean" : variant, config.loops);
  } catch (const InputError& error) {
    throw InputError("--variants: '" + variant + "': " + error.what());
  }
  config.run.loops = true;
  // What the odometry does without loops is computed once, as the variant of that name.
  if (odometry_too) config.run.odometry_pass = false;
  return config;
}

RunRequest Request(const CLI::App& command, const CompareArguments& arguments, const fs::path& out,
                   std::uint64_t seed) {
  RunRequest request;
  request.config = arguments.config;
  request.dataset = arguments.dataset;
  request.out = out;
  request.seed = seed;
  request.quiet = true;
  if (!arguments.ground_truth.empty()) request.ground_truth = arguments.ground_truth;
  if (command.count("--threads") > 0) request.threads = arguments.threads;
  if (command.count("--max-frames") > 0) request.max_frames = arguments.max_frames;
  return request;
}

// Runs in a process of its own, so that memory is measured per run and a crash ends that run alone. Returns
// the exit status; 128 + signal if it was killed.
int RunApart(const RunRequest& request, const RunConfig& config) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) throw InputError("compare: no new process can be started; is the machine out of memory?");
  if (child == 0) {
    int status = 2;
    try {
      const RunResult result = RunWithReport(request, config);
      status = result.interrupted ? 130 : result.Void() ? 1 : 0;
    } catch (const std::exception& error) {
      std::fprintf(stderr, "tutti: %s\n", error.what());
    }
    std::fflush(nullptr);
    _exit(status);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

RunFigures Failed(const CompareArguments& arguments, const std::string& variant, std::uint64_t seed,
                  int status) {
  RunFigures run;
  run.dataset = arguments.dataset;
  run.variant = variant;
  run.seed = seed;
  run.failure = "the run ended with status " + std::to_string(status);
  return run;
}

void CheckArguments(const CompareArguments& arguments) {
  if (arguments.seeds < 1) throw InputError("--seeds: must be at least 1");
  const std::set<std::string> different(arguments.variants.begin(), arguments.variants.end());
  if (different.size() != arguments.variants.size()) throw InputError("--variants: one is named twice");
}

int RunCompare(const CLI::App& command, const CompareArguments& arguments) {
  const TableFormat format = ParseTableFormat(arguments.table_format);
  CheckArguments(arguments);
  const RunConfig config = LoadConfig(arguments.config);
  const bool odometry_too =
      std::set<std::string>(arguments.variants.begin(), arguments.variants.end()).count("odometry") > 0;
  std::vector<RunConfig> configs;  // all of them before the first long run
  for (const std::string& variant : arguments.variants)
    configs.push_back(VariantConfig(config, variant, odometry_too));
  OpenDataset(arguments.dataset, config.dataset);  // what no variant can read is said once
  MakeFolder(arguments.out);
  const InterruptGuard guard;
  Comparison comparison;
  const fs::path out = arguments.out;
  for (std::size_t v = 0; v < configs.size(); ++v) {
    for (std::uint64_t seed = 1; seed <= arguments.seeds; ++seed) {
      const std::string& variant = arguments.variants[v];
      const fs::path folder = out / variant / ("seed_" + std::to_string(seed));
      MakeFolder(folder.parent_path());
      std::fprintf(stderr, "tutti: %s, seed %llu\n", variant.c_str(), static_cast<unsigned long long>(seed));
      const int status = RunApart(Request(command, arguments, folder, seed), configs[v]);
      if (status == 130 || InterruptGuard::Requested()) {
        std::fprintf(stderr, "tutti: interrupted; the runs by then are in %s\n", arguments.out.c_str());
        return 130;
      }
      comparison.runs.push_back(status == 0 ? ReadRunFigures(folder / "summary.json")
                                            : Failed(arguments, variant, seed, status));
      comparison.runs.back().variant = variant;
    }
  }
  WriteText(out / "comparison.json", ComparisonJson(comparison).dump(2) + "\n");
  WriteText(out / "comparison.md", DescribeComparison(comparison, TableFormat::kMarkdown));
  WriteComparisonReport(out / "report.html", "tutti compare: " + arguments.dataset, comparison);
  std::fputs(DescribeComparison(comparison, format).c_str(), stdout);
  if (ReportsAvailable()) std::printf("\n%s\n", (out / "report.html").c_str());
  if (!ReportsAvailable()) std::fprintf(stderr, "tutti: %s\n", ReportsMissing().c_str());
  for (const RunFigures& run : comparison.runs) {
    if (!run.failure.empty()) return 1;
  }
  return 0;
}

}  // namespace

void AddCompareCommand(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("compare", "What does the ensemble buy? SLAM with each way to find loops");
  const auto arguments = std::make_shared<CompareArguments>();
  command->add_option("--config", arguments->config, "YAML file, as for `tutti run`")->required();
  command->add_option("--dataset", arguments->dataset, "folder of the data set, or a video file")->required();
  command
      ->add_option("--out", arguments->out,
                   "folder for all runs and for comparison.md, comparison.json and report.html")
      ->required();
  command
      ->add_option("--variants", arguments->variants,
                   "odometry: no loops; surf, sift, orb, ...: that member alone; naive, product, majority: "
                   "that rule; ensemble: the mean of the members")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--seeds", arguments->seeds, "run each variant with the seeds 1 to this")
      ->capture_default_str();
  command->add_option("--ground-truth", arguments->ground_truth,
                      "trajectory to evaluate against (default: the data set's own)");
  command->add_option("--threads", arguments->threads, "most threads; the result is the same for any number");
  command->add_option("--max-frames", arguments->max_frames, "the first frames only");
  AddTableFormatOption(*command, arguments->table_format);
  command->footer(
      "Each run has its folder OUT/variant/seed_N with everything that `tutti run` writes. All variants of a "
      "seed track\n"
      "the same, byte for byte, until their first loop is closed or a lost frame is looked up in the loop "
      "detector. A\n"
      "run that fails is reported, and the rest go on.\n"
      "Example: tutti compare --config data/configs/7scenes.yaml --dataset redkitchen --out cmp --variants "
      "odometry,orb,ensemble");
  command->callback([command, arguments, &exit_code] { exit_code = RunCompare(*command, *arguments); });
}

}  // namespace tutti::cli
