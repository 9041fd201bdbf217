// Descriptors of words in blocks that never move: kd-trees and tries refer to them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "core/numbers.h"
#include "loopclosure/store/packed_mat.h"
#include "loopclosure/vocabulary/descriptor_index.h"
#include "loopclosure/vocabulary/word_map.h"

namespace tutti::internal {

/// A vector that grows without moving what it holds, so that no image pays for copying all of it: elements in
/// chunks of equal size. Indices are as in a std::vector.
template <typename T>
class ChunkedVector {
 public:
  T& operator[](std::size_t i) { return chunks_[i >> kBits][i & kMask]; }
  const T& operator[](std::size_t i) const { return chunks_[i >> kBits][i & kMask]; }

  /// Appends a value-initialised element.
  void Extend() {
    if (size_ >> kBits == chunks_.size()) chunks_.push_back(std::make_unique<T[]>(kMask + 1));
    ++size_;
  }
  std::size_t size() const { return size_; }

 private:
  static constexpr std::size_t kBits = 14;
  static constexpr std::size_t kMask = (std::size_t{1} << kBits) - 1;

  std::vector<std::unique_ptr<T[]>> chunks_;
  std::size_t size_ = 0;
};

/// Rows of equal size, each with the id of its word. A row keeps its place ("row number") until it is freed.
class WordStorage {
 public:
  explicit WordStorage(std::size_t row_bytes) : row_bytes_(row_bytes) {}

  /// Copies a descriptor in; returns its row number. Freed rows are used again, the latest first.
  int Add(int word, const std::uint8_t* descriptor) {
    int row = end();
    if (!free_.empty()) {
      row = free_.back();
      free_.pop_back();
    } else {
      words_.Extend();
      if (words_.size() > blocks_.size() * kRowsPerBlock) {
        blocks_.push_back(std::make_unique<std::uint8_t[]>(kRowsPerBlock * row_bytes_));
      }
    }
    words_[Index(row)] = word;
    std::memcpy(At(row), descriptor, row_bytes_);
    row_of_word_[word] = row;
    return row;
  }

  void Free(int row) {
    row_of_word_.Erase(WordOf(row));
    words_[Index(row)] = -1;
    free_.push_back(row);
  }

  /// Row number of a word, -1 if there is none.
  int RowOf(int word) const {
    const int* row = row_of_word_.Find(word);
    return row == nullptr ? -1 : *row;
  }
  /// Word of a row number, -1 if the row is free.
  int WordOf(int row) const { return words_[Index(row)]; }
  std::uint8_t* At(int row) const {
    const std::size_t index = Index(row);
    return blocks_[index / kRowsPerBlock].get() + index % kRowsPerBlock * row_bytes_;
  }
  /// Calls call(word, row) for every word, ascending.
  template <typename Call>
  void ForEach(const Call& call) const {
    row_of_word_.ForEach(call);
  }
  /// The number of each row's word among all words, ascending; -1 if the row is free. Which row a word lies
  /// in changes no answer: in a file, rows are numbered by their words.
  std::vector<int> Ranks() const;

  /// All words with their descriptors of a type (CV_8U or CV_32F). Of a word that is a row of `known`, which
  /// whoever loads it must have in the same order, the number of the row is saved.
  template <class Archive>
  void State(Archive& archive, int type, const std::vector<PackedMat>& known);

  int size() const { return static_cast<int>(row_of_word_.size()); }
  /// Row numbers are below this.
  int end() const { return static_cast<int>(words_.size()); }
  std::size_t row_bytes() const { return row_bytes_; }

  static constexpr std::size_t kRowsPerBlock = 1024;
  static constexpr int kMostWords = 1 << 28;  ///< word ids are below this

 private:
  std::size_t row_bytes_;
  std::vector<std::unique_ptr<std::uint8_t[]>> blocks_;
  ChunkedVector<int> words_;  // by row number, -1: free
  std::vector<int> free_;
  WordMap<int> row_of_word_;
};

/// An index whose words lie in a WordStorage. `Derived` has a template StateOf(archive, known).
template <class Derived>
class StoredIndex : public DescriptorIndex {
 public:
  const std::uint8_t* Find(int word) const override {
    const int row = storage_.RowOf(word);
    return row < 0 ? nullptr : storage_.At(row);
  }
  int size() const override { return storage_.size(); }
  void State(StateWriter& archive, const std::vector<PackedMat>& known) override {
    static_cast<Derived*>(this)->StateOf(archive, known);
  }
  void State(StateReader& archive, const std::vector<PackedMat>& known) override {
    static_cast<Derived*>(this)->StateOf(archive, known);
  }

 protected:
  explicit StoredIndex(std::size_t row_bytes) : storage_(row_bytes) {}

  WordStorage storage_;
};

}  // namespace tutti::internal
