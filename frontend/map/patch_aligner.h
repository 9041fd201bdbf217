// Sub-pixel position of a landmark in an image: its patch from the keyframe that made it, warped into the new
// view, is shifted until the grey values agree.
//
// S. Baker and I. Matthews, "Lucas-Kanade 20 years on", IJCV 2004 (inverse compositional), with gain and
// offset of the brightness. A detected corner is known to about a pixel of its pyramid level, and what it is
// a corner of changes with the level: without this the noise and the bias of corners are most of the drift.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "frontend/features/features.h"
#include "tutti/frontend/map.h"

namespace tutti {

/// Cuts the patch around a feature out of its frame's pyramid; null where it would reach beyond the image or
/// the frame has no pyramid.
std::shared_ptr<const Patch> CutPatch(const PinholeCamera& camera, const FrameFeatures& features,
                                      int feature);

/// Position [px, level 0] of `patch` in a frame. `A_frame_patch`: how offsets in the patch's keyframe map to
/// offsets in the frame, in pixels of level 0. `start`: where the frame has the feature [px, level 0]. None
/// if the patch does not look alike there, or is found elsewhere.
std::optional<Eigen::Vector2d> AlignPatch(const Patch& patch, const FrameFeatures& frame,
                                          const Eigen::Matrix2d& A_frame_patch, const Eigen::Vector2d& start);

/// Pixel of frame b at which the patch around a feature of frame a is seen, without the lens's error that is
/// known; near b's feature. `in_a`: about where the point is [a's camera frame]. None if they do not look
/// alike, or one of the frames has no pyramid any more.
std::optional<Eigen::Vector2d> FindPoint(const PinholeCamera& camera, const FrameFeatures& a, int feature_a,
                                         const FrameFeatures& b, int feature_b, const Pose& T_b_a,
                                         const Eigen::Vector3d& in_a);

/// A landmark's patch, found in a frame.
struct PatchView {
  int landmark = -1;
  Eigen::Vector2d pixel;  ///< where it is seen, without the lens's error that is known [px, level 0]
  double scale = 1;       ///< level-0 pixels per pixel of the patch there
};

/// Looks for landmarks where a pose says that they are, whatever corners the frame has: the patches of those
/// that are alike there, within a few pixels of their level. `T_camera_world`: of the frame. Nothing is found
/// without an image, or in features that a rolling shutter moved.
std::vector<PatchView> FindPatches(const Map& map, const PinholeCamera& camera, const Pose& T_camera_world,
                                   const std::vector<int>& landmarks, const FrameFeatures& features);

/// Finds landmarks precisely in a frame whose pose is about known: for each feature with a landmark (-1:
/// none) moves the keypoint. `T_camera_world`: of the frame. Returns the moved features, or null where
/// nothing moved.
std::shared_ptr<const FrameFeatures> AlignFeatures(const Map& map, const PinholeCamera& camera,
                                                   const Pose& T_camera_world,
                                                   const std::vector<int>& landmarks,
                                                   const FrameFeatures& features);

}  // namespace tutti
