#include "tutti/frontend/calibration_check.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>

#include "core/numbers.h"
#include "frontend/features/features.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
std::string
Text(const char* format, ...) {
  char text[300];
  std::va_list values;
  va_start(values, format);
  std::vsnprintf(text, sizeof text, format, values);
  va_end(values);
  return text;
}

void CheckLens(const PinholeCamera& c, const CalibrationCheckOptions& options, CalibrationReport& report) {
  const bool wide = c.width >= c.height;
  report.view_deg = 2 * internal::kDegrees * std::atan(wide ? 0.5 * c.width / c.fx : 0.5 * c.height / c.fy);
  report.centre_offset = std::max(std::abs(c.cx / c.width - 0.5), std::abs(c.cy / c.height - 0.5));
  if (report.view_deg < options.min_view_deg || report.view_deg > options.max_view_deg)
    report.findings.push_back(
        {Text("a focal length of %.1f px in an image of %dx%d is a field of view of %.0f deg", c.fx, c.width,
              c.height, report.view_deg),
         "give fx and fy in pixels (not mm), of this very image size"});
  const double aspect = std::max(c.fx / c.fy, c.fy / c.fx);
  if (aspect > options.max_aspect)
    report.findings.push_back({Text("fx = %.1f and fy = %.1f differ by a factor of %.2f", c.fx, c.fy, aspect),
                               "check fx and fy; pixels of cameras are almost square"});
  if (report.centre_offset > options.max_centre_offset)
    report.findings.push_back(
        {Text("the principal point (%.1f, %.1f) lies %.0f %% of the image's side from its middle", c.cx, c.cy,
              100 * report.centre_offset),
         Text("is the calibration of another image size than %dx%d? fx, fy, cx, cy scale with the image",
              c.width, c.height)});
}

struct StereoMatches {
  std::vector<cv::Point2f> left, right;
};

FrameFeatures Corners(const cv::Mat& image) {
  OdometryOptions options;
  options.features = 1000;
  return ExtractOrb(BuildPyramid(image, options), options);
}

// Mutual nearest neighbours, clearly nearer than the second, anywhere in the image.
void AddMatches(const InputFrame& frame, StereoMatches& matches) {
  const FrameFeatures left = Corners(frame.image), right = Corners(frame.right);
  if (left.size() < 2 || right.size() < 2) return;
  const cv::BFMatcher matcher(cv::NORM_HAMMING);
  std::vector<std::vector<cv::DMatch>> forward;
  std::vector<cv::DMatch> backward;
  matcher.knnMatch(left.descriptors, right.descriptors, forward, 2);
  matcher.match(right.descriptors, left.descriptors, backward);
  for (const std::vector<cv::DMatch>& pair : forward) {
    if (pair.size() < 2 || pair[0].distance > 0.8F * pair[1].distance) continue;
    if (backward[static_cast<std::size_t>(pair[0].trainIdx)].trainIdx != pair[0].queryIdx) continue;
    matches.left.push_back(left.keypoints[static_cast<std::size_t>(pair[0].queryIdx)].pt);
    matches.right.push_back(right.keypoints[static_cast<std::size_t>(pair[0].trainIdx)].pt);
  }
}

// Those that agree with one epipolar geometry, whichever it is.
StereoMatches Consistent(const StereoMatches& matches) {
  StereoMatches out;
  if (matches.left.size() < 15) return out;
  cv::setRNGSeed(1);
  std::vector<unsigned char> inlier;
  const cv::Mat f = cv::findFundamentalMat(matches.left, matches.right, cv::FM_RANSAC, 1.5, 0.999, inlier);
  if (f.empty()) return out;
  for (std::size_t i = 0; i < inlier.size(); ++i) {
    if (inlier[i] == 0) continue;
    out.left.push_back(matches.left[i]);
    out.right.push_back(matches.right[i]);
  }
  return out;
}

void CheckStereo(const std::vector<InputFrame>& frames, const CalibrationCheckOptions& options,
                 CalibrationReport& report) {
  StereoMatches all;
  for (const InputFrame& frame : frames) {
    if (!frame.right.empty()) AddMatches(frame, all);
  }
  const StereoMatches matches = Consistent(all);
  report.stereo_matches = static_cast<int>(matches.left.size());
  if (report.stereo_matches < options.min_matches) return;
  std::vector<double> rows;
  int same = 0, ahead = 0, behind = 0;
  for (std::size_t i = 0; i < matches.left.size(); ++i) {
    const double row = std::abs(double(matches.left[i].y) - double(matches.right[i].y));
    rows.push_back(row);
    if (row > options.same_row_px) continue;
    ++same;
    const double disparity = double(matches.left[i].x) - double(matches.right[i].x);
    if (disparity > 1) ++ahead;
    if (disparity < -1) ++behind;
  }
  report.row_error_px = internal::Median(rows);
  report.same_row = static_cast<double>(same) / static_cast<double>(rows.size());
  if (ahead + behind > 0) report.swapped = static_cast<double>(behind) / (ahead + behind);
  if (report.same_row < options.min_same_row) {
    report.findings.push_back(
        {Text("only %.0f %% of %d matches between left and right lie in the same row (median %.1f px apart)",
              100 * report.same_row, report.stereo_matches, report.row_error_px),
         "the pairs are not rectified, or by another calibration: rectify them, or give the right camera "
         "(camera.right, or the sensor.yaml of each in the EuRoC layout)"});
  } else if (report.swapped > 0.6 && behind >= options.min_matches / 2) {
    report.findings.push_back(
        {Text("%.0f %% of the matches lie farther right in the right image than in the left one",
              100 * report.swapped),
         "left and right are swapped: exchange the two folders (or the two sensor.yaml)"});
  }
}

void CheckDepth(const std::vector<InputFrame>& frames, const CalibrationCheckOptions& options,
                CalibrationReport& report) {
  std::vector<double> depths;
  std::size_t pixels = 0;
  for (const InputFrame& frame : frames) {
    for (int v = 0; v < frame.depth_m.rows; v += 4) {
      for (int u = 0; u < frame.depth_m.cols; u += 4, ++pixels) {
        const float z = frame.depth_m.at<float>(v, u);
        if (z > 0) depths.push_back(double(z));
      }
    }
  }
  if (pixels == 0) return;
  report.depth_share = static_cast<double>(depths.size()) / static_cast<double>(pixels);
  report.depth_median_m = internal::Median(depths);
  if (report.depth_share < options.min_depth_share) {
    report.findings.push_back(
        {Text("only %.1f %% of the pixels have a depth that is used", 100 * report.depth_share),
         "check dataset.depth_units_per_m (1000: millimetres, 5000: TUM) and max_depth_m"});
  } else if (report.depth_median_m < options.min_depth_m || report.depth_median_m > options.max_depth_m) {
    report.findings.push_back({Text("the median depth is %.3g m", report.depth_median_m),
                               "check dataset.depth_units_per_m (1000: millimetres, 5000: TUM)"});
  }
}

}  // namespace

std::string CalibrationCheckOptions::Validate() const {
  if (!(min_view_deg > 0 && min_view_deg < max_view_deg && max_view_deg < 180))
    return "the fields of view must be above 0, below 180, and in order";
  if (!(max_aspect >= 1)) return "max_aspect must be at least 1";
  if (!(max_centre_offset > 0)) return "max_centre_offset must be positive";
  if (!(same_row_px > 0 && min_same_row >= 0 && min_same_row <= 1))
    return "same_row_px must be positive, min_same_row 0 to 1";
  if (min_matches < 10) return "min_matches must be at least 10";
  if (!(min_depth_m > 0 && min_depth_m < max_depth_m))
    return "min_depth_m and max_depth_m must be positive and in order";
  if (frames < 1) return "frames must be at least 1";
  return {};
}

CalibrationReport CheckCalibration(const CameraRig& rig, const std::vector<InputFrame>& frames,
                                   const CalibrationCheckOptions& options) {
  const std::string problem = options.Validate();
  if (!problem.empty()) throw InputError("calibration check: " + problem);
  CalibrationReport report;
  if (!rig.calibrated) return report;
  CheckLens(rig.camera, options, report);
  if (rig.sensor == Sensor::kStereo) CheckStereo(frames, options, report);
  if (rig.sensor == Sensor::kRgbd) CheckDepth(frames, options, report);
  return report;
}

CalibrationReport CheckCalibration(const Dataset& dataset, const CalibrationCheckOptions& options) {
  std::vector<InputFrame> frames;
  const bool needed = dataset.Rig().calibrated && dataset.Rig().sensor != Sensor::kMono;
  if (needed && dataset.FrameSupply() == Supply::kStored) {
    const std::size_t among = std::min<std::size_t>(100, dataset.Size());
    for (int i = 0; i < options.frames; ++i) {
      const std::size_t at = among * static_cast<std::size_t>(i) / static_cast<std::size_t>(options.frames);
      ReadResult read = dataset.Read(at);
      if (read.frame && (i == 0 || frames.empty() || frames.back().index != read.frame->index))
        frames.push_back(std::move(*read.frame));
    }
  }
  return CheckCalibration(dataset.Rig(), frames, options);
}

}  // namespace tutti
