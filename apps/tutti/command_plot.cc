// tutti plot: trajectories and their errors as pictures.
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "apps/plot/plot_picture.h"
#include "apps/tutti/checks.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/evaluation_input.h"
#include "apps/tutti/files.h"
#include "apps/tutti/trajectory_plots.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

struct PlotArguments {
  EvaluationInput input;
  std::vector<std::string> out;
  std::string what = "trajectory", title;
  PlotFont font;
};

std::vector<PlotShape> Shapes(const PlotArguments& arguments) {
  const EvaluationInput input = Resolved(arguments.input);
  KeepInputs(FilesOf(input), arguments.out);
  RequireWritable(arguments.out);
  if (input.estimates.empty())
    throw InputError("there is no trajectory; give one or several as `tutti plot FILE...`");
  if (input.reference.empty()) {
    if (IsOfErrors(arguments.what))
      throw InputError("--what " + arguments.what + ": errors need a reference; give one with --reference");
    return TrajectoryShapes(DrawnFiles(input), arguments.what, arguments.title);
  }
  const std::vector<EvaluatedEstimate> estimates = EvaluateInput(input);
  if (IsOfErrors(arguments.what)) return ErrorShapes(estimates, arguments.what, arguments.title);
  const std::string title = arguments.title.empty() && arguments.what == "trajectory"
                                ? "Trajectories, alignment " + input.align
                                : arguments.title;
  return TrajectoryShapes(DrawnEstimates(estimates), arguments.what, title);
}

void RunPlot(const PlotArguments& arguments) {
  for (const std::string& file : arguments.out) PlotFormatOf(file);  // before the work
  const std::vector<PlotShape> shapes = Shapes(arguments);
  for (const std::string& file : arguments.out) {
    WritePlot(file, PlotFormatOf(file), shapes, arguments.font);
    std::printf("%s\n", file.c_str());
  }
}

}  // namespace

void SetUpPlot(CLI::App& command, int&) {
  const auto arguments = std::make_shared<PlotArguments>();
  arguments->input.reference_comes_first = false;
  AddEvaluationOptions(command, arguments->input);
  command
      .add_option(
          "--what", arguments->what,
          "trajectory: seen from above, along the two axes of largest extent; xyz, rpy, speed: over "
          "time; error: absolute translation error along the path; rpe: relative translation error, at "
          "the end of each pair; box, violin: how the absolute errors are distributed; error-map: the "
          "trajectory in the colours of its errors")
      ->check(OneOf(PlotNames()))
      ->capture_default_str();
  command.add_option("--out", arguments->out, "Files to write; the ending is the format: .svg, .png, .pdf")
      ->required();
  command.add_option("--title", arguments->title, "Text above the plot");
  command
      .add_option("--font", arguments->font.family,
                  "Family of all texts, as `fc-list : family` names it; for papers: \"Times New Roman\", "
                  "\"Latin Modern Roman\"")
      ->capture_default_str();
  command.add_option("--font-scale", arguments->font.scale, "Factor of the texts' heights")
      ->check(CLI::Range(0.25, 4.0))
      ->capture_default_str();
  command.footer(
      "trajectory, xyz, rpy and speed need no reference; with one, poses are associated and aligned as "
      "`tutti "
      "evaluate`\n"
      "does.\n"
      "Examples:\n"
      "  tutti plot a.txt b.txt --what xyz --out xyz.svg\n"
      "  tutti plot a.txt b.txt --reference gt.txt --out map.svg map.pdf\n"
      "  tutti plot a.txt --reference gt.txt --what error-map --out map.png\n"
      "  tutti plot a.txt --reference gt.txt --what rpe --rpe-delta 10 --rpe-unit metres --out rpe.png");
  command.callback([arguments] { RunPlot(*arguments); });
}

}  // namespace tutti::cli
