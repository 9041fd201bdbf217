#include "loopclosure/store/packed_mat.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include "core/numbers.h"
#include "core/state_archive.h"

namespace tutti::internal {
namespace {

// Calls call(column) such that columns with like values follow each other: those of SURF come in fours, of
// which two are never negative.
template <typename Call>
void ForEachColumn(int columns, const Call& call) {
  constexpr int kKinds = 4;
  for (int kind = 0; kind < kKinds; ++kind) {
    for (int c = kind; c < columns; c += kKinds) call(c);
  }
}

}  // namespace

// 256 floats, of which each takes a byte.
struct PackedMat::Code {
  Kind kind;
  int (*byte_of)(float);  // of a float that is one of them; of others any
  std::array<float, 256> values;

  // Packs a row; false if a value is none of them.
  bool Pack(const float* from, int count, std::uint8_t* to) const {
    bool all = true;
    for (int i = 0; i < count; ++i) {
      to[i] = static_cast<std::uint8_t>(byte_of(from[i]));
      all &= SameBits(values[to[i]], from[i]);
    }
    return all;
  }
  void Unpack(const std::uint8_t* from, int count, float* to) const {
    for (int i = 0; i < count; ++i) to[i] = values[from[i]];
  }

 private:
  static bool SameBits(float a, float b) {  // 0 and -0 are two, and a NaN is itself
    std::uint32_t bits_a, bits_b;
    std::memcpy(&bits_a, &a, sizeof a);
    std::memcpy(&bits_b, &b, sizeof b);
    return bits_a == bits_b;
  }
};

const std::array<PackedMat::Code, 2>& PackedMat::Codes() {
  const auto whole = [](float v) { return v >= 0 && v <= 255 ? static_cast<int>(v) : 0; };
  const auto root = [](float v) { return v >= -1 && v <= 1 ? SignedRoot(v) & 0xff : 0; };
  static const std::array<Code, 2> codes = [&] {
    std::array<Code, 2> made = {Code{Kind::kWholeAsBytes, whole, {}}, Code{Kind::kSquaresAsBytes, root, {}}};
    for (int i = 0; i < 256; ++i) {
      made[0].values[Index(i)] = static_cast<float>(i);
      made[1].values[Index(i)] = SignedSquare(i < 128 ? i : i - 256);
    }
    return made;
  }();
  return codes;
}

PackedMat::PackedMat(const cv::Mat& matrix) : values_(matrix) {
  CV_Assert(matrix.empty() || matrix.type() == CV_8U || matrix.type() == CV_32F);
  if (matrix.empty() || matrix.type() == CV_8U) return;
  cv::Mat bytes(matrix.size(), CV_8U);
  for (const Code& code : Codes()) {
    int r = 0;
    while (r < matrix.rows && code.Pack(matrix.ptr<float>(r), matrix.cols, bytes.ptr(r))) ++r;
    if (r < matrix.rows) continue;
    values_ = bytes;
    code_ = &code;
    return;
  }
}

cv::Mat PackedMat::Unpacked() const {
  if (code_ == nullptr) return values_;
  cv::Mat matrix(values_.size(), CV_32F);
  for (int r = 0; r < matrix.rows; ++r) code_->Unpack(values_.ptr(r), matrix.cols, matrix.ptr<float>(r));
  return matrix;
}

void PackedMat::CopyRow(int row, std::uint8_t* to) const {
  if (code_ == nullptr) {
    std::copy_n(values_.ptr(row), Index(values_.cols) * values_.elemSize(), to);
  } else {
    code_->Unpack(values_.ptr(row), values_.cols, reinterpret_cast<float*>(to));
  }
}

template <class Archive>
void PackedMat::State(Archive& archive) {
  Kind kind = Kind::kEmpty;
  if (!empty()) kind = code_ != nullptr ? code_->kind : type() == CV_32F ? Kind::kFloatPlanes : Kind::kBytes;
  archive(kind);
  if (Archive::kReading) *this = PackedMat();
  if (kind == Kind::kEmpty) return;
  int rows = values_.rows, columns = values_.cols;
  archive(rows, columns);
  if constexpr (Archive::kReading) {
    if (kind > Kind::kSquaresAsBytes) archive.Damaged("a matrix of an unknown kind");
    if (rows <= 0 || columns <= 0) archive.Damaged("a matrix of an impossible size");
    archive.Need(static_cast<std::uint64_t>(rows) * static_cast<std::uint64_t>(columns) *
                 (kind == Kind::kFloatPlanes ? sizeof(float) : 1));
    values_.create(rows, columns, kind == Kind::kFloatPlanes ? CV_32F : CV_8U);
    for (const Code& code : Codes()) code_ = code.kind == kind ? &code : code_;
  }
  const auto height = Index(rows), width = Index(columns);
  if (kind == Kind::kFloatPlanes) {
    std::vector<float> values(Archive::kReading ? 0 : height * width);
    auto element = values.begin();
    if constexpr (!Archive::kReading) {
      ForEachColumn(columns, [&](int c) {
        for (int r = 0; r < rows; ++r) *element++ = values_.ptr<float>(r)[c];
      });
    }
    archive(Planes{&values});
    if constexpr (Archive::kReading) {
      if (values.size() != height * width) archive.Damaged("a matrix of another size");
      element = values.begin();
      ForEachColumn(columns, [&](int c) {
        for (int r = 0; r < rows; ++r) values_.ptr<float>(r)[c] = *element++;
      });
    }
  } else if (code_ == nullptr) {
    for (int r = 0; r < rows; ++r) archive.Raw(values_.ptr(r), width);
  } else {
    cv::Mat transposed(columns, rows, CV_8U);
    if (!Archive::kReading) cv::transpose(values_, transposed);
    ForEachColumn(columns, [&](int c) { archive.Raw(transposed.ptr(c), height); });
    if (Archive::kReading) cv::transpose(transposed, values_);
  }
}

template void PackedMat::State(StateWriter& archive);
template void PackedMat::State(StateReader& archive);

}  // namespace tutti::internal
