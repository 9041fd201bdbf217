// tutti loops: loop closure alone on images, measured against a ground truth.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "apps/run/interrupt.h"
#include "apps/run/progress.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/loops/earlier_images.h"
#include "apps/tutti/loops/loops_input.h"
#include "apps/tutti/loops/loops_output.h"
#include "apps/tutti/loops/overlap_truth.h"
#include "apps/tutti/recording_options.h"
#include "core/camera_text.h"
#include "core/stopwatch.h"
#include "core/terminal.h"
#include "frontend/dataset/image_mask.h"
#include "frontend/dataset/rectified_rig.h"
#include "loopclosure/evaluation/view_overlap.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/slam/config.h"

namespace tutti::cli {
namespace {

struct LoopsArguments {
  std::string images, topic, out, rule, preset, camera, places, mask;
  GroundTruthArguments truth;
  std::vector<std::string> set;  // key=value, keys of the section `loops` of a configuration
  LoopDetectorOptions options;
  bool table = false;
  bool dump = false;
  bool rgbd = false;         // depth goes to the detector, too
  std::string depth_camera;  // of the images that depth belongs to
};

// What every rule of a table shares.
struct Input : ImageSet {
  std::optional<PinholeCamera> camera;
  std::optional<ImageMasks> masks;
  bool rgbd = false;
};

LoopRow Process(const Input& set, std::size_t i, std::int64_t number, LoopDetector& detector) {
  const std::filesystem::path &file = set.images[i], &right = set.rights[i];
  LoopRow row;
  row.file = file.filename().string();
  LoopQuery query;
  query.id = number;
  query.stamp_s = static_cast<double>(number);
  if (set.rgbd) {
    std::tie(query.image, query.depth_m) = set.ReadWithDepth(i);
  } else {
    query.image = right.empty() ? set.Read(i) : ReadJoined(file, right, &query.cameras);
  }
  row.read = !query.image.empty();
  if (row.read && set.camera) {
    query.camera = set.camera;
    query.camera->width = query.image.cols;
    query.camera->height = query.image.rows;
  }
  if (row.read && set.masks) query.mask = set.masks->Of(file.stem().string(), query.image.size());
  const internal::Stopwatch watch;
  row.result = detector.Detect(query);
  row.ms = watch.Milliseconds();
  return row;
}

// Images that are joined have none of these in common.
void RefuseForPairs(const LoopsArguments& arguments, const char* option, const char* what) {
  if (!arguments.truth.join_pairs) return;
  throw InputError(std::string(option) + ": images that --join-pairs joins have no common " + what +
                   "; leave one of the two out");
}

// --mask, and a word about images that have none.
std::optional<ImageMasks> MasksFor(const LoopsArguments& arguments, const ImageSet& set) {
  if (arguments.mask.empty()) return std::nullopt;
  RefuseForPairs(arguments, "--mask", "mask");
  ImageMasks masks(arguments.mask);
  if (set.recording) {
    const PinholeCamera& camera = set.recording->Rig().camera;
    masks.OfAll({camera.width, camera.height});  // refuses what can't be used
  }
  const auto without = std::count_if(set.images.begin(), set.images.end(),
                                     [&](const auto& image) { return !masks.Has(image.stem().string()); });
  const std::string of_all = " of " + std::to_string(set.images.size()) + " images";
  if (without == static_cast<std::ptrdiff_t>(set.images.size()))
    throw InputError(arguments.mask + ": holds no mask for any" + of_all +
                     "; a mask has the name of its image");
  if (without > 0)
    internal::Say("%s: %td%s have no mask; all of them is used", arguments.mask.c_str(), without,
                  of_all.c_str());
  return masks;
}

// What was kept for the pictures and the dump alone.
void DropEvidence(bool with_posterior, LoopResult& result) {
  if (!with_posterior) result.posterior_by_location = {};
  for (MemberOpinion& member : result.members) {
    if (!with_posterior) member.posterior_by_location = {};
    member.evidence = {};
  }
  result.tried = {};
  result.verification.inlier_matches = {};
}

// What the newest image has changed for one before it: figures, files and pictures are of final decisions.
// Returns how many loops more there are.
int TakeSecondWord(const EarlierImages& earlier, const LoopGroundTruth& truth, LoopRun& run,
                   LoopsDump* dump) {
  const std::optional<LateLoop> late = std::move(run.rows.back().result.late);
  run.rows.back().result.late.reset();
  const std::int64_t number = late ? late->query - earlier.first() : -1;
  if (number < 0 || number >= static_cast<std::int64_t>(run.rows.size())) return 0;
  LoopRow said;
  said.result.query = late->query;
  if (!TakeLate(*late, &said.result)) return 0;
  earlier.Separate(&said);  // the detector's numbers to this run's
  LoopRow& row = run.rows[static_cast<std::size_t>(number)];
  const bool before = row.result.accepted || row.earlier;
  row.earlier = said.earlier;
  row.second_word = late->accepted ? SecondWord::kAccepted : SecondWord::kWithdrawn;
  row.result.accepted = said.result.accepted;
  row.result.candidate = said.result.candidate;
  row.result.probability = said.result.probability;
  row.result.verification = said.result.verification;
  row.result.reason = said.result.reason;
  if (dump != nullptr) dump->AddLate(run, row.result, truth);
  row.result.verification.inlier_matches = {};
  return (row.result.accepted || row.earlier ? 1 : 0) - (before ? 1 : 0);
}

// Up to Ctrl-C: a run that ended early has the ground truth of its images only. A dump goes into `folder`.
LoopRun RunDetector(const LoopsArguments& arguments, const LoopDetectorOptions& options, const Input& set,
                    const std::filesystem::path& folder) {
  LoopRun run;
  run.images = arguments.images;
  run.stride = arguments.truth.stride;
  run.judged = !arguments.truth.file.empty();
  run.options = options;
  run.image = [&set](std::size_t row) { return set.Read(row); };
  LoopDetectorOptions with_posterior = options;
  with_posterior.keep_posterior = true;  // for confusion.png
  with_posterior.keep_evidence = arguments.dump || options.keep_evidence;
  LoopDetector detector(with_posterior);
  const std::string& places = arguments.places;
  if (!places.empty() && std::filesystem::exists(places)) detector.Load(places);
  EarlierImages earlier(detector, places.empty() ? options.ltm_file : places);
  run.earlier = earlier.first();
  std::optional<LoopsDump> dump;
  if (arguments.dump) dump.emplace(folder, options.members);
  const int total = static_cast<int>(set.images.size());
  int loops = 0;
  Progress progress(arguments.table ? "loops, " + RuleName(options) : "loops", set.images.size());
  for (std::size_t i = 0; i < set.images.size(); ++i) {
    if (InterruptGuard::Requested()) break;
    const std::filesystem::path& image = set.images[i];
    const std::int64_t number = earlier.first() + static_cast<std::int64_t>(i);
    run.rows.push_back(Process(set, i, number, detector));
    LoopRow& row = run.rows.back();
    earlier.Add(number, image);
    earlier.Separate(&row);
    if (!row.read)
      progress.Note(
          "tutti: warning: " + image.string() + ": can't be read; it counts as an image without features",
          "images can't be read");
    AddPosterior(row.result, total, run.posterior);
    if (dump) dump->Add(run, row.result, set.truth);
    DropEvidence(options.keep_posterior, row.result);
    loops += row.result.accepted || row.earlier ? 1 : 0;
    loops += TakeSecondWord(earlier, set.truth, run, dump ? &*dump : nullptr);
    progress.Update(run.rows.size(), std::to_string(loops) + " loops");
  }
  progress.Finish();
  if (dump) dump->Finish();
  if (!places.empty()) detector.Save(places);
  run.truth = set.truth;
  if (run.rows.size() < set.images.size()) {
    const int done = static_cast<int>(run.rows.size());
    run.truth = set.truth.First(done);
    const int side = (done * run.posterior.rows + total - 1) / total;
    run.posterior = run.posterior(cv::Rect(0, 0, side, side)).clone();
  }
  return run;
}

// All rules, each with the files of a run of its own in its folder.
int RunTable(const LoopsArguments& arguments, const Input& set) {
  OutputFolder folder(arguments.out, LoopsLayout(true));
  LoopTable table;
  for (const std::string& rule : TableRules(arguments.options)) {
    LoopDetectorOptions options = arguments.options;
    SetRule(rule, options);
    OutputFolder part(folder.path() / rule, LoopsLayout());
    const LoopRun run = RunDetector(arguments, options, set, part.Staging());
    if (run.rows.size() < set.images.size()) {
      internal::Say("interrupted in the rule '%s'; no table is written, only the rules before", rule.c_str());
      return 130;
    }
    const LoopReport report = EvaluateRun(run);
    WriteLoopRun(run, report, true, part);
    AddToTable(run, report, table);
  }
  WriteLoopTable(table, folder);
  return 0;
}

void CheckGroundTruth(const LoopsArguments& arguments) {
  const GroundTruthArguments& truth = arguments.truth;
  std::string problem = truth.rule.Validate();
  if (problem.empty() && truth.overlap)
    problem = internal::OverlapRule{*truth.overlap, truth.ignore_overlap, truth.rule.exclude_s}.Validate();
  if (!problem.empty()) throw InputError("ground truth: " + problem);
  if (!truth.overlap) return;
  if (truth.file.empty())
    throw InputError("--ground-truth-overlap needs a pose for each image: give --ground-truth FILE of poses");
  RefuseForPairs(arguments, "--ground-truth-overlap", "depth");
}

int RunLoops(const LoopsArguments& given) {
  LoopsArguments arguments = given;
  arguments.images = ImageFolder(arguments.images).string();
  if (arguments.out.empty()) arguments.out = DefaultOutput(given.images, "-loops").string();
  if (arguments.table && arguments.truth.file.empty())
    throw InputError("--table compares rules by a ground truth; give --ground-truth");
  if (!arguments.camera.empty()) RefuseForPairs(arguments, "--camera", "camera");
  if (!arguments.preset.empty()) ApplyPreset(arguments.preset, arguments.options);
  if (!arguments.rule.empty()) SetRule(arguments.rule, arguments.options);
  SetLoopOptions(arguments.set, arguments.options);
  for (const std::string& memory : {arguments.options.ltm_file, arguments.places}) {
    if (!arguments.table || memory.empty()) continue;
    throw InputError(memory +
                     ": --table runs several detectors, and what one has seen is of no use to another; "
                     "leave one of the two out");
  }
  OutputFolder::Check(arguments.out, LoopsLayout(arguments.table));
  CheckGroundTruth(arguments);
  if (arguments.rgbd) RefuseForPairs(arguments, "--rgbd", "depth");
  cv::setNumThreads(arguments.options.threads);
  std::optional<PinholeCamera> camera;
  if (!arguments.camera.empty()) camera = internal::ParseCamera(arguments.camera);
  arguments.truth.depth.camera = arguments.depth_camera.empty() ? arguments.camera : arguments.depth_camera;
  Input set = {LoadImageSet(arguments.images, arguments.truth, arguments.topic, camera, arguments.rgbd),
               camera, std::nullopt, arguments.rgbd};
  if (set.rgbd) set.camera = set.depth->camera();
  if (camera && set.recording) set.camera = set.recording->Rig().camera;
  for (const std::string& note : set.notes) internal::Say("%s", note.c_str());
  if (set.recording) {
    for (const std::string& warning : set.recording->Warnings()) {
      if (warning == NoCalibrationText(arguments.images)) continue;  // loops need none
      internal::Say("%s", warning.c_str());
    }
  }
  set.masks = MasksFor(arguments, set);
  const InterruptGuard interrupt;
  RefuseToReplace(arguments.out, arguments.truth.file);
  if (arguments.table) return RunTable(arguments, set);

  OutputFolder folder(arguments.out, LoopsLayout());
  const LoopRun run = RunDetector(arguments, arguments.options, set, folder.Staging());
  const LoopReport report = EvaluateRun(run);
  const bool finished = run.rows.size() == set.images.size();
  PrintLoopRun(run, report, WriteLoopRun(run, report, finished, folder));
  if (!finished) {
    internal::Say("interrupted after %zu of %zu images; the results are of those", run.rows.size(),
                  set.images.size());
    return 130;
  }
  return 0;
}

void AddOverlapOptions(CLI::App& command, LoopsArguments& a) {
  CLI::Option* overlap =
      command
          .add_option(
              "--ground-truth-overlap", a.truth.overlap,
              "trajectory, and depth images: a loop is two images, at least this share of one of which is "
              "seen in the other (0.3 is usual), in place of --gt-distance and --gt-angle")
          ->type_name("SHARE");
  AddDefaulted(command, "--gt-ignore-overlap", a.truth.ignore_overlap,
               "by overlap: no loop where less than this is shared, either way; between the two: ignored")
      ->type_name("SHARE")
      ->needs(overlap);
  command
      .add_option("--gt-depth", a.truth.depth.dataset,
                  "data set (RGB-D: TUM's and other layouts) that has the images' depth (default: the one "
                  "that they are part of)")
      ->type_name("DATASET");
  AddOption(command, "--gt-depth-units", a.truth.depth.units_per_m,
            "value of one metre in its depth images (default: as its layout says)", Positive());
  command.add_option("--gt-camera", a.depth_camera,
                     std::string(internal::kCameraText) +
                         " [px]: of those images (default: --camera, else as the data set says)");
  command.add_flag("--rgbd", a.rgbd,
                   "the images' depth (as --gt-depth) goes to the detector, too: motions in metres");
}

}  // namespace

void SetUpLoops(CLI::App& command, int& exit_code) {
  auto arguments = std::make_shared<LoopsArguments>();
  command
      .add_option(
          "images,--images", arguments->images,
          "folder of images, taken in natural order, or a data set's (KITTI, TUM, EuRoC); a video; or a bag "
          "of ROS 1 or 2")
      ->required();
  command.add_option("--topic", arguments->topic, "of a bag: the images' topic (default: its only one)");
  command.add_option("--ground-truth", arguments->truth.file,
                     "loop matrix (PNG, BMP, text; row = current image) or trajectory (TUM, "
                     "KITTI, EuRoC); without one the loops are listed and shown, but not judged");
  command.add_option("--out", arguments->out,
                     "folder for loops.csv, results.json, hypotheses.csv, curves and pictures (default: "
                     "tutti-out/NAME-loops)");
  AddDefaulted(command, "--stride", arguments->truth.stride, "every n-th image", CLI::Range(1, 1000000));
  command.add_flag("--join-pairs", arguments->truth.join_pairs,
                   "two images in a row, left and right, make one image (City Centre, New College)");
  command.add_flag("--keep-posterior", arguments->options.keep_posterior,
                   "also write posteriors.csv: each member's posterior of each location");
  command.add_flag("--dump", arguments->dump,
                   "also write dump_candidates.csv (what each candidate looked like to each member) and "
                   "dump_verification.csv (each geometric verification)");
  command
      .add_option(
          "--rule", arguments->rule,
          "joint (default), mean, log-pool, product, majority, naive, or one member: surf, sift, orb, "
          "akaze, brisk, kaze")
      ->type_name("RULE");
  command.add_option("--preset", arguments->preset,
                     "published parameters: standardised-mean, paper-2013, rtabmap-0.8.3, or default (ours)");
  LoopRule& rule = arguments->truth.rule;
  AddDefaulted(command, "--gt-distance", rule.distance_m, "trajectory: a loop is nearer than this [m]");
  AddDefaulted(command, "--gt-angle", rule.angle_deg, "trajectory: and turned by less than this [deg]");
  AddDefaulted(command, "--gt-ignore", rule.ignore_m,
               "trajectory: what is nearer than this but no loop is ignored [m]");
  AddDefaulted(command, "--gt-exclude-s", rule.exclude_s,
               "trajectory: a loop is at least this much older [s]");
  AddOverlapOptions(command, *arguments);
  command
      .add_flag("--table", arguments->table,
                "every rule and each member alone, one after the other; table.json, .md, .csv, and a folder "
                "for each")
      ->excludes(command.get_option("--rule"));
  command.add_option("--camera", arguments->camera,
                     std::string(internal::kCameraText) +
                         " [px]: verify with the essential matrix (default: fundamental matrix)");
  AddMaskOption(command, arguments->mask);
  AddDefaulted(command, "--threads", arguments->options.threads,
               "most threads; the result is the same for any number", Positive());
  AddDefaulted(command, "--seed", arguments->options.seed, "seed of kd-forests and RANSAC", NotNegative());
  command.add_option("--set", arguments->set,
                     "key=value: an option of the detector, with the keys of section 'loops' in tutti run "
                     "--help-config --advanced (extraction.features=300); may be given again");
  command
      .add_option(
          "--places", arguments->places,
          "file with what the detector knows: gone on with if it is there, written at the end. Loops "
          "into images of earlier runs are in earlier_loops.csv (also with --set ltm_file=FILE, where "
          "the filters start afresh)")
      ->type_name("FILE");
  command.callback([arguments, &exit_code] { exit_code = RunLoops(*arguments); });
}

}  // namespace tutti::cli
