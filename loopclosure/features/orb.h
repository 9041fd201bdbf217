// ORB that describes only the points that are kept. Internal.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace tutti::internal {

/// What cv::ORB::create is given, whose other parameters have their defaults: levels are smaller by 1.2 each,
/// Harris' response decides, patches are 31 px wide.
struct OrbOptions {
  int features = 0;         ///< how many points are detected, and those that are as strong as a level's last
  int levels = 1;           ///< of the pyramid
  int edge = 31;            ///< no point is nearer to a level's rim, at least 3 [px]
  int fast_threshold = 20;  ///< FAST threshold [grey levels of 255]
};

/// For images of this size.
OrbOptions OrbOptionsFor(cv::Size size, int features);

/// ORB (Rublee et al., ICCV 2011) of one image: points and descriptors are those of cv::ORB, bit for bit, as
/// it computes them where the processor has FMA (OrbDescription).
class Orb {
 public:
  /// `image`: 8-bit grey, not empty.
  Orb(const cv::Mat& image, const OrbOptions& options);

  /// What cv::ORB::detect finds, in its order, but without angles (-1): level by level, on each the points
  /// with FAST's greatest scores, and of these those with Harris' greatest responses.
  std::vector<cv::KeyPoint> Detect() const;

  /// A descriptor of 32 bytes (CV_8U) for each of some of Detect's points, in any order; sets their angles
  /// [deg].
  cv::Mat Describe(std::vector<cv::KeyPoint>& keypoints) const;

 private:
  struct Level {
    cv::Mat padded;  // the image, mirrored at its rim
    cv::Mat image;   // the part of it without the rim
    float scale = 1;
    int wanted = 0;  // points
  };
  std::vector<cv::KeyPoint> DetectOn(const Level& level) const;

  OrbOptions options_;
  std::vector<Level> levels_;
};

}  // namespace tutti::internal
