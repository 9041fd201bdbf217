// The image files of a folder, for the examples.
#pragma once

#include <algorithm>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "tutti/core/text.h"

namespace examples {

inline std::vector<std::string> FilesInOrder(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_regular_file() && cv::haveImageReader(entry.path().string()))
      files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end(), tutti::NaturalLess);  // 2.jpg before 10.jpg
  return files;
}

}  // namespace examples
