// The focal length of a camera that nobody calibrated, from its images.
#pragma once

#include <filesystem>
#include <string>

#include "tutti/core/camera.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/config.h"

namespace tutti {

/// What the first frames of a recording say of its camera.
struct FocalLength {
  bool measured = false;  ///< false: `camera` is as it was
  PinholeCamera camera;   ///< pixels of the given shape; k1 where the lens has one
  double sigma = 0;       ///< standard deviation of the focal length, as share of it
  double lens_sigma = 0;  ///< part of it: by whether the lens has distortion
  int frames = 0;         ///< that were looked at
  double cpu_s = 0;       ///< processor time that it took
  std::string reason;     ///< why it was not measured
};

/// Odometry with the camera of `config` on the first third of the recording (at least 40 frames, at most
/// `frames`), then a bundle adjustment of its keyframes with focal length and principal point free, once with
/// radial distortion free (Brown's model, k1 alone) and once without: the result is in the middle. Both again
/// with it, if it is more than 3 % away. Priors: principal point as it is, give or take 1 % of the width; k1
/// 0, give or take 0.05. `sigma` adds up how much worse the adjusted map fits with another focal length, half
/// of the difference between the two lenses, and what is left of the last move. One camera, or colour and
/// depth, without distortion; it is that of the images as they are stored (without dataset.rotate). The same
/// input gives the same result. Throws InputError if the data set can't be opened.
FocalLength MeasureFocalLength(const std::filesystem::path& dataset, const RunConfig& config,
                               int frames = 300);

/// "focal length measured on 40 frames: 431.7 px, give or take 1.2 %", or what is taken instead and why.
/// `photo_lens`: what the photos say of it (Recording); empty: nothing.
std::string FocalLengthText(const FocalLength& found, const std::string& photo_lens);

/// Makes these bundle adjustments on the map of a run, 40 keyframes in a row where its camera turns most,
/// without tracking anything again. `camera`: the odometry's with another focal length. `lens_sigma`: of what
/// was measured before, if its distortion was taken out of the images.
FocalLength FocalLengthOf(const Odometry& odometry, const FrameRange& session = {}, double lens_sigma = 0);

/// Whether a map agrees with the camera that it was made with.
struct LensCheck {
  bool measured = false;    ///< false: too small a map, or its motion does not tell
  double focal_ratio = 1;   ///< focal length that fits the map best, over the one that it was made with
  double sigma = 0;         ///< standard deviation of its logarithm
  double k1 = 0;            ///< radial distortion that was left over, as of LensFound
  bool other_lens = false;  ///< the map fits clearly better with this k1 than with another focal length alone
};

/// The bundle adjustment of MeasureFocalLength, once, on the keyframes of these frames where the camera turns
/// most: 40 in a row of the piece with most frames, 800 landmarks. Where another focal length alone explains
/// them as well as another distortion, the distortion is as it was calibrated (k1 0, give or take 0.005).
/// Less than a second.
LensCheck CheckLens(const Odometry& odometry, const FrameRange& session = {});

}  // namespace tutti
