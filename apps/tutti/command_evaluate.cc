// tutti evaluate: how far is a trajectory from the reference?
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "commands.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

struct EvaluateArguments {
  std::string reference, estimate, format = "tum", align = "se3", json, rpe_unit = "frames";
  EvaluationOptions options;
};

Trajectory Read(const std::string& file, TrajectoryFormat format) {
  std::vector<std::string> warnings;
  Trajectory out;
  try {
    out = ReadTrajectory(file, format, &warnings);
  } catch (const InputError& error) {
    // A file in another format fails in its first line; say so instead of complaining about columns alone.
    const TrajectoryFormat guess =
        std::filesystem::is_regular_file(file) ? GuessTrajectoryFormat(file) : format;
    if (guess == format) throw;
    const char* name = guess == TrajectoryFormat::kKitti   ? "kitti"
                       : guess == TrajectoryFormat::kEuroc ? "euroc"
                                                           : "tum";
    throw InputError(std::string(error.what()) + " (it looks like --format " + name + ")");
  }
  for (const std::string& warning : warnings) std::fprintf(stderr, "tutti: warning: %s\n", warning.c_str());
  return out;
}

nlohmann::ordered_json ToJson(const ErrorStatistics& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.std},
          {"min", s.min},   {"max", s.max},   {"sse", s.sse},       {"count", s.count}};
}

nlohmann::ordered_json ToJson(const EvaluationReport& report, const EvaluateArguments& arguments) {
  const Similarity& S = report.S_reference_estimate;
  const Eigen::Quaterniond& q = S.rotation;
  nlohmann::ordered_json json;
  json["reference"] = arguments.reference;
  json["estimate"] = arguments.estimate;
  json["format"] = arguments.format;
  json["pairs"] = report.pairs;
  json["reference_poses"] = report.reference_poses;
  json["estimate_poses"] = report.estimate_poses;
  json["path_length_m"] = report.path_length_m;
  json["alignment"] = {{"mode", ToString(report.alignment)},
                       {"scale", S.scale},
                       {"translation", {S.translation.x(), S.translation.y(), S.translation.z()}},
                       {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
  json["ate"] = ToJson(report.ate);
  json["ate_rotation_deg"] = ToJson(report.ate_rotation);
  json["rpe"] = {
      {"delta", arguments.options.rpe_delta},
      {"unit", arguments.rpe_unit},
      {"all_pairs", arguments.options.rpe_all_pairs},
      {"translation", report.rpe.count > 0 ? ToJson(report.rpe) : nlohmann::ordered_json()},
      {"rotation_deg", report.rpe.count > 0 ? ToJson(report.rpe_rotation) : nlohmann::ordered_json()}};
  json["kitti"] = {{"segments", report.kitti.segments}};
  if (report.kitti.segments > 0) {
    json["kitti"]["t_rel_percent"] = report.kitti.translation_percent;
    json["kitti"]["r_rel_deg_per_m"] = report.kitti.rotation_deg_per_m;
  }
  return json;
}

void PrintRow(const char* name, const ErrorStatistics& s) {
  std::printf("  %-22s %10.6f %10.6f %10.6f %10.6f %10.6f %10.6f\n", name, s.rmse, s.mean, s.median, s.std,
              s.min, s.max);
}

void Print(const EvaluationReport& report, const EvaluateArguments& arguments) {
  std::printf("%zu pairs of poses (reference %zu, estimate %zu), path %.2f m, alignment %s", report.pairs,
              report.reference_poses, report.estimate_poses, report.path_length_m,
              ToString(report.alignment));
  if (report.alignment == TrajectoryAlignment::kSim3)
    std::printf(" (scale %.6f)", report.S_reference_estimate.scale);
  std::printf("\n  %-22s %10s %10s %10s %10s %10s %10s\n", "", "rmse", "mean", "median", "std", "min", "max");
  PrintRow("ATE [m]", report.ate);
  PrintRow("ATE rotation [deg]", report.ate_rotation);
  char name[64];
  std::snprintf(name, sizeof name, "RPE per %g %s", arguments.options.rpe_delta,
                arguments.rpe_unit == "metres"     ? "m"
                : arguments.options.rpe_delta == 1 ? "frame"
                                                   : "frames");
  if (report.rpe.count > 0) {
    PrintRow((std::string(name) + " [m]").c_str(), report.rpe);
    PrintRow((std::string(name) + " [deg]").c_str(), report.rpe_rotation);
  } else {
    std::printf("  %s: no two poses are that far apart\n", name);
  }
  if (report.kitti.segments > 0) {
    std::printf("  KITTI, 100..800 m: t_rel %.4f %%, r_rel %.6f deg/m (%zu segments)\n",
                report.kitti.translation_percent, report.kitti.rotation_deg_per_m, report.kitti.segments);
  }
}

void RunEvaluate(EvaluateArguments arguments) {
  const TrajectoryFormat format = ParseTrajectoryFormat(arguments.format);
  arguments.options.alignment = ParseTrajectoryAlignment(arguments.align);
  arguments.options.by_index = format == TrajectoryFormat::kKitti;
  arguments.options.rpe_unit = arguments.rpe_unit == "metres" ? DeltaUnit::kMetres : DeltaUnit::kFrames;
  const Trajectory reference = Read(arguments.reference, format);
  // EuRoC's ground truth is a csv; what is compared with it mostly is a TUM file.
  const TrajectoryFormat estimate_format =
      format == TrajectoryFormat::kEuroc ? GuessTrajectoryFormat(arguments.estimate) : format;
  const Trajectory estimate = Read(arguments.estimate, estimate_format);
  EvaluationReport report;
  try {
    report = EvaluateTrajectory(reference, estimate, arguments.options);
  } catch (const InputError& error) {
    throw InputError(arguments.estimate + " against " + arguments.reference + ": " + error.what());
  }
  Print(report, arguments);
  if (arguments.json.empty()) return;
  std::ofstream out(arguments.json);
  out << ToJson(report, arguments).dump(2) << '\n';
  out.flush();
  if (!out)
    throw InputError(arguments.json + ": can't be written; check that the folder exists and is writable");
}

}  // namespace

void AddEvaluateCommand(CLI::App& app, int&) {
  CLI::App* command =
      app.add_subcommand("evaluate", "Errors of a trajectory against a reference (ATE, RPE, KITTI)");
  const auto arguments = std::make_shared<EvaluateArguments>();
  command->add_option("--reference", arguments->reference, "Ground truth")->required();
  command->add_option("--estimate", arguments->estimate, "Trajectory to judge")->required();
  command
      ->add_option("--format", arguments->format,
                   "tum: 'stamp x y z qx qy qz qw'; kitti: 12 numbers a line, paired line by line; euroc: "
                   "ASL csv (the "
                   "estimate may be tum)")
      ->check(CLI::IsMember({"tum", "kitti", "euroc"}))
      ->capture_default_str();
  command
      ->add_option("--align", arguments->align,
                   "How the estimate is laid on the reference: none; origin: first poses coincide; se3: best "
                   "rigid fit; "
                   "sim3: best fit with scale (mono)")
      ->check(CLI::IsMember({"none", "origin", "se3", "sim3"}))
      ->capture_default_str();
  command->add_option("--json", arguments->json, "Write every figure to this file");
  command
      ->add_option("--max-diff", arguments->options.max_time_difference_s,
                   "Largest time difference of a pair [s]")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--rpe-delta", arguments->options.rpe_delta, "Distance of the relative errors")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--rpe-unit", arguments->rpe_unit, "Unit of --rpe-delta")
      ->check(CLI::IsMember({"frames", "metres"}))
      ->capture_default_str();
  command->add_flag("--rpe-all-pairs", arguments->options.rpe_all_pairs,
                    "Relative errors from every pose, overlapping");
  command->footer(
      "ATE is the distance between associated positions after the alignment: is the map where it should be? "
      "RPE compares\n"
      "motions over a short distance: how fast does the odometry drift? Figures agree with evo's (evo_ape, "
      "evo_rpe).\n"
      "Example: tutti evaluate --reference groundtruth.txt --estimate out/trajectory.txt --align sim3");
  command->callback([arguments] { RunEvaluate(*arguments); });
}

}  // namespace tutti::cli
