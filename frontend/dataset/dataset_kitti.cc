// KITTI odometry: image_0 (and image_1), times.txt, calib.txt, poses.txt.
#include <cmath>

#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// "P0:" -> 3x4 projection matrices of calib.txt.
using Projections = std::map<std::string, Eigen::Matrix<double, 3, 4>>;

Projections ReadCalibration(const fs::path& file) {
  Projections projections;
  for (const TextLine& line : ReadTextLines(file)) {
    if (line.words[0].size() < 2 || line.words[0][0] != 'P') continue;  // Tr: the laser scanner's
    if (line.words.size() != 13)
      throw InputError(At(file, line.number) + "has " + std::to_string(line.words.size() - 1) +
                       " numbers after '" + line.words[0] + "'; a 3x4 matrix has 12");
    Eigen::Matrix<double, 3, 4>& p = projections[line.words[0]];
    for (int i = 0; i < 12; ++i) p(i / 4, i % 4) = NumberAt(file, line, static_cast<std::size_t>(i) + 1);
    if (!(p(0, 0) > 0 && p(1, 1) > 0))
      throw InputError(At(file, line.number) + "the focal lengths must be positive");
  }
  return projections;
}

void FindCalibration(const fs::path& folder, const std::string& left, const std::string& right,
                     const DatasetOptions& options, RigCalibration& rig) {
  const fs::path file = folder / "calib.txt";
  std::error_code code;
  const bool have_file = fs::exists(file, code);
  Projections projections;
  if (have_file) projections = ReadCalibration(file);
  const bool has_left = projections.count(left) != 0;
  rig.left = options.camera;
  rig.baseline_m = options.baseline_m;
  if (!rig.left) {
    if (!have_file)
      throw InputError(file.string() +
                       ": is missing, and the configuration has no camera; copy the sequence's calib.txt "
                       "there, or set fx, fy, cx, cy under 'camera:'");
    if (!has_left) throw InputError(file.string() + ": has no line '" + left + "'");
    const auto& p = projections[left];
    rig.left = Pinhole(p(0, 0), p(1, 1), p(0, 2), p(1, 2));
  }
  if (!has_left) return;
  rig.T_body_left.translation = PositionOfCamera(projections[left]);
  if (rig.baseline_m == 0 && projections.count(right) != 0)
    rig.baseline_m = PositionOfCamera(projections[right]).x() - PositionOfCamera(projections[left]).x();
}

using NumberedFiles = std::map<std::int64_t, ShortPath>;

// Frame number -> image. KITTI's names ("000123.png") are the frame numbers; other names count from 0 in
// natural order.
NumberedFiles NumberedImages(const fs::path& folder, const std::string& advice) {
  NumberedFiles numbered, counted;
  bool all_numbers = true;
  for (const fs::path& file : ListImages(folder)) {
    counted.emplace(static_cast<std::int64_t>(counted.size()), file);
    const std::optional<long long> number = ParseInteger(file.stem().string());
    all_numbers = all_numbers && number && *number >= 0 && numbered.emplace(*number, file).second;
  }
  if (counted.empty()) throw InputError(folder.string() + ": holds no images; " + advice);
  // Numbers far beyond the count are not frame numbers but, say, time stamps.
  const bool frames =
      all_numbers && numbered.rbegin()->first <= 100 * std::int64_t(numbered.size()) + 1000000;
  return frames ? numbered : counted;
}

// What the image of that number would be called.
std::string NameLike(const NumberedFiles& images, std::int64_t number) {
  const fs::path like = images.begin()->second;
  std::string digits = std::to_string(number);
  const std::size_t width = like.stem().string().size();
  if (digits.size() < width) digits.insert(0, width - digits.size(), '0');
  return digits + like.extension().string();
}

// A line for each number; no lines: there is no such file.
struct Times {
  fs::path file;
  std::vector<TextLine> lines;
  std::vector<double> stamps;
};

Times ReadTimes(const fs::path& folder, const fs::path& images, std::int64_t count,
                const DatasetOptions& options, FolderContents& out) {
  Times times{folder / "times.txt", {}, {}};
  std::error_code code;
  if (!fs::exists(times.file, code)) {
    out.warnings.push_back(times.file.string() + ": is missing; " +
                           (options.rate_hz > 0 ? "rate_hz is used" : "10 Hz is assumed"));
    return times;
  }
  times.lines = ReadTextLines(times.file);
  times.stamps = StampsAt(times.file, times.lines, out.stamp_unit, out.warnings);
  if (static_cast<std::int64_t>(times.lines.size()) < count)
    throw InputError(times.file.string() + ": has " + std::to_string(times.lines.size()) +
                     " time stamps, but " + images.string() + " has images up to number " +
                     std::to_string(count - 1) + "; one line for each image is needed");
  return times;
}

void FindTruth(const fs::path& folder, FolderContents& out) {
  // The public archive has sequences/00 beside poses/00.txt.
  const fs::path whole = fs::absolute(folder).lexically_normal();
  const fs::path name = whole.has_filename() ? whole : whole.parent_path();
  out.truth_places = {folder / "poses.txt", folder / "groundtruth.txt",
                      name.parent_path().parent_path() / "poses" / (name.filename().string() + ".txt")};
}

}  // namespace

Eigen::Vector3d PositionOfCamera(const Eigen::Matrix<double, 3, 4>& p) {
  return -(p.leftCols<3>().inverse() * p.col(3));
}

FolderContents FindKitti(const fs::path& folder, const DatasetOptions& options) {
  if (options.sensor == Sensor::kRgbd)
    throw InputError(folder.string() +
                     ": the KITTI layout has no depth images; set sensor to mono or stereo");
  FolderContents out;
  out.folder = folder;
  std::error_code code;
  const bool grey = fs::is_directory(folder / "image_0", code), stereo = options.sensor == Sensor::kStereo;
  const fs::path left_folder = folder / (grey ? "image_0" : "image_2");
  const fs::path right_folder = folder / (grey ? "image_1" : "image_3");
  FindCalibration(folder, grey ? "P0:" : "P2:", grey ? "P1:" : "P3:", options, out.rig);
  const NumberedFiles images = NumberedImages(left_folder, "put the sequence's images there");
  NumberedFiles right_images;
  if (stereo)
    right_images = NumberedImages(right_folder, "stereo needs the right camera's, or set sensor to mono");
  const std::int64_t first = images.begin()->first, count = images.rbegin()->first + 1;
  const Times times = ReadTimes(folder, left_folder, count, options, out);
  const bool timed = !times.lines.empty();
  out.rate_hz = options.rate_hz > 0 ? options.rate_hz : 10.0;
  out.pose_count = timed ? times.lines.size() : static_cast<std::size_t>(count);
  // A few gaps in the numbers are missing frames, which Read() reports; many are somebody's selection.
  const bool selection = 2 * static_cast<std::int64_t>(images.size()) < count - first;
  if (selection)
    out.warnings.push_back(left_folder.string() + ": holds a selection of " + std::to_string(images.size()) +
                           " images with numbers up to " + std::to_string(count - 1));
  StampOrder order(times.file, out.warnings);
  std::size_t alone = 0, pairs = 0;
  for (std::int64_t n = first; n < count; ++n) {
    const auto image = images.find(n);
    const auto right = right_images.find(n);
    const bool has_image = image != images.end(), has_right = right != right_images.end();
    if (selection && !has_image) continue;
    const auto line = static_cast<std::size_t>(n);
    FrameFiles frame;
    frame.stamp_s = timed ? times.stamps[line] : static_cast<double>(n) / out.rate_hz;
    if (timed && !order.Accept(times.lines[line].number, frame.stamp_s)) continue;
    frame.image = has_image ? image->second : ShortPath(left_folder / NameLike(images, n));
    if (has_right) frame.right = right->second;
    if (has_image) ++(has_right ? pairs : alone);
    out.pose_stamps.emplace_back(n, frame.stamp_s);
    out.frames.push_back(std::move(frame));
  }
  out.skipped = order.skipped();
  if (stereo)
    out.ReportAlone(right_folder, pairs == 0 ? out.frames.size() : alone,
                    "no image has the number of an image of " + left_folder.string(),
                    "left images have no right image and are tracked without", options);
  if (timed) out.MeasureRate();
  FindTruth(folder, out);
  return out;
}

}  // namespace tutti
