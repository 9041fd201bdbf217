// Real data for tests: under TUTTI_DATA, default ../shared/data from the project's root.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace tutti::testing {

/// Path of a real data folder or file; empty where it is absent.
std::filesystem::path RealData(const std::string& name);

/// The project's source folder, and a folder of this test's own, empty at the start of the test.
std::filesystem::path SourceDir();
std::filesystem::path FreshFolder();

/// What a file holds.
std::string BytesOf(const std::filesystem::path& file);

/// A file with this content in such a folder.
std::filesystem::path FreshFile(const std::string& name, const std::string& content);

}  // namespace tutti::testing

/// Skips the test with a clear line where the real data is absent.
#define TUTTI_REQUIRE_DATA(variable, name)                               \
  const std::filesystem::path variable = tutti::testing::RealData(name); \
  if ((variable).empty())                                                \
  GTEST_SKIP() << "real data '" << (name) << "' is absent; set TUTTI_DATA to its folder"
