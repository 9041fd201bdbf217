// The networks that write_network.py makes.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "tests/support/test_data.h"

namespace tutti::testing {

/// Tests that need them: written into a folder of the test's own. Skipped where python3-onnx is missing.
class SmallNetworks : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = FreshFolder();
    // Debian's packages are for Debian's Python, which need not be the first one on the path.
    const std::filesystem::path system = "/usr/bin/python3", said = folder_ / "said.txt";
    const std::string command = (std::filesystem::exists(system) ? system.string() : "python3") + " '" +
                                (SourceDir() / "tests/loopclosure/detector/write_network.py").string() +
                                "' '" + folder_.string() + "' > '" + said.string() + "' 2>&1";
    const int status = std::system(command.c_str());
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    constexpr int kMissing = 77, kNoPython = 127;
    if (code == kNoPython) GTEST_SKIP() << "python3 is missing";
    std::ostringstream text;
    text << std::ifstream(said).rdbuf();
    if (code == kMissing) GTEST_SKIP() << text.str();
    ASSERT_EQ(code, 0) << text.str();
  }

  const std::filesystem::path& folder() const { return folder_; }
  /// Path of a network's file.
  std::filesystem::path Network(const std::string& name) const { return folder_ / (name + ".onnx"); }

 private:
  std::filesystem::path folder_;
};

}  // namespace tutti::testing
