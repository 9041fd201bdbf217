// What the camera wrote into a photo of its lens (EXIF).
#include <libexif/exif-data.h>

#include <cmath>
#include <cstdio>
#include <memory>

#include "apps/run/recording.h"

namespace tutti {
namespace {

constexpr double kFilmDiagonal = 43.266615305567875;  // [mm], of 36 x 24

using Photo = std::unique_ptr<ExifData, void (*)(ExifData*)>;

// The first number of an entry; 0 where there is none.
double NumberIn(const Photo& photo, ExifTag tag) {
  const ExifEntry* entry = exif_content_get_entry(photo->ifd[EXIF_IFD_EXIF], tag);
  if (entry == nullptr || entry->data == nullptr || entry->components < 1 ||
      entry->size < exif_format_get_size(entry->format))
    return 0;
  const ExifByteOrder order = exif_data_get_byte_order(photo.get());
  switch (entry->format) {
    case EXIF_FORMAT_SHORT:
      return exif_get_short(entry->data, order);
    case EXIF_FORMAT_LONG:
      return exif_get_long(entry->data, order);
    case EXIF_FORMAT_RATIONAL: {
      const ExifRational value = exif_get_rational(entry->data, order);
      return value.denominator == 0 ? 0 : double(value.numerator) / double(value.denominator);
    }
    default:
      return 0;
  }
}

// [mm] of FocalPlaneResolutionUnit; inches where the photo does not say.
double PlaneUnit(double code) { return code == 3 ? 10 : code == 4 ? 1 : code == 5 ? 0.001 : 25.4; }

PhotoLens Lens(double focal_mm, double focal_px) {
  char text[80];
  std::snprintf(text, sizeof text, "%.4g mm (EXIF) = %.1f px", focal_mm, focal_px);
  return {focal_px, text};
}

}  // namespace

bool HasUnreadLens(const std::filesystem::path&) { return false; }

std::optional<PhotoLens> ReadPhotoLens(const std::filesystem::path& file, int width, int height) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(file, code)) return std::nullopt;
  const Photo photo(exif_data_new_from_file(file.c_str()), exif_data_unref);
  if (!photo) return std::nullopt;
  PhotoLens lens;
  const double film_mm = NumberIn(photo, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  const double focal_mm = NumberIn(photo, EXIF_TAG_FOCAL_LENGTH);
  const double per_unit = NumberIn(photo, EXIF_TAG_FOCAL_PLANE_X_RESOLUTION);
  const double taken_width = NumberIn(photo, EXIF_TAG_PIXEL_X_DIMENSION);
  if (film_mm > 0) {
    lens = Lens(film_mm, film_mm * std::hypot(width, height) / kFilmDiagonal);
  } else if (focal_mm > 0 && per_unit > 0) {
    const double scale = taken_width > 0 ? width / taken_width : 1;
    lens = Lens(focal_mm, focal_mm * per_unit /
                              PlaneUnit(NumberIn(photo, EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT)) * scale);
  }
  const bool possible = lens.focal_px > 0.2 * width && lens.focal_px < 50.0 * width;
  return possible ? std::optional<PhotoLens>(lens) : std::nullopt;
}

}  // namespace tutti
