// Calibrations, time stamps and ground truth as the layouts of layout.h have them.
#include <cmath>
#include <cstdio>
#include <map>

#include "core/numbers.h"
#include "core/time_stamps.h"
#include "frontend/dataset/dataset_folder.h"
#include "frontend/dataset/layout.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

struct NumberLine {
  std::size_t number = 0;
  std::vector<double> values;  // not finite ones, too
};

double AnyNumber(const fs::path& file, const TextLine& line, const std::string& word) {
  const std::optional<double> value = ParseDouble(word);
  if (!value) throw InputError(At(file, line.number) + "'" + word + "' is not a number");
  return *value;
}

// All lines of numbers; one header of words may stand before them.
std::vector<NumberLine> NumberLines(const fs::path& file) {
  std::vector<NumberLine> lines;
  bool first = true;
  for (const TextLine& line : ReadTextLines(file)) {
    if (std::exchange(first, false) && !ParseDouble(line.words.front())) continue;
    lines.push_back({line.number, {}});
    for (const std::string& word : line.words) lines.back().values.push_back(AnyNumber(file, line, word));
  }
  return lines;
}

// The numbers of a file that is one matrix.
std::vector<double> Numbers(const fs::path& file) {
  std::vector<double> all;
  for (const NumberLine& line : NumberLines(file)) {
    all.insert(all.end(), line.values.begin(), line.values.end());
    if (all.size() > 16) throw InputError(At(file, line.number) + "has more numbers than a 4x4 matrix");
  }
  return all;
}

// 3x4 or 4x4 by rows; nothing where it is not finite, as where a camera was lost.
std::optional<Pose> PoseOf(const std::string& place, const double* values, std::size_t count) {
  Eigen::Matrix<double, 3, 4> m;
  for (int i = 0; i < 12; ++i) m(i / 4, i % 4) = values[i];
  if (!m.allFinite()) return std::nullopt;
  const bool last_row = count == 12 || (values[12] == 0 && values[13] == 0 && values[14] == 0);
  // Entries too big for a determinant make it NaN.
  if (!last_row || !(std::abs(m.leftCols<3>().determinant() - 1) <= 0.1) ||
      m.leftCols<3>().cwiseAbs().maxCoeff() > 2)
    throw InputError(place + "is not a pose: a rotation with the translation [m] behind it is needed");
  return Pose::FromMatrix(m);
}

std::optional<Pose> PoseOfQuaternion(const std::string& place, const double* v) {
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  const Eigen::Vector3d t(v[0], v[1], v[2]);
  if (!q.coeffs().allFinite() || !t.allFinite()) return std::nullopt;
  if (!(std::abs(q.norm() - 1) <= 0.1)) throw InputError(place + "the quaternion is not of length 1");
  return Pose(q.normalized(), t);
}

using Poses = std::vector<std::optional<Pose>>;

Poses ReadLines(const fs::path& file) {
  Poses poses;
  for (const NumberLine& line : NumberLines(file)) {
    const std::size_t count = line.values.size();
    const std::string place = At(file, line.number);
    if (count == 7)
      poses.push_back(PoseOfQuaternion(place, line.values.data()));
    else if (count == 12 || count == 16)
      poses.push_back(PoseOf(place, line.values.data(), count));
    else
      throw InputError(place + "has " + std::to_string(count) +
                       " columns; a pose has 12 or 16 (a matrix by rows), or 7 (tx ty tz qx qy qz qw)");
  }
  return poses;
}

// Redwood and Open3D: "i j n", then four rows.
Poses ReadLog(const fs::path& file) {
  Poses poses;
  std::vector<double> matrix(16);  // a whole one: a head follows
  for (const NumberLine& line : NumberLines(file)) {
    if (line.values.size() != (matrix.size() == 16 ? 3 : 4))
      throw InputError(At(file, line.number) +
                       "three numbers and the four rows of a matrix were expected in turns");
    if (line.values.size() == 3) {
      matrix.clear();
      continue;
    }
    matrix.insert(matrix.end(), line.values.begin(), line.values.end());
    if (matrix.size() == 16) poses.push_back(PoseOf(At(file, line.number), matrix.data(), 16));
  }
  return poses;
}

using StampOfKey = std::map<std::string, double>;

StampOfKey StampsByKey(const LayoutTruth& truth) {
  StampOfKey stamps;
  for (const auto& [key, stamp] : truth.stamps) {
    if (std::isfinite(stamp)) stamps.emplace(key, stamp);
  }
  return stamps;
}

Trajectory ReadPoseFiles(const LayoutTruth& truth) {
  const StampOfKey stamps = StampsByKey(truth);
  std::map<double, Pose> found;
  for (const RoleImage& file : ImagesOf(truth.place, truth.role, ".txt")) {
    const auto stamp = stamps.find(file.key);
    if (stamp == stamps.end()) continue;
    const std::vector<double> values = Numbers(file.file);
    if (values.size() != 12 && values.size() != 16)
      throw InputError(file.file.string() + ": has " + std::to_string(values.size()) +
                       " numbers; the matrix of a pose has 16");
    const auto pose = PoseOf(file.file.string() + ": ", values.data(), values.size());
    if (pose) found.emplace(stamp->second, *pose);
  }
  Trajectory out;
  for (const auto& [stamp, pose] : found) out.push_back({stamp, pose});
  return out;
}

// KITTI's development kit, convertOxtsToPose.m: Mercator at the latitude of the first pose; x is east, y
// north, z up, from the first pose on. The IMU's x is forward, y left, z up.
Trajectory ReadOxts(const LayoutTruth& truth) {
  constexpr double kEarthRadius = 6378137;
  const fs::path stamps_file = truth.place.parent_path() / "timestamps.txt";
  std::error_code ignored;
  std::vector<std::pair<std::size_t, double>> own;
  if (fs::is_regular_file(stamps_file, ignored)) own = ReadLayoutStamps(stamps_file);
  const StampOfKey stamps = StampsByKey(truth);
  Trajectory out;
  double scale = 0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (const RoleImage& file : ImagesOf(truth.place, {"", ""}, ".txt")) {
    const auto stamp = stamps.find(file.key);
    const std::optional<long long> number = ParseInteger(file.key);
    const bool listed = number && *number >= 0 && static_cast<std::size_t>(*number) < own.size();
    if (!listed && stamp == stamps.end()) continue;
    const std::vector<NumberLine> lines = NumberLines(file.file);
    if (lines.empty() || lines.front().values.size() < 6)
      throw InputError(file.file.string() +
                       ": latitude, longitude, altitude, roll, pitch and yaw are needed");
    const double* v = lines.front().values.data();
    if (!Eigen::Map<const Vector6d>(v).allFinite() || std::abs(v[0]) >= 89.9)
      throw InputError(file.file.string() + ": is no place on earth that can be computed with");
    if (out.empty()) scale = std::cos(v[0] * internal::kRadians);
    const Eigen::Vector3d position(
        scale * kEarthRadius * v[1] * internal::kRadians,
        scale * kEarthRadius * std::log(std::tan((90 + v[0]) * 0.5 * internal::kRadians)), v[2]);
    if (out.empty()) origin = position;
    const Eigen::Quaterniond rotation = Eigen::AngleAxisd(v[5], Eigen::Vector3d::UnitZ()) *
                                        Eigen::AngleAxisd(v[4], Eigen::Vector3d::UnitY()) *
                                        Eigen::AngleAxisd(v[3], Eigen::Vector3d::UnitX());
    const double time = listed ? own[static_cast<std::size_t>(*number)].second : stamp->second;
    if (!out.empty() && time <= out.back().stamp_s)
      throw InputError(file.file.string() + ": its time does not follow that of the file before it (" +
                       stamps_file.string() + ")");
    out.push_back({time, Pose(rotation, position - origin)});
  }
  return out;
}

// Stray Scanner's documentation, format.md, and its viewer: camera to world, x right, y down, z forward.
Trajectory ReadOdometry(const LayoutTruth& truth, std::vector<std::string>* warnings) {
  Trajectory out;
  std::size_t repeated = 0;
  for (const NumberLine& line : NumberLines(truth.place)) {
    const std::string place = At(truth.place, line.number);
    if (line.values.size() < 9)
      throw InputError(place + "has " + std::to_string(line.values.size()) +
                       " columns; 9 are needed: timestamp, frame, x, y, z, qx, qy, qz, qw");
    const double stamp = line.values[0];
    if (!std::isfinite(stamp)) throw InputError(place + "the time stamp is not finite");
    if (!out.empty() && stamp < out.back().stamp_s) throw InputError(place + "goes back in time");
    if (!out.empty() && stamp == out.back().stamp_s) {
      ++repeated;
      continue;
    }
    if (const auto pose = PoseOfQuaternion(place, line.values.data() + 2)) out.push_back({stamp, *pose});
  }
  if (repeated > 0 && warnings != nullptr)
    warnings->push_back(truth.place.string() + ": " + std::to_string(repeated) +
                        " poses repeat the time stamp before them; left out");
  return out;
}

// Calibrated for about this size: the principal point is near the middle.
bool Fits(const PinholeCamera& camera, cv::Size size) {
  return std::abs(2 * camera.cx / size.width - 1) < 0.2 && std::abs(2 * camera.cy / size.height - 1) < 0.2;
}

}  // namespace

PinholeCamera ReadIntrinsics(const fs::path& file) {
  const std::vector<double> v = Numbers(file);
  const std::size_t row = v.size() == 9 ? 3 : 4;
  if (v.size() != 4 && v.size() != 9 && v.size() != 12 && v.size() != 16)
    throw InputError(file.string() + ": has " + std::to_string(v.size()) +
                     " numbers; intrinsics are 4 (fx fy cx cy) or a matrix of 3x3, 3x4 or 4x4");
  const PinholeCamera camera =
      v.size() == 4 ? Pinhole(v[0], v[1], v[2], v[3]) : Pinhole(v[0], v[row + 1], v[2], v[row + 2]);
  if (!(camera.fx > 0 && camera.fy > 0) || !std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy))
    throw InputError(file.string() + ": the focal lengths must be positive");
  return camera;
}

LayoutCalibration ReadLayoutCalibration(const fs::path& folder, const FoundLayout& found, cv::Size size) {
  const Layout& layout = *found.layout;
  if (layout.truth.form == TruthForm::kOxts) return ReadKittiRawCalibration(folder, found, size);
  LayoutCalibration out;
  std::error_code ignored;
  if (layout.forward_right_down) {  // NED: forward, right, down of a camera are z, x, y
    Eigen::Matrix3d R;
    R << 0, 0, 1, 1, 0, 0, 0, 1, 0;
    out.rig.T_body_left = Pose(Eigen::Quaterniond(R), Eigen::Vector3d::Zero());
  }
  const fs::path intrinsics = folder / layout.intrinsics, of_depth = folder / layout.depth_intrinsics;
  if (*layout.depth_intrinsics != '\0' && fs::is_regular_file(of_depth, ignored))
    out.depth = ReadIntrinsics(of_depth);
  if (*layout.intrinsics != '\0' && fs::is_regular_file(intrinsics, ignored)) {
    out.rig.left = ReadIntrinsics(intrinsics);
    out.source = layout.intrinsics;
    // Colour images that were made as small as the depth images.
    if (!Fits(*out.rig.left, size) && out.depth && Fits(*out.depth, size)) {
      out.rig.left = out.depth;
      out.source = layout.depth_intrinsics;
    }
  } else if (layout.published.width == size.width && layout.published.height == size.height) {
    out.rig.left = layout.published;
    out.source = "the one published for " + std::string(layout.name);
  }
  if (out.rig.left) out.rig.baseline_m = layout.baseline_m;
  return out;
}

std::vector<std::pair<std::size_t, double>> ReadLayoutStamps(const fs::path& file) {
  std::vector<std::pair<std::size_t, double>> stamps;
  std::vector<double> numbers;
  for (const TextLine& line : ReadTextLines(file)) {
    int year = 0, month = 0, day = 0, hour = 0, minute = 0, end = 0;
    std::sscanf(line.text.c_str(), " %4d-%2d-%2d %2d:%2d:%n", &year, &month, &day, &hour, &minute, &end);
    if (end == 0) {
      numbers.push_back(NumberAt(file, line, 0));
      stamps.emplace_back(line.number, numbers.back());
      continue;
    }
    const std::vector<std::string> rest = SplitText(line.text.substr(static_cast<std::size_t>(end)));
    const double second = rest.empty() ? -1 : ParseDouble(rest.front()).value_or(-1);
    if (month < 1 || month > 12 || day < 1 || day > 31 || !(second >= 0 && second < 61))
      throw InputError(At(file, line.number) + "'" + line.text + "' is no date with a time");
    // Days since 1970 of the Gregorian calendar, years from March on.
    const int y = year - (month <= 2 ? 1 : 0), since_march = (month + 9) % 12;
    const long long days =
        365LL * y + y / 4 - y / 100 + y / 400 + (153 * since_march + 2) / 5 + day - 1 - 719468;
    stamps.emplace_back(line.number,
                        86400.0 * static_cast<double>(days) + 3600.0 * hour + 60.0 * minute + second);
  }
  if (numbers.size() < stamps.size()) return stamps;  // dates
  const double seconds = internal::SecondsOf(internal::UnitOfStamps(numbers).unit);
  for (auto& stamp : stamps) stamp.second *= seconds;
  return stamps;
}

bool HoldsTruth(const LayoutTruth& truth) {
  std::error_code ignored;
  if (truth.form == TruthForm::kFiles) return !ImagesOf(truth.place, truth.role, ".txt").empty();
  if (truth.form == TruthForm::kOxts) return fs::is_directory(truth.place, ignored);
  return fs::is_regular_file(truth.place, ignored);
}

Trajectory ReadLayoutTruth(const LayoutTruth& truth, std::vector<std::string>* warnings) {
  Trajectory out;
  Poses lines;
  if (truth.form == TruthForm::kFiles) out = ReadPoseFiles(truth);
  if (truth.form == TruthForm::kOxts) out = ReadOxts(truth);
  if (truth.form == TruthForm::kOdometry) out = ReadOdometry(truth, warnings);
  if (truth.form == TruthForm::kLines) lines = ReadLines(truth.place);
  if (truth.form == TruthForm::kLog) lines = ReadLog(truth.place);
  if (!lines.empty() && lines.size() != truth.stamps.size())
    throw InputError(truth.place.string() + ": has " + std::to_string(lines.size()) +
                     " poses, but there are " + std::to_string(truth.stamps.size()) +
                     " images; one for each is needed");
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i] && std::isfinite(truth.stamps[i].second)) out.push_back({truth.stamps[i].second, *lines[i]});
  }
  if (out.empty()) throw InputError(truth.place.string() + ": holds no pose of an image");
  return out;
}

}  // namespace tutti
