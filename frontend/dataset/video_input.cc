#include "frontend/dataset/video_input.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio/registry.hpp>

#include "frontend/dataset/image_mask.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

// FFmpeg and OpenCV's own motion JPEG; GStreamer only where OpenCV was built without FFmpeg.
std::vector<int> Backends() {
  const std::vector<cv::VideoCaptureAPIs> known = cv::videoio_registry::getBackends();
  const bool ffmpeg = std::find(known.begin(), known.end(), cv::CAP_FFMPEG) != known.end();
  return {ffmpeg ? cv::CAP_FFMPEG : cv::CAP_GSTREAMER, cv::CAP_OPENCV_MJPEG};
}

}  // namespace

void OpenVideoFile(const std::filesystem::path& file, cv::VideoCapture& capture) {
  // Not CAP_ANY: it tries every backend, and each reports its failure at length on stderr.
  for (const int backend : Backends()) {
    try {
      if (capture.open(file.string(), backend)) return;
    } catch (const cv::Exception&) {  // the next one may do
    }
  }
  throw InputError(file.string() +
                   ": can't be opened as a video; is it complete and of a format that OpenCV decodes?");
}

void OpenVideoStream(const std::string& address, cv::VideoCapture& capture) {
  try {
    if (capture.open(address, Backends().front())) return;
  } catch (const cv::Exception&) {  // said below
  }
  throw InputError(address +
                   ": no stream of video can be opened there; check the address, the network, and whether a "
                   "video player shows it");
}

bool ReadGreyFrame(cv::VideoCapture& capture, cv::Mat& grey) {
  return capture.grab() && RetrieveGreyFrame(capture, grey);
}

bool RetrieveGreyFrame(cv::VideoCapture& capture, cv::Mat& grey) {
  cv::Mat image;
  if (!capture.retrieve(image) || image.empty()) return false;
  if (image.channels() == 1) {
    grey = image.clone();
  } else {
    cv::cvtColor(image, grey, image.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  }
  return true;
}

bool ReadColourFrame(cv::VideoCapture& capture, cv::Mat& colour) {
  cv::Mat image;
  if (!capture.read(image) || image.empty()) return false;
  if (image.channels() == 3) {
    colour = image.clone();
  } else {
    cv::cvtColor(image, colour, image.channels() == 4 ? cv::COLOR_BGRA2BGR : cv::COLOR_GRAY2BGR);
  }
  return true;
}

cv::Mat MaskOfAll(const DatasetOptions& options, cv::Size size, const std::optional<Rectifier>& rectifier) {
  if (options.mask.empty()) return {};
  const cv::Mat mask = ImageMasks(options.mask).OfAll(size);
  return rectifier ? rectifier->Apply(mask, Sampling::kNearest) : mask;
}

}  // namespace tutti
