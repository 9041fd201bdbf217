// One of the cameras behind "camera:": a V4L2 device, a stream, or a file in its stead.
#pragma once

#include <cmath>
#include <filesystem>
#include <opencv2/videoio.hpp>
#include <optional>
#include <string>
#include <vector>

#include "frontend/dataset/video_decoder.h"

namespace tutti {

/// What the images of a camera are.
enum class CameraContent {
  kGrey,   ///< colour or grey, taken as CV_8UC1
  kDepth,  ///< as stored, CV_16UC1 (of a folder of images also CV_32FC1)
};

/// What a device is asked for; 0: its own choice.
struct DeviceMode {
  int width = 0, height = 0;  ///< [px]
  double rate_hz = 0;         ///< [1/s]
};

/// A camera that is open. Grabbing and decoding are two steps, so that two cameras can be grabbed together.
class CameraInput {
 public:
  /// `source`: the number of a device, the address of a stream, a video file, or a pipe; of depth a folder of
  /// images, too. `name` is what messages call the whole. Throws InputError that names the source, also where
  /// a file's time stamps jump back.
  CameraInput(const std::string& name, const std::string& source, CameraContent content,
              const DeviceMode& mode);

  /// Takes the next image; false at the end, or if the device gives none.
  bool Grab();
  /// The image that was grabbed last; returns what is wrong with it, or nothing.
  std::string Retrieve(cv::Mat& image);
  /// Frames a second; 0: not known.
  double RateHz() const { return video_ ? video_->RateHz() : capture_.get(cv::CAP_PROP_FPS); }
  /// When the image that was grabbed last was taken [s], by the clock of all V4L2 devices; of a video from
  /// its first frame on. 0: not known.
  double TakenAt() const;
  /// Null: a device, or a folder.
  const VideoDecoder* Video() const { return video_ ? &*video_ : nullptr; }
  const std::string& Source() const { return source_; }

 private:
  void OpenDevice(const std::string& name, const DeviceMode& mode);
  cv::Mat PixelsOfLast();

  std::string source_;  // as messages name it: "/dev/video0", or the file
  CameraContent content_;
  bool device_ = false;
  cv::VideoCapture capture_;           // of a device
  std::optional<VideoDecoder> video_;  // of what is none
  std::optional<std::int64_t> first_ticks_;
  std::vector<std::filesystem::path> files_;  // of a folder of depth images
  std::size_t next_file_ = 0;
};

/// What GrabTogether() got.
struct GrabbedPair {
  bool first = false, second = false;  ///< there is an image
  double first_s = 0;                  ///< `seconds()` when the first one's image had come
};

/// Grabs images of two cameras that were taken as simultaneously as can be. Two devices that run freely keep
/// images in queues, and the one that fell behind has older ones: it is grabbed again until the times that
/// the devices say are less than half a period [s] apart, or it is no longer the older one. `seconds` reads a
/// clock [s]. Input: CameraInput, or what has its Grab() and TakenAt().
template <class Input, class Clock>
GrabbedPair GrabTogether(Input& first, Input& second, double period_s, const Clock& seconds) {
  GrabbedPair got;
  got.first = first.Grab();
  got.first_s = seconds();
  got.second = got.first && second.Grab();
  const auto lead = [&] {  // how much later the first was taken
    const double a = first.TakenAt(), b = second.TakenAt();
    return got.first && got.second && a > 0 && b > 0 ? a - b : 0.0;
  };
  constexpr int kLongestQueue = 32;
  const double begin = lead();
  for (int i = 0; i < kLongestQueue && std::abs(lead()) > 0.5 * period_s && lead() * begin > 0; ++i) {
    if (begin > 0) {
      got.second = second.Grab();
    } else {
      got.first = first.Grab();
      got.first_s = seconds();
    }
  }
  return got;
}

}  // namespace tutti
