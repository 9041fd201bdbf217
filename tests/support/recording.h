// Frames of the synthetic world as the odometry gets them, with their true poses.
#pragma once

#include <vector>

#include "data/synthetic/synthetic_world.h"
#include "tutti/frontend/odometry.h"

namespace tutti::testing {

struct Recording {
  CameraRig rig;
  std::vector<InputFrame> frames;
  Trajectory truth;  ///< of all frames

  /// Appends a frame; it gets the next index.
  void Add(const SyntheticFrame& rendered) {
    InputFrame frame;
    frame.index = static_cast<std::int64_t>(frames.size());
    frame.stamp_s = rendered.stamp_s;
    frame.image = rendered.image;
    frame.right = rendered.right;
    frame.depth_m = rendered.depth_m;
    frames.push_back(frame);
    truth.push_back({rendered.stamp_s, rendered.T_world_camera});
  }
};

/// Of a SyntheticWorld or a RenderedWorld.
template <class World>
CameraRig RigOf(const World& world) {
  CameraRig rig;
  const SyntheticSensor sensor = world.Options().sensor;
  rig.sensor = sensor == SyntheticSensor::kStereo ? Sensor::kStereo
               : sensor == SyntheticSensor::kRgbd ? Sensor::kRgbd
                                                  : Sensor::kMono;
  rig.camera = world.Camera();
  rig.baseline_m = rig.sensor == Sensor::kStereo ? world.Options().baseline_m : 0;
  rig.rate_hz = world.Options().rate_hz;
  rig.readout_s = world.Options().readout_s;
  return rig;
}

/// The first `count` frames of a world.
template <class World>
Recording Record(const World& world, std::size_t count) {
  Recording out;
  out.rig = RigOf(world);
  for (std::size_t i = 0; i < count; ++i) out.Add(world.Render(i));
  return out;
}

/// The frame with a covered lens.
inline InputFrame Black(InputFrame frame) {
  for (cv::Mat* image : {&frame.image, &frame.right, &frame.depth_m}) {
    if (!image->empty()) *image = cv::Mat(image->size(), image->type(), cv::Scalar(0));
  }
  return frame;
}

/// Something to see, but nothing of the map and no depth.
inline InputFrame Snow(InputFrame frame) {
  cv::RNG random(static_cast<std::uint64_t>(frame.index) + 1);
  for (cv::Mat* image : {&frame.image, &frame.right}) {
    if (image->empty()) continue;
    *image = image->clone();
    random.fill(*image, cv::RNG::UNIFORM, 0, 256);
  }
  if (!frame.depth_m.empty()) frame.depth_m = cv::Mat::zeros(frame.depth_m.size(), CV_32FC1);
  return frame;
}

}  // namespace tutti::testing
