// A map as files of other programs: PLY (Stanford polygon format), and the transforms.json of nerfstudio.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/export/map_model.h"

namespace tutti {

/// kFrusta: behind the landmarks, each keyframe as a pyramid of 5 vertices and 6 triangles.
enum class PlyCameras { kNone, kFrusta };

/// Writes a binary little-endian PLY: vertices with x y z (float, in the world of the model), red green blue
/// (uchar) and observations (uint: keyframes that see the landmark; 0 for a vertex of a frustum), then faces.
/// A frustum has its apex in the camera's centre and its base, turned as the image is, in front of the
/// camera, half as far away as keyframes lie apart in the median. Throws InputError if it can't be written in
/// full.
void WritePly(const std::filesystem::path& file, const MapModel& model, PlyCameras cameras);

/// The text of transforms.json (https://docs.nerf.studio/quickstart/data_conventions.html; instant-ngp reads
/// it, too) for these keyframes (indices of the model's). Their images are "images/NAME" beside it
/// (ImageName); `points`: file of the landmarks (PLY) beside it. Poses are camera-to-world with OpenGL's
/// camera axes: x right, y up, z backward. The world stays tutti's, with y down at the first camera;
/// nerfstudio turns it upright by itself (--orientation-method up, its default). The centre of the top-left
/// pixel is (0.5, 0.5), as in COLMAP.
std::string NerfTransforms(const MapModel& model, const std::vector<std::size_t>& chosen,
                           const std::string& points);

}  // namespace tutti
