// Views of tests grow by one feature after the other.
#pragma once

#include "loopclosure/store/packed_mat.h"

namespace tutti::testing {

inline void AppendRows(const cv::Mat& rows, internal::PackedMat* matrix) {
  cv::Mat all = matrix->Unpacked().clone();
  all.push_back(rows);
  *matrix = all;
}

}  // namespace tutti::testing
