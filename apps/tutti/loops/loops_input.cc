#include "apps/tutti/loops/loops_input.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <sstream>
#include <utility>

#include "apps/tutti/loops/overlap_truth.h"
#include "core/numbers.h"
#include "core/pose_columns.h"
#include "core/text_reader.h"
#include "frontend/dataset/image_file.h"
#include "frontend/dataset/layout.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/dataset.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

// A trajectory has lines of so many numbers as one has, or a line that names its columns. A text matrix that
// has just as many columns has as many rows, too. Throws InputError if it is no text.
bool LinesOfPoses(const fs::path& file) {
  internal::TextReader in(file);
  std::string line;
  std::size_t columns = 0, rows = 0;
  bool named = false;
  while (rows < 20 && in.Next(line)) {
    const std::vector<std::string> words = internal::PoseWords(line);
    if (words.empty()) continue;
    const bool is_number = ParseDouble(words.front()).has_value();
    if (rows == 0 && !is_number && internal::ColumnsOfNames(line)) named = true;
    if (internal::IsComment(line) || (rows == 0 && named && !is_number)) continue;
    if (!is_number || (rows > 0 && words.size() != columns)) return false;
    columns = words.size();
    ++rows;
  }
  if (named) return rows > 0;
  const bool as_poses = columns == 4 || columns == 8 || columns == 12 || columns == 13 || columns >= 16;
  return as_poses && columns <= 17 && rows != columns;
}

bool LooksLikeTrajectory(const fs::path& file) {
  try {
    return LinesOfPoses(file);
  } catch (const InputError&) {
    return false;  // an image; its reader says what is wrong with it
  }
}

Trajectory ReadPoses(const fs::path& file) {
  TrajectoryDetails details;
  Trajectory trajectory = ReadTrajectory(file, GuessTrajectoryFormat(file), nullptr, &details);
  const fs::path times_file = file.parent_path() / "times.txt";
  if (details.has_stamps || details.has_numbers || !fs::exists(times_file)) return trajectory;
  const std::vector<double> times = ReadTimes(times_file);
  if (times.size() != trajectory.size()) {
    throw InputError(times_file.string() + ": has " + std::to_string(times.size()) + " times, but " +
                     file.string() + " has " + std::to_string(trajectory.size()) + " poses");
  }
  for (std::size_t i = 0; i < times.size(); ++i) trajectory[i].stamp_s = times[i];
  return trajectory;
}

// The pose of each image by its time stamp; none of any if they are no stamps of this trajectory.
PosesOfImages PosesAt(const std::vector<double>& stamps, const Trajectory& trajectory) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < stamps.size(); ++i) intervals.push_back(stamps[i] - stamps[i - 1]);
  const double interval_s = internal::Median(std::move(intervals));
  PosesOfImages poses;
  bool any = false;
  for (const double stamp : stamps) {
    const std::optional<Pose> pose = PoseOfFrame(trajectory, stamp, interval_s);
    poses.push_back(pose ? std::optional<StampedPose>({stamp, *pose}) : std::nullopt);
    any = any || pose;
  }
  return any ? poses : PosesOfImages();
}

// Nothing is known of a pair with an image that has no pose.
LoopGroundTruth TruthOf(const PosesOfImages& poses, const LoopRule& rule) {
  Trajectory known;
  std::vector<int> row_of;  // in `known`; -1: no pose
  for (const auto& pose : poses) {
    row_of.push_back(pose ? static_cast<int>(known.size()) : -1);
    if (pose) known.push_back(*pose);
  }
  const LoopGroundTruth labels = LoopsFromTrajectory(known, rule);
  LoopGroundTruth truth(static_cast<int>(poses.size()));
  for (int r = 0; r < truth.size(); ++r) {
    for (int c = 0; c < r; ++c) {
      const int row = row_of[static_cast<std::size_t>(r)], column = row_of[static_cast<std::size_t>(c)];
      truth.Set(r, c, row < 0 || column < 0 ? LoopLabel::kIgnore : labels.At(row, column));
    }
  }
  return truth;
}

std::string RuleText(const LoopRule& rule) {
  std::ostringstream text;
  text << "loop: < " << rule.distance_m << " m and < " << rule.angle_deg << " deg, >= " << rule.exclude_s
       << " s older; ignored: younger, or < " << rule.ignore_m << " m";
  return text.str();
}

LoopGroundTruth FromPoses(const GroundTruthArguments& arguments, const std::vector<fs::path>& images,
                          const std::vector<double>& stamps, const DepthImages* depth) {
  Trajectory trajectory = ReadPoses(arguments.file);
  if (arguments.join_pairs && trajectory.size() == 2 * images.size()) {  // the left images' poses
    for (std::size_t i = 0; i < images.size(); ++i) trajectory[i] = trajectory[2 * i];
    trajectory.resize(images.size());
  }
  PosesOfImages poses(trajectory.begin(), trajectory.end());
  if (trajectory.size() != images.size())
    poses = PosesAt(stamps.empty() ? StampsOfImages(images) : stamps, trajectory);
  if (poses.empty()) {
    throw InputError(arguments.file + ": has " + std::to_string(trajectory.size()) +
                     " poses, but there are " + std::to_string(images.size()) + " images, and their " +
                     (stamps.empty() ? "names are no time stamps of it" : "time stamps are not among its") +
                     "; give one pose per image");
  }
  if (depth != nullptr && !HasRotations(trajectory)) {
    throw InputError(
        arguments.file +
        ": has positions alone; what two images see of each other depends on their orientations, "
        "too. Leave --ground-truth-overlap out");
  }
  if (depth != nullptr) return TruthByOverlap(arguments, poses, *depth);
  PosesOfImages strided;
  for (std::size_t i = 0; i < poses.size(); i += static_cast<std::size_t>(arguments.stride))
    strided.push_back(poses[i]);
  LoopGroundTruth truth = TruthOf(strided, arguments.rule);
  truth.description = arguments.file + " (" + RuleText(arguments.rule) +
                      (HasRotations(trajectory) ? ")" : "; positions alone: whatever the angle)");
  const auto unknown = std::count(strided.begin(), strided.end(), std::nullopt);
  if (unknown > 0) truth.description += "; of " + std::to_string(unknown) + " images it says nothing";
  return truth;
}

LoopGroundTruth NoTruth(int images) {
  LoopGroundTruth truth(images);
  for (int row = 0; row < images; ++row) {
    for (int column = 0; column < row; ++column) truth.Set(row, column, LoopLabel::kIgnore);
  }
  return truth;
}

}  // namespace

std::vector<double> StampsOfImages(const std::vector<fs::path>& images) {
  std::vector<double> stamps;
  const internal::StampsOfNames named = StampsInNames(images);
  for (const auto& stamp : named.stamps) stamps.push_back(stamp.first);
  if (stamps.size() == images.size()) return stamps;
  stamps.clear();
  for (const fs::path& image : images) {
    const auto number = ParseDouble(image.stem().string());
    if (!number) return {};
    stamps.push_back(*number);
  }
  return stamps;
}

fs::path ImageFolder(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) return folder;
  const std::optional<fs::path> images = ImagesOfDataset(folder);
  return images && ImagesIn(*images).size() > ImagesIn(folder).size() ? *images : folder;
}

std::vector<fs::path> ListImages(const fs::path& folder, bool pairs, std::vector<std::string>* notes) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    throw InputError(folder.string() + ": no such folder; give the folder that holds the images");
  }
  if (ImagesIn(folder).empty())
    throw InputError(folder.string() + ": holds no image files" +
                     (IsStrayScanner(folder) ? "; give its video, " + (folder / "rgb.mp4").string() : ""));
  return FramesIn(folder, pairs, notes);
}

std::vector<fs::path> ImagesIn(const fs::path& folder) {
  std::error_code error;
  const fs::directory_iterator readable(folder, error);
  if (error) throw InputError(folder.string() + ": can't be read (" + error.message() + ")");
  return tutti::ListImages(folder);
}

LoopGroundTruth LoadGroundTruth(const GroundTruthArguments& arguments, const std::vector<fs::path>& images,
                                const std::vector<double>& stamps, const DepthImages* depth) {
  std::error_code error;
  if (!fs::is_regular_file(arguments.file, error)) {
    throw InputError(arguments.file + ": no such file; --ground-truth takes a loop matrix or a trajectory");
  }
  if (LooksLikeTrajectory(arguments.file)) return FromPoses(arguments, images, stamps, depth);
  if (depth != nullptr) {
    throw InputError(
        arguments.file +
        ": is no trajectory, and --ground-truth-overlap needs a pose for each image; give the file "
        "of poses, or leave --ground-truth-overlap out");
  }
  const int all = static_cast<int>(images.size());
  const int used = (all + arguments.stride - 1) / arguments.stride;
  LoopGroundTruth truth = ReadLoopMatrix(arguments.file, all);
  if (arguments.join_pairs && truth.size() == 2 * all) truth = truth.PairsJoined();
  if (truth.size() == used) return truth;
  if (truth.size() == all) return truth.Strided(arguments.stride);
  std::string images_text = std::to_string(all) + " images";
  if (arguments.stride > 1) {
    images_text += " (" + std::to_string(used) + " with --stride " + std::to_string(arguments.stride) + ")";
  }
  throw InputError(arguments.file + ": the ground truth is " + std::to_string(truth.size()) + " x " +
                   std::to_string(truth.size()) + ", but there are " + images_text +
                   "; give the one that belongs to them");
}

std::vector<fs::path> TakeRightImages(const std::string& folder, std::vector<fs::path>& images) {
  if (images.size() % 2 != 0) {
    throw InputError(
        folder + ": has " + std::to_string(images.size()) +
        " images, but --join-pairs needs pairs of a left and a right one; add the missing image");
  }
  std::vector<fs::path> left, right;
  for (std::size_t i = 0; i < images.size(); i += 2) {
    left.push_back(images[i]);
    right.push_back(images[i + 1]);
  }
  images = std::move(left);
  return right;
}

cv::Mat ReadJoined(const fs::path& left, const fs::path& right, std::vector<cv::Rect>* cameras) {
  const cv::Mat a = ReadImageFile(left, cv::IMREAD_UNCHANGED).image;
  const cv::Mat b = ReadImageFile(right, cv::IMREAD_UNCHANGED).image;
  if (a.empty() || b.empty() || a.type() != b.type()) return {};
  cv::Mat joined = cv::Mat::zeros(std::max(a.rows, b.rows), a.cols + b.cols, a.type());
  const cv::Rect in_left(0, 0, a.cols, a.rows), in_right(a.cols, 0, b.cols, b.rows);
  a.copyTo(joined(in_left));
  b.copyTo(joined(in_right));
  if (cameras != nullptr) *cameras = {in_left, in_right};
  return joined;
}

cv::Mat ImageSet::Read(std::size_t i) const {
  if (!recording) return ReadImageFile(images.at(i), cv::IMREAD_UNCHANGED).image;
  return recording->ReadColour(i * static_cast<std::size_t>(stride)).image;
}

std::pair<cv::Mat, cv::Mat> ImageSet::ReadWithDepth(std::size_t i) const {
  const std::size_t image = i * static_cast<std::size_t>(stride);
  return {depth->Colour(image), depth->Depth(image)};
}

namespace {

// The folder of 'ros2 bag record', and not one of images.
bool IsBagFolder(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error) || !ImagesIn(path).empty()) return false;
  try {
    return DetectDatasetType(path) == DatasetType::kBag;
  } catch (const InputError&) {
    return false;  // nothing is there, which ListImages says
  }
}

// A video or a bag; null: a folder of images.
std::shared_ptr<const Dataset> OpenRecording(const fs::path& path, const std::string& topic,
                                             const std::optional<PinholeCamera>& camera, bool is_bag) {
  std::error_code error;
  if (!topic.empty() && !is_bag) throw InputError(path.string() + ": is no bag of ROS; leave --topic out");
  if (IsCamera(path.string())) DetectDatasetType(path);  // says that it comes once
  if (!is_bag && !fs::is_regular_file(path, error)) return nullptr;
  DatasetOptions options;
  options.topic = topic;
  options.camera = camera;
  try {
    return OpenDataset(path, options);
  } catch (const InputError& e) {
    const std::string text = e.what(), key = "dataset.topic";
    const std::size_t at = text.find(key);
    throw InputError(at == std::string::npos ? text : std::string(text).replace(at, key.size(), "--topic"));
  }
}

}  // namespace

ImageSet LoadImageSet(const std::string& path, const GroundTruthArguments& arguments,
                      const std::string& topic, const std::optional<PinholeCamera>& camera, bool with_depth) {
  ImageSet set;
  set.stride = arguments.stride;
  std::error_code error;
  const bool is_bag =
      fs::is_regular_file(path, error) ? DetectDatasetType(path) == DatasetType::kBag : IsBagFolder(path);
  set.recording = OpenRecording(path, topic, camera, is_bag);
  std::vector<fs::path> images;
  std::vector<double> stamps;
  if (set.recording) {
    for (std::size_t i = 0; i < set.recording->Size(); ++i) {
      images.push_back(fs::path(path) / ("frame " + std::to_string(i)));
      stamps.push_back(set.recording->Stamp(i));
    }
  } else {
    images = ListImages(path, arguments.join_pairs, &set.notes);
    images.erase(std::remove_if(images.begin(), images.end(),
                                [&](const auto& p) { return fs::equivalent(p, arguments.file, error); }),
                 images.end());
  }
  std::vector<fs::path> rights(images.size());
  if (arguments.join_pairs && set.recording)
    throw InputError(path + ": --join-pairs joins images of a folder, not frames of a video or a bag");
  if (arguments.join_pairs) rights = TakeRightImages(path, images);
  for (std::size_t i = 0; i < images.size(); i += static_cast<std::size_t>(arguments.stride)) {
    set.images.push_back(images[i]);
    set.rights.push_back(rights[i]);
  }
  if (arguments.overlap || with_depth)
    set.depth = std::make_shared<DepthImages>(arguments.depth, path, images, stamps);
  set.truth = arguments.file.empty()
                  ? NoTruth(static_cast<int>(set.images.size()))
                  : LoadGroundTruth(arguments, images, stamps, arguments.overlap ? set.depth.get() : nullptr);
  return set;
}

}  // namespace tutti::cli
