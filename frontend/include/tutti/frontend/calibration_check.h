// Can this calibration be right? Measured on the images themselves.
#pragma once

#include <string>
#include <vector>

#include "tutti/frontend/dataset.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Bounds of what is believed. Generous: a finding is to be taken seriously.
struct CalibrationCheckOptions {
  double min_view_deg = 15;        ///< narrowest field of view along the longer side [deg]
  double max_view_deg = 150;       ///< widest [deg]
  double max_aspect = 1.5;         ///< greatest ratio of fx and fy, either way
  double max_centre_offset = 0.2;  ///< principal point from the middle, as share of width or height
  double same_row_px = 2;          ///< stereo: rows of a match may differ by so much [px]
  double min_same_row = 0.5;       ///< stereo: least share of matches in the same row
  int min_matches = 40;            ///< stereo: fewer say nothing
  double min_depth_m = 0.2;        ///< RGB-D: bounds of the median depth [m]
  double max_depth_m = 40;         ///< [m]
  double min_depth_share = 0.03;   ///< RGB-D: least share of pixels with depth
  int frames = 4;                  ///< looked at, spread over the first 100

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
};

/// What can't be right: measured figure and what to do, one sentence each.
struct CalibrationFinding {
  std::string measured;
  std::string advice;
};

/// What was measured. Zero where the sensor has none.
struct CalibrationReport {
  double view_deg = 0;       ///< field of view of the rectified camera along the longer side [deg]
  double centre_offset = 0;  ///< greater of |cx - w/2| / w and |cy - h/2| / h
  int stereo_matches = 0;    ///< between left and right that agree with one epipolar geometry
  double row_error_px = 0;   ///< median |v_left - v_right| over them [px]
  double same_row = 0;       ///< share of them within same_row_px
  double swapped =
      0;  ///< of those in one row, not at infinity: share that lies farther right in the right image
  double depth_median_m = 0;                 ///< of all pixels with depth [m]
  double depth_share = 0;                    ///< pixels with depth
  std::vector<CalibrationFinding> findings;  ///< empty: nothing speaks against it
};

/// Looks at the rig alone, and for stereo and RGB-D at these frames as well.
CalibrationReport CheckCalibration(const CameraRig& rig, const std::vector<InputFrame>& frames,
                                   const CalibrationCheckOptions& options = {});

/// Checks a data set: reads options.frames of its first 100 frames if it is stored (mono: none). A data
/// set without calibration has no findings.
CalibrationReport CheckCalibration(const Dataset& dataset, const CalibrationCheckOptions& options = {});

}  // namespace tutti
#pragma GCC visibility pop
