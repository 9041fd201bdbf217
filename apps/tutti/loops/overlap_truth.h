// Ground truth by overlap: which images show the same place, by poses and depth of their data set.
#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "apps/tutti/loops/loops_input.h"

namespace tutti::cli {

/// The depth images that belong to images. Thread-safe.
class DepthImages {
 public:
  /// `images`: all of a folder or recording, at `path`; `stamps`: theirs [s], empty: those that they are
  /// named by. Without DepthArguments::dataset the data set around `path` has them. Throws InputError, which
  /// says what to do, where there is no depth, no camera, or an image has no frame in that data set.
  DepthImages(const DepthArguments& arguments, const std::filesystem::path& path,
              const std::vector<std::filesystem::path>& images, const std::vector<double>& stamps);

  /// Depth of an image [m], as Dataset::Read gives it; empty where there is none.
  cv::Mat Depth(std::size_t image) const;
  /// The image itself, in colour, rectified as the depth is.
  cv::Mat Colour(std::size_t image) const;
  const PinholeCamera& camera() const;
  /// Of the camera in the frame that poses are of.
  const Pose& T_body_camera() const;
  /// Where the depth is.
  const std::filesystem::path& folder() const { return folder_; }

 private:
  void FindFrames(const std::vector<std::filesystem::path>& images, const std::vector<double>& stamps);

  std::filesystem::path folder_;
  std::shared_ptr<const Dataset> dataset_;
  std::vector<std::size_t> frames_;  // of the data set, by image
};

/// Labels of every stride-th image by overlap. `poses`: of all images. Throws InputError where no image has
/// both a pose and depth.
LoopGroundTruth TruthByOverlap(const GroundTruthArguments& arguments, const PosesOfImages& poses,
                               const DepthImages& depth);

}  // namespace tutti::cli
