// The options that `tutti evaluate` and `tutti plot` share, with the names that users of evo know.
#include <utility>

#include "apps/tutti/evaluation_input.h"
#include "apps/tutti/options.h"

namespace tutti::cli {
namespace {

// One of these words, or a short one that stands for one.
CLI::Validator WordOrShort(const std::vector<std::string>& words,
                           const std::vector<std::pair<std::string, std::string>>& short_words) {
  const CLI::Validator known = OneOf(words);
  return CLI::Validator(
      [=](std::string& text) {
        for (const auto& [letter, word] : short_words) {
          if (text == letter) text = word;
        }
        return known(text);
      },
      known.get_description());
}

void AddFiles(CLI::App& command, EvaluationInput& input) {
  command.add_option("files", input.files,
                     input.reference_comes_first
                         ? "The reference, then the estimates, in place of --reference and --estimate"
                         : "Trajectories, in place of --estimate");
  command.add_option("--reference,--ref", input.reference, "Ground truth");
  command.add_option("--estimate", input.estimates, "Trajectories to judge, one or several");
  command.add_option("--run", input.runs,
                     "Folders of `tutti run`: the final trajectory, the poses as first given out and the "
                     "odometry without loops; the run's ground truth and alignment, if no other is given");
  command.add_option("--name", input.names, "Names of the estimates for the table, in their order");
  const CLI::IsMember formats({"auto", "tum", "kitti", "euroc", "g2o"});
  AddDefaulted(command, "--format", input.format,
               "auto: by content; tum: 'stamp x y z qx qy qz qw'; kitti: 12 numbers a line; euroc: ASL csv; "
               "g2o: the vertices of a graph, in the order of their ids",
               formats);
  AddOption(command, "--reference-format", input.reference_format,
            "Of the reference, where it is not that of --format", formats);
  command.add_option("--times", input.times,
                     "KITTI's times.txt: the time stamps of files that have none (kitti, g2o)");
  command.add_option("--frames", input.frames,
                     "Stamps of all images (rgb.txt, data.csv, times.txt), for the coverage; without, "
                     "frames that have no pose are counted by the estimate's median interval");
}

void AddAlignment(CLI::App& command, EvaluationInput& input) {
  CLI::Option* align =
      AddOption(
          command, "--align", input.align,
          "How the estimate is laid on the reference: none; origin: first poses coincide; se3: best rigid "
          "fit; sim3: best fit with scale (mono); scale: the scale of sim3 alone; yaw: turn about "
          "--vertical and move",
          CLI::IsMember(TrajectoryAlignmentNames()))
          ->default_str("se3");
  CLI::Option* fit = command.add_flag("-a", input.fit, "As --align se3, with -s sim3")->excludes(align);
  CLI::Option* scale =
      command.add_flag("-s,--correct_scale", input.fit_scale, "As --align scale, with -a sim3")
          ->excludes(align);
  command.add_flag("--align_origin", input.fit_origin, "As --align origin")
      ->excludes(align)
      ->excludes(fit)
      ->excludes(scale);
  AddDefaulted(command, "--align-first,--n_to_align", input.options.align_first,
               "Align by so many associated poses from the start; 0: by all", NotNegative());
  AddDefaulted(command, "--vertical", input.vertical, "Axis of the reference that yaw turns about",
               CLI::IsMember({"x", "y", "z"}));
  AddDefaulted(command, "--project-to-plane,--project_to_plane", input.plane,
               "After the alignment, put all poses into this plane; their rotations keep the turn about its "
               "normal",
               CLI::IsMember(ProjectionPlaneNames()));
}

void AddAssociation(CLI::App& command, EvaluationInput& input) {
  AddDefaulted(command, "--downsample", input.options.downsample,
               "First, leave at most so many evenly spaced poses of each file; 0: all", NotNegative());
  AddOption(command, "--motion-filter,--motion_filter", input.motion_filter,
            "Then leave a pose after so many metres of path, or degrees of turn, since the last [m deg]",
            NotNegative())
      ->expected(2);
  AddDefaulted(command, "--max-diff,--t_max_diff", input.options.max_time_difference_s,
               "Largest time difference of a pair [s]", NotNegative());
  AddDefaulted(command, "--time-offset,--t-offset,--t_offset", input.options.time_offset_s,
               "Added to the estimate's time stamps [s]");
  command.add_flag("--interpolate", input.options.interpolate,
                   "Compare with the reference interpolated at the estimate's stamps, not with its nearest "
                   "pose");
  AddDefaulted(command, "--max-gap", input.options.max_interpolation_s,
               "Don't interpolate between poses further apart [s]", Positive());
}

void AddRelative(CLI::App& command, EvaluationInput& input) {
  AddDefaulted(command, "-d,--rpe-delta,--delta", input.options.rpe_delta, "Distance of the relative errors",
               Positive());
  command.add_option("-u,--rpe-unit,--delta_unit", input.rpe_unit, "Unit of --rpe-delta; or f, m, d, s, r")
      ->transform(WordOrShort(DeltaUnitNames(), {{"f", "frames"},
                                                 {"m", "metres"},
                                                 {"d", "degrees"},
                                                 {"deg", "degrees"},
                                                 {"s", "seconds"},
                                                 {"r", "radians"},
                                                 {"rad", "radians"}}))
      ->capture_default_str();
  command.add_flag("--rpe-all-pairs,--all-pairs,--all_pairs", input.options.rpe_all_pairs,
                   "Relative errors from every pose, overlapping");
  AddDefaulted(command, "-t,--rpe-tolerance,--delta_tol", input.options.rpe_tolerance,
               "All pairs: allowed deviation from --rpe-delta, as a fraction of it", NotNegative());
}

}  // namespace

void AddEvaluationOptions(CLI::App& command, EvaluationInput& input) {
  AddFiles(command, input);
  AddAlignment(command, input);
  AddAssociation(command, input);
  AddRelative(command, input);
}

}  // namespace tutti::cli
