#include "frontend/map/other_camera.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

namespace tutti {
namespace {

// Levels of the pyramid by which a corner of the one camera lies higher in the other's.
int LevelsApart(const PinholeCamera& from, const PinholeCamera& to, const std::vector<float>& scales) {
  if (scales.size() < 2) return 0;
  return static_cast<int>(std::lround(std::log(to.fx / from.fx) / std::log(double(scales[1]))));
}

// Pixels of one camera in those of another.
struct PixelMap {
  PixelMap(const PinholeCamera& a, const PinholeCamera& b)
      : scale_x(b.fx / a.fx),
        scale_y(b.fy / a.fy),
        offset_x(b.cx - scale_x * a.cx),
        offset_y(b.cy - scale_y * a.cy) {}
  cv::Point2f operator()(const cv::Point2f& p) const {
    return {static_cast<float>(scale_x * double(p.x) + offset_x),
            static_cast<float>(scale_y * double(p.y) + offset_y)};
  }
  double scale_x, scale_y, offset_x, offset_y;
};

}  // namespace

bool SameCamera(const CameraRig& a, const CameraRig& b) {
  const PinholeCamera &p = a.camera, &q = b.camera;
  return p.width == q.width && p.height == q.height && p.fx == q.fx && p.fy == q.fy && p.cx == q.cx &&
         p.cy == q.cy && a.baseline_m == b.baseline_m;
}

std::string OtherCameraProblem(const CameraRig& map, const CameraRig& session,
                               const std::vector<float>& scales) {
  if (map.sensor != session.sensor)
    return std::string("the map was made with another kind of sensor (") + WordOf(map.sensor) +
           "; here: " + WordOf(session.sensor) +
           "), and distances of the two do not compare; go on with the same kind";
  const int apart = std::abs(LevelsApart(map.camera, session.camera, scales));
  if (apart < std::max<int>(1, static_cast<int>(scales.size()) - 2)) return "";
  char text[200];
  std::snprintf(
      text, sizeof text,
      "the focal length is %.2f times that of the map's camera (%.1f px, %.1f px): what one of them "
      "sees is too small for the other; scale the images",
      session.camera.fx / map.camera.fx, session.camera.fx, map.camera.fx);
  return text;
}

void CarryOver(const Map& from, const PinholeCamera& camera, const PinholeCamera& to_camera, Map* to) {
  const PixelMap moved(camera, to_camera);
  const int levels = LevelsApart(camera, to_camera, from.scales());
  const int top = static_cast<int>(from.scales().size()) - 1;
  for (int id = 0; id < from.KeyframeCount(); ++id) {
    Keyframe keyframe = from.keyframe(id);
    auto features = std::make_shared<FrameFeatures>(*WithoutImages(*keyframe.features));
    for (cv::KeyPoint& k : features->keypoints) {
      k.pt = moved(k.pt);
      k.size *= static_cast<float>(moved.scale_x);
      k.octave = std::clamp(k.octave + levels, 0, top);
    }
    features->lens.setZero();
    features->rolled.clear();
    features->other_camera = true;
    features->BuildGrid(to_camera.width, to_camera.height);
    keyframe.features = std::move(features);
    to->Restore(std::move(keyframe));
  }
  for (int id = 0; id < from.LandmarkCount(); ++id) {
    Landmark landmark = from.landmark(id);
    if (landmark.patch) {
      auto patch = std::make_shared<Patch>(*landmark.patch);
      patch->scale_x *= static_cast<float>(moved.scale_x);
      patch->scale_y *= static_cast<float>(moved.scale_y);
      landmark.patch = std::move(patch);
    }
    to->Restore(std::move(landmark), from.ReplacedBy(id));
  }
  to->UpdateGeometry();
}

}  // namespace tutti
