// Left and right images that are joined side by side, as the City Centre and New College sets are used.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace tutti::cli {

/// `images` = left, right, left, right...: keeps the left ones in it and returns the right ones. Throws
/// InputError that names `folder` if their number is odd.
std::vector<std::filesystem::path> TakeRightImages(const std::string& folder,
                                                   std::vector<std::filesystem::path>& images);

/// Both images as they are in their files, left beside right; the lower one gets a black border below. Empty
/// if one of them can't be read or their types differ. `cameras`: where left and right are in it.
cv::Mat ReadJoined(const std::filesystem::path& left, const std::filesystem::path& right,
                   std::vector<cv::Rect>* cameras = nullptr);

}  // namespace tutti::cli
