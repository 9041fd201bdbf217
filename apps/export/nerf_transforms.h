// A map as the transforms.json of nerfstudio (https://docs.nerf.studio/quickstart/data_conventions.html),
// which instant-ngp reads, too.
//
// Poses are camera-to-world with OpenGL's camera axes: x right, y up, z backward. The world stays tutti's,
// with y down at the first camera; nerfstudio turns it upright by itself (--orientation-method up, its
// default). The centre of the top-left pixel is (0.5, 0.5), as in COLMAP.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "apps/export/map_model.h"

namespace tutti {

/// The text of transforms.json for these keyframes (indices of the model's). Their images are "images/NAME"
/// beside it (ImageName); `points`: file of the landmarks (PLY) beside it.
std::string NerfTransforms(const MapModel& model, const std::vector<std::size_t>& chosen,
                           const std::string& points);

}  // namespace tutti
