// What a recording is, from what lies in its folder: `tutti run DIR` needs no configuration.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tutti/frontend/frame.h"
#include "tutti/slam/config.h"

namespace tutti {

/// What the command line says of the camera. At most one of calibration, camera and view_deg.
struct CameraRequest {
  std::optional<std::filesystem::path> calibration;  ///< a file for ReadCalibration
  std::string camera;                                ///< "fx,fy,cx,cy[,k1,k2,p1,p2[,k3]]" [px]; empty: not
  std::optional<double> view_deg;                    ///< horizontal field of view [deg]
  std::optional<Sensor> sensor;                      ///< instead of what the folder suggests
  double depth_units_per_m = 0;                      ///< instead of the layout's; 0: not said

  /// Says anything of the lens?
  bool HasLens() const { return calibration || !camera.empty() || view_deg; }
};

/// How a recording will be read.
struct Recording {
  RunConfig config;
  /// What was found: layout, sensor, camera, a line each, with what to pass for another choice.
  std::vector<std::string> findings;
  bool guessed_lens = false;  ///< nothing says what the focal length is: config has a usual one, or a photo's
  std::string photo_lens;     ///< what the photos say of it ("32 mm (EXIF) = 591.7 px"); empty: nothing
};

/// A config.yaml of tutti in the folder counts first. Else: layout from the folder's content; sensor from the
/// cameras that have images; calibration from `camera`, else from the data set's own files, else from a
/// calibration file in the folder, else the one that is published for a folder of that name (TUM's freiburg1
/// to 3), else guessed, from what the photos say (EXIF) if they do. Cameras (camera:0), streams and videos
/// too. Throws InputError for a missing or empty folder,
/// and for a calibration that can't be used.
Recording Recognise(const std::filesystem::path& dataset, const CameraRequest& camera);

/// Sets the camera that the command line names, in a configuration from elsewhere. Throws InputError as
/// Recognise does.
void SetCamera(const std::filesystem::path& dataset, const CameraRequest& camera, RunConfig& config);

/// The focal length that a photo names.
struct PhotoLens {
  double focal_px = 0;  ///< of the image as it is now
  std::string text;     ///< "32 mm (EXIF) = 591.7 px"
};

/// From FocalLengthIn35mmFilm, by the image's diagonal; else from FocalLength and FocalPlaneXResolution, by
/// the width that the photo was taken with. None where the file has neither, or figures that no lens has, and
/// without libexif. Never throws.
std::optional<PhotoLens> ReadPhotoLens(const std::filesystem::path& file, int width, int height);

/// Has the file EXIF that this tutti can't read, because it was built without libexif?
bool HasUnreadLens(const std::filesystem::path& file);

}  // namespace tutti
