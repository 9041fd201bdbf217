// --mask, which several commands have.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "tutti/frontend/dataset.h"

namespace tutti::cli {

inline void AddMaskOption(CLI::App& command, std::string& mask) {
  command.add_option("--mask", mask,
                     "8-bit image as large as the camera's: where it is 0 (the robot's own body), the images "
                     "are not used; or a folder with such a mask for each image, of the image's name (for "
                     "what moves)");
}

/// As somebody in another folder finds it: the configuration is kept with maps and checkpoints.
inline void SetMask(const std::string& mask, DatasetOptions& options) {
  if (!mask.empty()) options.mask = std::filesystem::absolute(mask).lexically_normal().string();
}

}  // namespace tutti::cli
