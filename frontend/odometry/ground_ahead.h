// Pieces of the ground that were measured from a distance, until the camera is above them.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "tutti/core/pose.h"

namespace tutti {

/// Value type. A plane that is seen some heights ahead says best how high the ground is there, and not below
/// the camera: a road that bends up or down by little, or an error of the plane's slope, is then much of the
/// height. So the height is told where it is known, when the camera comes by.
class GroundAhead {
 public:
  struct Height {
    double log_height = 0;  ///< logarithm of the camera's height above the plane [map units]
    double way = 0;         ///< as given to Add
  };

  /// `plane`: n / h of the ground as a camera sees it, whose points X have n . X = h; `T_camera_first`: the
  /// camera now, from that one; `way`: between the two images that told the plane [heights].
  void Add(const Eigen::Vector3d& plane, const Pose& T_camera_first, double way);
  /// The camera has gone on by `step` (T_now_last). What it is above now is told, and dropped; what it passes
  /// by, in a turn, is dropped.
  std::vector<Height> Approach(const Pose& step);
  /// The map around the camera was made larger by this factor.
  void Scale(double scale);
  std::size_t size() const { return pieces_.size(); }
  /// False: not what a file can have kept of one.
  bool IsPossible() const;

  template <class Archive>
  void State(Archive& archive) {
    archive(pieces_);
  }

 private:
  struct Piece {
    Eigen::Vector3d plane = Eigen::Vector3d::Zero();
    Pose T_camera_first;
    double way = 0;

    template <class Archive>
    void State(Archive& archive) {
      archive(plane, T_camera_first, way);
    }
  };
  std::vector<Piece> pieces_;  // the newest last
};

}  // namespace tutti
