// Descriptors of whole images, for the members `hog` and `dnn`. Internal.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "tutti/loopclosure/detector_options.h"

namespace tutti {

constexpr int kMinSide = 16;  ///< smaller images hold no feature of any member [px]

/// Histograms of gradients (Dalal & Triggs, CVPR 2005) of a thumbnail of 64x48 pixels: 8x6 cells of 9
/// directions without sign, each cell relative to the gradients of the 3x3 cells around it, so that neither
/// light nor contrast matter, not even where they differ within the image. 1 x 432, CV_32F, of length 1;
/// empty if there is nothing to see (a plain image, or a side below 16 px). `grey`: CV_8UC1; where `mask`
/// (CV_8UC1 of the same size, or empty) is 0 nothing counts.
cv::Mat DescribeByGradients(const cv::Mat& grey, const cv::Mat& mask = cv::Mat());

/// The image with the mean of the rest where the mask (CV_8UC1; empty or of another size: none) is 0; empty
/// if that is everywhere.
cv::Mat WithoutMasked(const cv::Mat& image, const cv::Mat& mask);

/// A descriptor (1 x D, CV_32F) at length 1, in a matrix of its own; empty for one of no length or of none.
cv::Mat NormalisedDescriptor(const cv::Mat& descriptor);

/// A network from an ONNX file, run by OpenCV's dnn module on the CPU. Copies share it.
class DnnDescriptor {
 public:
  /// Reads the file and runs the network once, so that what is wrong with it is known before the first image.
  /// Throws InputError if the file can't be read or is no network that OpenCV understands, for an unknown
  /// layer, for one whose output is no vector, and for an image size that the network does not take.
  explicit DnnDescriptor(const DnnOptions& options);

  /// The network's output for an image, 1 x width(), CV_32F, of length 1; empty if there is nothing to see (a
  /// plain image, or a side below 16 px), or the output is 0 throughout. `image`: as LoopQuery::image;
  /// `grey`: what ToGrey8 makes of it, the input in three equal channels where the image is not 8-bit colour;
  /// where `mask` (CV_8UC1 of the same size, or empty) is 0, the mean of the rest takes the pixels' place.
  /// The bytes are the same for any number of threads: the network runs in the calling one. Throws InputError
  /// if a value of the output is not a finite number.
  cv::Mat Describe(const cv::Mat& image, const cv::Mat& grey, const cv::Mat& mask) const;

  /// Length of the descriptor [values], at least 2.
  int width() const;
  /// What the descriptors depend on, in words: two with the same fingerprint can be compared.
  std::string Fingerprint() const;

 private:
  struct Network;
  std::shared_ptr<Network> network_;
};

}  // namespace tutti
