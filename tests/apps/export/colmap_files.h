// COLMAP's text files, read as its documentation has them; and COLMAP itself.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "tests/apps/tutti/executable.h"
#include "tutti/core/pose.h"

namespace tutti::testing {

/// Runs Debian's COLMAP; status 127 where there is none.
inline ProcessResult RunColmap(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "colmap");
  return RunProgramAndSignal("/usr/bin/env", arguments, "", 0);
}

/// The lines of a file that are no comments, as numbers and words. Empty lines stay: an image without points
/// has one.
inline std::vector<std::vector<std::string>> DataLines(const std::filesystem::path& file) {
  std::ifstream in(file);
  EXPECT_TRUE(in) << file;
  std::vector<std::vector<std::string>> lines;
  for (std::string line; std::getline(in, line);) {
    if (!line.empty() && line[0] == '#') continue;
    std::istringstream words(line);
    lines.emplace_back();
    for (std::string word; words >> word;) lines.back().push_back(word);
  }
  return lines;
}

/// T_camera_world of each image of an images.txt, by name.
inline std::map<std::string, Pose> ImagePoses(const std::filesystem::path& file) {
  std::map<std::string, Pose> poses;
  const auto lines = DataLines(file);
  for (std::size_t i = 0; i < lines.size(); i += 2) {
    const auto number = [&](std::size_t word) { return std::stod(lines[i].at(word)); };
    poses[lines[i].at(9)] = Pose(Eigen::Quaterniond(number(1), number(2), number(3), number(4)),
                                 Eigen::Vector3d(number(5), number(6), number(7)));
  }
  return poses;
}

}  // namespace tutti::testing

/// Skips the test where COLMAP is absent.
#define TUTTI_REQUIRE_COLMAP()                         \
  if (tutti::testing::RunColmap({"help"}).status != 0) \
  GTEST_SKIP() << "there is no COLMAP; apt-get install --no-install-recommends colmap"
