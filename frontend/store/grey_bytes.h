// Images as bytes that pack well, without loss.
#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace tutti::internal {

/// A CV_8UC1 image without its size, a byte a pixel: what is left of each grey value after a guess from its
/// neighbours (the median edge detector; M. Weinberger et al., "The LOCO-I lossless image compression
/// algorithm", T-IP 2000). SectionPacker makes about 45 % of a photograph of it.
std::string PutGrey(const cv::Mat& image);

/// Fills an image, which has its size, with what PutGrey made of one of that size; false if the bytes are
/// not of one.
bool GetGrey(const std::string& bytes, cv::Mat* image);

/// Whether so many bytes are an image of this size.
bool IsGrey(const std::string& bytes, int rows, int columns);

}  // namespace tutti::internal
