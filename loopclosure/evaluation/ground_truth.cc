#include "tutti/loopclosure/ground_truth.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "core/numbers.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

constexpr int kMaxImages = 30000;  // 900 million pairs; more is surely a damaged file

LoopLabel LabelOf(double value) {
  if (value == 0.0) return LoopLabel::kNone;
  return value == 1.0 || value >= 250.0 ? LoopLabel::kLoop : LoopLabel::kIgnore;
}

LoopGroundTruth ReadImage(const std::filesystem::path& file) {
  const cv::Mat image = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
  if (image.empty()) {
    throw InputError(file.string() +
                     ": not an image or a text that can be read; give a loop matrix or a trajectory");
  }
  if (image.rows != image.cols) {
    throw InputError(file.string() + ": a loop matrix must be square, this one is " +
                     std::to_string(image.rows) + " x " + std::to_string(image.cols));
  }
  std::vector<double> values;
  values.reserve(image.total());
  for (int r = 0; r < image.rows; ++r) {
    for (int c = 0; c < image.cols; ++c) {
      const int grey = image.at<std::uint8_t>(r, c);
      // An image may hold 0 and 1; compression may have touched black and white.
      values.push_back(grey == 1 ? 1.0 : grey < 6 ? 0.0 : grey);
    }
  }
  return LoopsFromMatrix(values, image.rows);
}

bool LooksLikeText(const std::string& head) {
  return std::all_of(head.begin(), head.end(), [](char ch) {
    const unsigned char u = static_cast<unsigned char>(ch);
    return u == '\n' || u == '\r' || u == '\t' || (u >= 32 && u < 127);
  });
}

std::vector<double> ParseRow(const std::string& line, const std::string& where) {
  std::vector<double> row;
  for (const std::string& word : SplitText(line, " \t\r,;")) {
    const auto value = ParseDouble(word);
    if (!value || !std::isfinite(*value) || *value < 0) {
      throw InputError(where + ": '" + word.substr(0, 40) + "' is not a label; use 0, 1 or 255");
    }
    row.push_back(*value);
  }
  return row;
}

LoopGroundTruth ReadText(const std::filesystem::path& file, int num_images) {
  internal::TextReader in(file);
  std::vector<std::vector<double>> rows;
  std::string line;
  while (in.Next(line)) {
    if (line.empty() || line[0] == '#') continue;
    const std::string where = file.string() + ":" + std::to_string(in.number());
    std::vector<double> row = ParseRow(line, where);
    if (row.empty()) continue;
    if (!rows.empty() && row.size() != rows.front().size()) {
      throw InputError(where + ": " + std::to_string(row.size()) + " numbers, but the lines before have " +
                       std::to_string(rows.front().size()));
    }
    rows.push_back(std::move(row));
    if (rows.size() > internal::Index(kMaxImages) * 100)
      throw InputError(where + ": too many lines for a loop matrix");
  }
  if (rows.empty()) throw InputError(file.string() + ": holds no labels");
  const std::size_t columns = rows.front().size();
  if (columns == 2 && rows.size() != 2) {
    LoopGroundTruth truth(num_images);
    for (const std::vector<double>& pair : rows) {
      if (pair[0] >= num_images || pair[1] >= num_images || pair[0] != std::floor(pair[0]) ||
          pair[1] != std::floor(pair[1])) {
        std::ostringstream numbers;  // they may be too big for any integer
        numbers << pair[0] << " " << pair[1];
        throw InputError(file.string() + ": the pair " + numbers.str() + " is none of " +
                         std::to_string(num_images) + " images");
      }
      truth.Set(static_cast<int>(std::max(pair[0], pair[1])), static_cast<int>(std::min(pair[0], pair[1])),
                LoopLabel::kLoop);
    }
    return truth;
  }
  if (columns != rows.size()) {
    throw InputError(file.string() + ": a loop matrix must be square, this one is " +
                     std::to_string(rows.size()) + " x " + std::to_string(columns));
  }
  std::vector<double> values;
  for (const std::vector<double>& row : rows) values.insert(values.end(), row.begin(), row.end());
  return LoopsFromMatrix(values, static_cast<int>(columns));
}

}  // namespace

LoopGroundTruth::LoopGroundTruth(int size)
    : size_(size), labels_(internal::Index(size) * internal::Index(size), LoopLabel::kNone) {}

LoopLabel LoopGroundTruth::At(int row, int column) const {
  if (row < 0 || row >= size_ || column < 0 || column >= row) return LoopLabel::kNone;
  return labels_[internal::Index(row) * internal::Index(size_) + internal::Index(column)];
}

void LoopGroundTruth::Set(int row, int column, LoopLabel label) {
  if (row < 0 || row >= size_ || column < 0 || column >= row) return;
  labels_[internal::Index(row) * internal::Index(size_) + internal::Index(column)] = label;
}

bool LoopGroundTruth::HasLoop(int row) const {
  for (int c = 0; c < row; ++c) {
    if (At(row, c) == LoopLabel::kLoop) return true;
  }
  return false;
}

int LoopGroundTruth::RowsWithLoop() const {
  int rows = 0;
  for (int r = 0; r < size_; ++r) rows += HasLoop(r) ? 1 : 0;
  return rows;
}

LoopGroundTruth LoopGroundTruth::Strided(int stride) const {
  LoopGroundTruth result((size_ + stride - 1) / stride);
  result.description = description;
  for (int r = 0; r < result.size_; ++r) {
    for (int c = 0; c < r; ++c) result.Set(r, c, At(r * stride, c * stride));
  }
  return result;
}

LoopGroundTruth LoopGroundTruth::First(int size) const {
  LoopGroundTruth result(std::clamp(size, 0, size_));
  result.description = description;
  result.least_overlap = least_overlap;
  result.best_views = best_views;
  if (!best_views.empty()) result.best_views.resize(internal::Index(result.size_));
  for (int r = 0; r < result.size_; ++r) {
    for (int c = 0; c < r; ++c) result.Set(r, c, At(r, c));
  }
  return result;
}

LoopGroundTruth LoopGroundTruth::PairsJoined() const {
  LoopGroundTruth result(size_ / 2);
  result.description = description.empty() ? "" : description + " (of single images; joined in pairs)";
  for (int r = 0; r < result.size_; ++r) {
    for (int c = 0; c < r; ++c) {
      // The labels' values grow from none over ignore to loop.
      result.Set(
          r, c,
          std::max({At(2 * r, 2 * c), At(2 * r, 2 * c + 1), At(2 * r + 1, 2 * c), At(2 * r + 1, 2 * c + 1)}));
    }
  }
  return result;
}

std::string LoopRule::Validate() const {
  if (!(distance_m > 0)) return "the distance of a loop must be above 0 m";
  if (!(angle_deg > 0 && angle_deg <= 180)) return "the angle of a loop must be above 0 and at most 180 deg";
  if (!(ignore_m >= distance_m)) return "the ignore distance must be at least the distance of a loop";
  if (!(exclude_s >= 0)) return "the exclusion time must be 0 s or more";
  return {};
}

LoopGroundTruth LoopsFromMatrix(const std::vector<double>& values, int size) {
  if (size < 0 || values.size() != internal::Index(size) * internal::Index(size)) {
    throw InputError("a loop matrix of " + std::to_string(size) + " images can't have " +
                     std::to_string(values.size()) + " labels");
  }
  bool lower_used = false;
  bool upper_used = false;
  const auto at = [&](int r, int c) {
    return values[internal::Index(r) * internal::Index(size) + internal::Index(c)];
  };
  for (int r = 0; r < size; ++r) {
    for (int c = 0; c < size; ++c) {
      if (r == c || at(r, c) == 0.0) continue;
      (c < r ? lower_used : upper_used) = true;
    }
  }
  // Some authors give the upper triangle: row = past image.
  const bool transpose = upper_used && !lower_used;
  LoopGroundTruth truth(size);
  for (int r = 0; r < size; ++r) {
    for (int c = 0; c < r; ++c) truth.Set(r, c, LabelOf(transpose ? at(c, r) : at(r, c)));
  }
  return truth;
}

LoopGroundTruth ReadLoopMatrix(const std::filesystem::path& file, int num_images) {
  const std::string advice = "check the path of the ground truth";
  internal::RequireFile(file, advice);
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(file.string() + ": can't be opened; " + advice);
  std::string head(512, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, in.gcount())));
  if (head.empty()) throw InputError(file.string() + ": is empty");
  in.close();
  if (head.rfind("MATLAB", 0) == 0) {
    throw InputError(file.string() +
                     ": a file of MATLAB; save its matrix as text, which is two lines of Python "
                     "(data/README.md)");
  }

  LoopGroundTruth truth = LooksLikeText(head) ? ReadText(file, num_images) : ReadImage(file);
  truth.description = file.string();
  return truth;
}

LoopGroundTruth LoopsFromTrajectory(const Trajectory& trajectory, const LoopRule& rule) {
  const std::string problem = rule.Validate();
  if (!problem.empty()) throw InputError("ground truth from a trajectory: " + problem);
  LoopGroundTruth truth(static_cast<int>(trajectory.size()));
  const bool rotations = HasRotations(trajectory);
  for (int r = 0; r < truth.size(); ++r) {
    const StampedPose& current = trajectory[internal::Index(r)];
    for (int c = 0; c < r; ++c) {
      const StampedPose& past = trajectory[internal::Index(c)];
      const double distance = (current.pose.translation - past.pose.translation).norm();
      if (current.stamp_s - past.stamp_s < rule.exclude_s - 1e-6) {
        truth.Set(r, c, LoopLabel::kIgnore);
      } else if (distance < rule.ignore_m) {
        const double angle =
            rotations ? (past.pose.Inverse() * current.pose).Angle() * internal::kDegrees : 0;
        const bool loop = distance < rule.distance_m && angle < rule.angle_deg;
        truth.Set(r, c, loop ? LoopLabel::kLoop : LoopLabel::kIgnore);
      }
    }
  }
  return truth;
}

}  // namespace tutti
