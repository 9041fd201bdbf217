#include "frontend/dataset/dataset_folder.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/text_reader.h"
#include "core/time_stamps.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// From a left-handed frame with y up into the right-handed one with y down: S R S with S = diag(1, -1, 1)
// turns the same angle about the mirrored axis, the other way round.
void MirrorY(Trajectory& trajectory) {
  for (StampedPose& p : trajectory) {
    p.pose.translation.y() *= -1;
    const Eigen::Quaterniond q = p.pose.rotation;
    p.pose.rotation = Eigen::Quaterniond(q.w(), -q.x(), q.y(), -q.z());
  }
}

}  // namespace

std::string At(const fs::path& file, std::size_t line) {
  return file.string() + ":" + std::to_string(line) + ": ";
}

std::vector<TextLine> ReadTextLines(const fs::path& file) {
  internal::TextReader in(file);
  std::vector<TextLine> lines;
  std::string text;
  while (in.Next(text)) {
    const std::size_t comment = text.find('#');
    if (comment != std::string::npos) text.resize(comment);
    std::vector<std::string> words = SplitText(text);
    if (!words.empty()) lines.push_back({in.number(), std::move(words), text});
  }
  return lines;
}

std::vector<TextLine> ReadListLines(const fs::path& file) {
  std::vector<TextLine> lines = ReadTextLines(file);
  const auto is_number = [&](std::size_t i) { return ParseDouble(lines[i].words.front()).has_value(); };
  if (lines.size() > 1 && !is_number(0) && is_number(1)) lines.erase(lines.begin());
  return lines;
}

double NumberAt(const fs::path& file, const TextLine& line, std::size_t word) {
  if (word >= line.words.size())
    throw InputError(At(file, line.number) + "has " + std::to_string(line.words.size()) +
                     " columns; at least " + std::to_string(word + 1) + " are needed");
  const std::optional<double> value = ParseDouble(line.words[word]);
  const std::string comma = internal::DecimalComma(line.text);
  if (comma.rfind(line.words[word] + ",", 0) == 0)
    throw InputError(At(file, line.number) + "'" + internal::Excerpt(comma) +
                     "' has a decimal comma; write decimal points");
  if (!value || !std::isfinite(*value))
    throw InputError(At(file, line.number) + "'" + internal::Excerpt(line.words[word]) +
                     "' is not a finite number; repair or remove the line");
  return *value;
}

std::vector<double> StampsAt(const fs::path& file, const std::vector<TextLine>& lines, StampUnit& unit,
                             std::vector<std::string>& warnings, std::size_t word) {
  std::vector<double> stamps;
  stamps.reserve(lines.size());
  for (const TextLine& line : lines) stamps.push_back(NumberAt(file, line, word));
  const StampUnit found = internal::UnitOfStamps(stamps, unit).unit;
  const std::string note = internal::UnitNote(file.string(), found, unit);
  if (!note.empty()) warnings.push_back(note);
  unit = found;
  for (double& stamp : stamps) stamp *= internal::SecondsOf(unit);
  return stamps;
}

Trajectory StampedByFrame(const fs::path& file, const Trajectory& poses, const TrajectoryDetails& details,
                          std::size_t count, const std::vector<std::pair<std::int64_t, double>>& frames) {
  if (!details.has_numbers && poses.size() != count)
    throw InputError(file.string() + ": has " + std::to_string(poses.size()) +
                     " poses, but the sequence has " + std::to_string(count) +
                     " frames; KITTI poses need one line for each frame");
  Trajectory out;
  auto pose = poses.begin();
  for (const auto& [number, stamp_s] : frames) {
    while (pose != poses.end() && pose->stamp_s < static_cast<double>(number)) ++pose;
    if (pose == poses.end()) break;
    if (pose->stamp_s == static_cast<double>(number)) out.push_back({stamp_s, pose->pose});
  }
  if (out.empty())
    throw InputError(file.string() + ": has no pose with the number of a frame; it numbers " +
                     std::to_string(std::llround(poses.front().stamp_s)) + " to " +
                     std::to_string(std::llround(poses.back().stamp_s)));
  return out;
}

bool StampOrder::Accept(std::size_t line, double stamp_s) {
  if (last_ && stamp_s < *last_)
    throw InputError(At(file_, line) + "time stamp " + std::to_string(stamp_s) +
                     " s goes back in time (the one before is " + std::to_string(*last_) +
                     " s); sort the file by time, or cut it there if it is two recordings");
  if (last_ && stamp_s == *last_) {
    constexpr std::size_t kMostLines = 5;
    if (++skipped_ <= kMostLines + 1) warnings_.emplace_back();
    warnings_.back() = skipped_ <= kMostLines
                           ? At(file_, line) + "repeats the time stamp before it; the frame is skipped"
                           : file_.string() + ": " + std::to_string(skipped_ - kMostLines) +
                                 " more lines repeat the time stamp before them";
    return false;
  }
  last_ = stamp_s;
  return true;
}

void FolderContents::MeasureRate() {
  if (frames.size() > 1)
    rate_hz = static_cast<double>(frames.size() - 1) / (frames.back().stamp_s - frames.front().stamp_s);
}

void FolderContents::ReportAlone(const fs::path& list, std::size_t alone, const std::string& none,
                                 const std::string& some, const DatasetOptions& options) {
  if (alone == frames.size()) throw InputError(list.string() + ": " + none);
  if (alone == 0 || options.follow_s > 0) return;
  warnings.push_back(list.string() + ": " + PartText(alone, frames.size()) + " " + some);
}

FolderDataset::FolderDataset(FolderContents contents, const DatasetOptions& options)
    : contents_(std::move(contents)), options_(options) {
  if (contents_.frames.empty())
    throw InputError(contents_.folder.string() +
                     ": holds no frame; check the folder and the options of the data set");
  if (contents_.pose_stamps.empty()) {
    contents_.pose_count = Size();
    for (std::size_t i = 0; i < Size(); ++i) contents_.pose_stamps.emplace_back(i, Stamp(i));
  }
  FindImageSize();
  rig_ = RectifyRig(contents_.folder.string(), contents_.rig, options_, size_, contents_.rate_hz);
  SetUpDepth();
  SetUpMasks();
}

void FolderDataset::FindImageSize() {
  // A folder without any good image among its first ones is not worth a run.
  constexpr std::size_t kTries = 50;
  std::string first_error;
  for (std::size_t i = 0; i < std::min(kTries, Size()); ++i) {
    const ImageFile file = ReadGreyFile(contents_.frames[i].image);
    if (file.error.empty()) {
      size_ = file.image.size();
      if (file.image.depth() == CV_16U) FindRange(i, file.image);
      return;
    }
    if (first_error.empty()) first_error = file.error;
  }
  throw InputError(first_error + "; none of the first " + std::to_string(std::min(kTries, Size())) +
                   " images can be read");
}

// Looks at `first`, the first good image, whose place is `place`, and at some later ones.
void FolderDataset::FindRange(std::size_t place, const cv::Mat& first) {
  constexpr std::size_t kLooked = 8;
  std::vector<cv::Mat> images = {first};
  for (std::size_t k = 1; k < kLooked && options_.follow_s <= 0; ++k) {
    const std::size_t i = place + k * (Size() - place) / kLooked;
    const ImageFile file = i == place ? ImageFile() : ReadGreyFile(contents_.frames[i].image);
    if (file.image.size() == size_ && file.image.depth() == CV_16U) images.push_back(file.image);
  }
  range_ = RangeOf(images);
  if (range_.bits > 8)
    contents_.warnings.push_back(contents_.frames[place].image.string() + ": " + RangeText(range_));
}

void FolderDataset::SetUpDepth() {
  if (options_.sensor != Sensor::kRgbd) return;
  depth_.emplace(options_, contents_.depth, contents_.rig.left, size_);
  if (options_.follow_s > 0) return;
  for (const FrameFiles& frame : contents_.frames) {
    if (frame.depth.empty()) continue;
    for (std::string& note : depth_->Notes(frame.depth)) contents_.warnings.push_back(std::move(note));
    return;
  }
}

void FolderDataset::SetUpMasks() {
  if (options_.mask.empty()) return;
  ImageMasks masks(options_.mask);
  if (!masks.PerImage()) {
    mask_ = Rectified(rig_.left, masks.OfAll(size_), Sampling::kNearest);
    return;
  }
  masks_ = std::move(masks);
  std::size_t without = 0, with = 0;
  for (const FrameFiles& frame : contents_.frames) {
    const std::string stem = frame.image.stem().string();
    if (!masks_->Has(stem)) {
      ++without;
    } else if (with++ == 0) {
      masks_->Of(stem, size_);  // what is wrong with all is known before the long work
    }
  }
  if (options_.follow_s > 0 || without == 0) return;
  const std::string of_all = " of " + std::to_string(contents_.frames.size()) + " images";
  if (with == 0)
    throw InputError(options_.mask + ": holds no mask for any" + of_all + " of " + contents_.folder.string() +
                     "; a mask has the name of its image (" + contents_.frames.front().image.stem().string() +
                     ".png)");
  contents_.warnings.push_back(options_.mask + ": " + std::to_string(without) + of_all +
                               " have no mask; all of them is used");
}

cv::Mat FolderDataset::MaskOf(const fs::path& image) const {
  if (!masks_) return mask_;
  const cv::Mat mask = masks_->Of(image.stem().string(), size_);
  return mask.empty() ? mask : Rectified(rig_.left, mask, Sampling::kNearest);
}

// What is wrong with the image that was read from `file`; else `out` gets it, 8 bit and rectified.
std::string FolderDataset::Rectify(const ImageFile& read, const fs::path& file,
                                   const std::optional<Rectifier>& rectifier, cv::Mat& out) const {
  if (!read.error.empty()) return read.error;
  if (read.image.size() != size_)
    return file.string() + ": has " + SizeText(read.image.size()) +
           " pixels, but the data set's images have " + SizeText(size_);
  out = Rectified(rectifier, To8Bit(read.image, range_));
  return {};
}

ReadResult FolderDataset::Read(std::size_t i) const {
  if (i >= Size()) return {std::nullopt, NoFrame(i), {}};
  return ReadFiles(i, contents_.frames[i]);
}

ColourImage FolderDataset::ReadColour(std::size_t i) const {
  if (i >= Size()) return {cv::Mat(), NoFrame(i)};
  return ReadColourOf(contents_.frames[i]);
}

std::string FolderDataset::NoFrame(std::size_t i) const {
  return contents_.folder.string() + ": has no frame " + std::to_string(i) + " (it has " +
         std::to_string(Size()) + ")";
}

ColourImage FolderDataset::ReadColourOf(const FrameFiles& files) const {
  ColourImage out;
  try {
    out.error = Rectify(ReadColourFile(files.image), files.image, rig_.left, out.image);
  } catch (const std::exception& e) {
    out = {cv::Mat(), files.image.string() + ": can't be used: " + e.what()};
  }
  return out;
}

ReadResult FolderDataset::ReadFiles(std::size_t i, const FrameFiles& files) const {
  ReadResult result;
  try {
    InputFrame frame;
    frame.index = Number(i);
    frame.stamp_s = files.stamp_s;
    frame.clock_s = files.clock_s;
    frame.depth_later_s = files.depth_later_s;
    result.error = Rectify(ReadGreyFile(files.image), files.image, rig_.left, frame.image);
    if (!result.error.empty()) return result;
    frame.mask = MaskOf(files.image);
    if (!files.right.empty())
      result.depth_error = Rectify(ReadGreyFile(files.right), files.right, rig_.right, frame.right);
    if (!files.depth.empty()) result.depth_error = depth_->Read(files.depth, rig_.left, frame.depth_m);
    result.frame = std::move(frame);
  } catch (const std::exception& e) {  // out of memory for an absurd image size, and the like
    result.frame.reset();
    result.error = files.image.string() + ": can't be used: " + e.what();
  }
  return result;
}

std::optional<fs::path> FolderDataset::GroundTruthFile() const {
  std::error_code code;
  if (contents_.truth && HoldsTruth(*contents_.truth)) return contents_.truth->place;
  for (const fs::path& file : contents_.truth_places) {
    if (fs::is_regular_file(file, code)) return file;
    // A folder, or a link that leads nowhere: the run is not to end without its figures and without a word.
    if (fs::exists(fs::symlink_status(file, code)))
      throw InputError(file.string() +
                       ": should be the ground truth, but is no readable file; repair or remove it, or give "
                       "--ground-truth FILE or none");
  }
  return std::nullopt;
}

Trajectory FolderDataset::ReadGroundTruth(const fs::path& file, std::vector<std::string>* warnings) const {
  std::error_code code;
  if (contents_.truth && fs::equivalent(file, contents_.truth->place, code))
    return ReadLayoutTruth(*contents_.truth, warnings);
  TrajectoryDetails details;
  Trajectory poses =
      ReadTrajectory(file, GuessTrajectoryFormat(file), warnings, &details, contents_.stamp_unit);
  const double scale = contents_.stamp_scale;
  internal::FitUnit({Stamp(0) / scale, Stamp(Size() - 1) / scale}, poses, details, warnings);
  if (details.has_stamps) {
    for (StampedPose& p : poses) p.stamp_s *= scale;
  } else {
    poses = StampedByFrame(file, poses, details, contents_.pose_count, contents_.pose_stamps);
  }
  if (options_.mirrored_ground_truth) MirrorY(poses);
  return poses;
}

}  // namespace tutti
