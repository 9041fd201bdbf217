// tutti convert: a trajectory from one format to another.
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/options.h"
#include "core/terminal.h"
#include "tutti/backend/trajectory_file.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

struct ConvertArguments {
  std::string in, out, from = "auto", to, times, times_out;
};

void RunConvert(const ConvertArguments& arguments) {
  std::optional<PoseFileFormat> from;
  if (arguments.from != "auto") from = ParsePoseFileFormat(arguments.from);
  const PoseFileFormat to = ParsePoseFileFormat(arguments.to);
  CheckFiles({arguments.in, arguments.times}, {arguments.out, arguments.times_out});
  std::vector<double> times;
  std::vector<std::string> warnings;
  if (!arguments.times.empty()) times = ReadTimes(arguments.times, &warnings);
  const PoseFile in = ReadPoseFile(arguments.in, from, times);
  SayWarnings(warnings);
  SayWarnings(in.warnings);
  const bool needs_stamps = to == PoseFileFormat::kTum || to == PoseFileFormat::kEuroc;
  if (!in.has_stamps && (needs_stamps || !arguments.times_out.empty())) {
    throw InputError(arguments.in + ": the format " + ToString(in.format) +
                     " has no time stamps; give --times (KITTI: times.txt, one time stamp [s] a line)");
  }
  WritePoseFile(arguments.out, in.trajectory, to, in.stamps_ns);
  if (!arguments.times_out.empty()) WriteTimes(arguments.times_out, in.trajectory, in.stamps_ns);
  if (!HasRotations(in.trajectory))
    internal::Say("warning: %s: has positions alone; the quaternions written are 0", arguments.in.c_str());
  std::printf("%zu poses: %s (%s) -> %s (%s)\n", in.trajectory.size(), arguments.in.c_str(),
              ToString(in.format), arguments.out.c_str(), ToString(to));
  if (in.has_stamps && !needs_stamps && arguments.times_out.empty())
    std::printf("the format %s has no time stamps; --times-out keeps them in a file of their own\n",
                ToString(to));
}

}  // namespace

void SetUpConvert(CLI::App& command, int&) {
  const auto arguments = std::make_shared<ConvertArguments>();
  command.add_option("input", arguments->in, "Trajectory to read")->required();
  command.add_option("output", arguments->out, "File to write")->required();
  command.add_option("--to", arguments->to, "Format of the output")
      ->required()
      ->check(CLI::IsMember(PoseFileFormatNames()));
  AddDefaulted(command, "--from", arguments->from, "Format of the input; auto: by content",
               CLI::IsMember({"auto", "tum", "kitti", "euroc", "g2o"}));
  command.add_option("--times", arguments->times,
                     "Time stamps of kitti's lines or g2o's ids: one a line, as KITTI's times.txt");
  command.add_option("--times-out", arguments->times_out, "Write the time stamps to this file");
  command.footer(
      R"(Nothing is turned or moved: KITTI's ground truth stays in its camera frame, EuRoC's in the body's. g2o gets the
vertices 0, 1, ... and edges between neighbours with identity information, for viewers and tests, not to optimise.
Time stamps are kept to the nanosecond. Their unit (s, ms, us, ns) is recognised by size and spacing, and said
where it is not the format's. Columns that a first line names may be in any order.
Examples:
  tutti convert poses/00.txt 00.tum --to tum --times sequences/00/times.txt
  tutti convert mav0/state_groundtruth_estimate0/data.csv groundtruth.txt --to tum
  tutti convert out/trajectory.txt 00.txt --to kitti --times-out times.txt)");
  command.callback([arguments] { RunConvert(*arguments); });
}

}  // namespace tutti::cli
