#include "core/pose_columns.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>

#include "core/text_reader.h"
#include "core/time_stamps.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::internal {
namespace {

using Words = std::vector<std::string>;

bool IsOneOf(const std::string& word, const Words& words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

// The parts of a column's name in lower case: "p_RS_R_x [m]" -> p, rs, r, x. The unit in brackets goes to
// `unit`.
Words PartsOfName(const std::string& name, std::string& unit) {
  std::string lower = name;
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const std::size_t bracket = lower.find_first_of("[(");
  if (bracket != std::string::npos) {
    unit = lower.substr(bracket + 1, lower.find_first_of("])", bracket) - bracket - 1);
    lower.resize(bracket);
  }
  return SplitText(lower, " \t\r_./:-#%\"'");
}

std::optional<StampUnit> UnitNamed(const std::string& word) {
  if (IsOneOf(word, {"s", "sec", "secs", "second", "seconds"})) return StampUnit::kSeconds;
  if (IsOneOf(word, {"ms", "msec", "millis", "milliseconds"})) return StampUnit::kMilliseconds;
  if (IsOneOf(word, {"us", "usec", "micros", "microseconds"})) return StampUnit::kMicroseconds;
  if (IsOneOf(word, {"ns", "nsec", "nanos", "nanoseconds"})) return StampUnit::kNanoseconds;
  return std::nullopt;
}

// "tx", "pos_x", "q_RS_w", "pose.orientation.y": its axis, 0 to 3 for x to w, and whose it is.
void TakeAxis(Words parts, int place, PoseColumns& out) {
  const std::size_t axis = std::string("xyzw").find(parts.back().back());
  if (axis == std::string::npos) return;
  parts.back().pop_back();
  if (parts.back().empty()) parts.pop_back();
  const auto any = [&](const Words& words) {
    return std::any_of(parts.begin(), parts.end(), [&](const std::string& p) { return IsOneOf(p, words); });
  };
  if (any({"v",     "vel",     "velocity", "b",          "bias",         "bg",    "ba",
           "bw",    "a",       "acc",      "accel",      "acceleration", "gyro",  "omega",
           "twist", "angular", "cov",      "covariance", "std",          "sigma", "error"}))
    return;
  int* column = nullptr;
  if (any({"q", "quat", "quaternion", "orientation", "orient", "rotation", "rot"}))
    column = &out.quaternion.at(axis);
  else if (axis < 3 && (parts.empty() || any({"t", "p", "pos", "position", "trans", "translation", "loc",
                                              "location", "pose"})))
    column = &out.position.at(axis);
  if (column != nullptr && *column == PoseColumns::kNone) *column = place;
}

// The stamp of a message goes before the time at which it was recorded.
struct TimeColumn {
  bool of_message = false;
};

void TakeName(const std::string& name, int place, TimeColumn& time, PoseColumns& out) {
  std::string unit;
  Words parts = PartsOfName(name, unit);
  if (parts.empty()) return;
  const std::optional<StampUnit> last = parts.size() > 1 ? UnitNamed(parts.back()) : std::nullopt;
  if (last && parts.size() > 2) return;  // header.stamp.secs: a part of a stamp
  if (last) parts.pop_back();
  const std::string word = parts.back();
  const bool stamp = IsOneOf(word, {"timestamp", "timestamps", "stamp", "timestep"});
  if (stamp || IsOneOf(word, {"time", "t", "ts", "sec", "seconds", "nsec"})) {
    if (out.stamp != PoseColumns::kNone && (time.of_message || !stamp)) return;
    out.stamp = place;
    time.of_message = stamp;
    out.unit = last ? last : UnitNamed(unit.empty() ? word : unit);
  } else if (IsOneOf(word, {"num", "number", "index", "idx", "id", "frame", "seq", "no", "nr", "i"})) {
    if (out.number == PoseColumns::kNone) out.number = place;
  } else {
    TakeAxis(parts, place, out);
  }
}

Words NamesIn(const std::string& line) {
  if (line.find_first_of(",;\t") != std::string::npos) {
    Words names;
    for (const std::string& name : SplitText(line, ",;\t\r")) {
      if (name.find_first_not_of(" #%") != std::string::npos) names.push_back(name);
    }
    return names;
  }
  Words names;
  for (const std::string& word : SplitText(line, " \r")) {
    const bool unit = word.front() == '[' || word.front() == '(';
    if (unit && !names.empty())
      names.back() += word;  // "x [m]"
    else if (word.find_first_not_of("#%") != std::string::npos)
      names.push_back(word);
  }
  return names;
}

double NumberOr(const Words& words, std::size_t place, double otherwise) {
  return place < words.size() ? ParseDouble(words[place]).value_or(otherwise) : otherwise;
}

bool IsUnitQuaternion(const Words& words, std::size_t first) {
  double squares = 0;
  for (std::size_t i = first; i < first + 4; ++i) squares += std::pow(NumberOr(words, i, 1e3), 2);
  return std::abs(squares - 1) < 1e-2 || squares == 0;
}

// Numbers of lines: each is one more than that before.
bool CountsLines(const Words& first, const Words& second) {
  const double a = NumberOr(first, 0, NAN), b = NumberOr(second, 0, NAN);
  return a == std::floor(a) && b == a + 1;
}

bool EndsWithRowOfTransform(const Words& words) {
  const std::size_t n = words.size();
  return n >= 16 && NumberOr(words, n - 4, NAN) == 0 && NumberOr(words, n - 3, NAN) == 0 &&
         NumberOr(words, n - 2, NAN) == 0 && NumberOr(words, n - 1, NAN) == 1;
}

[[noreturn]] void RefuseColumns(std::size_t have, const std::string& layout) {
  throw InputError("has " + std::to_string(have) + " columns; " + layout);
}

PoseColumns Tum(const Words& first, const Words& second, bool with_sigmas) {
  const std::size_t n = first.size();
  PoseColumns out;
  out.count = n;
  const bool counted = CountsLines(first, second) && (n == 5 || (n == 9 && IsUnitQuaternion(first, 5)));
  if (!counted && n != 4 && n != 8 && !(n == 10 && with_sigmas))
    RefuseColumns(
        n,
        "the TUM format has 8: stamp tx ty tz qx qy qz qw (or 4, without the rotation); a first line "
        "may name other columns");
  const int at = counted ? 1 : 0;
  if (counted) out.number = 0;
  out.stamp = at;
  out.position = {at + 1, at + 2, at + 3};
  if (n > 5) out.quaternion = {at + 4, at + 5, at + 6, at + 7};
  if (n == 10) out.sigmas = 8;
  return out;
}

PoseColumns Kitti(const Words& first) {
  const std::size_t n = first.size();
  if (n != 12 && n != 13 && n != 16 && n != 17)
    RefuseColumns(n,
                  "the KITTI format has 12: the 3x4 matrix [R|t] by rows (or 16: 4x4), and KITTI-360 the "
                  "frame's number before them");
  PoseColumns out;
  out.count = n;
  out.matrix = n == 13 || n == 17 ? 1 : 0;
  if (out.matrix == 1) out.stamp = 0;  // or the frame's number, which the reader sees when it has all
  return out;
}

PoseColumns Euroc(const Words& first) {
  const std::size_t n = first.size();
  if (n != 4 && n < 8)
    RefuseColumns(n,
                  "the EuRoC format has at least 8: stamp [ns], x, y, z, qw, qx, qy, qz (or 4, without the "
                  "rotation)");
  PoseColumns out;
  out.count = n == 4 ? 4 : 8;
  out.more = n != 4;
  out.stamp = 0;
  out.position = {1, 2, 3};
  if (n != 4) out.quaternion = {5, 6, 7, 4};
  return out;
}

}  // namespace

Words PoseWords(const std::string& line) { return SplitText(line, " \t\r,;"); }

std::optional<PoseColumns> ColumnsOfNames(const std::string& line) {
  PoseColumns out;
  TimeColumn time;
  const Words names = NamesIn(line);
  for (std::size_t i = 0; i < names.size(); ++i) TakeName(names[i], static_cast<int>(i), time, out);
  out.count = names.size();
  const auto absent = [](int column) { return column == PoseColumns::kNone; };
  if (absent(out.stamp) && absent(out.number)) return std::nullopt;
  if (std::any_of(out.position.begin(), out.position.end(), absent)) return std::nullopt;
  if (std::any_of(out.quaternion.begin(), out.quaternion.end(), absent))
    out.quaternion.fill(PoseColumns::kNone);
  return out;
}

PoseColumns ColumnsOfNumbers(const Words& first, const Words& second, TrajectoryFormat format,
                             bool with_sigmas) {
  if (format == TrajectoryFormat::kKitti) return Kitti(first);
  return format == TrajectoryFormat::kEuroc ? Euroc(first) : Tum(first, second, with_sigmas);
}

std::string TumLine(const StampedPose& pose, std::optional<std::int64_t> stamp_ns) {
  const Eigen::Vector3d& t = pose.pose.translation;
  const Eigen::Quaterniond& q = pose.pose.rotation;
  char line[1024];
  std::snprintf(line, sizeof line, " %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", t.x(), t.y(), t.z(), q.x(), q.y(),
                q.z(), q.w());
  return (stamp_ns ? StampText(*stamp_ns) : StampText(pose.stamp_s)) + line;
}

TrajectoryFormat FormatOfNumbers(const std::string& line) {
  const Words words = PoseWords(line);
  const std::size_t n = words.size();
  const bool decimal_comma = !DecimalComma(line).empty();
  const bool commas = line.find_first_of(",;") != std::string::npos;
  const bool matrix = n == 12 || n == 13 || EndsWithRowOfTransform(words);
  if (decimal_comma) return TrajectoryFormat::kTum;
  if (!commas) return matrix || n == 16 || n == 17 ? TrajectoryFormat::kKitti : TrajectoryFormat::kTum;
  if (EndsWithRowOfTransform(words)) return TrajectoryFormat::kKitti;
  if (n == 9 && IsUnitQuaternion(words, 5) && !IsUnitQuaternion(words, 4))
    return TrajectoryFormat::kTum;  // behind the line's number
  // EuRoC's stamps are whole nanoseconds. Commas after seconds are TUM's columns.
  const std::optional<double> stamp = ParseDouble(words[0]);
  return stamp && *stamp != std::floor(*stamp) ? TrajectoryFormat::kTum : TrajectoryFormat::kEuroc;
}

}  // namespace tutti::internal
