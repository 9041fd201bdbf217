// Landmarks and cameras as a PLY file (Stanford polygon format).
#pragma once

#include <filesystem>

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

}  // namespace tutti
