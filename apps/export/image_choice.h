// Which keyframes' images an export takes.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "apps/export/map_model.h"

namespace tutti {

/// At most `most` of the keyframes that have a sharpness, as ascending indices. Where there are more, the one
/// that is missed least goes, again and again: whose neighbours are near (along the way of the camera, in
/// which moving and turning count alike) and which is blurred compared with those around it. First and last
/// stay unless `most` is 1.
std::vector<std::size_t> ChooseImages(const std::vector<ModelKeyframe>& keyframes,
                                      const std::vector<std::optional<double>>& sharpness, std::size_t most);

}  // namespace tutti
