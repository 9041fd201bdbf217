#include "frontend/dataset/video_input.h"

#include <algorithm>
#include <cmath>

#include "frontend/dataset/image_mask.h"
#include "frontend/dataset/rectified_rig.h"
#include "frontend/dataset/turned_dataset.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

// How far the principal point is from the middle of images of this size, as share of their sides.
double OffCentre(const PinholeCamera& camera, cv::Size size) {
  return std::max(std::abs((camera.cx + 0.5) / size.width - 0.5),
                  std::abs((camera.cy + 0.5) / size.height - 0.5));
}

// Whether the camera is that of the sensor's `own` orientation, and not of the images that are `turned`. One
// that has the size of its images from these, or none, is told by its principal point.
bool IsOfSensor(const PinholeCamera& camera, cv::Size own, cv::Size turned) {
  const cv::Size size(camera.width, camera.height);
  if (size != own && size != turned && size != cv::Size()) return false;  // of neither, which is said later
  if (own == turned || size == own) return true;
  return OffCentre(camera, turned) > 0.1 && OffCentre(camera, own) < OffCentre(camera, turned);
}

// The same camera with pixels that are so many times as wide.
PinholeCamera Widened(PinholeCamera camera, double aspect, int width) {
  camera.fx /= aspect;
  camera.cx = (camera.cx + 0.5) / aspect - 0.5;
  camera.width = width;
  return camera;
}

}  // namespace

std::optional<PinholeCamera> CameraOfVideo(const std::string& name, const VideoDecoder& video,
                                           const DatasetOptions& options, cv::Size size,
                                           std::vector<std::string>& warnings) {
  const int degrees = video.TurnedBy();
  const double aspect = video.PixelAspect();
  const bool quarter = degrees % 180 != 0;
  const cv::Size own = quarter ? cv::Size(size.height, size.width) : size;
  const int square_width = static_cast<int>(std::lround(own.width * aspect));
  if (degrees != 0 && options.sensor != Sensor::kMono)
    throw InputError(name + ": its rotation flag says " + std::to_string(degrees) +
                     " deg, and images of two cameras can't be turned; remove the flag (ffmpeg -i INPUT -c "
                     "copy -metadata:s:v rotate=0 OUTPUT), or use one camera (sensor mono)");
  if (degrees != 0 && options.readout_s > 0)
    throw InputError(name + ": its rotation flag says " + std::to_string(degrees) +
                     " deg, and images of a rolling shutter can't be turned: its rows would become columns, "
                     "or run upwards; leave readout_s 0");
  std::optional<PinholeCamera> camera = options.camera;
  std::string pixels = name + ": its pixels are " + std::to_string(aspect) + " times as wide as high";
  if (!camera && options.fov_deg > 0) {
    camera = CameraOfView(options.fov_deg, own);
    camera->fy *= aspect;
  } else if (camera && aspect != 1) {
    const bool square = cv::Size(camera->width, camera->height) == cv::Size(square_width, own.height);
    if (square) camera = Widened(*camera, aspect, own.width);
    pixels += square ? "; the calibration, of square ones, is made that of " + SizeText(own)
                     : "; the calibration must be of images as they are stored, " + SizeText(own);
  }
  if (aspect != 1) warnings.push_back(pixels);
  if (degrees == 0) return camera;
  std::string turned = name + ": its rotation flag says " + std::to_string(degrees) +
                       " deg: the images are turned clockwise by that, to " + SizeText(size);
  if (camera && IsOfSensor(*camera, own, size)) {
    camera->width = own.width;
    camera->height = own.height;
    camera = TurnedCamera(*camera, degrees);
    turned += ", and with them the camera, as one of the sensor's own orientation (" + SizeText(own) + ")";
  }
  warnings.push_back(turned);
  return camera;
}

cv::Mat MaskOfAll(const DatasetOptions& options, cv::Size size, const std::optional<Rectifier>& rectifier) {
  if (options.mask.empty()) return {};
  const cv::Mat mask = ImageMasks(options.mask).OfAll(size);
  return rectifier ? rectifier->Apply(mask, Sampling::kNearest) : mask;
}

}  // namespace tutti
