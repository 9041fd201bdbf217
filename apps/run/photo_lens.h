// What the camera wrote into a photo of its lens (EXIF).
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tutti {

/// The focal length that a photo names.
struct PhotoLens {
  double focal_px = 0;  ///< of the image as it is now
  std::string text;     ///< "32 mm (EXIF) = 591.7 px"
};

/// From FocalLengthIn35mmFilm, by the image's diagonal; else from FocalLength and FocalPlaneXResolution, by
/// the width that the photo was taken with. None where the file has neither, or figures that no lens has, and
/// without libexif. Never throws.
std::optional<PhotoLens> ReadPhotoLens(const std::filesystem::path& file, int width, int height);

/// Has the file EXIF that this tutti can't read, because it was built without libexif?
bool HasUnreadLens(const std::filesystem::path& file);

}  // namespace tutti
