#include "loopclosure/vocabulary/word_storage.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "core/numbers.h"
#include "core/state_archive.h"

namespace tutti::internal {

// Rows of the matrices that are of a vocabulary's kind, numbered through.
class KnownRows {
 public:
  KnownRows(const std::vector<PackedMat>& known, int type, int width) {
    for (const PackedMat& matrix : known) {
      if (matrix.type() != type || matrix.cols() != width) continue;
      for (int r = 0; r < matrix.rows(); ++r) rows_.emplace_back(&matrix, r);
    }
  }
  int size() const { return static_cast<int>(rows_.size()); }
  void Copy(int row, std::uint8_t* to) const {
    const auto& [matrix, r] = rows_[Index(row)];
    matrix->CopyRow(r, to);
  }

 private:
  std::vector<std::pair<const PackedMat*, int>> rows_;
};

// Finds rows by what is in them.
class RowIndex {
 public:
  RowIndex(const KnownRows& rows, std::size_t row_bytes) : rows_(rows), row_(row_bytes) {
    numbers_.reserve(Index(rows.size()));
    for (int r = 0; r < rows.size(); ++r) {
      rows.Copy(r, row_.data());
      numbers_.emplace_back(Checksum(row_.data()), r);
    }
    std::sort(numbers_.begin(), numbers_.end());
  }
  // The first that is the same, -1 if there is none.
  int Find(const std::uint8_t* descriptor) {
    const std::uint32_t checksum = Checksum(descriptor);
    auto at = std::lower_bound(numbers_.begin(), numbers_.end(), std::make_pair(checksum, 0));
    for (; at != numbers_.end() && at->first == checksum; ++at) {
      rows_.Copy(at->second, row_.data());
      if (std::equal(row_.begin(), row_.end(), descriptor)) return at->second;
    }
    return -1;
  }

 private:
  std::uint32_t Checksum(const std::uint8_t* row) const {
    return Crc32(std::string_view(reinterpret_cast<const char*>(row), row_.size()));
  }

  const KnownRows& rows_;
  std::vector<std::uint8_t> row_;                       // the last that was looked at
  std::vector<std::pair<std::uint32_t, int>> numbers_;  // checksum, row
};

std::vector<int> WordStorage::Ranks() const {
  std::vector<int> ranks(Index(end()), -1);
  int next = 0;
  ForEach([&](int, int row) { ranks[Index(row)] = next++; });
  return ranks;
}

template <class Archive>
void WordStorage::State(Archive& archive, int type, const std::vector<PackedMat>& known) {
  const int width = static_cast<int>(row_bytes_ / Index(CV_ELEM_SIZE(type)));
  const KnownRows rows(known, type, width);
  std::vector<int> words;
  std::vector<int> steps;  // to a word's row among the known ones from the row before; 0: no such row
  PackedMat others;        // the descriptors of words without a row
  if constexpr (!Archive::kReading) {
    RowIndex index(rows, row_bytes_);
    cv::Mat unknown(0, width, type);
    int before = -1;
    ForEach([&](int word, int row) {
      words.push_back(word);
      const int same = index.Find(At(row));
      const bool is_known = same >= 0 && same != before;
      steps.push_back(is_known ? same - before : 0);
      if (is_known) {
        before = same;
      } else {
        unknown.push_back(cv::Mat(1, width, type, At(row)));
      }
    });
    others = PackedMat(unknown);
  }
  archive(GrowingNumbers{&words}, SmallNumbers{&steps}, others);
  if constexpr (Archive::kReading) {
    const auto unknown = static_cast<int>(std::count(steps.begin(), steps.end(), 0));
    if (steps.size() != words.size() || others.rows() != unknown ||
        (unknown > 0 && (others.type() != type || others.cols() != width)))
      archive.Damaged("words without descriptors");
    if (!words.empty() && words.back() >= kMostWords) archive.Damaged("more words than there can be");
    std::vector<std::uint8_t> descriptor(row_bytes_);
    std::int64_t row = -1;
    int next = 0;
    for (std::size_t i = 0; i < words.size(); ++i) {
      row += steps[i];
      if (steps[i] == 0) {
        others.CopyRow(next++, descriptor.data());
      } else if (row >= 0 && row < rows.size()) {
        rows.Copy(static_cast<int>(row), descriptor.data());
      } else {
        archive.Damaged("a word of features that are nowhere");
      }
      Add(words[i], descriptor.data());
    }
  }
}

template void WordStorage::State(StateWriter& archive, int type, const std::vector<PackedMat>& known);
template void WordStorage::State(StateReader& archive, int type, const std::vector<PackedMat>& known);

}  // namespace tutti::internal
