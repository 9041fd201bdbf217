// One line of a g2o file, as numbers. Private to the back end.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"

namespace tutti::internal {

/// How a pose is written: x y heading; x y z roll pitch yaw (R = Rz Ry Rx); x y z qx qy qz qw; the same and a
/// scale.
enum class PoseForm { kPlanar, kEuler, kQuaternion, kSimilarity };
PoseForm FormOf(GraphKind kind);
std::size_t NumbersOf(PoseForm form);

/// The words of a line. What can't be read is an InputError with file and line.
class G2oLine {
 public:
  explicit G2oLine(std::filesystem::path file) : file_(std::move(file)) {}

  /// Comments are left out. False if nothing else is there.
  bool Split(std::string& text, std::size_t number);

  const std::string& Word(std::size_t k) const { return words_[k]; }
  std::size_t Words() const { return words_.size(); }
  std::size_t number() const { return number_; }
  /// All words with one blank between them.
  std::string Text() const;

  double Number(std::size_t word) const;
  /// Whole numbers up to 2^64 - 1; from 2^63 on as a negative number, and `beyond` is set.
  NodeId Id(std::size_t word, bool* beyond) const;
  Similarity Pose(std::size_t word, PoseForm form) const;
  /// The upper triangle by rows, of these coordinates.
  Matrix7d Upper(std::size_t word, const std::vector<int>& coordinates) const;

  [[noreturn]] void Fail(const std::string& what) const { Fail(number_, what); }
  [[noreturn]] void Fail(std::size_t line, const std::string& what) const;
  /// Throws unless the line has one of these two numbers of words behind the tag.
  void Need(std::size_t numbers, std::size_t or_numbers) const;

 private:
  std::filesystem::path file_;
  std::vector<std::string> words_;
  std::size_t number_ = 0;
};

}  // namespace tutti::internal
