#include "apps/tutti/loops/overlap_truth.h"

#include <algorithm>
#include <sstream>

#include "apps/run/recording.h"
#include "frontend/dataset/image_file.h"
#include "loopclosure/evaluation/view_overlap.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

// The data set whose images these are; `path` itself where it is none's.
fs::path DatasetAround(const fs::path& path) {
  std::error_code code;
  const fs::path given = (fs::absolute(path, code).lexically_normal() / "").parent_path();
  fs::path folder = given;
  for (int level = 0; level < 3 && folder.has_relative_path(); ++level) {
    folder = folder.parent_path();
    const std::optional<fs::path> images = ImagesOfDataset(folder);
    if (images && fs::equivalent(*images, given, code)) return folder;
  }
  return path;
}

std::shared_ptr<const Dataset> Open(const fs::path& folder, const DepthArguments& arguments) {
  CameraRequest request;
  request.sensor = Sensor::kRgbd;
  request.camera = arguments.camera;
  request.depth_units_per_m = arguments.units_per_m;
  const Recording recording = Recognise(folder, request);
  if (recording.guessed_lens) {
    throw InputError(folder.string() +
                     ": nothing here says what the camera is, which a depth image is nothing without; give "
                     "--gt-camera fx,fy,cx,cy");
  }
  DatasetOptions options = recording.config.dataset;
  options.start = 0, options.end = 0, options.stride = 1;  // images are counted among all
  options.mask.clear();
  return OpenDataset(folder, options);
}

}  // namespace

DepthImages::DepthImages(const DepthArguments& arguments, const fs::path& path,
                         const std::vector<fs::path>& images, const std::vector<double>& stamps)
    : folder_(arguments.dataset.empty() ? DatasetAround(path) : fs::path(arguments.dataset)) {
  try {
    dataset_ = Open(folder_, arguments);
  } catch (const InputError& error) {
    std::string text = error.what();
    if (arguments.dataset.empty())
      text += ". Depth is looked for in the data set around the images; --gt-depth DATASET names another";
    throw InputError(text);
  }
  FindFrames(images, stamps);
}

void DepthImages::FindFrames(const std::vector<fs::path>& images, const std::vector<double>& stamps) {
  if (dataset_->Size() == images.size()) {
    for (std::size_t i = 0; i < images.size(); ++i) frames_.push_back(i);
    return;
  }
  const std::vector<double> known = stamps.empty() ? StampsOfImages(images) : stamps;
  for (std::size_t i = 0; i < known.size(); ++i) {
    const std::optional<std::size_t> frame = FindStamp(*dataset_, known[i]);
    if (!frame) {
      throw InputError(images[i].string() + ": has no frame in " + folder_.string() +
                       ", whose depth is to be its; give the data set of these images as --gt-depth");
    }
    frames_.push_back(*frame);
  }
  if (frames_.empty()) {
    throw InputError(folder_.string() + ": has depth for " + std::to_string(dataset_->Size()) +
                     " frames, but there are " + std::to_string(images.size()) +
                     " images, and their names are no time stamps; give the data set of these images as "
                     "--gt-depth");
  }
}

cv::Mat DepthImages::Depth(std::size_t image) const {
  const ReadResult read = dataset_->Read(frames_.at(image));
  return read.frame ? read.frame->depth_m : cv::Mat();
}

cv::Mat DepthImages::Colour(std::size_t image) const { return dataset_->ReadColour(frames_.at(image)).image; }

const PinholeCamera& DepthImages::camera() const { return dataset_->Rig().camera; }

const Pose& DepthImages::T_body_camera() const { return dataset_->Rig().T_body_camera; }

LoopGroundTruth TruthByOverlap(const GroundTruthArguments& arguments, const PosesOfImages& poses,
                               const DepthImages& depth) {
  const internal::OverlapRule rule = {*arguments.overlap, arguments.ignore_overlap, arguments.rule.exclude_s};
  std::vector<std::optional<internal::DepthView>> views;
  std::vector<double> stamps;
  for (std::size_t i = 0; i < poses.size(); i += static_cast<std::size_t>(arguments.stride)) {
    views.emplace_back();
    stamps.push_back(poses[i] ? poses[i]->stamp_s : 0);
    if (!poses[i]) continue;
    const cv::Mat metres = depth.Depth(i);
    if (!metres.empty()) views.back().emplace(poses[i]->pose * depth.T_body_camera(), depth.camera(), metres);
  }
  const auto unknown = std::count(views.begin(), views.end(), std::nullopt);
  if (unknown == static_cast<std::ptrdiff_t>(views.size())) {
    throw InputError(depth.folder().string() + ": none of " + std::to_string(views.size()) +
                     " images has both depth there and a pose in " + arguments.file);
  }
  LoopGroundTruth truth = internal::LoopsFromOverlap(views, stamps, rule);
  std::ostringstream text;
  text << arguments.file << " and depth of " << depth.folder().string() << " (loop: >= " << 100 * rule.share
       << " % of one are seen in the other, >= " << rule.exclude_s
       << " s older; ignored: younger, or >= " << 100 * rule.ignore_share << " %)";
  if (unknown > 0) text << "; of " << unknown << " images it says nothing";
  truth.description = text.str();
  return truth;
}

}  // namespace tutti::cli
