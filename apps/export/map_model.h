// What an export needs of a map, as plain values: everything after the last correction.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/core/camera.h"
#include "tutti/core/pose.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

/// A keyframe and what it sees.
struct ModelKeyframe {
  int id = -1;
  std::int64_t frame_index = 0;  ///< number in the map (MapSession::frame_offset)
  double stamp_s = 0;
  Pose T_world_camera;  ///< camera: x right, y down, z forward
  /// They see MapModel::landmarks, in the order of the features; the centre of the top-left pixel is (0, 0).
  std::vector<SeenLandmark> views;
};

/// A point of the map.
struct ModelLandmark {
  int id = -1;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();   ///< in the world [m]
  int observations = 0;                                 ///< keyframes of the model that see it
  std::array<std::uint8_t, 3> rgb = {{128, 128, 128}};  ///< grey until LookAtImages has seen it
};

/// The largest piece of a map. World: the camera of its first keyframe, as it was first (x right, y down, z
/// forward); lengths in metres, with one camera in units of the initial map.
struct MapModel {
  PinholeCamera camera;  ///< of the rectified images: no distortion
  /// One camera: k1, k2 of the distortion that self-calibration found in the rectified images and took out of
  /// the pixels of all views (LensFound); 0 where there is none.
  Eigen::Vector2d lens = Eigen::Vector2d::Zero();
  std::vector<ModelKeyframe> keyframes;  ///< ascending ids
  std::vector<ModelLandmark> landmarks;  ///< ascending ids; each is seen by one keyframe at least
  PoseGraph graph;                       ///< S_world_camera of all keyframes
  Trajectory trajectory;                 ///< T_world_body of frames that have a pose, ascending stamps
  std::int64_t image_offset = 0;  ///< number in the map of the data set's frame 0 (MapSession::frame_offset)
  std::size_t other_keyframes = 0;  ///< of other pieces, which are left out
};

/// The model of a map. Landmarks that are gone or not finite are left out, and so are views from behind.
/// `frames`: of the trajectory. Throws InputError if no frame has a pose.
MapModel ModelOf(const Odometry& odometry, const PoseGraph& graph, const FrameRange& frames = {});

/// "frame_000042.png": the frame's number in its data set, so that names of exported images sort by time.
std::string ImageName(std::int64_t frame_index);

}  // namespace tutti
