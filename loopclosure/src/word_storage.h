// Descriptors of words in blocks that never move: kd-trees point into them.
#pragma once

#include <cstdint>
#include <cstring>
#include <memory>
#include <unordered_map>
#include <vector>

namespace tutti::internal {

/// Rows of equal size, each with the id of its word. A row keeps its place ("row number") until it is freed.
class WordStorage {
 public:
  explicit WordStorage(std::size_t row_bytes) : row_bytes_(row_bytes) {}

  /// Copies a descriptor in; returns its row number. Freed rows are used again, the latest first.
  int Add(int word, const std::uint8_t* descriptor) {
    int row = static_cast<int>(words_.size());
    if (!free_.empty()) {
      row = free_.back();
      free_.pop_back();
    } else {
      AddFree();
    }
    words_[static_cast<std::size_t>(row)] = word;
    std::memcpy(At(row), descriptor, row_bytes_);
    row_of_word_[word] = row;
    return row;
  }

  void Free(int row) {
    row_of_word_.erase(words_[static_cast<std::size_t>(row)]);
    words_[static_cast<std::size_t>(row)] = -1;
    free_.push_back(row);
  }

  /// Row number of a word, -1 if there is none.
  int RowOf(int word) const {
    const auto found = row_of_word_.find(word);
    return found == row_of_word_.end() ? -1 : found->second;
  }
  /// Word of a row number, -1 if the row is free.
  int WordOf(int row) const { return words_[static_cast<std::size_t>(row)]; }
  std::uint8_t* At(int row) const {
    const std::size_t index = static_cast<std::size_t>(row);
    return blocks_[index / kRowsPerBlock].get() + index % kRowsPerBlock * row_bytes_;
  }
  /// For loading: one more row number, which is free, but not used again before SetFreeRows says so.
  void AddFree() {
    words_.push_back(-1);
    if (words_.size() > blocks_.size() * kRowsPerBlock) {
      blocks_.push_back(std::make_unique<std::uint8_t[]>(kRowsPerBlock * row_bytes_));
    }
  }
  /// Free rows, the next one to be used last.
  const std::vector<int>& FreeRows() const { return free_; }
  /// For loading; false if one of them is in use, or there are others.
  bool SetFreeRows(const std::vector<int>& rows) {
    std::vector<char> named(words_.size(), 0);
    for (const int row : rows) {
      if (row < 0 || row >= end() || WordOf(row) >= 0 || named[static_cast<std::size_t>(row)] != 0)
        return false;
      named[static_cast<std::size_t>(row)] = 1;
    }
    if (rows.size() + row_of_word_.size() != words_.size()) return false;
    free_ = rows;
    return true;
  }

  /// Row numbers are below this.
  int end() const { return static_cast<int>(words_.size()); }
  std::size_t row_bytes() const { return row_bytes_; }

  static constexpr std::size_t kRowsPerBlock = 1024;
  static constexpr int kMostWords = 1 << 28;  ///< word ids are below this

 private:
  std::size_t row_bytes_;
  std::vector<std::unique_ptr<std::uint8_t[]>> blocks_;
  std::vector<int> words_;  // by row number, -1: free
  std::vector<int> free_;
  std::unordered_map<int, int> row_of_word_;
};

}  // namespace tutti::internal
