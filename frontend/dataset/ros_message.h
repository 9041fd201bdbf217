// Messages of ROS as they lie in bags: sensor_msgs/Image, CompressedImage, CameraInfo, Imu.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "frontend/dataset/camera_info.h"
#include "frontend/dataset/image_file.h"
#include "tutti/core/imu.h"

namespace tutti {

/// How values become bytes: one after the other (ROS 1, wiki.ros.org/msg), or aligned (ROS 2: OMG's CDR, the
/// little-endian one).
enum class Serialization { kRos1, kCdr };

/// "sensor_msgs/Image" of what ROS 2 calls "sensor_msgs/msg/Image".
std::string NameOfType(std::string type);

/// How a message with a std_msgs/Header begins: its number (ROS 2: the kind of serialization), seconds,
/// nanoseconds.
using MessageHead = std::array<std::uint32_t, 3>;
/// Its stamp [s]; nan where it is compressed.
double StampOf(const MessageHead& head);
/// How Zstandard begins.
bool IsPacked(std::string_view bytes);

/// Image or CompressedImage.
bool IsImageMessage(const std::string& type);

/// What an image message holds, or what is wrong with it.
struct MessageImage : ImageFile {
  bool metres = false;  ///< 32FC1, which ROS gives in metres
};
/// `type`: one for which IsImageMessage holds. Never throws; thread-safe.
MessageImage DecodeImageMessage(const std::string& message, const std::string& type,
                                Serialization serialization, Pixels pixels);

/// `source`: for messages. Throws InputError where the message ends early.
CameraInfo DecodeCameraInfo(const std::string& message, Serialization serialization,
                            const std::string& source);

/// Angular velocity and acceleration of sensor_msgs/Imu; the stamp is left at 0. Throws InputError where the
/// message ends early.
ImuSample DecodeImuMessage(const std::string& message, Serialization serialization,
                           const std::string& source);

}  // namespace tutti
