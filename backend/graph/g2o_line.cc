#include "backend/graph/g2o_line.h"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include "core/text_reader.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::internal {

PoseForm FormOf(GraphKind kind) {
  return kind == GraphKind::kSE2   ? PoseForm::kPlanar
         : kind == GraphKind::kSE3 ? PoseForm::kQuaternion
                                   : PoseForm::kSimilarity;
}

std::size_t NumbersOf(PoseForm form) {
  switch (form) {
    case PoseForm::kPlanar:
      return 3;
    case PoseForm::kEuler:
      return 6;
    case PoseForm::kQuaternion:
      return 7;
    case PoseForm::kSimilarity:
      return 8;
  }
  return 0;
}

bool G2oLine::Split(std::string& text, std::size_t number) {
  number_ = number;
  const std::size_t comment = text.find('#');
  if (comment != std::string::npos) text.resize(comment);
  words_ = SplitText(text, " \t\r");
  return !words_.empty();
}

std::string G2oLine::Text() const {
  std::string text;
  for (const std::string& word : words_) text += (text.empty() ? "" : " ") + word;
  return text;
}

void G2oLine::Fail(std::size_t line, const std::string& what) const {
  throw InputError(file_.string() + ":" + std::to_string(line) + ": " + what);
}

void G2oLine::Need(std::size_t numbers, std::size_t or_numbers) const {
  const std::size_t has = words_.size() - 1;
  if (has == numbers || has == or_numbers) return;
  Fail(words_[0] + " has " + std::to_string(has) + " numbers; " + std::to_string(numbers) +
       (or_numbers == numbers ? "" : " or " + std::to_string(or_numbers)) + " are needed");
}

double G2oLine::Number(std::size_t word) const {
  const std::string& text = words_[word];
  const std::optional<double> value = ParseDouble(text);
  if (!value && text.find(',') != std::string::npos)
    Fail("'" + Excerpt(text) + "' has a comma; write decimal points, and blanks between numbers");
  if (!value) Fail("'" + Excerpt(text) + "' is not a number");
  if (!std::isfinite(*value)) Fail("'" + text + "' is not finite; remove or repair this line");
  return *value;
}

NodeId G2oLine::Id(std::size_t word, bool* beyond) const {
  const std::string& text = words_[word];
  const std::optional<long long> value = ParseInteger(text);
  if (value) return *value;
  std::uint64_t large = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, large);
  if (error != std::errc() || stop != end)
    Fail("'" + Excerpt(text) + "' is not a node id (a whole number below 2^64)");
  *beyond = true;
  return static_cast<NodeId>(large);
}

Similarity G2oLine::Pose(std::size_t word, PoseForm form) const {
  std::array<double, 8> v{};  // read in their order, so that the first bad one is named
  for (std::size_t i = 0; i < NumbersOf(form); ++i) v.at(i) = Number(word + i);
  Similarity pose;
  pose.translation = Eigen::Vector3d(v[0], v[1], form == PoseForm::kPlanar ? 0 : v[2]);
  if (form == PoseForm::kPlanar) {
    pose.rotation = Eigen::Quaterniond(std::cos(0.5 * v[2]), 0, 0, std::sin(0.5 * v[2]));
    return pose;
  }
  if (form == PoseForm::kEuler) {
    pose.rotation = Eigen::Quaterniond(std::cos(0.5 * v[5]), 0, 0, std::sin(0.5 * v[5])) *
                    Eigen::Quaterniond(std::cos(0.5 * v[4]), 0, std::sin(0.5 * v[4]), 0) *
                    Eigen::Quaterniond(std::cos(0.5 * v[3]), std::sin(0.5 * v[3]), 0, 0);
    return pose;
  }
  pose.rotation = Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  const double norm = pose.rotation.norm();
  if (norm < 1e-6) Fail("the quaternion is zero; a unit quaternion is needed");
  if (!std::isfinite(norm)) Fail("the quaternion is too large; a unit quaternion is needed");
  pose.rotation.normalize();
  if (form == PoseForm::kSimilarity) {
    pose.scale = v[7];
    if (pose.scale <= 0) Fail("the scale must be positive");
  }
  return pose;
}

Matrix7d G2oLine::Upper(std::size_t word, const std::vector<int>& coordinates) const {
  Matrix7d out = Matrix7d::Zero();
  for (std::size_t r = 0; r < coordinates.size(); ++r) {
    for (std::size_t c = r; c < coordinates.size(); ++c, ++word)
      out(coordinates[r], coordinates[c]) = out(coordinates[c], coordinates[r]) = Number(word);
  }
  return out;
}

}  // namespace tutti::internal
