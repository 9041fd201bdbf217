// A way that is given, in the stead of the world's own: poses of a body, and the cameras on it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "data/synthetic/pose_spline.h"
#include "data/synthetic/rasterizer.h"
#include "data/synthetic/synthetic_world.h"
#include "tutti/core/camera.h"

namespace tutti::synthetic {

/// A camera on the body, with its lens.
struct MountedCamera {
  PinholeCamera camera;
  Pose T_body_camera;
};

/// EuRoC's cam0 and cam1, as their sensor.yaml have them.
std::vector<MountedCamera> EurocCameras();

/// Immutable.
struct GivenPath {
  PoseSpline spline;                   ///< T_world_body; world z is up
  std::vector<double> stamps_s;        ///< of the frames
  std::vector<MountedCamera> cameras;  ///< left and right, or one
};

/// Stamps of the frames of a path: those of its poses, or with a rate so many a second. Throws InputError for
/// poses that come more often than 60 times a second, without a rate.
std::vector<double> FrameStamps(const Trajectory& poses, double rate_hz);

/// What a camera with a lens sees: a plain camera's image that covers it, bent. Immutable.
class Lens {
 public:
  /// `supersample`: samples per pixel and axis.
  Lens(const PinholeCamera& camera, int supersample);
  Rendering See(const std::vector<Face>& faces, const std::vector<Texture>& textures,
                const Pose& T_world_camera, const Light& light) const;

 private:
  PinholeCamera camera_, plain_;
  int supersample_;
  cv::Mat samples_, centres_;  // CV_32FC2: where they are in the plain image; empty without distortion
};

// As a data set in EuRoC's layout (euroc_files.cc): mav0/cam0 and cam1 (data, data.csv, sensor.yaml), depth0
// for RGB-D (16 bit), state_groundtruth_estimate0.

/// Folders of images, under the data set's.
std::vector<std::string> EurocImageFolders(SyntheticSensor sensor);
/// Name of the images of a time: "1403715524912142992.png".
std::string EurocName(double stamp_s);
/// data.csv of each camera, sensor.yaml, and the poses of the body, of the first so many frames. Throws
/// InputError.
void WriteEurocLists(const SyntheticWorld& world, std::size_t frames, const std::filesystem::path& folder);

}  // namespace tutti::synthetic
