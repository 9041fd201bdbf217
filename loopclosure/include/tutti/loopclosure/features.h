// The features that one member takes from an image.
#pragma once

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <string>
#include <vector>

#include "tutti/loopclosure/detector_options.h"

#pragma GCC visibility push(default)
namespace tutti {

namespace internal {
class SiftScratchPool;
}  // namespace internal

/// Keypoints and their descriptors, row by row.
struct Features {
  std::vector<cv::KeyPoint> keypoints;  ///< N, in pixels of the full image
  cv::Mat descriptors;                  ///< N x D, CV_32F or CV_8U; empty if N = 0
};

/// The image as one 8-bit channel: colour to grey; 16-bit and float stretched from minimum to maximum; empty
/// stays empty.
cv::Mat ToGrey8(const cv::Mat& image);

/// Whether a mask (CV_8UC1) is 0 at the pixel; outside of it the nearest of its pixels counts. Nothing is
/// masked by an empty one.
bool IsMasked(const cv::Mat& mask, const cv::Point2f& pixel);

/// Drops the features at which the mask is 0.
void DropMasked(const cv::Mat& mask, Features& features);

/// Indices of the strongest `count` keypoints spread over a grid of `columns` cells along the longer side:
/// each cell's best first, up to an equal share, the rest by response. In order of strength; ties by
/// position. Deterministic. The detector's grid is of 8 columns: cells of about 8 features each, if it keeps
/// 400 of an image.
std::vector<int> SelectSpread(const std::vector<cv::KeyPoint>& keypoints, cv::Size image_size, int count,
                              int columns = 8);

/// SURF of dlib (its Hessian pyramid and 64 values per point) as a cv::Feature2D: CV_32F descriptors of unit
/// length.
cv::Ptr<cv::Feature2D> CreateDlibSurf(int max_features, int octaves, double threshold);

/// Makes a detector and descriptor for images of this size that finds at least `features` features where
/// there are so many. Called for each image, from several threads at once.
using FeatureFactory = std::function<cv::Ptr<cv::Feature2D>(cv::Size image_size, int features)>;

/// Any cv::Feature2D as a member of the ensemble, under a name of its own: options.members may hold it from
/// now on, in this process. Its descriptors must be CV_8U (Hamming) or CV_32F (Euclidean). Throws InputError
/// if the name is empty or taken.
void RegisterFeatureType(const std::string& name, FeatureFactory factory);

/// Detects and describes with one cv::Feature2D, named as in LoopDetectorOptions::members.
class FeatureExtractor {
 public:
  /// Throws InputError for an unknown name.
  FeatureExtractor(const std::string& name, const ExtractionOptions& options);

  /// Features of an 8-bit grey image, at most options.features. Never throws for hard images (blank, tiny,
  /// huge, empty).
  Features Extract(const cv::Mat& grey) const;

 private:
  double Shrinking(double pixels) const;  // by which the member sees the image smaller; below 1: larger

  std::string name_;
  ExtractionOptions options_;
  FeatureFactory factory_;                                // of all but surf, sift and orb
  cv::Ptr<cv::Feature2D> surf_;                           // copies share it, and the scratches
  std::shared_ptr<internal::SiftScratchPool> scratches_;  // of sift
};

}  // namespace tutti
#pragma GCC visibility pop
