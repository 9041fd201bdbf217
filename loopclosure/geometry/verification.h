// Geometric verification: do two images show the same place, and how were the cameras placed?
#pragma once

#include <optional>
#include <vector>

#include "loopclosure/store/packed_mat.h"
#include "tutti/core/camera.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/loopclosure/detector_options.h"
#include "tutti/loopclosure/features.h"

namespace tutti {

/// What is kept of an image for verification: the members' features and the caller's, with 3D points where
/// known.
struct View {
  /// Keypoints further than this from pixel (0, 0), in x or y, are refused as nonsense [px].
  static constexpr float kFarthestPixel = 1e6f;
  /// The features of one source.
  struct Set {
    std::vector<cv::Point2f> pixels;      ///< N [px]
    internal::PackedMat descriptors;      ///< N rows
    std::vector<Eigen::Vector3f> points;  ///< empty, or N points in the camera frame; NaN where unknown
    std::vector<int> numbers;             ///< the caller's number of each, growing; empty: 0 to N - 1

    template <class Archive>
    void State(Archive& archive);
  };
  std::int64_t id = -1;                 ///< of the query that it was made of
  cv::Size size;                        ///< of the image [px]
  std::optional<PinholeCamera> camera;  ///< of the image; none: fundamental matrix
  std::vector<cv::Rect> cameras;        ///< LoopQuery::cameras
  std::vector<Set> members;             ///< one per member
  Set caller;                           ///< the caller's own; may be empty
  bool metric = true;                   ///< 3D points are in metres

  /// For saved detectors and the long-term memory's file.
  template <class Archive>
  void State(Archive& archive);
};

/// The view of a query. Depth at a keypoint is the median of the 3x3 pixels around it; unknown where they
/// disagree by more than 5 % (the edge of an object) or lie outside of the options' range.
View MakeView(const LoopQuery& query, const std::vector<Features>& members,
              const VerificationOptions& options);

/// Verifies one candidate (loop-closure.md section 5). The features of all members and the caller's are
/// matched (ratio test and mutual check) and pooled, one match per place. Then, by what is known:
///  * points in metres in the candidate: PnP by RANSAC, refined on the inliers -> kRigid with information;
///  * camera only, or mono: essential matrix -> kEssential, and where both images have points (mono), Sim(3)
///  by 3D-3D RANSAC ->
///    kSimilarity, if they fit;
///  * no camera: fundamental matrix -> kFundamental.
/// Inliers must be many, a good share of the matches, and spread over both images. Deterministic for options
/// and seed.
class GeometricVerifier {
 public:
  /// `seed`: of RANSAC.
  GeometricVerifier(const VerificationOptions& options, std::uint64_t seed)
      : options_(options), seed_(seed) {}

  /// Says whether both views show the same place, with the relative pose as far as it is known, or why not.
  /// On at most `threads` threads, with the same result for any number.
  Verification Verify(const View& query, const View& candidate, int threads = 1) const;

 private:
  VerificationOptions options_;
  std::uint64_t seed_;
};

}  // namespace tutti
