// Videos through the libraries of FFmpeg: the frames of a container, and the times at which it shows them.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "frontend/dataset/image_file.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// A video that is decoded from its beginning on, frame by frame. Not OpenCV's reader: before 4.7 that has no
/// times for the last frames, and no 16-bit pixels.
class VideoDecoder {
 public:
  /// `source`: a file, a pipe that has a name, "-" (standard input), or the address of a stream (rtsp://,
  /// http://). Throws InputError that names the source and says what to do.
  explicit VideoDecoder(const std::string& source);
  ~VideoDecoder();
  VideoDecoder(VideoDecoder&&) noexcept;
  VideoDecoder& operator=(VideoDecoder&&) noexcept;

  /// Decodes the next frame; false at the end. What is damaged is skipped.
  bool Grab();
  /// When the frame that was grabbed last is to be shown, in ticks of the container; nothing: it says no
  /// time.
  std::optional<std::int64_t> Ticks() const;
  /// So many ticks in seconds.
  double Seconds(std::int64_t ticks) const;
  /// The pixels of the frame that was grabbed last, turned as the container says (TurnedBy); empty if they
  /// can't be had: with kStored all but 8 and 16-bit grey.
  cv::Mat Retrieve(Pixels pixels) const;

  /// Mean frame rate that the container states [1/s]; 0: it does not.
  double RateHz() const;
  /// Clockwise angle by which the images are turned to be upright: 0, 90, 180 or 270 [deg] (phones).
  int TurnedBy() const;
  /// Width of a pixel over its height, as the images are stored (before they are turned).
  double PixelAspect() const;

  /// What the container alone says of its frames, in ticks; consumes the video. Throws InputError where the
  /// times jump back.
  struct Listed {
    std::vector<std::int64_t> shown;    ///< sorted; empty if that does not suffice (no times, interlaced
                                        ///< frames in two parts) and all must be decoded
    std::vector<std::int64_t> decoded;  ///< when each is to be decoded; empty if it does not say so of all
  };
  Listed List();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// What the container of a video says of its camera: the orientation of its sensor and the shape of its
/// pixels. `name` is what messages call the video, `size` that of its images, turned. Gives the camera of the
/// options as it is for these images: one of a calibration that was made for the sensor's own orientation is
/// turned, one for square pixels is made as wide as the pixels are, one that is known by its field of view
/// (options.fov_deg, of the sensor's own orientation) is made. Adds to `warnings` what it did. Throws
/// InputError for stereo and rolling shutters, whose images can't be turned.
std::optional<PinholeCamera> CameraOfVideo(const std::string& name, const VideoDecoder& video,
                                           const DatasetOptions& options, cv::Size size,
                                           std::vector<std::string>& warnings);

/// What a message about times that jump back says, the same of every kind of recording. `before_s` and
/// `stamp_s`: of image number `at` and of the one before it [s].
std::string StampsJumpBack(const std::string& name, std::size_t at, double before_s, double stamp_s);

}  // namespace tutti
