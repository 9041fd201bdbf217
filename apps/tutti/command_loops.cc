// tutti loops: loop closure alone on a folder of images, measured against a ground truth.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "command_loops_input.h"
#include "command_loops_output.h"
#include "commands.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/pipeline/config.h"
#include "tutti/pipeline/interrupt.h"
#include "tutti/pipeline/progress.h"

namespace tutti::cli {
namespace {

struct LoopsArguments {
  std::string images, out, rule = "mean", camera;
  GroundTruthArguments truth;
  std::vector<std::string> set;  // key=value, keys of the section `loops` of a configuration
  LoopDetectorOptions options;
};

std::optional<PinholeCamera> ParseCamera(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::vector<std::string> words = SplitText(text, ", ");
  std::vector<double> values;
  for (const std::string& word : words) {
    const auto value = ParseDouble(word);
    if (value) values.push_back(*value);
  }
  if (words.size() != 4 || values.size() != 4 || !(values[0] > 0) || !(values[1] > 0)) {
    throw InputError("--camera " + text + ": give four numbers, fx,fy,cx,cy in pixels");
  }
  PinholeCamera camera;
  camera.fx = values[0];
  camera.fy = values[1];
  camera.cx = values[2];
  camera.cy = values[3];
  return camera;
}

LoopRow Process(const std::filesystem::path& file, int number, const std::optional<PinholeCamera>& camera,
                LoopDetector& detector) {
  LoopRow row;
  row.file = file.filename().string();
  LoopQuery query;
  query.id = number;
  query.stamp_s = number;
  query.image = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
  row.read = !query.image.empty();
  if (row.read && camera) {
    query.camera = camera;
    query.camera->width = query.image.cols;
    query.camera->height = query.image.rows;
  }
  const auto begin = std::chrono::steady_clock::now();
  row.result = detector.Detect(query);
  row.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  return row;
}

int RunLoops(const LoopsArguments& given) {
  LoopsArguments arguments = given;
  if (arguments.truth.stride < 1) throw InputError("--stride must be at least 1");
  SetRule(arguments.rule, arguments.options);
  SetLoopOptions(arguments.set, arguments.options);
  const std::string problem = arguments.truth.rule.Validate();
  if (!problem.empty()) throw InputError("ground truth: " + problem);
  cv::setNumThreads(arguments.options.threads);

  LoopRun run;
  run.images = arguments.images;
  run.stride = arguments.truth.stride;
  run.options = arguments.options;
  std::vector<std::filesystem::path> images = ListImages(arguments.images);
  // The matrix may lie among the images (corridor/ground_truth.bmp).
  std::error_code error;
  images.erase(std::remove_if(images.begin(), images.end(),
                              [&](const auto& p) {
                                return std::filesystem::equivalent(p, arguments.truth.file, error);
                              }),
               images.end());
  run.truth = LoadGroundTruth(arguments.truth, images);
  const std::optional<PinholeCamera> camera = ParseCamera(arguments.camera);
  LoopDetector detector(arguments.options);

  const std::size_t total = static_cast<std::size_t>(run.truth.size());
  const InterruptGuard interrupt;
  int loops = 0;
  {
    Progress progress("loops", total);
    for (std::size_t i = 0; i < images.size(); i += static_cast<std::size_t>(run.stride)) {
      if (InterruptGuard::Requested()) break;
      run.rows.push_back(Process(images[i], static_cast<int>(run.rows.size()), camera, detector));
      const LoopRow& row = run.rows.back();
      if (!row.read)
        progress.Note("tutti: warning: " + images[i].string() +
                      ": can't be read; it counts as an image without features");
      loops += row.result.accepted ? 1 : 0;
      progress.Update(run.rows.size(), std::to_string(loops) + " loops");
    }
    progress.Finish();
  }
  WriteLoopRun(run, arguments.out);
  if (run.rows.size() < total) {
    std::fprintf(stderr, "tutti: interrupted after %zu of %zu images; the results are of those\n",
                 run.rows.size(), total);
    return 130;
  }
  return 0;
}

}  // namespace

void AddLoopsCommand(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<LoopsArguments>();
  CLI::App* command = app.add_subcommand(
      "loops", "loop closure alone on a folder of images, measured against a ground truth");
  command->add_option("--images", arguments->images, "folder of images, taken in natural order")->required();
  command
      ->add_option("--ground-truth", arguments->truth.file,
                   "loop matrix (PNG, BMP, text, MATLAB v5 .mat; row = current image) or trajectory (TUM, "
                   "KITTI, EuRoC)")
      ->required();
  command->add_option("--out", arguments->out, "folder for results.json and hypotheses.csv")->required();
  command->add_option("--stride", arguments->truth.stride, "every n-th image")->capture_default_str();
  command
      ->add_option("--rule", arguments->rule,
                   "mean, product, majority, naive, or one member: surf, sift, orb, akaze, brisk")
      ->capture_default_str();
  LoopRule& rule = arguments->truth.rule;
  command->add_option("--gt-distance", rule.distance_m, "trajectory: a loop is nearer than this [m]")
      ->capture_default_str();
  command->add_option("--gt-angle", rule.angle_deg, "trajectory: and turned by less than this [deg]")
      ->capture_default_str();
  command
      ->add_option("--gt-ignore", rule.ignore_m,
                   "trajectory: what is nearer than this but no loop is ignored [m]")
      ->capture_default_str();
  command->add_option("--gt-exclude-s", rule.exclude_s, "trajectory: a loop is at least this much older [s]")
      ->capture_default_str();
  command->add_option("--camera", arguments->camera,
                      "fx,fy,cx,cy [px]: verify with the essential matrix (default: fundamental matrix)");
  command
      ->add_option("--threads", arguments->options.threads,
                   "most threads; the result is the same for any number")
      ->capture_default_str();
  command->add_option("--seed", arguments->options.seed, "seed of kd-forests and RANSAC")
      ->capture_default_str();
  command->add_option(
      "--set", arguments->set,
      "key=value: an option of the detector, with the keys of section 'loops' in --help-config "
      "(extraction.features=300); may be given again");
  command->callback([arguments, &exit_code] { exit_code = RunLoops(*arguments); });
}

}  // namespace tutti::cli
