// Matrices of descriptors as bytes.
#pragma once

#include <opencv2/core.hpp>

#include "core/byte_stream.h"

namespace tutti::internal {

/// Appends a matrix of CV_8U or CV_32F. CV_32F with whole numbers 0..255 throughout (SIFT) is packed into
/// bytes, without loss; others are laid out such that zstd makes less of them.
void PutMat(const cv::Mat& matrix, ByteWriter& out);
/// What PutMat wrote. Throws InputError where that is damaged.
cv::Mat GetMat(ByteReader& in);

}  // namespace tutti::internal
