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
#include "apps/run/output_folder.h"
#include "apps/run/runner.h"
#include "apps/tutti/camera_options.h"
#include "apps/tutti/checks.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/comparison.h"
#include "apps/tutti/comparison_page.h"
#include "apps/tutti/configuration_of.h"
#include "apps/tutti/files.h"
#include "apps/tutti/run_apart.h"
#include "apps/tutti/run_with_report.h"
#include "core/example_configs.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/config.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct CompareArguments {
  std::string config, out, ground_truth, table_format = "text";
  std::vector<std::string> datasets;
  std::vector<std::string> variants = {"odometry", "surf",     "sift", "orb",      "naive",
                                       "product",  "majority", "mean", "log-pool", "standardised-mean",
                                       "ensemble"};
  int runs = 5, start = 0, end = 0, stride = 1, threads = 2;
  double noise = 0;
  bool separate = false;
  CameraWords camera;
};

// The configuration of a variant. Throws InputError for a word that is none.
RunConfig VariantConfig(RunConfig config, const std::string& variant, bool odometry_elsewhere) {
  if (variant == "odometry") {
    config.run.loops = false;
    return config;
  }
  try {
    if (variant == "standardised-mean") {
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

/// Every run of a variant: all data sets, from another first frame and with other noise each time.
std::vector<Sample> Samples(const CompareArguments& arguments) {
  std::vector<Sample> samples;
  for (const std::string& dataset : arguments.datasets) {
    for (int k = 0; k < arguments.runs; ++k)
      samples.push_back({dataset, arguments.start + k, arguments.noise, k, 1});
  }
  return samples;
}

RunRequest Request(const CLI::App& command, const CompareArguments& arguments, const fs::path& out,
                   const Sample& sample) {
  RunRequest request;
  request.config = arguments.config;
  request.dataset = sample.dataset;
  request.out = out;
  request.start = sample.start;
  request.quiet = true;
  if (!arguments.ground_truth.empty()) request.ground_truth = arguments.ground_truth;
  if (command.count("--threads") > 0) request.threads = arguments.threads;
  if (command.count("--end") > 0) request.end = arguments.end;
  if (command.count("--stride") > 0) request.stride = arguments.stride;
  return request;
}

void CheckVariants(const CompareArguments& arguments) {
  const std::set<std::string> different(arguments.variants.begin(), arguments.variants.end());
  if (different.size() != arguments.variants.size()) throw InputError("--variants: one is named twice");
}

/// The experiment: its folders, and a process for each part of it.
class Experiment {
 public:
  Experiment(const CLI::App& command, const CompareArguments& arguments, const RunConfig& config)
      : command_(command), arguments_(arguments), config_(config), samples_(Samples(arguments)) {
    const bool odometry_too =
        std::count(arguments.variants.begin(), arguments.variants.end(), "odometry") > 0;
    for (const std::string& variant : arguments.variants)
      configs_.push_back(VariantConfig(config, variant, odometry_too && arguments.separate));
  }

  std::size_t Runs() const { return samples_.size(); }

  /// Exit statuses of the variants, as RunApart gives them.
  std::vector<int> Run(std::size_t k) const { return arguments_.separate ? RunSeparately(k) : RunShared(k); }

  /// What variant v's run left.
  RunFigures Figures(std::size_t v, std::size_t k, int status) const {
    RunFigures run;
    if (status == 0) {
      run = ReadRunFigures(Folder(v, k) / "summary.json");
    } else {
      run.sample = samples_[k];
      run.failure = "the run ended with status " + std::to_string(status);
    }
    run.variant = arguments_.variants[v];
    run.dataset = arguments_.datasets.front();
    if (arguments_.datasets.size() > 1)
      run.dataset += " and " + std::to_string(arguments_.datasets.size() - 1) + " more";
    return run;
  }

 private:
  fs::path Folder(const std::string& variant, std::size_t k) const {
    return fs::path(arguments_.out) / variant / ("run_" + std::to_string(k + 1));
  }
  fs::path Folder(std::size_t v, std::size_t k) const { return Folder(arguments_.variants[v], k); }

  void Say(const std::string& variant, std::size_t k) const {
    internal::Say("%s, run %zu of %zu", variant.c_str(), k + 1, samples_.size());
  }

  RunRequest RequestFor(const std::string& variant, std::size_t k) const {
    MakeFolder(Folder(variant, k).parent_path());
    return Request(command_, arguments_, Folder(variant, k), samples_[k]);
  }

  // The noise is no option of `tutti run`, so it comes with the configuration.
  RunConfig WithNoise(RunConfig config, std::size_t k) const {
    config.dataset.noise = samples_[k].noise;
    config.dataset.noise_draw = samples_[k].noise_draw;
    return config;
  }

  std::vector<int> RunSeparately(std::size_t k) const {
    std::vector<int> statuses;
    for (std::size_t v = 0; v < configs_.size(); ++v) {
      Say(arguments_.variants[v], k);
      const RunRequest request = RequestFor(arguments_.variants[v], k);
      statuses.push_back(
          RunApart([&] { return StatusOf(RunWithReport(request, WithNoise(configs_[v], k))); }));
      if (statuses.back() == 130) break;
    }
    return statuses;
  }

  // One process tracks; each variant closes its loops in a copy of that process.
  std::vector<int> RunShared(std::size_t k) const {
    SharedStatuses statuses(configs_.size());
    const int tracking = RunApart([&] {
      Say("odometry", k);
      const TrackedSequence tracked = TrackWithReport(RequestFor("odometry", k), WithNoise(config_, k));
      const int status = StatusOf(tracked.result);
      for (std::size_t v = 0; v < configs_.size() && status == 0; ++v) {
        if (arguments_.variants[v] == "odometry") {
          statuses.Set(v, 0);
          continue;
        }
        Say(arguments_.variants[v], k);
        const RunRequest request = RequestFor(arguments_.variants[v], k);
        const RunConfig config = WithNoise(configs_[v], k);
        statuses.Set(v, RunApart([&] {
                       return StatusOf(tracked.odometry ? CloseLoopsWithReport(tracked, request, config)
                                                        : RunWithReport(request, config));
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
  std::vector<Sample> samples_;
  std::vector<RunConfig> configs_;  // of the variants
};

// The runs are results of their own; each replaces an earlier one when it is complete.
OutputLayout Layout() {
  const auto is_result = [](const fs::path& entry) {
    const std::string name = entry.filename();
    return name == "comparison.json" || name == "comparison.md" || name == "report.html";
  };
  const auto is_part = [](const fs::path& entry) { return fs::exists(entry / "run_1"); };
  return {is_result, "comparison.json", "datasets", {}, is_part};
}

void WriteComparison(OutputFolder& folder, const Comparison& comparison) {
  folder.Write({"comparison.md", [&](const fs::path& file) {
                  internal::WriteFile(file, DescribeComparison(comparison, TableFormat::kMarkdown));
                }});
  folder.Write({"comparison.json", [&](const fs::path& file) {
                  internal::WriteFile(file, JsonText(ComparisonJson(comparison)));
                }});
  if (ReportsAvailable()) {
    folder.Write({"report.html", [&](const fs::path& file) {
                    WriteComparisonReport(file, "tutti compare: " + comparison.runs.front().dataset,
                                          comparison);
                  }});
  }
  const fs::path where = folder.Finish(true);
  ThrowFailures(folder.failures(), where);
}

int RunCompare(const CLI::App& command, CompareArguments arguments) {
  if (arguments.out.empty()) arguments.out = DefaultOutput(arguments.datasets.front(), "-compared");
  const TableFormat format = ParseTableFormat(arguments.table_format);
  CheckVariants(arguments);
  OutputFolder::Check(arguments.out, Layout());
  const RunConfig config =
      ConfigurationOf(arguments.config, arguments.datasets.front(), CameraOf(command, arguments.camera));
  for (const std::string& dataset : arguments.datasets) {
    if (IsPipe(dataset)) DetectDatasetType(dataset);  // says that it comes once
  }
  const Experiment experiment(command, arguments, config);
  DatasetOptions last = config.dataset;
  last.start = arguments.start + arguments.runs - 1;
  if (command.count("--end") > 0) last.end = arguments.end;
  for (const std::string& dataset : arguments.datasets)
    OpenDataset(dataset, last);  // what no variant can read is said once
  const InterruptGuard guard;
  OutputFolder folder(arguments.out, Layout());
  std::vector<std::vector<int>> statuses;  // by run, then variant
  for (std::size_t k = 0; k < experiment.Runs(); ++k) {
    statuses.push_back(experiment.Run(k));
    const std::vector<int>& now = statuses.back();
    if (InterruptGuard::Requested() || std::count(now.begin(), now.end(), 130) > 0) {
      internal::Say("interrupted; the runs by then are in %s", arguments.out.c_str());
      return 130;
    }
  }
  Comparison comparison;
  for (std::size_t v = 0; v < arguments.variants.size(); ++v) {
    for (std::size_t k = 0; k < experiment.Runs(); ++k)
      comparison.runs.push_back(experiment.Figures(v, k, statuses[k][v]));
  }
  const std::string tables = DescribeComparison(comparison, format);
  std::fputs(internal::Printable(tables, internal::Breaks::kAll).c_str(), stdout);
  WriteComparison(folder, comparison);
  if (ReportsAvailable()) std::printf("\n%s\n", (folder.path() / "report.html").c_str());
  if (!ReportsAvailable()) internal::Say("%s", ReportsMissing().c_str());
  const auto failed = [](const RunFigures& run) { return !run.failure.empty(); };
  return std::any_of(comparison.runs.begin(), comparison.runs.end(), failed) ? 1 : 0;
}

}  // namespace

void SetUpCompare(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<CompareArguments>();
  command
      .add_option("dataset,--dataset", arguments->datasets,
                  "the recording, as for `tutti run`; several (of one kind, read alike) make one table")
      ->required();
  command.add_option("--config", arguments->config,
                     "YAML file, as for `tutti run`; without it, layout, sensor and calibration are found in "
                     "the first recording, and what was found is said");
  AddCameraOptions(command, arguments->camera);
  command.add_option("--out", arguments->out,
                     "folder for all runs and for comparison.md, comparison.json and report.html (default: "
                     "tutti-out/NAME-compared)");
  command
      .add_option("--variants", arguments->variants,
                  "odometry: no loops; surf, sift, orb, ...: that member alone; naive, product, majority, "
                  "mean, log-pool: that rule; standardised-mean: that preset; ensemble: the rule joint")
      ->delimiter(',')
      ->capture_default_str();
  command
      .add_option(
          "--runs", arguments->runs,
          "runs of each variant on each data set: each starts a frame later than the one before, and gets "
          "noise of its own (--noise). Below five there is no p")
      ->check(Positive())
      ->capture_default_str();
  command
      .add_option("--noise", arguments->noise,
                  "standard deviation of Gaussian noise that is added to the images [grey levels of 255]")
      ->check(NotNegative())
      ->capture_default_str();
  command.add_option("--ground-truth", arguments->ground_truth,
                     "trajectory to evaluate against (default: the data set's own)");
  command.add_option("--threads", arguments->threads, "most threads; the result is the same for any number")
      ->check(Positive());
  command.add_option("--start", arguments->start, "first frame of the first run, counted from 0")
      ->check(NotNegative());
  command.add_option("--end", arguments->end, "frame before which to stop")->check(Positive());
  command.add_option("--stride", arguments->stride, "use every so many frames")->check(Positive());
  command.add_flag("--separate", arguments->separate,
                   "no shared odometry: every variant tracks, too, as `tutti run` does");
  AddTableFormatOption(command, arguments->table_format);
  command.footer(
      "Each run has its folder OUT/VARIANT/run_N with everything that `tutti run` writes. Tracking is done "
      "once "
      "for each N\n"
      "(OUT/odometry/run_N), and every variant closes its loops on that odometry; with --separate each is a "
      "run "
      "of its own,\n"
      "whose loops move the map that it tracks on. A run that fails is reported, and the rest go on.\n"
      "Example: tutti compare redkitchen --config 7scenes --variants odometry,orb,ensemble");
  command.callback([&command, arguments, &exit_code] { exit_code = RunCompare(command, *arguments); });
}

}  // namespace tutti::cli
