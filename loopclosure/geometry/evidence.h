// What the inliers of a camera motion are worth as evidence that two images show one place. Internal.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "loopclosure/geometry/verification.h"

namespace tutti::internal {

/// What the matches of two images are held to.
enum class FitModel {
  kFundamental,  ///< a line in the other image; 7 matches give up to 3 of them
  kEssential,    ///< the same from 5 matches, up to 10
  kPnp,          ///< a point in the other image; 3 matches with points give up to 4. Counted by lines all the
                 ///< same: it is the same scene that is to be surprising, whatever is known of its depth
};

/// How many matches would fit a model by chance.
struct ChanceFit {
  double expected = 0;  ///< of these matches, the sample included
  double log_nfa = 0;   ///< log10 of the number of false alarms: of models that as many or more would fit
};

/// The a-contrario model of Moisan & Stival (IJCV 57, 2004): the end of a match lies anywhere in the image,
/// evenly, so that it is within `threshold_px` of a line with probability alpha = 2 d D / A at most (D
/// diagonal, A area). Of n matches that are free to fit k do, beyond the sample
/// of s:
///     NFA = models (n - s) C(n, k) C(k, s) alpha^(k - s)
/// Below 1 (log_nfa < 0) chance hardly explains them. 0 for both without a match or image; log_nfa is 0 where
/// no more than the sample fits.
ChanceFit FitByChance(FitModel model, int matches, int inliers, double threshold_px, const cv::Size& image);

constexpr int kGridColumns = 8, kGridRows = 6;

/// The cell of a grid of 8x6 over the image, row by row; of the nearest for a pixel outside.
int GridCell(const cv::Point2f& pixel, const cv::Size& image);

/// Cells of that grid with at least one of the pixels, 0..48; pixels outside count in the nearest cell.
int OccupiedCells(const std::vector<cv::Point2f>& pixels, const cv::Size& image);

/// Root of the mean squared deviation of the displacements first -> second from their mean, as a share of the
/// diagonal of `image`. 0 if all moved as one.
double MotionSpread(const std::vector<cv::Point2f>& first, const std::vector<cv::Point2f>& second,
                    const cv::Size& image);

/// Standard deviation of the pixels along their narrowest direction, x as a share of the width and y of the
/// height: matches on one line or in one spot fit many camera motions.
double NarrowestSpread(const std::vector<cv::Point2f>& pixels, const cv::Size& image);

/// How wide that has to be for `inliers` in abundance, beyond 1.5 times the `least`: they may lie closer
/// together, down to 0.6 of `spread`.
double SpreadNeeded(double spread, int least, int inliers);

/// True for a match whose ends are less than `static_px` apart: nothing moved there.
bool StaysAtItsPixel(const VerifiedMatch& match, double static_px);

/// Share of the features (of all sets; where the two views differ, of the one with fewer) that lie apart from
/// these matches: in cells of an 8x6 grid over the image that hold none of them, nor do the cells around.
/// Near 0 where the camera stands as it stood: it sees the same everywhere. Large where only a part of the
/// image is the same whatever lies behind it. 0 without features.
double ShareApart(const std::vector<VerifiedMatch>& matches, const View& query, const View& candidate);

}  // namespace tutti::internal
