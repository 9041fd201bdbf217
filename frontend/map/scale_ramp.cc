#include "frontend/map/scale_ramp.h"

#include <cmath>
#include <vector>

namespace tutti {

std::map<int, Similarity> ScaleRamp(const Map& map, int first, int newest, double log_scale) {
  std::vector<int> ids;
  std::vector<double> ways;  // from the first one [map units]
  double way = 0;
  for (int id = first; id <= newest; ++id) {
    const Keyframe& k = map.keyframe(id);
    if (k.piece != map.keyframe(newest).piece || k.replaced_by >= 0) continue;
    if (!ids.empty())
      way += (k.T_world_camera.translation - map.keyframe(ids.back()).T_world_camera.translation).norm();
    ids.push_back(id);
    ways.push_back(way);
  }
  std::map<int, Similarity> moved;
  if (!(way > 0)) return moved;
  Eigen::Vector3d at = map.keyframe(ids.front()).T_world_camera.translation;
  for (std::size_t i = 1; i < ids.size(); ++i) {
    const Pose &before = map.keyframe(ids[i - 1]).T_world_camera, &now = map.keyframe(ids[i]).T_world_camera;
    const double scale = std::exp(log_scale * ways[i] / way);
    at += scale * (now.translation - before.translation);
    Similarity S(now);
    S.translation = at;
    S.scale = scale;
    moved.emplace(ids[i], S);
  }
  return moved;
}

}  // namespace tutti
