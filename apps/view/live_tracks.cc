#include "apps/view/live_tracks.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

namespace tutti::view {

void ExtendTrail(std::vector<SeenLandmark> seen, LiveTrail* trail) {
  trail->push_front(std::make_shared<const std::vector<SeenLandmark>>(std::move(seen)));
  if (trail->size() > kTrailFrames) trail->pop_back();
}

std::vector<LiveTrack> TracksOf(const LiveTrail& trail, std::size_t most) {
  std::vector<LiveTrack> tracks;
  if (trail.empty() || most == 0) return tracks;
  const std::size_t step = std::max<std::size_t>(1, (trail.front()->size() + most - 1) / most);
  std::unordered_map<int, std::size_t> track_of;  // landmark -> its track
  for (const SeenLandmark& seen : *trail.front()) {
    if (static_cast<std::size_t>(seen.landmark) % step != 0 || tracks.size() == most) continue;
    if (track_of.emplace(seen.landmark, tracks.size()).second) tracks.push_back({seen.pixel});
  }
  for (std::size_t frame = 1; frame < trail.size(); ++frame) {
    for (const SeenLandmark& seen : *trail[frame]) {
      const auto track = track_of.find(seen.landmark);
      if (track != track_of.end()) tracks[track->second].push_back(seen.pixel);
    }
  }
  return tracks;
}

}  // namespace tutti::view
