// Reads a file of poses: its columns, its lines, then the unit of its time stamps.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/pose_columns.h"
#include "core/text_reader.h"
#include "core/time_stamps.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::internal {
namespace {

using Words = std::vector<std::string>;

/// A quaternion of 0, for poses that are positions alone.
Eigen::Quaterniond NoRotation() { return Eigen::Quaterniond(0, 0, 0, 0); }

constexpr const char* kNoNanoseconds =
    "' is no time stamp in nanoseconds, which EuRoC's format begins with; seconds and TUM's columns with "
    "commas are --format tum (--from tum)";

std::string NoNumber(const std::string& word) {
  return "'" + Excerpt(word) +
         "' is not a number; a first line that names columns is like: timestamp tx ty tz qx qy qz qw";
}

bool IsUnknown(const Pose& pose) { return pose.rotation.coeffs() == NoRotation().coeffs(); }

// KITTI-360's frames: whole numbers that no clock says.
bool IsNumbering(const std::vector<double>& values, RecognisedUnit unit) {
  constexpr double kMostFrames = 1e8;
  if (unit.unit != StampUnit::kSeconds && unit.certain) return false;
  return std::all_of(values.begin(), values.end(), [](double value) {
    return value == std::floor(value) && value >= 0 && value < kMostFrames;
  });
}

/// One pass over one file.
class PoseReader {
 public:
  /// `tolerant`: repeated stamps are left out. `with_sigmas`: TUM may have columns of them.
  PoseReader(std::filesystem::path file, TrajectoryFormat format, bool tolerant, bool with_sigmas)
      : file_(std::move(file)), format_(format), tolerant_(tolerant), with_sigmas_(with_sigmas) {}

  Trajectory Read(StampUnit expected, TrajectoryDetails& details) {
    ForEachLine(
        file_, [&](std::size_t line, const Words& words) { Take(line, words); },
        [&](const std::string& text) { return TakeNames(text); });
    if (!columns_ && !first_.empty()) Begin({});
    if (rows_.empty()) throw InputError(file_.string() + ": holds no pose");
    CheckRotations();
    FindUnit(expected, details);
    return Finish(details);
  }

  std::vector<std::string> Warnings(const TrajectoryDetails& details, StampUnit expected) const {
    std::vector<std::string> out;
    const auto warn = [&](const Tolerated& what, const std::string& text) {
      if (what.count == 0) return;
      out.push_back(file_.string() + ":" + std::to_string(what.first_line) + ": " + text +
                    ", with all such poses: " + std::to_string(what.count));
    };
    if (details.has_stamps && !columns_->unit && details.unit != expected) {
      const std::string note = UnitNote(file_.string(), details.unit, UsualUnit());
      if (!note.empty()) out.push_back(note);
    }
    warn(repeats_, "repeats the time stamp of the pose before it; left out");
    if (2 * repeats_.count > rows_.size())
      out.back() += " of " + std::to_string(rows_.size()) + "; were the stamps written with too few digits?";
    warn(lengths_, "the quaternion is not of length 1; normalised");
    return out;
  }

 private:
  struct Row {
    std::size_t line = 0;
    std::string stamp;
    double value = 0;  // of the stamp, or the frame's number
    Pose pose;
    Eigen::Matrix3d rotation;
    MotionSigma sigma;
  };
  // Poses that are put up with.
  struct Tolerated {
    std::size_t count = 0, first_line = 0;
    void Note(std::size_t line) {
      if (count++ == 0) first_line = line;
    }
  };

  StampUnit UsualUnit() const {
    return format_ == TrajectoryFormat::kEuroc ? StampUnit::kNanoseconds : StampUnit::kSeconds;
  }

  // Before the first pose; of several lines the last. True if the line is none of numbers.
  bool TakeNames(const std::string& text) {
    const bool is_comment = IsComment(text);
    if (columns_ || !first_.empty()) return is_comment;
    if (!is_comment) {
      const Words words = PoseWords(text);
      if (words.empty() || must_fit_ || ParseDouble(words[0])) return false;
    }
    const std::optional<PoseColumns> named = ColumnsOfNames(text);
    if (named) names_ = named;
    must_fit_ = named && !is_comment;
    return is_comment || named;
  }

  void Take(std::size_t line, const Words& words) {
    if (!columns_ && first_.empty()) {
      first_ = words;
      first_line_ = line;
      if (names_ && names_->count == words.size()) {
        columns_ = names_;
      } else if (must_fit_) {
        FailAt(file_, line,
               "has " + std::to_string(words.size()) + " columns, but the line above names " +
                   std::to_string(names_->count));
      } else {
        return;  // the second line may say more
      }
    }
    if (!columns_) Begin(words);
    Use(line, words);
  }

  void Begin(const Words& second) {
    try {
      columns_ = ColumnsOfNumbers(first_, second, format_, with_sigmas_);
    } catch (const InputError& error) {
      FailAt(file_, first_line_, ParseDouble(first_[0]) ? error.what() : NoNumber(first_[0]));
    }
    Use(first_line_, first_);
  }

  void Use(std::size_t line, const Words& words) {
    const PoseColumns& c = *columns_;
    if (words.size() != c.count && !(c.more && words.size() > c.count))
      FailAt(file_, line,
             "has " + std::to_string(words.size()) + " columns; the first line has " +
                 std::to_string(first_.size()));
    Row row;
    row.line = line;
    row.value = static_cast<double>(rows_.size());
    const int time = c.stamp != PoseColumns::kNone ? c.stamp : c.number;
    if (time != PoseColumns::kNone) {
      row.stamp = words[static_cast<std::size_t>(time)];
      row.value = NumberAt(file_, line, row.stamp);
    }
    if (c.matrix != PoseColumns::kNone)
      TakeMatrix(line, words, row);
    else
      row.pose = PoseOf(line, words);
    if (c.sigmas != PoseColumns::kNone)
      row.sigma = SigmaAt(file_, line, words[static_cast<std::size_t>(c.sigmas)],
                          words[static_cast<std::size_t>(c.sigmas) + 1]);
    rows_.push_back(std::move(row));
  }

  Pose PoseOf(std::size_t line, const Words& words) {
    const auto number = [&](int column) {
      return NumberAt(file_, line, words[static_cast<std::size_t>(column)]);
    };
    const auto& [tx, ty, tz] = columns_->position;
    const Eigen::Vector3d t(number(tx), number(ty), number(tz));
    if (!columns_->HasRotation()) return Pose(NoRotation(), t);
    const auto& [qx, qy, qz, qw] = columns_->quaternion;
    const Eigen::Quaterniond q(number(qw), number(qx), number(qy), number(qz));
    if (q.norm() < 1e-6) return Pose(NoRotation(), t);
    if (q.norm() > 1e6)
      FailAt(file_, line, "the quaternion is far from length 1; a unit quaternion is needed");
    if (std::abs(q.norm() - 1) > 1e-3) lengths_.Note(line);
    return Pose(q.normalized(), t);
  }

  void TakeMatrix(std::size_t line, const Words& words, Row& row) const {
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    const auto first = static_cast<std::size_t>(columns_->matrix);
    for (std::size_t i = first; i < words.size(); ++i) {
      const auto place = static_cast<Eigen::Index>(i - first);
      m(place / 4, place % 4) = NumberAt(file_, line, words[i]);
    }
    row.rotation = m.topLeftCorner<3, 3>();
    // Entries too big for a determinant make it NaN.
    if (!(std::abs(row.rotation.determinant() - 1.0) <= 0.1 && row.rotation.cwiseAbs().maxCoeff() <= 2))
      FailAt(file_, line, "its 3x3 part is not a rotation matrix");
    if (m.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
      FailAt(file_, line, "the last row of its 4x4 matrix is not 0 0 0 1");
    row.pose = Pose::FromMatrix(m.topRows<3>());
  }

  // A quaternion of 0 stands for no rotation, if it does so in all lines.
  void CheckRotations() const {
    if (!columns_->HasRotation()) return;
    const auto unknown = [](const Row& row) { return IsUnknown(row.pose); };
    const auto first = std::find_if(rows_.begin(), rows_.end(), unknown);
    if (first == rows_.end() ||
        (rows_.size() > 1 && std::all_of(first, rows_.end(), unknown) && first == rows_.begin()))
      return;
    FailAt(file_, first->line, "the quaternion is zero; a unit quaternion is needed");
  }

  void FindUnit(StampUnit expected, TrajectoryDetails& details) const {
    details.has_stamps = columns_->stamp != PoseColumns::kNone;
    details.has_numbers = !details.has_stamps && columns_->number != PoseColumns::kNone;
    if (!details.has_stamps) return;
    std::vector<double> values;
    values.reserve(rows_.size());
    for (const Row& row : rows_) values.push_back(row.value);
    const bool euroc = format_ == TrajectoryFormat::kEuroc;
    if (euroc) expected = StampUnit::kNanoseconds;
    RecognisedUnit unit = UnitOfStamps(values, columns_->unit.value_or(expected));
    if (columns_->unit && !unit.certain) unit = {*columns_->unit};
    if (columns_->matrix != PoseColumns::kNone && IsNumbering(values, UnitOfStamps(values))) {
      details.has_stamps = false;
      details.has_numbers = true;
      return;
    }
    details.unit = unit.unit;
    details.unit_is_certain = unit.certain;
    // TUM's columns with commas would be read with the quaternion in the wrong order.
    if (euroc && columns_->more && unit.unit == StampUnit::kSeconds)
      FailAt(file_, rows_.front().line, "'" + rows_.front().stamp + kNoNanoseconds);
  }

  Trajectory Finish(TrajectoryDetails& details) {
    Trajectory out;
    bool fits = details.has_stamps;
    const double seconds = details.has_stamps ? SecondsOf(details.unit) : 1;
    for (const Row& row : rows_) {
      const double stamp_s = row.value * seconds;
      if (LeaveOut(row.line, out, stamp_s)) continue;
      out.push_back({stamp_s, row.pose});
      if (columns_->matrix != PoseColumns::kNone) details.rotations_as_written.push_back(row.rotation);
      if (columns_->sigmas != PoseColumns::kNone) details.sigmas.push_back(row.sigma);
      const std::optional<std::int64_t> exact = fits ? NanosecondsOf(row.stamp, details.unit) : std::nullopt;
      fits = exact.has_value();
      if (fits) details.stamps_ns.push_back(*exact);
    }
    if (!fits) details.stamps_ns.clear();
    return out;
  }

  // True if the pose is to be left out. Throws if time does not grow.
  bool LeaveOut(std::size_t line, const Trajectory& before, double stamp_s) {
    if (before.empty() || stamp_s > before.back().stamp_s) return false;
    if (stamp_s < before.back().stamp_s)
      FailAt(file_, line, "goes back in time; sort the file by its first column");
    if (!tolerant_)
      FailAt(file_, line, "repeats the time stamp of the pose before it; remove one of the two");
    repeats_.Note(line);
    return true;
  }

  const std::filesystem::path file_;
  const TrajectoryFormat format_;
  const bool tolerant_, with_sigmas_;
  Tolerated repeats_;  // of a time stamp, left out
  Tolerated lengths_;  // of quaternions, not 1, normalised
  std::optional<PoseColumns> names_, columns_;
  bool must_fit_ = false;           // names_ are from a line that is no comment
  std::vector<std::string> first_;  // line of numbers
  std::size_t first_line_ = 0;
  std::vector<Row> rows_;
};

}  // namespace
}  // namespace tutti::internal

namespace tutti {

bool HasRotations(const Trajectory& trajectory) {
  return trajectory.empty() || trajectory.front().pose.rotation.coeffs() != internal::NoRotation().coeffs();
}

Trajectory ReadTrajectory(const std::filesystem::path& file, TrajectoryFormat format,
                          std::vector<std::string>* warnings, TrajectoryDetails* details,
                          StampUnit expected) {
  internal::PoseReader reader(file, format, warnings != nullptr, details != nullptr);
  TrajectoryDetails found;
  Trajectory out = reader.Read(expected, found);
  if (warnings != nullptr) {
    for (std::string& warning : reader.Warnings(found, expected)) warnings->push_back(std::move(warning));
  }
  if (details != nullptr) *details = std::move(found);
  return out;
}

}  // namespace tutti
