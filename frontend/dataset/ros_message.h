// Messages of ROS 1 as they lie in bags (wiki.ros.org/msg): sensor_msgs/Image, CompressedImage, CameraInfo.
#pragma once

#include <optional>
#include <string>

#include "frontend/dataset/image_file.h"
#include "tutti/core/camera.h"

namespace tutti {

/// Image or CompressedImage.
bool IsImageMessage(const std::string& type);

/// What an image message holds, or what is wrong with it.
struct MessageImage : ImageFile {
  bool metres = false;  ///< 32FC1, which ROS gives in metres
};
/// Pixels as stored if `depth`, else in grey, 8 or 16 bit. `type`: one for which IsImageMessage holds. Never
/// throws; thread-safe.
MessageImage DecodeImageMessage(const std::string& message, const std::string& type, bool depth);

/// The camera of a CameraInfo; nothing where it says that it is not calibrated (K[0] = 0). `source`: for
/// messages. Throws InputError for a distortion that tutti does not know, and where the message ends early.
std::optional<PinholeCamera> CameraOfMessage(const std::string& message, const std::string& source);

}  // namespace tutti
