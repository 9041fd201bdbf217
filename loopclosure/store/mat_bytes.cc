#include "loopclosure/store/mat_bytes.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tutti::internal {
namespace {

enum class MatKind : std::uint8_t { kEmpty, kBytes, kFloatPlanes, kFloatsAsBytes };

bool WholeBytes(const cv::Mat& matrix) {
  for (int r = 0; r < matrix.rows; ++r) {
    const float* row = matrix.ptr<float>(r);
    const bool whole = std::all_of(row, row + matrix.cols,
                                   [](float v) { return v >= 0.0f && v <= 255.0f && v == std::floor(v); });
    if (!whole) return false;
  }
  return true;
}

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

void PutMat(const cv::Mat& matrix, ByteWriter& out) {
  if (matrix.empty()) return out.Put(MatKind::kEmpty);
  CV_Assert(matrix.type() == CV_8U || matrix.type() == CV_32F);
  const bool pack = matrix.type() == CV_32F && WholeBytes(matrix);
  out.Put(matrix.type() == CV_8U ? MatKind::kBytes : pack ? MatKind::kFloatsAsBytes : MatKind::kFloatPlanes);
  out.Put<std::int32_t>(matrix.rows);
  out.Put<std::int32_t>(matrix.cols);
  if (matrix.type() == CV_32F && !pack) {
    std::vector<float> values;
    values.reserve(matrix.total());
    const cv::Mat columns = matrix.t();
    ForEachColumn(matrix.cols, [&](int c) {
      values.insert(values.end(), columns.ptr<float>(c), columns.ptr<float>(c) + matrix.rows);
    });
    return out.PutPlanes(values);
  }
  cv::Mat stored;  // of its own: OpenCV would transpose a square matrix in the caller's memory
  if (pack) {
    cv::transpose(matrix, stored);  // values of one dimension are alike
    stored.convertTo(stored, CV_8U);
  } else {
    stored = matrix;
  }
  for (int r = 0; r < stored.rows; ++r) {
    out.PutRaw(stored.ptr(r), static_cast<std::size_t>(stored.cols) * stored.elemSize());
  }
}

cv::Mat GetMat(ByteReader& in) {
  const auto kind = in.Get<std::uint8_t>();
  if (kind == static_cast<std::uint8_t>(MatKind::kEmpty)) return {};
  if (kind > static_cast<std::uint8_t>(MatKind::kFloatsAsBytes)) in.Damaged("a matrix of an unknown kind");
  const auto rows = in.Get<std::int32_t>();
  const auto columns = in.Get<std::int32_t>();
  const bool planes = kind == static_cast<std::uint8_t>(MatKind::kFloatPlanes);
  const std::size_t width = planes ? sizeof(float) : 1;
  if (rows <= 0 || columns <= 0 ||
      static_cast<std::uint64_t>(rows) * static_cast<std::uint64_t>(columns) > in.Left() / width) {
    in.Damaged("a matrix of an impossible size");
  }
  if (planes) {
    const std::vector<float> values = in.GetPlanes();
    if (values.size() != static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns))
      in.Damaged("a matrix of another size");
    cv::Mat matrix(columns, rows, CV_32F);
    const float* next = values.data();
    ForEachColumn(columns, [&](int c) {
      std::copy_n(next, rows, matrix.ptr<float>(c));
      next += rows;
    });
    return matrix.t();
  }
  const bool packed = kind == static_cast<std::uint8_t>(MatKind::kFloatsAsBytes);
  cv::Mat matrix = packed ? cv::Mat(columns, rows, CV_8U) : cv::Mat(rows, columns, CV_8U);
  in.GetRaw(matrix.data, matrix.total());
  if (!packed) return matrix;
  cv::transpose(matrix, matrix);
  matrix.convertTo(matrix, CV_32F);
  return matrix;
}

}  // namespace tutti::internal
