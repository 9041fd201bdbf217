// A short drive through the synthetic town in KITTI's layout, made once for all tests.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/apps/tutti/executable.h"

namespace tutti::testing {

/// Folder with image_0, image_1, times.txt, calib.txt, poses.txt of `frames` stereo pairs; shared by all
/// tests: don't change it.
const std::filesystem::path& TinyTown();

/// A copy of it that a test may damage.
std::filesystem::path CopyOfTinyTown(const std::filesystem::path& where);

/// Configuration for it; `more` is appended (whole sections).
std::filesystem::path TinyConfig(const std::filesystem::path& folder, const std::string& more = "");

constexpr int kTinyFrames = 30;

/// Runs on the tiny town, into folders of the test's own.
class TownTest : public ::testing::Test {
 protected:
  /// `tutti run` on the town, into a folder of this name.
  ProcessResult Run(const std::string& out, const std::vector<std::string>& more = {}) const;
  /// summary.json of that folder.
  nlohmann::json Summary(const std::string& out = "out") const;

  const std::filesystem::path folder_, out_, config_;
  TownTest();
};

}  // namespace tutti::testing
