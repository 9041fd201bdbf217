// tutti collect: the summaries of many runs in one table.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "apps/report/page.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/comparison.h"
#include "apps/tutti/files.h"
#include "apps/tutti/options.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct CollectArguments {
  std::vector<std::string> runs;
  TableFormat format = TableFormat::kText;
  std::string json, report;
  bool by_folder = false;
  TableChoice choice;
};

/// The summary of a run's folder, or all summaries below a folder, in natural order of their paths.
std::vector<fs::path> Summaries(const std::string& where) {
  std::error_code error;
  if (!fs::is_directory(where, error)) return {fs::path(where)};
  std::vector<std::string> files;
  for (fs::recursive_directory_iterator it(where, fs::directory_options::skip_permission_denied, error), end;
       !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename();
    if (name[0] == '.' || name == "unfinished")
      it.disable_recursion_pending();  // what broke off is no figure
    if (name == "summary.json") files.push_back(it->path().string());
  }
  if (error) throw InputError(where + ": can't be read (" + error.message() + ")");
  if (files.empty()) throw InputError(where + ": holds no summary.json; give folders of `tutti run --out`");
  std::sort(files.begin(), files.end(), NaturalLess);
  return {files.begin(), files.end()};
}

// The folder that the run's folder lies in: a sweep has runs/data set/configuration/start_0/summary.json.
std::string FolderAbove(const fs::path& summary) {
  const fs::path run = fs::absolute(summary).parent_path();
  return run.parent_path().filename().string();
}

void RunCollect(const CollectArguments& arguments) {
  CheckFiles({}, {arguments.json, arguments.report});
  std::vector<RunFigures> runs;
  std::vector<std::string> read;
  for (const std::string& where : arguments.runs) {
    for (const fs::path& file : Summaries(where)) {
      read.push_back(file);
      runs.push_back(ReadRunFigures(file));
      if (arguments.by_folder) runs.back().variant = FolderAbove(file);
    }
  }
  KeepInputs(read, {arguments.json, arguments.report});
  const std::string tables = DescribeComparison(runs, arguments.format, arguments.choice);
  std::fputs(internal::Printable(tables, internal::Breaks::kAll).c_str(), stdout);
  if (!arguments.report.empty()) {
    if (!ReportsAvailable()) throw InputError("--report: " + ReportsMissing());
    WriteComparisonReport(arguments.report, "tutti collect", runs);
  }
  if (!arguments.json.empty()) internal::WriteFile(arguments.json, JsonText(ComparisonJson(runs)));
}

}  // namespace

void SetUpCollect(CLI::App& command, int&) {
  const auto arguments = std::make_shared<CollectArguments>();
  command
      .add_option("runs", arguments->runs, "Folders of runs, folders of such folders, or summary.json files")
      ->required();
  command.add_flag("--by-folder", arguments->by_folder,
                   "a run's variant is the name of the folder above its own (CONFIGURATION/start_0)");
  AddTableFormatOption(command, arguments->format);
  command
      .add_option("--columns", arguments->choice.columns,
                  "Which columns, in this order: " + JoinText(ComparisonColumns()) + "; all if none is given")
      ->delimiter(',')
      ->check(OneOf(ComparisonColumns()));
  AddOption(command, "--precision", arguments->choice.decimals, "Decimals of the errors",
            NumberThat([](double value) { return value >= 0 && value <= 12; }, "of 0 to 12", "0..12"));
  command.add_flag("--bold-best", arguments->choice.bold_best,
                   "The best of each column in bold (markdown, latex) or with a star (text)");
  command.add_option("--json", arguments->json, "Write the table to this file");
  command.add_option(
      "--report", arguments->report,
      "Write one page over all runs to this file (report.html); charts are of the first run of "
      "each data set and variant");
  command.footer(
      R"(Runs are grouped by data set and by variant: odometry (run.loops: false), ensemble (loops.rule: joint),
standardised-mean (that preset), else the rule. Runs of one group should differ in the first frame, the noise or
the seed alone: the table says in which, and the interval is over them.
Examples:
  tutti collect results/ --table-format markdown > table.md
  tutti collect results/ --columns ate,rpe,time --precision 3 --bold-best --table-format latex)");
  command.callback([arguments] { RunCollect(*arguments); });
}

}  // namespace tutti::cli
