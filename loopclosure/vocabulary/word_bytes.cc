#include "loopclosure/vocabulary/word_bytes.h"

#include <algorithm>
#include <cstring>
#include <string_view>
#include <utility>

#include "loopclosure/store/mat_bytes.h"

namespace tutti::internal {
namespace {

int Width(const WordStorage& storage, int type) {
  return static_cast<int>(storage.row_bytes() / static_cast<std::size_t>(CV_ELEM_SIZE(type)));
}

// Rows of the matrices that are of a vocabulary's kind.
std::vector<const std::uint8_t*> RowsOf(const std::vector<cv::Mat>& known, int type, int width) {
  std::vector<const std::uint8_t*> rows;
  for (const cv::Mat& matrix : known) {
    if (matrix.type() != type || matrix.cols != width) continue;
    for (int r = 0; r < matrix.rows; ++r) rows.push_back(matrix.ptr(r));
  }
  return rows;
}

// Finds rows by what is in them.
class RowIndex {
 public:
  RowIndex(const std::vector<const std::uint8_t*>& rows, std::size_t row_bytes)
      : rows_(rows), row_bytes_(row_bytes) {
    numbers_.reserve(rows.size());
    for (std::size_t r = 0; r < rows.size(); ++r)
      numbers_.emplace_back(Checksum(rows[r]), static_cast<std::uint32_t>(r));
    std::sort(numbers_.begin(), numbers_.end());
  }
  // The first that is the same, -1 if there is none.
  std::int64_t Find(const std::uint8_t* descriptor) const {
    const std::uint32_t checksum = Checksum(descriptor);
    auto at = std::lower_bound(numbers_.begin(), numbers_.end(), std::make_pair(checksum, 0U));
    for (; at != numbers_.end() && at->first == checksum; ++at) {
      if (std::memcmp(rows_[at->second], descriptor, row_bytes_) == 0) return at->second;
    }
    return -1;
  }

 private:
  std::uint32_t Checksum(const std::uint8_t* row) const {
    return Crc32(std::string_view(reinterpret_cast<const char*>(row), row_bytes_));
  }

  const std::vector<const std::uint8_t*>& rows_;
  std::size_t row_bytes_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> numbers_;  // checksum, row
};

}  // namespace

void SaveWords(const WordStorage& storage, int type, const std::vector<cv::Mat>& known, ByteWriter& out) {
  const int width = Width(storage, type);
  const std::vector<const std::uint8_t*> rows = RowsOf(known, type, width);
  const RowIndex index(rows, storage.row_bytes());
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
  PutMat(others, out);
}

void LoadWords(const WordStorage& storage, int type, const std::vector<cv::Mat>& known, ByteReader& in,
               const WordSink& sink) {
  const int width = Width(storage, type);
  const std::vector<const std::uint8_t*> rows = RowsOf(known, type, width);
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
      const std::int64_t step = in.GetSignedVarint(), most = static_cast<std::int64_t>(rows.size());
      if (step < -most || step > most || row_before + step < 0 || row_before + step >= most)
        in.Damaged("a word of features that are nowhere");
      row = row_before += step;
    } else {
      ++others;
    }
    words.emplace_back(word_before, row);
  }
  const cv::Mat rest = GetMat(in);
  if (rest.rows != others || (others > 0 && (rest.type() != type || rest.cols != width)))
    in.Damaged("words without descriptors");
  int next = 0;
  for (const auto& [word, row] : words)
    sink(word, row >= 0 ? rows[static_cast<std::size_t>(row)] : rest.ptr(next++));
}

}  // namespace tutti::internal
