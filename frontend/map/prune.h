// Keyframes that a map can do without.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <set>

#include "tutti/frontend/map.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// Removes redundant keyframes, after FuseAll: until then, none of their views is known to be superfluous. At
/// least 85 % of the landmarks that one sees are seen by others from as near
/// as it sees them, or nearer, by three (R. Mur-Artal et al., "ORB-SLAM", T-RO 31(5), 2015, section VI-E), or
/// by `least_views` of an earlier visit (a keyframe in between has not even a tenth in common). Where an
/// earlier visit saw the place at all, 70 % are enough: each time, noise makes corners that were not there
/// before. Both let a place that is driven again and again cost what the first time did: where keyframes are
/// far apart, three never see the same in one drive.
///
/// From the newest to the oldest, so the first visits stay. So do the first keyframe of each submap, and
/// those of `keep`. For each one that is removed the older keyframe stands that has most landmarks in common
/// with it; `may(removed, into)`, asked last, can forbid it, and is then asked for the next one. Landmarks
/// with fewer than `least_views` views left (that many tell where one is) are removed as well. Frames hang on
/// the keyframe that stands for theirs, and stay where they are. Ids stay as they are. Returns which keyframe
/// stands for each, which may have been removed itself.
std::map<int, int> Prune(const std::set<int>& keep, std::size_t least_views,
                         const std::function<bool(int removed, int into)>& may, Map* map);

}  // namespace tutti
#pragma GCC visibility pop
