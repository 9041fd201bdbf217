// NumPy's array files (.npy), of depth images.
#pragma once

#include <filesystem>

#include "frontend/dataset/image_file.h"

namespace tutti {

/// An array of two dimensions (or three, of which one is 1) in C order: float16, float32 and float64 become
/// CV_32FC1, uint16 CV_16UC1. Never throws; what the header claims is compared with the file's size first.
ImageFile ReadNpyFile(const std::filesystem::path& file);

}  // namespace tutti
