// tutti compare: what did the ensemble buy me? The same SLAM with each way to find loops.
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "apps/report/page.h"
#include "apps/run/interrupt.h"
#include "apps/run/output_folder.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/comparison.h"
#include "apps/tutti/files.h"
#include "apps/tutti/recording_options.h"
#include "apps/tutti/run_with_report.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/config.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct CompareArguments {
  RunRequest request;  // what the options say of each run
  std::string config, out;
  TableFormat format = TableFormat::kText;
  std::vector<std::string> datasets;
  std::vector<std::string> variants = {"odometry", "surf",     "sift", "orb",      "naive",
                                       "product",  "majority", "mean", "log-pool", "standardised-mean",
                                       "ensemble"};
  int runs = 5, start = 0;
  double noise = 0;
  bool separate = false;
  CameraRequest camera;
};

// Calls `work` in a copy of this process, where memory is measured for itself and a crash ends that one
// alone. Returns its status; 128 + signal if it was killed, 2 if it threw (the text goes to stderr). Only one
// thread may run. Throws InputError if no process can be started.
int RunApart(const std::function<int()>& work) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) throw InputError("no new process can be started; is the machine out of memory?");
  if (child == 0) {
    int status = 2;
    try {
      status = work();
    } catch (const std::exception& error) {
      internal::Say("%s", error.what());
    }
    std::fflush(nullptr);
    _exit(status);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

// Statuses that a process leaves for the one that started it, however it ends.
class SharedStatuses {
 public:
  // Throws InputError if there is no memory.
  explicit SharedStatuses(std::size_t count) : count_(count) {
    void* memory =
        mmap(nullptr, count * sizeof(int), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw InputError("the machine is out of memory");
    statuses_ = static_cast<int*>(memory);
    std::fill_n(statuses_, count_, kNever);
  }
  ~SharedStatuses() { munmap(statuses_, count_ * sizeof(int)); }
  SharedStatuses(const SharedStatuses&) = delete;
  SharedStatuses& operator=(const SharedStatuses&) = delete;

  void Set(std::size_t i, int status) { statuses_[i] = status; }
  // All; those that were never set get `otherwise`, or 2 if that is 0.
  std::vector<int> Take(int otherwise) const {
    std::vector<int> out(statuses_, statuses_ + count_);
    std::replace(out.begin(), out.end(), int{kNever}, otherwise == 0 ? 2 : otherwise);
    return out;
  }

 private:
  static constexpr int kNever = -1;
  std::size_t count_;
  int* statuses_;
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

/// The experiment: its folders, and a process for each part of it.
class Experiment {
 public:
  Experiment(const CompareArguments& arguments, const RunConfig& config)
      : arguments_(arguments), config_(config), samples_(Samples(arguments)) {
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
    RunRequest request = arguments_.request;
    request.config = arguments_.config;
    request.dataset = samples_[k].dataset;
    request.out = Folder(variant, k);
    request.start = samples_[k].start;
    request.quiet = true;
    return request;
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
      const RunRequest request = WithReport(RequestFor(arguments_.variants[v], k));
      statuses.push_back(RunApart([&] { return StatusOf(RunSlam(request, WithNoise(configs_[v], k))); }));
      if (statuses.back() == 130) break;
    }
    return statuses;
  }

  // One process tracks; each variant closes its loops in a copy of that process.
  std::vector<int> RunShared(std::size_t k) const {
    SharedStatuses statuses(configs_.size());
    const int tracking = RunApart([&] {
      Say("odometry", k);
      const TrackedSequence tracked =
          TrackSequence(WithReport(RequestFor("odometry", k), false), WithNoise(config_, k));
      const int status = StatusOf(tracked.result);
      for (std::size_t v = 0; v < configs_.size() && status == 0; ++v) {
        if (arguments_.variants[v] == "odometry") {
          statuses.Set(v, 0);
          continue;
        }
        Say(arguments_.variants[v], k);
        const RunRequest request = WithReport(RequestFor(arguments_.variants[v], k));
        const RunConfig config = WithNoise(configs_[v], k);
        statuses.Set(v, RunApart([&] {
                       return StatusOf(tracked.odometry ? CloseLoops(tracked, request, config)
                                                        : RunSlam(request, config));
                     }));
        if (InterruptGuard::Requested()) return 130;
      }
      return status;
    });
    return statuses.Take(tracking);
  }

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

void WriteComparison(OutputFolder& folder, const std::vector<RunFigures>& runs) {
  using File = const fs::path&;
  folder.Write({"comparison.md", [&](File file) {
                  internal::WriteFile(file, DescribeComparison(runs, TableFormat::kMarkdown));
                }});
  folder.Write(
      {"comparison.json", [&](File file) { internal::WriteFile(file, JsonText(ComparisonJson(runs))); }});
  if (ReportsAvailable()) {
    folder.Write({"report.html", [&](File file) {
                    WriteComparisonReport(file, "tutti compare: " + runs.front().dataset, runs);
                  }});
  }
  const fs::path where = folder.Finish(true);
  ThrowFailures(folder.failures(), where);
}

int RunCompare(CompareArguments arguments) {
  if (arguments.out.empty()) arguments.out = DefaultOutput(arguments.datasets.front(), "-compared");
  if (std::set<std::string>(arguments.variants.begin(), arguments.variants.end()).size() !=
      arguments.variants.size())
    throw InputError("--variants: one is named twice");
  OutputFolder::Check(arguments.out, Layout());
  const RunConfig config = ConfigurationOf(arguments.config, arguments.datasets.front(), arguments.camera);
  for (const std::string& dataset : arguments.datasets) {
    if (IsPipe(dataset)) DetectDatasetType(dataset);  // says that it comes once
  }
  const Experiment experiment(arguments, config);
  DatasetOptions last = config.dataset;
  last.start = arguments.start + arguments.runs - 1;
  if (arguments.request.end) last.end = *arguments.request.end;
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
  std::vector<RunFigures> runs;
  for (std::size_t v = 0; v < arguments.variants.size(); ++v) {
    for (std::size_t k = 0; k < experiment.Runs(); ++k)
      runs.push_back(experiment.Figures(v, k, statuses[k][v]));
  }
  const std::string tables = DescribeComparison(runs, arguments.format);
  std::fputs(internal::Printable(tables, internal::Breaks::kAll).c_str(), stdout);
  WriteComparison(folder, runs);
  if (ReportsAvailable()) std::printf("\n%s\n", (folder.path() / "report.html").c_str());
  if (!ReportsAvailable()) internal::Say("%s", ReportsMissing().c_str());
  const auto failed = [](const RunFigures& run) { return !run.failure.empty(); };
  return std::any_of(runs.begin(), runs.end(), failed) ? 1 : 0;
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
  AddDefaulted(command, "--variants", arguments->variants,
               "odometry: no loops; surf, sift, orb, ...: that member alone; naive, product, majority, mean, "
               "log-pool: that rule; standardised-mean: that preset; ensemble: the rule joint")
      ->delimiter(',');
  AddDefaulted(
      command, "--runs", arguments->runs,
      "runs of each variant on each data set: each starts a frame later than the one before, and gets "
      "noise of its own (--noise). Below five there is no p",
      Positive());
  AddDefaulted(command, "--noise", arguments->noise,
               "standard deviation of Gaussian noise that is added to the images [grey levels of 255]",
               NotNegative());
  RunRequest& request = arguments->request;
  AddPath(command, "--ground-truth", request.ground_truth,
          "trajectory to evaluate against (default: the data set's own)");
  AddThreads(command, request.threads);
  AddOption(command, "--start", arguments->start, "first frame of the first run, counted from 0",
            NotNegative());
  AddEndAndStride(command, "frame", request.end, request.stride);
  command.add_flag("--separate", arguments->separate,
                   "no shared odometry: every variant tracks, too, as `tutti run` does");
  AddTableFormatOption(command, arguments->format);
  command.footer(
      R"(Each run has its folder OUT/VARIANT/run_N with everything that `tutti run` writes. Tracking is done once for each N
(OUT/odometry/run_N), and every variant closes its loops on that odometry; with --separate each is a run of its own,
whose loops move the map that it tracks on. A run that fails is reported, and the rest go on.
Example: tutti compare redkitchen --config 7scenes --variants odometry,orb,ensemble)");
  command.callback([arguments, &exit_code] { exit_code = RunCompare(*arguments); });
}

}  // namespace tutti::cli
