// What video files and live cameras share: the camera that fits their images, the mask of all images.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "frontend/dataset/video_decoder.h"
#include "frontend/features/rectifier.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// What the container of a video says of its camera: the orientation of its sensor and the shape of its
/// pixels. `name` is what messages call the video, `size` that of its images, turned. Gives the camera of the
/// options as it is for these images: one of a calibration that was made for the sensor's own orientation is
/// turned, one for square pixels is made as wide as the pixels are, one that is known by its field of view
/// (options.fov_deg, of the sensor's own orientation) is made. Adds to `warnings` what it did. Throws
/// InputError for stereo and rolling shutters, whose images can't be turned.
std::optional<PinholeCamera> CameraOfVideo(const std::string& name, const VideoDecoder& video,
                                           const DatasetOptions& options, cv::Size size,
                                           std::vector<std::string>& warnings);

/// options.mask, which must be one for all images, rectified; empty if there is none. Throws InputError.
cv::Mat MaskOfAll(const DatasetOptions& options, cv::Size size, const std::optional<Rectifier>& rectifier);

}  // namespace tutti
