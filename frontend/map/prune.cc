#include "frontend/map/prune.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "frontend/features/features.h"
#include "frontend/map/map_frames.h"

namespace tutti {
namespace {

constexpr double kShare = 0.85;      // of a redundant keyframe's landmarks that
constexpr std::size_t kOthers = 3;   // so many others see
constexpr double kShareAgain = 0.7;  // of one whose place an earlier visit saw: noise makes other corners
constexpr int kCoarserLevels = 1;    // that a view of the others may be coarser: a corner's level wavers
constexpr double kElsewhere = 0.1;   // of its landmarks: who has fewer in common with it saw something else
constexpr int kLeastInCommon = 15;   // landmarks in common with the keyframe that is to stand for another

int LevelOf(const Map& map, const Observation& view) {
  return map.keyframe(view.keyframe).features->keypoints[static_cast<std::size_t>(view.feature)].octave;
}

// The newest keyframe before this one that saw something else, -1: none. What is older is of an earlier
// visit. `seen`: landmarks that this one sees.
int LastElsewhere(const Map& map, int id, std::ptrdiff_t seen) {
  const std::map<int, int>& covisible = map.keyframe(id).covisible;
  for (int other = id - 1; other >= 0; --other) {
    if (map.keyframe(other).replaced_by >= 0) continue;
    const auto shared = covisible.find(other);
    if (shared == covisible.end() || shared->second < kElsewhere * static_cast<double>(seen)) return other;
  }
  return -1;
}

// Whether others see a landmark as well as this view does: enough of them, or so many of an earlier visit as
// tell where it is.
bool IsSeenByOthers(const Map& map, const Landmark& landmark, const Observation& view, int last_elsewhere,
                    std::size_t least_views) {
  const int coarsest = LevelOf(map, view) + kCoarserLevels;
  std::size_t others = 0, earlier = 0;
  for (const Observation& other : landmark.observations) {
    if (other.keyframe == view.keyframe || LevelOf(map, other) > coarsest) continue;
    ++others;
    if (other.keyframe < last_elsewhere) ++earlier;
  }
  return others >= kOthers || earlier >= least_views;
}

// Whether an earlier visit has a keyframe that could stand for this one.
bool WasSeenEarlier(const Map& map, int id, int last_elsewhere) {
  const std::map<int, int>& covisible = map.keyframe(id).covisible;
  return std::any_of(covisible.begin(), covisible.end(), [&](const auto& other) {
    return other.first < last_elsewhere && other.second >= kLeastInCommon;
  });
}

bool IsRedundant(const Map& map, int id, std::size_t least_views) {
  const std::vector<int>& landmarks = map.keyframe(id).landmarks;
  const auto seen = std::count_if(landmarks.begin(), landmarks.end(), [](int l) { return l >= 0; });
  const int last_elsewhere = LastElsewhere(map, id, seen);
  int redundant = 0;
  for (std::size_t f = 0; f < landmarks.size(); ++f) {
    if (landmarks[f] < 0) continue;
    const Observation view{id, static_cast<int>(f)};
    if (IsSeenByOthers(map, map.landmark(landmarks[f]), view, last_elsewhere, least_views)) ++redundant;
  }
  const double share = WasSeenEarlier(map, id, last_elsewhere) ? kShareAgain : kShare;
  return seen > 0 && redundant >= share * static_cast<double>(seen);
}

// Older keyframes of the same piece: those with most common landmarks first (ties: the oldest).
std::vector<int> StandIns(const Map& map, int id) {
  std::vector<std::pair<int, int>> by_shared;
  for (const auto& [other, shared] : map.keyframe(id).covisible) {
    if (other < id && shared >= kLeastInCommon && map.keyframe(other).piece == map.keyframe(id).piece)
      by_shared.emplace_back(-shared, other);
  }
  std::sort(by_shared.begin(), by_shared.end());
  std::vector<int> stand_ins;
  stand_ins.reserve(by_shared.size());
  for (const auto& [shared, other] : by_shared) stand_ins.push_back(other);
  return stand_ins;
}

// The oldest of each piece: they hold it where it is.
std::set<int> FirstOfPieces(const Map& map) {
  std::set<int> first, pieces;
  for (int id = 0; id < map.KeyframeCount(); ++id) {
    if (map.keyframe(id).replaced_by < 0 && pieces.insert(map.keyframe(id).piece).second) first.insert(id);
  }
  return first;
}

}  // namespace

std::map<int, int> Prune(const std::set<int>& keep, std::size_t least_views,
                         const std::function<bool(int removed, int into)>& may, Map* map) {
  const Map& now = *map;
  const std::set<int> first = FirstOfPieces(now);
  const std::vector<Pose> poses = FramePoses(now);
  std::map<int, int> removed;
  for (int id = now.KeyframeCount() - 1; id > 0; --id) {
    if (now.keyframe(id).replaced_by >= 0 || keep.count(id) != 0 || first.count(id) != 0) continue;
    if (!IsRedundant(now, id, least_views)) continue;
    const std::vector<int> stand_ins = StandIns(now, id);
    const auto into =
        std::find_if(stand_ins.begin(), stand_ins.end(), [&](int other) { return may(id, other); });
    if (into == stand_ins.end()) continue;
    map->RemoveKeyframe(id, *into, least_views);
    removed[id] = *into;
  }
  if (removed.empty()) return removed;
  map->UpdateGeometry();
  RehangFrames(poses, map);
  return removed;
}

}  // namespace tutti
