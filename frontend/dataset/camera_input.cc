#include "frontend/dataset/camera_input.h"

#include <opencv2/imgproc.hpp>

#include "frontend/dataset/image_file.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> DepthImages(const std::string& folder) {
  std::vector<fs::path> files = ListImages(folder);
  if (files.empty()) throw InputError(folder + ": holds no depth images (16-bit PNG, ...)");
  return files;
}

}  // namespace

CameraInput::CameraInput(const std::string& name, const std::string& source, CameraContent content,
                         const DeviceMode& mode)
    : source_(source), content_(content) {
  std::error_code ignored;
  if (!IsStream(source) && IsCameraDevice("camera:" + source)) {
    OpenDevice(name, mode);
  } else if (content == CameraContent::kDepth && fs::is_directory(source, ignored)) {
    files_ = DepthImages(source);
  } else {
    if (fs::is_regular_file(source, ignored)) VideoDecoder(source).List();
    video_.emplace(source);
  }
}

void CameraInput::OpenDevice(const std::string& name, const DeviceMode& mode) {
  device_ = true;
  const int number = static_cast<int>(*ParseInteger(source_));
  source_ = "/dev/video" + source_;
  bool opened = false;
  try {
    opened = capture_.open(number, cv::CAP_V4L2);
  } catch (const cv::Exception&) {  // no such camera, or OpenCV was built without V4L2
  }
  if (!opened)
    throw InputError(name + ": there is no such camera (" + source_ +
                     "), or no permission to use it; is it plugged in, and are you in the group video?" +
                     (content_ == CameraContent::kDepth
                          ? " Of depth devices OpenCV opens those with the format Y16 (v4l2-ctl "
                            "--list-formats), not those with Z16 alone"
                          : ""));
  if (content_ == CameraContent::kDepth)
    capture_.set(cv::CAP_PROP_FOURCC, cv::VideoWriter::fourcc('Y', '1', '6', ' '));
  if (mode.width > 0) {
    capture_.set(cv::CAP_PROP_FRAME_WIDTH, mode.width);
    capture_.set(cv::CAP_PROP_FRAME_HEIGHT, mode.height);
  }
  if (mode.rate_hz > 0) capture_.set(cv::CAP_PROP_FPS, mode.rate_hz);
}

bool CameraInput::Grab() {
  if (!files_.empty()) return next_file_ < files_.size() && ++next_file_ > 0;
  if (video_) {
    if (!video_->Grab()) return false;
    if (!first_ticks_) first_ticks_ = video_->Ticks();
    return true;
  }
  try {
    return capture_.grab();
  } catch (const cv::Exception&) {
    return false;
  }
}

double CameraInput::TakenAt() const {
  if (device_) return 1e-3 * capture_.get(cv::CAP_PROP_POS_MSEC);
  const std::optional<std::int64_t> ticks = video_ && first_ticks_ ? video_->Ticks() : std::nullopt;
  return ticks ? video_->Seconds(*ticks - *first_ticks_) : 0;
}

cv::Mat CameraInput::PixelsOfLast() {
  if (video_) return video_->Retrieve(content_ == CameraContent::kDepth ? Pixels::kStored : Pixels::kGrey);
  cv::Mat read, grey;
  if (!capture_.retrieve(read) || read.empty()) return {};
  if (content_ == CameraContent::kDepth || read.channels() == 1) return read.clone();
  cv::cvtColor(read, grey, read.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  return grey;
}

std::string CameraInput::Retrieve(cv::Mat& image) {
  image.release();
  if (!files_.empty()) {
    ImageFile read = ReadDepthFile(files_[next_file_ - 1]);
    image = read.image;
    return read.error;
  }
  try {
    image = PixelsOfLast();
  } catch (const cv::Exception&) {  // said below
  }
  if (content_ == CameraContent::kGrey) return image.empty() ? source_ + ": an image can't be decoded" : "";
  if (image.type() == CV_16UC1 && !image.empty()) return {};
  image.release();
  if (device_) return source_ + ": gives no 16-bit images (format Y16), which depth needs";
  return source_ +
         ": gives no 16-bit images, which depth needs (FFV1, gray16le); take the images "
         "out into a folder and give that: ffmpeg -i " +
         source_ + " FOLDER/%06d.png";
}

}  // namespace tutti
