// ORB features of one frame, spread over the image, with depth where the sensor gives it.
//
// E. Rublee et al., "ORB: an efficient alternative to SIFT or SURF", ICCV 2011. The corners are spread over
// the image by a grid on each pyramid level; OpenCV's ORB describes them.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "tutti/frontend/frame.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

/// An image and its smaller ones. Those of a saved map are made when they are first asked for: of most maps
/// that are loaded they never are.
class Pyramid {
 public:
  Pyramid() = default;
  /// CV_8UC1; level 0 is the image.
  explicit Pyramid(std::vector<cv::Mat> levels) : levels_(std::move(levels)) {}

  /// Any thread may ask.
  const std::vector<cv::Mat>& Levels() const;
  /// For saved maps; defined in frontend/store/features_state.h.
  template <class Archive>
  void State(Archive& archive);

 private:
  mutable std::once_flag made_;
  mutable std::function<std::vector<cv::Mat>()> make_;  // null: they are there
  mutable std::vector<cv::Mat> levels_;
};

/// The level of a pyramid after `image`.
cv::Mat NextLevel(const cv::Mat& image, const cv::Size& size);
/// Width and height of a level's pixels [px of the whole image]. As the sizes of levels are rounded, these
/// are not quite the scales of the options. Pixel centres have integer coordinates on every level, so that
/// the levels' corners are half a pixel apart: u of a level is (u + 0.5) scale - 0.5 of the whole image.
inline cv::Point2f LevelScale(const cv::Mat& whole, const cv::Mat& level) {
  return {static_cast<float>(whole.cols) / static_cast<float>(level.cols),
          static_cast<float>(whole.rows) / static_cast<float>(level.rows)};
}

/// Number of differing bits of two 256-bit descriptors.
int HammingDistance(const std::uint8_t* a, const std::uint8_t* b);

/// A depth image, and when it was taken.
struct DepthImage {
  cv::Mat metres;            ///< CV_32FC1 [m], 0 = no measurement
  double later_s = 0;        ///< taken so long after the middle row of the colour image [s]
  double max_m = 0;          ///< farther depth is not used; 0 = no limit
  double inverse_sigma = 0;  ///< standard deviation of inverse depth [1/m]

  /// Inverse depth at a pixel [1/m]; 0 where it is not known, negative at an edge: there, what is seen may
  /// belong to either side.
  float InverseAt(int x, int y) const;
};

/// Inverse depth of every step-th pixel.
struct DepthGrid {
  int step = 1;                      ///< [px]; the first is in row and column step / 2
  int columns = 0;                   ///< of one row
  std::vector<float> inverse_depth;  ///< row by row [1/m]; 0 where it is not known, negative beside an edge

  int Rows() const { return static_cast<int>(inverse_depth.size()) / std::max(1, columns); }
  float At(int row, int column) const {
    return inverse_depth[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                         static_cast<std::size_t>(column)];
  }
  Eigen::Vector2d PixelOf(int row, int column) const {
    return {step / 2 + column * step, step / 2 + row * step};
  }
  /// The element nearest to a pixel, without its sign.
  float Near(const Eigen::Vector2d& pixel) const {
    const int first = step / 2;
    const auto nearest = [&](double at, int count) {
      return std::clamp(static_cast<int>(std::lround((at - first) / step)), 0, count - 1);
    };
    return std::abs(At(nearest(pixel.y(), Rows()), nearest(pixel.x(), columns)));
  }
};

/// Features of one rectified frame. N features.
struct FrameFeatures {
  std::vector<cv::KeyPoint> keypoints;             ///< N, level-0 pixels, with octave and angle [deg]
  cv::Mat descriptors;                             ///< N x 32, CV_8U
  std::vector<float> inverse_depth;                ///< N [1/m]; 0 where unknown
  std::vector<float> inverse_depth_sigma;          ///< N, standard deviation of inverse_depth [1/m]
  Eigen::Vector2d lens = Eigen::Vector2d::Zero();  ///< correction of the lens in the keypoints (LensError)
  bool other_camera = false;  ///< in the pixels of the map's camera, but another one took it (CarryOver)
  std::vector<cv::Point2f> rolled;  ///< N, what RollingShutter moved the keypoints by [px]; empty: nothing
  std::vector<int> aligned;         ///< N, landmark whose patch the position was aligned with, or -1
  std::shared_ptr<const Pyramid> pyramid;  ///< of the (left) image; null where it is not needed any more
  /// RGB-D: the depth image in short, for ImageAligner; null where it is not needed any more.
  std::shared_ptr<const DepthGrid> depth_grid;
  /// RGB-D, taken at another time than the rows of the image: until RollingShutter looks up where its
  /// features were then; else null, as in saved maps.
  std::shared_ptr<const DepthImage> depth_image;
  double depth_later_s = 0;  ///< InputFrame::depth_later_s; 0 in saved maps
  bool has_depth = false;    ///< the frame came with a depth or right image
  double row_error_px = 0;   ///< stereo: median absolute row difference of the matches [px]
  int stereo_matches = 0;    ///< stereo: features with a match in the right image

  /// Indices of the features within `radius` [px] of `centre`, in octaves first..last, cell by
  /// cell of the grid.
  void InArea(const cv::Point2f& centre, float radius, int first_octave, int last_octave,
              std::vector<int>* out) const;
  /// Calls visit(pixel, octave, index) for each of them.
  template <class Visit>
  void ForEachInArea(const cv::Point2f& centre, float radius, int first_octave, int last_octave,
                     const Visit& visit) const;
  /// Fills the grid that InArea uses; call after the keypoints are set.
  void BuildGrid(int width, int height);
  /// Everything, for saved maps; defined in frontend/store/features_state.h.
  template <class Archive>
  void State(Archive& archive);
  std::size_t size() const { return keypoints.size(); }
  /// What was added to a keypoint because its row was read at another time than the middle one [px].
  Eigen::Vector2d Rolled(std::size_t f) const {
    return rolled.empty() ? Eigen::Vector2d(0, 0) : Eigen::Vector2d(rolled[f].x, rolled[f].y);
  }
  const std::uint8_t* Descriptor(int i) const { return descriptors.ptr<std::uint8_t>(i); }

 private:
  static constexpr int kCell = 24;  // [px]
  void FillGrid();
  struct Entry {  // what InArea asks of a feature, side by side in memory
    cv::Point2f pixel;
    int octave = 0, feature = 0;
  };
  int columns_ = 0, rows_ = 0;
  std::vector<Entry> entries_;    // cell by cell, rows of cells first; ascending within a cell
  std::vector<int> first_entry_;  // of each cell, and the number of entries at the end
};

template <class Visit>
void FrameFeatures::ForEachInArea(const cv::Point2f& centre, float radius, int first_octave, int last_octave,
                                  const Visit& visit) const {
  if (entries_.empty()) return;
  const int c0 = std::max(0, cvFloor((centre.x - radius) / kCell));
  const int c1 = std::min(columns_ - 1, cvFloor((centre.x + radius) / kCell));
  const int r0 = std::max(0, cvFloor((centre.y - radius) / kCell));
  const int r1 = std::min(rows_ - 1, cvFloor((centre.y + radius) / kCell));
  if (c0 > c1) return;
  for (int r = r0; r <= r1; ++r) {
    // The cells of a row lie one after the other.
    const int row = r * columns_, past = row + c1 + 1, first = row + c0;
    const int begin = first_entry_[static_cast<std::size_t>(first)],
              end = first_entry_[static_cast<std::size_t>(past)];
    for (int e = begin; e < end; ++e) {
      const Entry& entry = entries_[static_cast<std::size_t>(e)];
      // One branch, which is mostly not taken: a processor guesses wrong at each of several.
      const int inside = static_cast<int>(entry.octave >= first_octave) &
                         static_cast<int>(entry.octave <= last_octave) &
                         static_cast<int>(std::abs(entry.pixel.x - centre.x) <= radius) &
                         static_cast<int>(std::abs(entry.pixel.y - centre.y) <= radius);
      if (inside != 0) visit(entry.pixel, entry.octave, entry.feature);
    }
  }
}

/// A copy that holds no images.
std::shared_ptr<const FrameFeatures> WithoutImages(const FrameFeatures& features);

/// Scale of each pyramid level: level 0 has 1, level l scale_factor^l.
std::vector<float> PyramidScales(const OdometryOptions& options);

/// Image pyramid; level l is smaller by scale_factor^l.
std::vector<cv::Mat> BuildPyramid(const cv::Mat& image, const OdometryOptions& options);

/// Two thresholds, and how many corners to keep.
struct CornerOptions {
  int wanted = 0;
  int threshold = 0;      ///< of corners, where there are any
  int threshold_min = 0;  ///< in cells of the grid that have none; at most `threshold`
  int border = 0;         ///< [px] no corner lies nearer to the image's rim; at least 3
};

/// FAST corners of an 8-bit grey image at whole pixels, with FAST's score as response (E. Rosten, T.
/// Drummond, "Machine learning for high-speed corner detection", ECCV 2006; OpenCV's). If there are more than
/// wanted, then round by round the strongest that is left in each cell of a grid, and in the order of their
/// strength; corners below the upper threshold count only where a cell has nothing better, so that weak
/// texture is covered without crowding out strong corners. An image that is smaller than its borders has
/// none, and neither has a place where `mask` (CV_8UC1, as large as the image; empty: nowhere) is 0.
std::vector<cv::KeyPoint> DetectCorners(const cv::Mat& image, const CornerOptions& options,
                                        const cv::Mat& mask = {});

/// Detects and describes features of one 8-bit grey image; no depth. Blank or tiny images give none. No
/// feature's pixel, rounded, is one where `mask` (CV_8UC1, as large as level 0; empty: nowhere) is 0.
FrameFeatures ExtractOrb(const std::vector<cv::Mat>& pyramid, const OdometryOptions& options,
                         const cv::Mat& mask = {});

/// Finds each left feature of a rectified pair in the right image: best descriptor along its row, then the
/// disparity at the keypoint by a least-squares fit of a slanted surface on the feature's pyramid level.
/// Fills inverse_depth, its sigma, row_error_px and stereo_matches.
void MatchStereo(const std::vector<cv::Mat>& left_pyramid, const std::vector<cv::Mat>& right_pyramid,
                 const FrameFeatures& right, const CameraRig& rig, const OdometryOptions& options,
                 FrameFeatures* left);

/// Everything for one frame of the rig: features of the (left) image, and depth from the depth image or from
/// the right image (descriptor search along the row, then a least-squares fit). Pure: may run on any thread.
FrameFeatures ExtractFeatures(const InputFrame& frame, const CameraRig& rig, const OdometryOptions& options);

}  // namespace tutti
