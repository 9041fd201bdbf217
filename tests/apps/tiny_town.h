// A short drive through the synthetic town in KITTI's layout, made once for all tests.
#pragma once

#include <filesystem>

namespace tutti::testing {

/// Folder with image_0, image_1, times.txt, calib.txt, poses.txt of `frames` stereo pairs; shared by all
/// tests: don't change it.
const std::filesystem::path& TinyTown();

/// A copy of it that a test may damage.
std::filesystem::path CopyOfTinyTown(const std::filesystem::path& where);

/// Configuration for it; `more` is appended (whole sections).
std::filesystem::path TinyConfig(const std::filesystem::path& folder, const std::string& more = "");

constexpr int kTinyFrames = 30;

}  // namespace tutti::testing
