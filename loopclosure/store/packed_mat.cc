#include "loopclosure/store/packed_mat.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <vector>

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

// Floats that are so many units each take a byte.
struct PackedMat::Unit {
  Kind kind;
  float size;  // a power of two
  int least;   // of 256 numbers that follow each other [units]

  // Of a row; false if a value is no such number.
  bool Pack(const float* from, int count, std::uint8_t* to) const {
    const float per_unit = 1 / size;
    const auto low = static_cast<float>(least), high = static_cast<float>(least + 255);
    bool whole = true;
    for (int i = 0; i < count; ++i) {
      const float units = from[i] * per_unit;
      const bool inside = units >= low && units <= high;
      const int number = inside ? static_cast<int>(units) : 0;
      to[i] = static_cast<std::uint8_t>(number - least);
      whole &= inside && static_cast<float>(number) == units && !(number == 0 && std::signbit(units));
    }
    return whole;
  }
  void Unpack(const std::uint8_t* from, int count, float* to) const {
    for (int i = 0; i < count; ++i) to[i] = static_cast<float>(from[i] + least) * size;
  }
};

const PackedMat::Unit PackedMat::kUnits[2] = {{Kind::kWholeAsBytes, 1.0f, 0},            // SIFT
                                              {Kind::kStepsAsBytes, 1.0f / 128, -128}};  // SURF

PackedMat::PackedMat(const cv::Mat& matrix) : values_(matrix) {
  CV_Assert(matrix.empty() || matrix.type() == CV_8U || matrix.type() == CV_32F);
  if (matrix.empty() || matrix.type() == CV_8U) return;
  cv::Mat bytes(matrix.size(), CV_8U);
  for (const Unit& unit : kUnits) {
    int r = 0;
    while (r < matrix.rows && unit.Pack(matrix.ptr<float>(r), matrix.cols, bytes.ptr(r))) ++r;
    if (r < matrix.rows) continue;
    values_ = bytes;
    unit_ = &unit;
    return;
  }
}

cv::Mat PackedMat::Unpacked() const {
  if (unit_ == nullptr) return values_;
  cv::Mat matrix(values_.size(), CV_32F);
  for (int r = 0; r < matrix.rows; ++r) unit_->Unpack(values_.ptr(r), matrix.cols, matrix.ptr<float>(r));
  return matrix;
}

void PackedMat::CopyRow(int row, std::uint8_t* to) const {
  if (unit_ == nullptr) {
    std::copy_n(values_.ptr(row), static_cast<std::size_t>(values_.cols) * values_.elemSize(), to);
  } else {
    unit_->Unpack(values_.ptr(row), values_.cols, reinterpret_cast<float*>(to));
  }
}

void PackedMat::Put(ByteWriter& out) const {
  if (empty()) return out.Put(Kind::kEmpty);
  const bool floats = values_.type() == CV_32F;
  out.Put(unit_ != nullptr ? unit_->kind : floats ? Kind::kFloatPlanes : Kind::kBytes);
  out.Put<std::int32_t>(values_.rows);
  out.Put<std::int32_t>(values_.cols);
  const auto rows = static_cast<std::size_t>(values_.rows), columns = static_cast<std::size_t>(values_.cols);
  if (floats) {
    std::vector<float> values;
    values.reserve(rows * columns);
    ForEachColumn(values_.cols, [&](int c) {
      for (int r = 0; r < values_.rows; ++r) values.push_back(values_.ptr<float>(r)[c]);
    });
    out.PutPlanes(values);
  } else if (unit_ != nullptr) {
    const cv::Mat transposed = values_.t();
    ForEachColumn(values_.cols, [&](int c) { out.PutRaw(transposed.ptr(c), rows); });
  } else {
    for (int r = 0; r < values_.rows; ++r) out.PutRaw(values_.ptr(r), columns);
  }
}

PackedMat PackedMat::Get(ByteReader& in) {
  const auto kind = static_cast<Kind>(in.Get<std::uint8_t>());
  if (kind == Kind::kEmpty) return {};
  if (kind > Kind::kStepsAsBytes) in.Damaged("a matrix of an unknown kind");
  const auto rows = in.Get<std::int32_t>();
  const auto columns = in.Get<std::int32_t>();
  const bool planes = kind == Kind::kFloatPlanes;
  const std::size_t width = planes ? sizeof(float) : 1;
  if (rows <= 0 || columns <= 0 ||
      static_cast<std::uint64_t>(rows) * static_cast<std::uint64_t>(columns) > in.Left() / width) {
    in.Damaged("a matrix of an impossible size");
  }
  PackedMat packed;
  const auto height = static_cast<std::size_t>(rows);
  if (planes) {
    const std::vector<float> values = in.GetPlanes();
    packed.values_.create(rows, columns, CV_32F);
    if (values.size() != packed.values_.total()) in.Damaged("a matrix of another size");
    const float* next = values.data();
    ForEachColumn(columns, [&](int c) {
      for (int r = 0; r < rows; ++r) packed.values_.ptr<float>(r)[c] = *next++;
    });
  } else if (kind == Kind::kBytes) {
    packed.values_.create(rows, columns, CV_8U);
    in.GetRaw(packed.values_.data, packed.values_.total());
  } else {
    cv::Mat transposed(columns, rows, CV_8U);
    ForEachColumn(columns, [&](int c) { in.GetRaw(transposed.ptr(c), height); });
    packed.values_ = transposed.t();
    packed.unit_ =
        std::find_if(std::begin(kUnits), std::end(kUnits), [&](const Unit& u) { return u.kind == kind; });
  }
  return packed;
}

}  // namespace tutti::internal
