// tutti compare: what did the ensemble buy me? The same SLAM with each way to find loops.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "apps/report/page.h"
#include "apps/run/interrupt.h"
#include "apps/run/outputs.h"
#include "apps/run/runner.h"
#include "apps/tutti/checks.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/comparison.h"
#include "apps/tutti/files.h"
#include "apps/tutti/run_apart.h"
#include "apps/tutti/run_with_report.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/config.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct CompareArguments {
  std::string config, dataset, out, ground_truth, table_format = "text";
  std::vector<std::string> variants = {"odometry", "surf", "sift",     "orb",  "naive",   "product",
                                       "majority", "mean", "log-pool", "seed", "ensemble"};
  std::uint64_t seeds = 3;
  int threads = 2;
  std::int64_t max_frames = 0;
  bool separate = false;
};

// The configuration of a variant. Throws InputError for a word that is none.
RunConfig VariantConfig(RunConfig config, const std::string& variant, bool odometry_elsewhere) {
  if (variant == "odometry") {
    config.run.loops = false;
    return config;
  }
  try {
    if (variant == "seed") {
      SetRule("mean", config.loops);
      ApplyPreset("standardised-mean", config.loops);
    } else {
      SetRule(variant == "ensemble" ? "joint" : variant, config.loops);
    }
    const std::string problem = config.loops.Validate();
    if (!problem.empty()) throw InputError(problem);
  } catch (const InputError& error) {
    throw InputError("--variants: '" + variant + "': " + error.what());
  }
  config.run.loops = true;
  // What the odometry does without loops is computed once, as the variant of that name.
  if (odometry_elsewhere) config.run.odometry_pass = false;
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
  const std::set<std::string> different(arguments.variants.begin(), arguments.variants.end());
  if (different.size() != arguments.variants.size()) throw InputError("--variants: one is named twice");
}

/// The experiment: its folders, and a process for each part of it.
class Experiment {
 public:
  Experiment(const CLI::App& command, const CompareArguments& arguments, const RunConfig& config)
      : command_(command), arguments_(arguments), config_(config) {
    const bool odometry_too =
        std::count(arguments.variants.begin(), arguments.variants.end(), "odometry") > 0;
    for (const std::string& variant : arguments.variants)
      configs_.push_back(VariantConfig(config, variant, odometry_too && arguments.separate));
  }

  /// Exit statuses of the variants, as RunApart gives them.
  std::vector<int> RunSeed(std::uint64_t seed) const {
    return arguments_.separate ? RunSeparately(seed) : RunShared(seed);
  }

  fs::path Folder(const std::string& variant, std::uint64_t seed) const {
    return fs::path(arguments_.out) / variant / ("seed_" + std::to_string(seed));
  }

 private:
  void Say(const std::string& variant, std::uint64_t seed) const {
    std::fprintf(stderr, "tutti: %s, seed %llu\n", variant.c_str(), static_cast<unsigned long long>(seed));
  }

  RunRequest RequestFor(const std::string& variant, std::uint64_t seed) const {
    MakeFolder(Folder(variant, seed).parent_path());
    return Request(command_, arguments_, Folder(variant, seed), seed);
  }

  std::vector<int> RunSeparately(std::uint64_t seed) const {
    std::vector<int> statuses;
    for (std::size_t v = 0; v < configs_.size(); ++v) {
      Say(arguments_.variants[v], seed);
      const RunRequest request = RequestFor(arguments_.variants[v], seed);
      statuses.push_back(RunApart([&] { return StatusOf(RunWithReport(request, configs_[v])); }));
      if (statuses.back() == 130) break;
    }
    return statuses;
  }

  // One process tracks; each variant closes its loops in a copy of that process.
  std::vector<int> RunShared(std::uint64_t seed) const {
    SharedStatuses statuses(configs_.size());
    const int tracking = RunApart([&] {
      Say("odometry", seed);
      const TrackedSequence tracked = TrackWithReport(RequestFor("odometry", seed), config_);
      const int status = StatusOf(tracked.result);
      for (std::size_t v = 0; v < configs_.size() && status == 0; ++v) {
        if (arguments_.variants[v] == "odometry") {
          statuses.Set(v, 0);
          continue;
        }
        Say(arguments_.variants[v], seed);
        const RunRequest request = RequestFor(arguments_.variants[v], seed);
        statuses.Set(v, RunApart([&] {
                       return StatusOf(tracked.odometry ? CloseLoopsWithReport(tracked, request, configs_[v])
                                                        : RunWithReport(request, configs_[v]));
                     }));
        if (InterruptGuard::Requested()) return 130;
      }
      return status;
    });
    return statuses.Take(tracking);
  }

  const CLI::App& command_;
  const CompareArguments& arguments_;
  RunConfig config_;
  std::vector<RunConfig> configs_;  // of the variants
};

int RunCompare(const CLI::App& command, const CompareArguments& arguments) {
  const TableFormat format = ParseTableFormat(arguments.table_format);
  CheckArguments(arguments);
  const RunConfig config = LoadConfig(arguments.config);
  const Experiment experiment(command, arguments, config);
  OpenDataset(arguments.dataset, config.dataset);  // what no variant can read is said once
  MakeFolder(arguments.out);
  const InterruptGuard guard;
  std::vector<std::vector<int>> statuses;  // by seed, then variant
  for (std::uint64_t seed = 1; seed <= arguments.seeds; ++seed) {
    statuses.push_back(experiment.RunSeed(seed));
    const std::vector<int>& now = statuses.back();
    if (InterruptGuard::Requested() || std::count(now.begin(), now.end(), 130) > 0) {
      std::fprintf(stderr, "tutti: interrupted; the runs by then are in %s\n", arguments.out.c_str());
      return 130;
    }
  }
  Comparison comparison;
  for (std::size_t v = 0; v < arguments.variants.size(); ++v) {
    for (std::uint64_t seed = 1; seed <= arguments.seeds; ++seed) {
      const std::string& variant = arguments.variants[v];
      const int status = statuses[seed - 1][v];
      comparison.runs.push_back(status == 0
                                    ? ReadRunFigures(experiment.Folder(variant, seed) / "summary.json")
                                    : Failed(arguments, variant, seed, status));
      comparison.runs.back().variant = variant;
    }
  }
  const fs::path out = arguments.out;
  WriteText(out / "comparison.json", ComparisonJson(comparison).dump(2) + "\n");
  WriteText(out / "comparison.md", DescribeComparison(comparison, TableFormat::kMarkdown));
  WriteComparisonReport(out / "report.html", "tutti compare: " + arguments.dataset, comparison);
  std::fputs(DescribeComparison(comparison, format).c_str(), stdout);
  if (ReportsAvailable()) std::printf("\n%s\n", (out / "report.html").c_str());
  if (!ReportsAvailable()) std::fprintf(stderr, "tutti: %s\n", ReportsMissing().c_str());
  const auto failed = [](const RunFigures& run) { return !run.failure.empty(); };
  return std::any_of(comparison.runs.begin(), comparison.runs.end(), failed) ? 1 : 0;
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
                   "odometry: no loops; surf, sift, orb, ...: that member alone; naive, product, majority, "
                   "mean, log-pool: that rule; seed: the preset standardised-mean; ensemble: the rule joint")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--seeds", arguments->seeds, "run each variant with the seeds 1 to this")
      ->check(Positive())
      ->capture_default_str();
  command->add_option("--ground-truth", arguments->ground_truth,
                      "trajectory to evaluate against (default: the data set's own)");
  command->add_option("--threads", arguments->threads, "most threads; the result is the same for any number");
  command->add_option("--max-frames", arguments->max_frames, "the first frames only")->check(Positive());
  command->add_flag("--separate", arguments->separate,
                    "no shared odometry: every variant tracks, too, as `tutti run` does");
  AddTableFormatOption(*command, arguments->table_format);
  command->footer(
      "Each run has its folder OUT/variant/seed_N with everything that `tutti run` writes. Tracking is done "
      "once "
      "per seed\n"
      "(OUT/odometry/seed_N), and every variant closes its loops on that odometry; with --separate each is a "
      "run of "
      "its own,\n"
      "whose loops move the map that it tracks on. A run that fails is reported, and the rest go on.\n"
      "Example: tutti compare --config data/configs/7scenes.yaml --dataset redkitchen --out cmp --variants "
      "odometry,orb,ensemble");
  command->callback([command, arguments, &exit_code] { exit_code = RunCompare(*command, *arguments); });
}

}  // namespace tutti::cli
