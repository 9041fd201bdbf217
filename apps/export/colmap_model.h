// A map as a sparse model of COLMAP (https://colmap.github.io/format.html), for COLMAP itself and all that
// reads its models, such as trainers of Gaussian splats.
//
// COLMAP's poses are world-to-camera, quaternions w first; camera axes as tutti's (x right, y down, z
// forward). The centre of its top-left pixel is (0.5, 0.5) ("Keypoints and Descriptors" in
// https://colmap.github.io/database.html), tutti's is (0, 0): principal points and pixels get half a pixel.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "apps/export/keyframe_images.h"
#include "apps/export/map_model.h"

namespace tutti {

/// One PINHOLE camera, the chosen keyframes as images, and the landmarks that at least two of them see.
class ColmapModel {
 public:
  /// A point in an image.
  struct Point2D {
    Eigen::Vector2d pixel;  ///< COLMAP's
    std::uint64_t point3d;  ///< id of a Point3D
  };
  struct Image {
    std::uint32_t id;  ///< from 1, in order of time
    std::string name;
    Pose T_camera_world;
    std::vector<Point2D> points;
  };
  /// Point `point` (from 0) of an image.
  struct TrackElement {
    std::uint32_t image;
    std::uint32_t point;
  };
  struct Point3D {
    std::uint64_t id;  ///< the landmark's plus 1
    Eigen::Vector3d position;
    std::array<std::uint8_t, 3> rgb;
    double error_px;  ///< mean distance of its pixels from its projections
    std::vector<TrackElement> track;
  };

  /// `chosen`: indices of the model's keyframes. The two images that come first in the files are those that
  /// are farthest apart along the second one's x axis, of those with at least the median number of points:
  /// COLMAP's bundle adjustment holds the pose of the first and tvec[0] of the second, which is all that
  /// tells it the scale.
  ColmapModel(const MapModel& model, const std::vector<std::size_t>& chosen);

  const PinholeCamera& Camera() const { return camera_; }  ///< with COLMAP's principal point
  const std::vector<Image>& Images() const { return images_; }
  const std::vector<Point3D>& Points() const { return points_; }
  /// Landmarks that fewer than two of the images see.
  std::size_t LeftOut() const { return left_out_; }
  /// Images that see a point, in the mean; 0 without points.
  double MeanTrackLength() const;
  /// Images() in the order of the files, as indices.
  const std::vector<std::size_t>& FileOrder() const { return file_order_; }

  /// Writes cameras, images and points3D, each as .txt and as .bin (the same numbers), into a folder that is
  /// there. Throws InputError if one can't be written in full.
  void Write(const std::filesystem::path& folder) const;

 private:
  void OrderFiles();

  PinholeCamera camera_;
  std::vector<Image> images_;
  std::vector<Point3D> points_;
  std::vector<std::size_t> file_order_;
  std::size_t left_out_ = 0;
};

/// What became of the views of a model.
struct TrackChanges {
  double most_px = 0;       ///< farthest that a view may lie from the projection of its landmark
  std::size_t dropped = 0;  ///< views that lay farther
  std::size_t added = 0;    ///< views that were found in the images
};

/// tutti's map is held by depth, by the weights of its views and by robust losses. A program that gets
/// keyframes and tracks alone, and takes all views for equally good (COLMAP's bundle adjustment), would tear
/// at it. So (1) views are dropped that lie farther from the projection of their landmark than three times
/// the median of these distances (3.5 standard deviations if they are normal), but no less than 0.5 px. And
/// (2) since keyframes lie far apart and corners are not found again in all of them, landmarks are looked for
/// in the images of all `chosen` keyframes (indices of the model's) that should show them: by optical flow
/// (Lucas-Kanade with pyramids), from the view with the most similar line of sight (at most 40 degrees off),
/// with the projection as the start. What lies as near to the projection, and leads back to where it came
/// from within 0.1 px, becomes a view. Poses, positions and ModelLandmark::observations stay as they are.
TrackChanges RefineTracks(const KeyframeImages& images, const std::vector<std::size_t>& chosen,
                          MapModel* model);

}  // namespace tutti
