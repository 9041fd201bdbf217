// `tutti generate --from-images`: a folder of images, changed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "data/synthetic/image_change.h"

namespace tutti::cli {

struct ChangedImagesOptions {
  std::filesystem::path from, out;
  int stride = 1;       ///< every stride-th image is taken
  int change_from = 0;  ///< those before this one (of the taken) are copied as they are
  std::uint64_t seed = 1;
  int threads = 1;
  bool force = false;  ///< write into a folder that is not empty: its images are removed
  /// Called after each image with (done, total), from one thread at a time; false: stop.
  std::function<bool(std::size_t, std::size_t)> progress;
};

/// How many images were taken, and how many of them were written (less if `progress` said stop).
struct ChangedImages {
  std::size_t taken = 0, written = 0;
  std::vector<std::string> notes;  ///< of what was left out
};

/// Writes each taken image under its old name, but as PNG; those that are not changed are copied byte for
/// byte. The files do not depend on the number of threads. Throws InputError that names the folder or file.
ChangedImages WriteChangedImages(const ImageChange& change, const ChangedImagesOptions& options);

}  // namespace tutti::cli
