#include <cmath>
#include <cstdio>
#include <functional>

#include "core/angle.h"
#include "core/replaced_file.h"
#include "core/text_input.h"
#include "core/text_reader.h"
#include "core/tum_line.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

[[noreturn]] void Fail(const std::filesystem::path& file, std::size_t line, const std::string& what) {
  throw InputError(file.string() + ":" + std::to_string(line) + ": " + what);
}

// Calls `use` for each line that carries data; '#' starts a comment.
void ForEachLine(const std::filesystem::path& file,
                 const std::function<void(std::size_t, const std::vector<std::string>&)>& use) {
  internal::TextReader in(file);
  std::string text;
  while (in.Next(text)) {
    const std::size_t line = in.number();
    const std::size_t comment = text.find('#');
    if (comment != std::string::npos) text.resize(comment);
    const std::string comma = internal::DecimalComma(text);
    if (!comma.empty())
      Fail(file, line, "'" + internal::Excerpt(comma) + "' has a decimal comma; write decimal points");
    const std::vector<std::string> words = SplitText(text);
    if (!words.empty()) use(line, words);
  }
}

double NumberOf(const std::filesystem::path& file, std::size_t line, const std::string& word) {
  const std::optional<double> value = ParseDouble(word);
  if (!value) Fail(file, line, "'" + internal::Excerpt(word) + "' is not a number");
  if (!std::isfinite(*value))
    Fail(file, line, "'" + word + "' is not finite; remove this pose or repair the file");
  constexpr double kLargest = 1e100;  // squares of what is beyond it overflow
  if (std::abs(*value) > kLargest)
    Fail(file, line,
         "'" + internal::Excerpt(word) +
             "' is too large to compute with; remove this pose or repair the file");
  return *value;
}

// Things that are put up with where the caller wants to know of them instead of an error.
struct Tolerated {
  std::size_t count = 0, first_line = 0;
  void Note(std::size_t line) {
    if (count++ == 0) first_line = line;
  }
};
struct Oddities {
  bool tolerated = false;
  Tolerated repeats;  // poses that repeat a time stamp, left out
  Tolerated lengths;  // quaternions that are not of length 1, normalised
};

Pose QuaternionPose(const std::filesystem::path& file, std::size_t line, const Eigen::Vector3d& t, double x,
                    double y, double z, double w, Oddities& odd) {
  const Eigen::Quaterniond q(w, x, y, z);
  if (q.norm() < 1e-6) Fail(file, line, "the quaternion is zero; a unit quaternion is needed");
  if (q.norm() > 1e6) Fail(file, line, "the quaternion is far from length 1; a unit quaternion is needed");
  if (std::abs(q.norm() - 1) > 1e-3) odd.lengths.Note(line);
  return Pose(q.normalized(), t);
}

void RequireColumns(const std::filesystem::path& file, std::size_t line, std::size_t have, std::size_t want,
                    const char* layout) {
  if (have < want) {
    Fail(file, line, "has " + std::to_string(have) + " columns; " + layout);
  }
}

// True if the pose is to be left out. Throws if time does not grow.
bool LeaveOut(const std::filesystem::path& file, std::size_t line, const Trajectory& before, double stamp_s,
              Oddities& odd) {
  if (before.empty() || stamp_s > before.back().stamp_s) return false;
  if (stamp_s < before.back().stamp_s)
    Fail(file, line, "goes back in time; sort the file by its first column");
  if (!odd.tolerated) Fail(file, line, "repeats the time stamp of the pose before it; remove one of the two");
  odd.repeats.Note(line);
  return true;
}

// From the words of a line, in metres and degrees.
MotionSigma SigmaOf(const std::filesystem::path& file, std::size_t line, const std::string& translation,
                    const std::string& rotation) {
  const double metres = NumberOf(file, line, translation), degrees = NumberOf(file, line, rotation);
  if (metres < 0 || degrees < 0) Fail(file, line, "a standard deviation is below 0");
  return {metres, degrees * internal::kRadians};
}

Trajectory ReadTum(const std::filesystem::path& file, Oddities& odd, std::vector<MotionSigma>* sigmas) {
  Trajectory out;
  std::size_t columns = 8;
  ForEachLine(file, [&](std::size_t line, const std::vector<std::string>& w) {
    if (sigmas != nullptr && out.empty() && w.size() == 10) columns = 10;
    if (w.size() != columns) {
      Fail(file, line,
           "has " + std::to_string(w.size()) +
               (columns == 8 ? " columns; the TUM format has 8: stamp tx ty tz qx qy qz qw"
                             : " columns; the first line has 10"));
    }
    double v[8];
    for (int i = 0; i < 8; ++i) v[i] = NumberOf(file, line, w[static_cast<std::size_t>(i)]);
    if (LeaveOut(file, line, out, v[0], odd)) return;
    out.push_back({v[0], QuaternionPose(file, line, {v[1], v[2], v[3]}, v[4], v[5], v[6], v[7], odd)});
    if (columns == 10) sigmas->push_back(SigmaOf(file, line, w[8], w[9]));
  });
  return out;
}

Trajectory ReadKitti(const std::filesystem::path& file, std::vector<Eigen::Matrix3d>* rotations) {
  Trajectory out;
  ForEachLine(file, [&](std::size_t line, const std::vector<std::string>& w) {
    if (w.size() != 12) {
      Fail(file, line,
           "has " + std::to_string(w.size()) +
               " columns; the KITTI format has 12: the 3x4 matrix [R|t] by rows");
    }
    Eigen::Matrix<double, 3, 4> m;
    for (int i = 0; i < 12; ++i) m(i / 4, i % 4) = NumberOf(file, line, w[static_cast<std::size_t>(i)]);
    const Eigen::Matrix3d rotation = m.leftCols<3>();
    // Entries too big for a determinant make it NaN.
    if (!(std::abs(rotation.determinant() - 1.0) <= 0.1 && rotation.cwiseAbs().maxCoeff() <= 2))
      Fail(file, line, "its 3x3 part is not a rotation matrix");
    out.push_back({static_cast<double>(out.size()), Pose::FromMatrix(m)});
    if (rotations != nullptr) rotations->push_back(rotation);
  });
  return out;
}

constexpr const char* kNoNanoseconds =
    "' is no time stamp in nanoseconds, which EuRoC's format begins with; seconds and TUM's columns with "
    "commas are --format tum (--from tum)";

Trajectory ReadEuroc(const std::filesystem::path& file, Oddities& odd) {
  Trajectory out;
  ForEachLine(file, [&](std::size_t line, const std::vector<std::string>& w) {
    RequireColumns(file, line, w.size(), 8,
                   "the EuRoC format has at least 8: stamp [ns], x, y, z, qw, qx, qy, qz");
    double v[8];
    for (int i = 0; i < 8; ++i) v[i] = NumberOf(file, line, w[static_cast<std::size_t>(i)]);
    // Seconds, in TUM's order with commas, would be read as nanoseconds and the quaternion in the wrong
    // order.
    if (v[0] != std::floor(v[0])) Fail(file, line, "'" + w[0] + kNoNanoseconds);
    const double stamp = v[0] * 1e-9;
    if (LeaveOut(file, line, out, stamp, odd)) return;
    out.push_back({stamp, QuaternionPose(file, line, {v[1], v[2], v[3]}, v[5], v[6], v[7], v[4], odd)});
  });
  constexpr double kFastest_s = 1e-6;  // nothing measures a million poses a second
  const auto gaps = static_cast<double>(out.size()) - 1;
  if (gaps > 0 && out.back().stamp_s - out.front().stamp_s < kFastest_s * gaps)
    throw InputError(file.string() + ": '" + std::to_string(std::llround(out.back().stamp_s * 1e9)) +
                     kNoNanoseconds);
  return out;
}

}  // namespace

MotionSigma& MotionSigma::operator+=(const MotionSigma& next) {
  const auto both = [](double a, double b) { return std::sqrt(a * a + b * b); };
  translation_m = both(translation_m, next.translation_m);
  rotation_rad = both(rotation_rad, next.rotation_rad);
  return *this;
}

TrajectoryFormat ParseTrajectoryFormat(const std::string& name) {
  if (name == "tum") return TrajectoryFormat::kTum;
  if (name == "kitti") return TrajectoryFormat::kKitti;
  if (name == "euroc") return TrajectoryFormat::kEuroc;
  throw InputError("unknown trajectory format '" + name + "'; use tum, kitti or euroc");
}

TrajectoryFormat GuessTrajectoryFormat(const std::filesystem::path& file) {
  std::error_code code;
  if (std::filesystem::exists(file, code) && !std::filesystem::is_regular_file(file, code))
    throw InputError(file.string() +
                     ": is no file, so that its format can't be guessed; name it, or give a file");
  internal::TextReader in(file);
  std::string text;
  while (in.Next(text)) {
    const std::vector<std::string> words = SplitText(text);
    if (words.empty() || words[0][0] == '#') continue;
    const bool decimal_comma = !internal::DecimalComma(text).empty();
    if (text.find(',') == std::string::npos || decimal_comma)
      return words.size() == 12 && !decimal_comma ? TrajectoryFormat::kKitti : TrajectoryFormat::kTum;
    // EuRoC's stamps are whole nanoseconds. Commas after seconds are TUM's columns.
    const std::optional<double> stamp = ParseDouble(words[0]);
    return stamp && *stamp != std::floor(*stamp) ? TrajectoryFormat::kTum : TrajectoryFormat::kEuroc;
  }
  return TrajectoryFormat::kTum;
}

Trajectory ReadTrajectory(const std::filesystem::path& file, TrajectoryFormat format,
                          std::vector<std::string>* warnings, std::vector<Eigen::Matrix3d>* rotations,
                          std::vector<MotionSigma>* sigmas) {
  Trajectory out;
  Oddities odd;
  odd.tolerated = warnings != nullptr;
  if (rotations != nullptr) rotations->clear();
  if (sigmas != nullptr) sigmas->clear();
  switch (format) {
    case TrajectoryFormat::kTum:
      out = ReadTum(file, odd, sigmas);
      break;
    case TrajectoryFormat::kKitti:
      out = ReadKitti(file, rotations);
      break;
    case TrajectoryFormat::kEuroc:
      out = ReadEuroc(file, odd);
      break;
  }
  if (out.empty()) throw InputError(file.string() + ": holds no pose");
  const auto warn = [&](const Tolerated& what, const char* text) {
    if (warnings == nullptr || what.count == 0) return;
    warnings->push_back(file.string() + ":" + std::to_string(what.first_line) + ": " + text +
                        ", with all such poses: " + std::to_string(what.count));
  };
  warn(odd.repeats, "repeats the time stamp of the pose before it; left out");
  warn(odd.lengths, "the quaternion is not of length 1; normalised");
  return out;
}

std::vector<MotionSigma> ReadMotionSigmas(const std::filesystem::path& file, const Trajectory& trajectory) {
  constexpr double kSameTime_s = 1e-3;
  std::vector<MotionSigma> sigmas;
  ForEachLine(file, [&](std::size_t line, const std::vector<std::string>& w) {
    const std::size_t columns = w.size();
    if (columns != 2 && columns != 3)
      Fail(file, line,
           "has " + std::to_string(columns) +
               " columns; standard deviations have 2, metres and degrees, or a time stamp and these");
    if (sigmas.size() == trajectory.size())
      Fail(file, line, "there are only " + std::to_string(trajectory.size()) + " poses; one line for each");
    const double stamp_s = trajectory[sigmas.size()].stamp_s;
    if (columns == 3 && !(std::abs(NumberOf(file, line, w[0]) - stamp_s) <= kSameTime_s))
      Fail(file, line, "is not of the time of its pose, " + std::to_string(stamp_s) + " s");
    sigmas.push_back(SigmaOf(file, line, w[columns - 2], w[columns - 1]));
  });
  if (sigmas.size() != trajectory.size())
    throw InputError(file.string() + ": has " + std::to_string(sigmas.size()) + " lines for " +
                     std::to_string(trajectory.size()) + " poses; one for each is needed");
  return sigmas;
}

std::vector<double> ReadTimes(const std::filesystem::path& file) {
  std::vector<double> out;
  ForEachLine(file, [&](std::size_t line, const std::vector<std::string>& w) {
    out.push_back(NumberOf(file, line, w[0]));
    if (out.size() > 1 && out.back() < out[out.size() - 2])
      Fail(file, line, "goes back in time; sort the file, or cut it there if it is two recordings");
  });
  return out;
}

void WriteTrajectory(const std::filesystem::path& file, const Trajectory& trajectory,
                     TrajectoryFormat format) {
  std::string text;
  char line[512];
  if (format == TrajectoryFormat::kTum) text = internal::kTumHeader;
  if (format == TrajectoryFormat::kEuroc) text = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w,q_x,q_y,q_z\n";
  for (const StampedPose& s : trajectory) {
    const Eigen::Vector3d& t = s.pose.translation;
    const Eigen::Quaterniond& q = s.pose.rotation;
    switch (format) {
      case TrajectoryFormat::kTum:
        text += internal::TumLine(s);
        continue;
      case TrajectoryFormat::kKitti: {
        const Eigen::Matrix4d m = s.pose.Matrix();
        std::snprintf(line, sizeof line,
                      "%.12e %.12e %.12e %.12e %.12e %.12e %.12e %.12e %.12e %.12e %.12e %.12e\n", m(0, 0),
                      m(0, 1), m(0, 2), m(0, 3), m(1, 0), m(1, 1), m(1, 2), m(1, 3), m(2, 0), m(2, 1),
                      m(2, 2), m(2, 3));
        break;
      }
      case TrajectoryFormat::kEuroc:
        std::snprintf(line, sizeof line, "%lld,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n",
                      std::llround(s.stamp_s * 1e9), t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z());
        break;
    }
    text += line;
  }
  internal::WriteFile(file, text);
}

}  // namespace tutti
