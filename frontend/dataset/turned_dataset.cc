#include "frontend/dataset/turned_dataset.h"

#include <utility>

#include "core/numbers.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

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

TurnedDataset::TurnedDataset(std::unique_ptr<Dataset> stored, int degrees, const std::string& name)
    : stored_(std::move(stored)), degrees_(degrees), rig_(stored_->Rig()) {
  if (rig_.sensor == Sensor::kStereo)
    throw InputError(name +
                     ": stereo pairs can't be turned (rotate): turned cameras lie above each other, or the "
                     "wrong way round; turn and rectify the images before, or use one camera (sensor mono)");
  if (rig_.readout_s > 0)
    throw InputError(name +
                     ": images of a rolling shutter can't be turned (rotate): its rows would become columns, "
                     "or run upwards; leave readout_s 0");
  rig_.camera = TurnedCamera(rig_.camera, degrees_);
  // The turned camera's x axis is where the image's right side was: rays turn with the image.
  const Eigen::Quaterniond q(Eigen::AngleAxisd(-degrees_ * internal::kRadians, Eigen::Vector3d::UnitZ()));
  rig_.T_body_camera = rig_.T_body_camera * Pose(q, Eigen::Vector3d::Zero());
}

ReadResult TurnedDataset::Read(std::size_t i) const {
  ReadResult read = stored_->Read(i);
  if (!read.frame) return read;
  for (cv::Mat* image : {&read.frame->image, &read.frame->depth_m, &read.frame->mask})
    *image = TurnedImage(*image, degrees_);
  return read;
}

ColourImage TurnedDataset::ReadColour(std::size_t i) const {
  ColourImage read = stored_->ReadColour(i);
  read.image = TurnedImage(read.image, degrees_);
  return read;
}

}  // namespace tutti
