// How the scale of a map changes along its newest keyframes.
#pragma once

#include <map>

#include "tutti/frontend/map.h"

namespace tutti {

/// For MoveKeyframes: keyframes from `first` on, of the piece that `newest` is of, get larger by a factor
/// whose logarithm grows along the way from 0 to `log_scale`. The one before stays where it is.
std::map<int, Similarity> ScaleRamp(const Map& map, int first, int newest, double log_scale);

}  // namespace tutti
