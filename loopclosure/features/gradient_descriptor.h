// Descriptors of whole images: histograms of gradients; and the length that all of them have.
#pragma once

#include <opencv2/core.hpp>

namespace tutti {

/// Histograms of gradients (Dalal & Triggs, CVPR 2005) of a thumbnail of 64x48 pixels: 8x6 cells of 9
/// directions without sign, each cell relative to the gradients of the 3x3 cells around it, so that neither
/// light nor contrast matter, not even where they differ within the image. 1 x 432, CV_32F, of length 1;
/// empty if there is nothing to see (a plain image, or a side below 16 px). `grey`: CV_8UC1; where `mask`
/// (CV_8UC1 of the same size, or empty) is 0 nothing counts.
cv::Mat DescribeByGradients(const cv::Mat& grey, const cv::Mat& mask = cv::Mat());

/// A descriptor (1 x D, CV_32F) at length 1, in a matrix of its own; empty for one of no length or of none.
cv::Mat NormalisedDescriptor(const cv::Mat& descriptor);

}  // namespace tutti
