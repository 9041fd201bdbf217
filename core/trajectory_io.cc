#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>

#include "core/pose_columns.h"
#include "core/replaced_file.h"
#include "core/text_reader.h"
#include "core/time_stamps.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

using internal::FailAt;
using internal::NumberAt;
using Words = std::vector<std::string>;

// Before the file is there.
void RequireRoom(const std::filesystem::path& file, const Trajectory& trajectory, TrajectoryFormat format,
                 const std::vector<std::int64_t>& stamps_ns) {
  if (!stamps_ns.empty() && stamps_ns.size() != trajectory.size())
    throw InputError(file.string() + ": there are " + std::to_string(stamps_ns.size()) + " time stamps for " +
                     std::to_string(trajectory.size()) + " poses");
  if (format == TrajectoryFormat::kKitti && !HasRotations(trajectory))
    throw InputError(file.string() +
                     ": can't be written: the poses are positions alone, and KITTI's format needs rotations; "
                     "write tum or euroc");
  constexpr double kMost_s = 9.2e9;  // of 64 bits
  for (const StampedPose& pose : trajectory) {
    if (format != TrajectoryFormat::kEuroc || !stamps_ns.empty() || std::abs(pose.stamp_s) < kMost_s)
      continue;
    char stamp[32];
    std::snprintf(stamp, sizeof stamp, "%g", pose.stamp_s);
    throw InputError(file.string() + ": can't be written: the time stamp " + stamp +
                     " s does not fit into EuRoC's nanoseconds, of which there are 9.2e18; write tum");
  }
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
  std::optional<internal::PoseColumns> names;
  while (in.Next(text)) {
    const Words words = internal::PoseWords(text);
    if (words.empty()) continue;
    const bool is_number = ParseDouble(words[0]).has_value();
    if (internal::IsComment(text) || (!is_number && !names)) {
      if (std::optional<internal::PoseColumns> named = internal::ColumnsOfNames(text)) names = named;
      if (internal::IsComment(text) || names) continue;
    }
    if (names && names->count == words.size() && names->HasRotation())
      return names->ScalarFirst() ? TrajectoryFormat::kEuroc : TrajectoryFormat::kTum;
    return internal::FormatOfNumbers(text);
  }
  return TrajectoryFormat::kTum;
}

std::vector<MotionSigma> ReadMotionSigmas(const std::filesystem::path& file, const Trajectory& trajectory) {
  constexpr double kSameTime_s = 1e-3;
  std::vector<MotionSigma> sigmas;
  std::vector<std::pair<std::size_t, double>> stamps;  // with their lines
  internal::ForEachLine(file, [&](std::size_t line, const Words& w) {
    const std::size_t columns = w.size();
    if (columns != 2 && columns != 3)
      FailAt(file, line,
             "has " + std::to_string(columns) +
                 " columns; standard deviations have 2, metres and degrees, or a time stamp and these");
    if (sigmas.size() == trajectory.size())
      FailAt(file, line, "there are only " + std::to_string(trajectory.size()) + " poses; one line for each");
    if (columns == 3) stamps.emplace_back(line, NumberAt(file, line, w[0]));
    if (columns == 3 ? stamps.size() != sigmas.size() + 1 : !stamps.empty())
      FailAt(file, line, "has another number of columns than the lines before");
    sigmas.push_back(internal::SigmaAt(file, line, w[columns - 2], w[columns - 1]));
  });
  if (sigmas.size() != trajectory.size())
    throw InputError(file.string() + ": has " + std::to_string(sigmas.size()) + " lines for " +
                     std::to_string(trajectory.size()) + " poses; one for each is needed");
  std::vector<double> values;
  for (const auto& stamp : stamps) values.push_back(stamp.second);
  const double seconds = internal::SecondsOf(internal::UnitOfStamps(values).unit);
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    const double pose_s = trajectory[i].stamp_s;
    if (!(std::abs(seconds * stamps[i].second - pose_s) <= kSameTime_s))
      FailAt(file, stamps[i].first, "is not of the time of its pose, " + std::to_string(pose_s) + " s");
  }
  return sigmas;
}

std::vector<double> ReadTimes(const std::filesystem::path& file, std::vector<std::string>* warnings) {
  std::vector<double> out;
  bool first = true;
  internal::ForEachLine(file, [&](std::size_t line, const Words& w) {
    const bool names_columns = std::exchange(first, false) && w.size() > 1 && !ParseDouble(w[0]);
    if (names_columns) return;
    out.push_back(NumberAt(file, line, w[0]));
    if (out.size() > 1 && out.back() < out[out.size() - 2])
      FailAt(file, line, "goes back in time; sort the file, or cut it there if it is two recordings");
  });
  const StampUnit unit = internal::UnitOfStamps(out).unit;
  for (double& stamp : out) stamp *= internal::SecondsOf(unit);
  const std::string note = internal::UnitNote(file.string(), unit, StampUnit::kSeconds);
  if (warnings != nullptr && !note.empty()) warnings->push_back(note);
  return out;
}

void WriteTrajectory(const std::filesystem::path& file, const Trajectory& trajectory, TrajectoryFormat format,
                     const std::vector<std::int64_t>& stamps_ns) {
  RequireRoom(file, trajectory, format, stamps_ns);
  std::string text;
  char line[1024];
  if (format == TrajectoryFormat::kTum) text = internal::kTumHeader;
  if (format == TrajectoryFormat::kEuroc) text = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w,q_x,q_y,q_z\n";
  for (std::size_t k = 0; k < trajectory.size(); ++k) {
    const StampedPose& s = trajectory[k];
    const Eigen::Vector3d& t = s.pose.translation;
    const Eigen::Quaterniond& q = s.pose.rotation;
    switch (format) {
      case TrajectoryFormat::kTum:
        text += stamps_ns.empty() ? internal::TumLine(s) : internal::TumLine(s, stamps_ns[k]);
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
        std::snprintf(
            line, sizeof line, "%lld,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n",
            static_cast<long long>(stamps_ns.empty() ? std::llround(s.stamp_s * 1e9) : stamps_ns[k]), t.x(),
            t.y(), t.z(), q.w(), q.x(), q.y(), q.z());
        break;
    }
    text += line;
  }
  internal::WriteFile(file, text);
}

}  // namespace tutti
