#include "frontend/map/append.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include "frontend/features/features.h"
#include "tutti/core/error.h"

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

Map WithRig(const Map& map, const CameraRig& rig) {
  const std::string problem = OtherCameraProblem(map.rig(), rig, map.scales());
  if (!problem.empty()) throw InputError(problem);
  Map to(map.scales(), rig, map.aligned_sigma());
  to.RestorePieces(map.NextPiece());
  to.TakeFrames(map);
  const bool same = SameCamera(map.rig(), rig);
  const PixelMap moved(map.rig().camera, rig.camera);
  const int levels = LevelsApart(map.rig().camera, rig.camera, map.scales());
  const int top = static_cast<int>(map.scales().size()) - 1;
  for (int id = 0; id < map.KeyframeCount(); ++id) {
    Keyframe keyframe = map.keyframe(id);
    if (same) {
      to.Restore(std::move(keyframe));
      continue;
    }
    auto features = std::make_shared<FrameFeatures>(*WithoutImages(*keyframe.features));
    for (cv::KeyPoint& k : features->keypoints) {
      k.pt = moved(k.pt);
      k.size *= static_cast<float>(moved.scale_x);
      k.octave = std::clamp(k.octave + levels, 0, top);
    }
    features->lens.setZero();
    features->rolled.clear();
    features->other_camera = true;
    features->BuildGrid(rig.camera.width, rig.camera.height);
    keyframe.features = std::move(features);
    to.Restore(std::move(keyframe));
  }
  for (int id = 0; id < map.LandmarkCount(); ++id) {
    Landmark landmark = map.landmark(id);
    if (landmark.patch && !same) {
      auto patch = std::make_shared<Patch>(*landmark.patch);
      patch->scale_x *= static_cast<float>(moved.scale_x);
      patch->scale_y *= static_cast<float>(moved.scale_y);
      landmark.patch = std::move(patch);
    }
    to.Restore(std::move(landmark), map.ReplacedBy(id));
  }
  if (!same) to.UpdateGeometry();
  return to;
}

namespace {

// Features whose alignment with landmarks is told by other numbers.
std::shared_ptr<const FrameFeatures> Renumbered(const std::shared_ptr<const FrameFeatures>& features,
                                                int landmarks) {
  const auto is_landmark = [](int id) { return id >= 0; };
  if (std::none_of(features->aligned.begin(), features->aligned.end(), is_landmark)) return features;
  auto renumbered = std::make_shared<FrameFeatures>(*features);
  for (int& id : renumbered->aligned) id += id >= 0 ? landmarks : 0;
  return renumbered;
}

}  // namespace

void Append(const Map& of_other_camera, std::int64_t frame_offset, Map* map) {
  const std::string problem = OtherCameraProblem(map->rig(), of_other_camera.rig(), map->scales());
  if (!problem.empty()) throw InputError(problem);
  if (map->scales() != of_other_camera.scales())
    throw InputError(
        "the two maps have other image pyramids (odometry.pyramid_levels, odometry.scale_factor)");
  const Map other = WithRig(of_other_camera, map->rig());
  const int keyframes = map->KeyframeCount(), landmarks = map->LandmarkCount(), pieces = map->NextPiece();
  for (int id = 0; id < other.KeyframeCount(); ++id) {
    Keyframe k = other.keyframe(id);
    k.id += keyframes;
    k.frame_index += frame_offset;
    k.piece += pieces;
    if (k.replaced_by >= 0) k.replaced_by += keyframes;
    k.features = Renumbered(k.features, landmarks);
    for (int& l : k.landmarks) l += l >= 0 ? landmarks : 0;
    std::map<int, int> covisible;
    for (const auto& [neighbour, shared] : k.covisible) covisible[neighbour + keyframes] = shared;
    k.covisible = std::move(covisible);
    map->Restore(std::move(k));
  }
  for (int id = 0; id < other.LandmarkCount(); ++id) {
    Landmark l = other.landmark(id);
    for (Observation& o : l.observations) o.keyframe += keyframes;
    if (l.reference >= 0) l.reference += keyframes;
    if (l.patch_source.keyframe >= 0) l.patch_source.keyframe += keyframes;
    const int replaced_by = other.ReplacedBy(id);
    map->Restore(std::move(l), replaced_by >= 0 ? replaced_by + landmarks : -1);
  }
  map->RestorePieces(pieces + other.NextPiece());
  for (std::size_t i = 0; i < other.frames().size(); ++i) {
    MapFrame frame = other.frames()[i];
    frame.index += frame_offset;
    frame.keyframe += keyframes;
    if (frame.before >= 0) frame.before += keyframes;
    map->Restore(frame);
  }
}

}  // namespace tutti
