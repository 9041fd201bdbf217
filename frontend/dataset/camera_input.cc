#include "frontend/dataset/camera_input.h"

#include "frontend/dataset/image_file.h"
#include "frontend/dataset/video_input.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

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
  if (IsStream(source)) {
    OpenVideoStream(source, capture_);
  } else if (IsCameraDevice("camera:" + source)) {
    OpenDevice(name, mode);
  } else if (content == CameraContent::kDepth && fs::is_directory(source, ignored)) {
    files_ = DepthImages(source);
  } else {
    OpenVideoFile(source, capture_);
  }
  if (content == CameraContent::kDepth && files_.empty()) capture_.set(cv::CAP_PROP_CONVERT_RGB, 0);
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
  if (!opened) {
    throw InputError(name + ": there is no such camera (" + source_ +
                     "), or no permission to use it; is it plugged in, and are you in the group video?" +
                     (content_ == CameraContent::kDepth
                          ? " Of depth devices OpenCV opens those with the format Y16 (v4l2-ctl "
                            "--list-formats), not those with Z16 alone"
                          : ""));
  }
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
  try {
    return capture_.grab();
  } catch (const cv::Exception&) {
    return false;
  }
}

std::string CameraInput::Retrieve(cv::Mat& image) {
  try {
    if (content_ == CameraContent::kDepth) return RetrieveDepth(image);
    if (RetrieveGreyFrame(capture_, image)) return {};
  } catch (const cv::Exception&) {  // said below
  }
  image.release();
  return source_ + ": an image can't be decoded";
}

std::string CameraInput::RetrieveDepth(cv::Mat& image) {
  if (!files_.empty()) {
    ImageFile read = ReadDepthFile(files_[next_file_ - 1]);
    image = read.image;
    return read.error;
  }
  cv::Mat read;
  if (!capture_.retrieve(read) || read.empty()) return source_ + ": a depth image can't be decoded";
  if (read.type() == CV_16UC1) {
    image = read.clone();
    return {};
  }
  image.release();
  if (device_) return source_ + ": gives no 16-bit images (format Y16), which depth needs";
  return source_ + ": OpenCV " + CV_VERSION +
         " gives no 16-bit images of this video, which depth needs (from 4.7 on it does of FFV1, gray16le); "
         "take the images out into a folder and give that: ffmpeg -i " +
         source_ + " FOLDER/%06d.png";
}

}  // namespace tutti
