#include "frontend/dataset/wrapped_dataset.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "core/numbers.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

// Drawn anew for each frame, so that it is the same whatever was read before, and by which thread.
void AddNoise(double sigma, std::uint64_t seed, cv::Mat& image) {
  if (image.empty()) return;
  cv::RNG random(seed);
  cv::Mat noise(image.size(), CV_32FC1), noisy;
  random.fill(noise, cv::RNG::NORMAL, 0, sigma);
  image.convertTo(noisy, CV_32FC1);
  noisy += noise;
  noisy.convertTo(image, CV_8UC1);
}

class SelectedDataset : public WrappedDataset {
 public:
  SelectedDataset(std::unique_ptr<Dataset> whole, const DatasetOptions& options)
      : WrappedDataset(std::move(whole)),
        start_(static_cast<std::size_t>(options.start)),
        end_(options.end > 0 ? static_cast<std::size_t>(options.end)
                             : std::numeric_limits<std::size_t>::max()),
        stride_(static_cast<std::size_t>(options.stride)),
        noise_(options.noise),
        noise_draw_(static_cast<std::uint64_t>(options.noise_draw)) {
    rig_.rate_hz /= options.stride;
  }

  bool WaitFor(std::size_t i, const std::function<bool()>& stop) const override {
    return Place(i) < end_ && whole_->WaitFor(Place(i), stop);
  }
  std::size_t Size() const override {
    const std::size_t end = std::min(end_, whole_->Size());
    return end > start_ ? (end - start_ + stride_ - 1) / stride_ : 0;
  }
  double Stamp(std::size_t i) const override { return whole_->Stamp(Place(i)); }
  std::int64_t Number(std::size_t i) const override { return whole_->Number(Place(i)); }
  ReadResult Read(std::size_t i) const override {
    ReadResult read = whole_->Read(Place(i));
    if (!read.frame || noise_ <= 0) return read;
    const std::uint64_t seed = 2 * ((noise_draw_ << 32U) + static_cast<std::uint64_t>(read.frame->index)) + 1;
    AddNoise(noise_, seed, read.frame->image);
    AddNoise(noise_, seed + 1, read.frame->right);
    return read;
  }
  ColourImage ReadColour(std::size_t i) const override { return whole_->ReadColour(Place(i)); }

 private:
  std::size_t Place(std::size_t i) const { return start_ + i * stride_; }  // in whole_

  std::size_t start_, end_, stride_;
  double noise_;  // grey levels
  std::uint64_t noise_draw_;
};

class TurnedDataset : public WrappedDataset {
 public:
  TurnedDataset(std::unique_ptr<Dataset> stored, int degrees)
      : WrappedDataset(std::move(stored)), degrees_(degrees) {
    rig_.camera = TurnedCamera(rig_.camera, degrees_);
    // The turned camera's x axis is where the image's right side was: rays turn with the image.
    const Eigen::Quaterniond q(Eigen::AngleAxisd(-degrees_ * internal::kRadians, Eigen::Vector3d::UnitZ()));
    rig_.T_body_camera = rig_.T_body_camera * Pose(q, Eigen::Vector3d::Zero());
  }

  ReadResult Read(std::size_t i) const override {
    ReadResult read = whole_->Read(i);
    if (!read.frame) return read;
    for (cv::Mat* image : {&read.frame->image, &read.frame->depth_m, &read.frame->mask})
      *image = TurnedImage(*image, degrees_);
    return read;
  }
  ColourImage ReadColour(std::size_t i) const override {
    ColourImage read = whole_->ReadColour(i);
    read.image = TurnedImage(read.image, degrees_);
    return read;
  }

 private:
  int degrees_;
};

PinholeCamera QuarterTurned(const PinholeCamera& camera) {
  PinholeCamera turned = camera;
  turned.width = camera.height;
  turned.height = camera.width;
  turned.fx = camera.fy;
  turned.fy = camera.fx;
  turned.cx = camera.height - 1 - camera.cy;
  turned.cy = camera.cx;
  if (camera.distortion == Distortion::kRadTan) {  // x and y of a ray become -y and x
    turned.coefficients[2] = camera.coefficients[3];
    turned.coefficients[3] = -camera.coefficients[2];
  }
  return turned;
}

}  // namespace

cv::Mat TurnedImage(const cv::Mat& image, int degrees) {
  if (image.empty() || degrees == 0) return image;
  cv::Mat turned;
  cv::rotate(image, turned,
             degrees == 90    ? cv::ROTATE_90_CLOCKWISE
             : degrees == 180 ? cv::ROTATE_180
                              : cv::ROTATE_90_COUNTERCLOCKWISE);
  return turned;
}

PinholeCamera TurnedCamera(const PinholeCamera& camera, int degrees) {
  PinholeCamera turned = camera;
  for (int done = 0; done < degrees; done += 90) turned = QuarterTurned(turned);
  return turned;
}

std::unique_ptr<Dataset> TurnFrames(std::unique_ptr<Dataset> stored, int degrees, const std::string& name) {
  if (stored->Rig().sensor == Sensor::kStereo)
    throw InputError(name +
                     ": stereo pairs can't be turned (rotate): turned cameras lie above each other, or the "
                     "wrong way round; turn and rectify the images before, or use one camera (sensor mono)");
  if (stored->Rig().readout_s > 0)
    throw InputError(name +
                     ": images of a rolling shutter can't be turned (rotate): its rows would become columns, "
                     "or run upwards; leave readout_s 0");
  return std::make_unique<TurnedDataset>(std::move(stored), degrees);
}

std::unique_ptr<Dataset> SelectFrames(std::unique_ptr<Dataset> whole, const DatasetOptions& options,
                                      const std::string& name) {
  const bool all = options.start == 0 && options.end == 0 && options.stride == 1;
  if (all && options.noise <= 0) return whole;
  if (options.end != 0 && options.end <= options.start)
    throw InputError("dataset: end must be greater than start (" + std::to_string(options.start) +
                     "); it is " + std::to_string(options.end));
  const std::size_t frames = whole->Size();
  if (whole->FrameSupply() == Supply::kStored && static_cast<std::size_t>(options.start) >= frames)
    throw InputError(name + ": has " + std::to_string(frames) + " frames, 0 to " +
                     std::to_string(frames - 1) + "; it can't start with frame " +
                     std::to_string(options.start));
  return std::make_unique<SelectedDataset>(std::move(whole), options);
}

}  // namespace tutti
