// Runs the numbered example of the loop-closure module as a user would.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "test_data.h"
#include "textured_image.h"

namespace tutti {
namespace {

struct Outcome {
  int status = -1;
  std::string text;
};

Outcome RunExample(const std::string& arguments) {
  Outcome outcome;
  std::FILE* pipe = ::popen(("'" TUTTI_EXAMPLE_01 "' " + arguments + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 512> line{};
  while (std::fgets(line.data(), static_cast<int>(line.size()), pipe) != nullptr) outcome.text += line.data();
  const int status = ::pclose(pipe);
  outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

TEST(Example01, FindsTheLoopsOfAFolder) {
  const std::filesystem::path folder = testing::FreshFolder();
  std::ofstream(folder / "notes.txt") << "not an image\n";
  for (int i = 0; i < 20; ++i) {
    const cv::Mat place = testing::TexturedImage(static_cast<std::uint32_t>(i % 15));
    cv::imwrite((folder / (std::to_string(i) + ".png")).string(), i < 15 ? place : testing::SeenAgain(place));
  }
  const Outcome outcome = RunExample("'" + folder.string() + "'");
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("image 18 is where image 3 was"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("20 images, "), std::string::npos) << outcome.text;
}

TEST(Example01, ABadFolderIsAnErrorNotACrash) {
  EXPECT_EQ(RunExample("/nowhere/at/all").status, 1);
  EXPECT_EQ(RunExample("").status, 1);
}

}  // namespace
}  // namespace tutti
