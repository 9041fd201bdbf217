// A made-up scene: random points with random descriptors, seen without noise.
#pragma once

#include <algorithm>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "frontend/features/features.h"
#include "tests/support/plain_camera.h"
#include "tutti/frontend/map.h"

namespace tutti::testing {

class PointScene {
 public:
  static constexpr int kPoints = 300;

  PointScene() : map_(PyramidScales(OdometryOptions())) {
    cv::RNG rng(11);
    descriptors_.create(kPoints, 32, CV_8UC1);
    rng.fill(descriptors_, cv::RNG::UNIFORM, 0, 256);
    for (int i = 0; i < kPoints; ++i) {
      const double z = rng.uniform(4.0, 12.0);
      const double y = z * rng.uniform(-0.4, 0.4), x = z * rng.uniform(-0.55, 0.55);
      points_.emplace_back(x, y, z);
    }
  }

  // What a camera sees: feature i is point order[i]; points outside the image are left out.
  std::shared_ptr<FrameFeatures> See(const Pose& T_world_camera, std::vector<int>* order) const {
    auto features = std::make_shared<FrameFeatures>();
    const Pose T_camera_world = T_world_camera.Inverse();
    order->clear();
    for (int i = kPoints - 1; i >= 0; --i) {
      const Eigen::Vector3d p = T_camera_world * points_[static_cast<std::size_t>(i)];
      if (p.z() <= 0.1 || !camera_.Contains(camera_.Project(p), 2)) continue;
      const Eigen::Vector2d pixel = camera_.Project(p);
      features->keypoints.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 31.0F,
                                       static_cast<float>(i % 40), 1.0F, 1);
      features->descriptors.push_back(descriptors_.row(i));
      order->push_back(i);
    }
    features->inverse_depth.assign(features->size(), 0.0F);
    features->inverse_depth_sigma.assign(features->size(), 0.0F);
    features->BuildGrid(camera_.width, camera_.height);
    return features;
  }

  int AddKeyframe(const Pose& T_world_camera, std::vector<int>* order) {
    Keyframe k;
    k.T_world_camera = T_world_camera;
    k.features = See(T_world_camera, order);
    return map_.AddKeyframe(k);
  }

  // A keyframe at the origin whose features all have a landmark: landmark l is point order_[l].
  void MakeLandmarks() {
    const int id = AddKeyframe(Pose(), &order_);
    for (std::size_t f = 0; f < order_.size(); ++f) {
      map_.AddLandmark(points_[static_cast<std::size_t>(order_[f])], id, static_cast<int>(f));
      map_.UpdateLandmark(static_cast<int>(f));
    }
  }

  PinholeCamera camera_ = PlainCamera(450);
  Map map_;
  cv::Mat descriptors_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<int> order_;
};

}  // namespace tutti::testing
