#include "loopclosure/vocabulary/word_bytes.h"

#include <algorithm>
#include <cstring>
#include <string_view>
#include <utility>

namespace tutti::internal {
namespace {

int Width(const WordStorage& storage, int type) {
  return static_cast<int>(storage.row_bytes() / static_cast<std::size_t>(CV_ELEM_SIZE(type)));
}

// Rows of the matrices that are of a vocabulary's kind, numbered through.
class KnownRows {
 public:
  KnownRows(const std::vector<PackedMat>& known, int type, int width) {
    for (const PackedMat& matrix : known) {
      if (matrix.type() != type || matrix.cols() != width) continue;
      for (int r = 0; r < matrix.rows(); ++r) rows_.emplace_back(&matrix, r);
    }
  }
  std::int64_t size() const { return static_cast<std::int64_t>(rows_.size()); }
  void Copy(std::int64_t row, std::uint8_t* to) const {
    const auto& [matrix, r] = rows_[static_cast<std::size_t>(row)];
    matrix->CopyRow(r, to);
  }

 private:
  std::vector<std::pair<const PackedMat*, int>> rows_;
};

// Finds rows by what is in them.
class RowIndex {
 public:
  RowIndex(const KnownRows& rows, std::size_t row_bytes) : rows_(rows), row_(row_bytes) {
    numbers_.reserve(static_cast<std::size_t>(rows.size()));
    for (std::int64_t r = 0; r < rows.size(); ++r) {
      rows.Copy(r, row_.data());
      numbers_.emplace_back(Checksum(row_.data()), static_cast<std::uint32_t>(r));
    }
    std::sort(numbers_.begin(), numbers_.end());
  }
  // The first that is the same, -1 if there is none.
  std::int64_t Find(const std::uint8_t* descriptor) {
    const std::uint32_t checksum = Checksum(descriptor);
    auto at = std::lower_bound(numbers_.begin(), numbers_.end(), std::make_pair(checksum, 0U));
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
  std::vector<std::uint8_t> row_;                                 // the last that was looked at
  std::vector<std::pair<std::uint32_t, std::uint32_t>> numbers_;  // checksum, row
};

}  // namespace

void SaveWords(const WordStorage& storage, int type, const std::vector<PackedMat>& known, ByteWriter& out) {
  const int width = Width(storage, type);
  const KnownRows rows(known, type, width);
  RowIndex index(rows, storage.row_bytes());
  cv::Mat others(0, width, type);
  int word_before = -1;
  std::int64_t row_before = -1;
  out.PutVarint(static_cast<std::uint64_t>(storage.size()));
  storage.ForEach([&](int word, int row) {
    out.PutVarint(static_cast<std::uint64_t>(word - word_before - 1));
    word_before = word;
    const std::int64_t same = index.Find(storage.At(row));
    out.PutVarint(same >= 0 ? 1 : 0);
    if (same >= 0) {
      out.PutSignedVarint(same - row_before);
      row_before = same;
    } else {
      others.push_back(cv::Mat(1, width, type, storage.At(row)));
    }
  });
  PackedMat(others).Put(out);
}

void LoadWords(const WordStorage& storage, int type, const std::vector<PackedMat>& known, ByteReader& in,
               const WordSink& sink) {
  const int width = Width(storage, type);
  const KnownRows rows(known, type, width);
  const std::uint64_t count = in.GetVarint();
  if (count > in.Left() / 2) in.Damaged("more words than bytes");
  std::vector<std::pair<int, std::int64_t>> words;  // with their rows; -1: among the others
  words.reserve(static_cast<std::size_t>(count));
  int word_before = -1, others = 0;
  std::int64_t row_before = -1;
  for (std::uint64_t i = 0; i < count; ++i) {
    word_before += 1 + in.GetVarintIndex(WordStorage::kMostWords - 1 - word_before);
    std::int64_t row = -1;
    if (in.GetVarintIndex(2) == 1) {
      const std::int64_t step = in.GetSignedVarint(), most = rows.size();
      if (step < -most || step > most || row_before + step < 0 || row_before + step >= most)
        in.Damaged("a word of features that are nowhere");
      row = row_before += step;
    } else {
      ++others;
    }
    words.emplace_back(word_before, row);
  }
  const cv::Mat rest = PackedMat::Get(in).Unpacked();
  if (rest.rows != others || (others > 0 && (rest.type() != type || rest.cols != width)))
    in.Damaged("words without descriptors");
  std::vector<std::uint8_t> known_row(storage.row_bytes());
  int next = 0;
  for (const auto& [word, row] : words) {
    if (row < 0) {
      sink(word, rest.ptr(next++));
    } else {
      rows.Copy(row, known_row.data());
      sink(word, known_row.data());
    }
  }
}

}  // namespace tutti::internal
