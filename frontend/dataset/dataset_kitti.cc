// KITTI odometry: image_0 (and image_1), times.txt, calib.txt, poses.txt.
#include <cmath>
#include <map>

#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

// "P0:" -> 3x4 projection matrices of calib.txt.
using Projections = std::map<std::string, Eigen::Matrix<double, 3, 4>>;

Projections ReadCalibration(const std::filesystem::path& file) {
  Projections projections;
  for (const TextLine& line : ReadTextLines(file)) {
    if (line.words[0].size() < 2 || line.words[0][0] != 'P') continue;  // Tr: the laser scanner's
    if (line.words.size() != 13) {
      throw InputError(At(file, line.number) + "has " + std::to_string(line.words.size() - 1) +
                       " numbers after '" + line.words[0] + "'; a 3x4 matrix has 12");
    }
    Eigen::Matrix<double, 3, 4>& p = projections[line.words[0]];
    for (std::size_t i = 0; i < 12; ++i) {
      p(static_cast<int>(i) / 4, static_cast<int>(i) % 4) = NumberAt(file, line, i + 1);
    }
    if (!(p(0, 0) > 0 && p(1, 1) > 0)) {
      throw InputError(At(file, line.number) + "the focal lengths must be positive");
    }
  }
  return projections;
}

void FindCalibration(const std::filesystem::path& folder, const std::string& left, const std::string& right,
                     const DatasetOptions& options, FolderContents& out) {
  std::filesystem::path file = folder / "calib.txt";
  std::error_code code;
  const bool have_file = std::filesystem::exists(file, code);
  Projections projections;
  if (have_file) projections = ReadCalibration(file);
  out.left = options.camera;
  out.baseline_m = options.baseline_m;
  if (!out.left) {
    if (!have_file) {
      throw InputError(file.string() +
                       ": is missing, and the configuration has no camera; copy the sequence's calib.txt "
                       "there, or set fx, fy, cx, cy under 'camera:'");
    }
    if (projections.count(left) == 0) throw InputError(file.string() + ": has no line '" + left + "'");
    const auto& p = projections[left];
    out.left.emplace();
    out.left->fx = p(0, 0);
    out.left->fy = p(1, 1);
    out.left->cx = p(0, 2);
    out.left->cy = p(1, 2);
  }
  if (projections.count(left) != 0) out.T_body_left.translation = PositionOfCamera(projections[left]);
  if (out.baseline_m == 0 && projections.count(left) != 0 && projections.count(right) != 0) {
    out.baseline_m = PositionOfCamera(projections[right]).x() - PositionOfCamera(projections[left]).x();
  }
}

// Number in a file's name ("000123.png" -> 123), or nothing.
std::optional<std::int64_t> NumberOf(const std::filesystem::path& file) {
  const std::optional<long long> number = ParseInteger(file.stem().string());
  if (!number || *number < 0) return std::nullopt;
  return *number;
}

// Frame number -> image. KITTI's names are the frame numbers; other names count from 0 in natural order.
std::map<std::int64_t, ShortPath> NumberedImages(const std::filesystem::path& folder) {
  std::map<std::int64_t, ShortPath> numbered, counted;
  bool all_numbers = true;
  for (const std::filesystem::path& file : ListImages(folder)) {
    counted.emplace(static_cast<std::int64_t>(counted.size()), file);
    const std::optional<std::int64_t> number = NumberOf(file);
    all_numbers = all_numbers && number && numbered.emplace(*number, file).second;
  }
  // Numbers far beyond the count are not frame numbers but, say, time stamps.
  if (!all_numbers || numbered.empty() ||
      numbered.rbegin()->first > 100 * std::int64_t(numbered.size()) + 1000000) {
    return counted;
  }
  return numbered;
}

// What the image of that number would be called.
std::string NameLike(const std::map<std::int64_t, ShortPath>& images, std::int64_t number) {
  const std::filesystem::path like = images.begin()->second;
  std::string digits = std::to_string(number);
  const std::size_t width = like.stem().string().size();
  if (digits.size() < width) digits.insert(0, width - digits.size(), '0');
  return digits + like.extension().string();
}

void FindTruth(const std::filesystem::path& folder, FolderContents& out) {
  out.truth_places.push_back(folder / "poses.txt");
  out.truth_places.push_back(folder / "groundtruth.txt");
  // The public archive: sequences/00 beside poses/00.txt.
  const std::filesystem::path whole = std::filesystem::absolute(folder).lexically_normal();
  const std::filesystem::path name = whole.has_filename() ? whole : whole.parent_path();
  out.truth_places.push_back(name.parent_path().parent_path() / "poses" /
                             (name.filename().string() + ".txt"));
}

}  // namespace

Eigen::Vector3d PositionOfCamera(const Eigen::Matrix<double, 3, 4>& p) {
  return -(p.leftCols<3>().inverse() * p.col(3));
}

FolderContents FindKitti(const std::filesystem::path& folder, const DatasetOptions& options) {
  if (options.sensor == Sensor::kRgbd) {
    throw InputError(folder.string() +
                     ": the KITTI layout has no depth images; set sensor to mono or stereo");
  }
  FolderContents out;
  out.folder = folder;
  std::error_code code;
  const bool grey = std::filesystem::is_directory(folder / "image_0", code);
  const std::filesystem::path left_folder = folder / (grey ? "image_0" : "image_2");
  const std::filesystem::path right_folder = folder / (grey ? "image_1" : "image_3");
  FindCalibration(folder, grey ? "P0:" : "P2:", grey ? "P1:" : "P3:", options, out);

  const auto images = NumberedImages(left_folder);
  if (images.empty())
    throw InputError(left_folder.string() + ": holds no images; put the sequence's images there");
  std::map<std::int64_t, ShortPath> right_images;
  if (options.sensor == Sensor::kStereo) {
    right_images = NumberedImages(right_folder);
    if (right_images.empty()) {
      throw InputError(right_folder.string() +
                       ": holds no images; stereo needs the right camera's, or set sensor to mono");
    }
  }
  const std::int64_t count = images.rbegin()->first + 1;
  const std::filesystem::path times_file = folder / "times.txt";
  const bool have_times = std::filesystem::exists(times_file, code);
  std::vector<TextLine> times;
  std::vector<double> stamps;
  if (have_times) {
    times = ReadTextLines(times_file);
    stamps = StampsAt(times_file, times, out.stamp_unit, out.warnings);
    if (static_cast<std::int64_t>(times.size()) < count) {
      throw InputError(times_file.string() + ": has " + std::to_string(times.size()) + " time stamps, but " +
                       left_folder.string() + " has images up to number " + std::to_string(count - 1) +
                       "; one line for each image is needed");
    }
  } else {
    out.warnings.push_back(times_file.string() + ": is missing; " +
                           (options.rate_hz > 0 ? "rate_hz is used" : "10 Hz is assumed"));
  }
  const double rate_hz = options.rate_hz > 0 ? options.rate_hz : 10.0;
  // A few gaps in the numbers are missing frames, which Read() reports; many are somebody's selection.
  const bool selection = 2 * static_cast<std::int64_t>(images.size()) < count - images.begin()->first;
  if (selection) {
    out.warnings.push_back(left_folder.string() + ": holds a selection of " + std::to_string(images.size()) +
                           " images with numbers up to " + std::to_string(count - 1));
  }
  StampOrder order(times_file, out.warnings);
  std::size_t alone = 0, pairs = 0;
  for (std::int64_t n = images.begin()->first; n < count; ++n) {
    if (selection && images.count(n) == 0) continue;
    FrameFiles frame;
    frame.stamp_s = static_cast<double>(n) / rate_hz;
    if (have_times) {
      const auto line = static_cast<std::size_t>(n);
      frame.stamp_s = stamps[line];
      if (!order.Accept(times[line].number, frame.stamp_s)) continue;
    }
    const auto image = images.find(n);
    const auto right = right_images.find(n);
    frame.image = image != images.end() ? image->second : ShortPath(left_folder / NameLike(images, n));
    if (right != right_images.end()) frame.right = right->second;
    if (image != images.end()) ++(right != right_images.end() ? pairs : alone);
    out.pose_stamps.emplace_back(n, frame.stamp_s);
    out.frames.push_back(std::move(frame));
  }
  out.skipped = order.skipped();
  if (options.sensor == Sensor::kStereo) {
    if (pairs == 0) {
      throw InputError(right_folder.string() + ": no image has the number of an image of " +
                       left_folder.string());
    }
    WarnOfFramesWithoutDepth(right_folder, alone, "left images have no right image and are tracked without",
                             options, &out);
  }
  out.pose_count = have_times ? times.size() : static_cast<std::size_t>(count);
  out.rate_hz = rate_hz;
  if (have_times && out.frames.size() > 1) {
    out.rate_hz =
        static_cast<double>(out.frames.size() - 1) / (out.frames.back().stamp_s - out.frames.front().stamp_s);
  }
  FindTruth(folder, out);
  return out;
}

}  // namespace tutti
