// Runs the numbered examples of the loop-closure module as a user would.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "tests/loopclosure/features/textured_image.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

struct Outcome {
  int status = -1;
  std::string text;

  bool Has(const std::string& part) const { return text.find(part) != std::string::npos; }
};

Outcome RunExample(const std::string& program, const std::string& arguments) {
  Outcome outcome;
  std::FILE* pipe = ::popen(("'" + program + "' " + arguments + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 512> line{};
  while (std::fgets(line.data(), static_cast<int>(line.size()), pipe) != nullptr) outcome.text += line.data();
  const int status = ::pclose(pipe);
  outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

constexpr int kWalkPlaces = 15;

// Images begin .. end - 1 of a walk past 15 places and past the same places again, beside a file that is
// none.
std::string MakeFolder(const std::filesystem::path& folder, int begin, int end) {
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "notes.txt") << "not an image\n";
  for (int i = begin; i < end; ++i) {
    const cv::Mat place = testing::TexturedImage(static_cast<std::uint32_t>(i % kWalkPlaces));
    cv::imwrite((folder / (std::to_string(i) + ".png")).string(),
                i < kWalkPlaces ? place : testing::SeenAgain(place));
  }
  return "'" + folder.string() + "'";
}

TEST(Example01, FindsTheLoopsOfAFolder) {
  const Outcome outcome = RunExample(TUTTI_EXAMPLE_01, MakeFolder(testing::FreshFolder(), 0, 20));
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_TRUE(outcome.Has("image 18 is where image 3 was")) << outcome.text;
  EXPECT_TRUE(outcome.Has("20 images, ")) << outcome.text;
}

TEST(Example02, TheCallersFeaturesTakePartInTheEnsemble) {
  const Outcome outcome = RunExample(TUTTI_EXAMPLE_02, MakeFolder(testing::FreshFolder(), 0, 20));
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  const std::size_t line = outcome.text.find("image 18 is where image 3 was");
  ASSERT_NE(line, std::string::npos) << outcome.text;
  double orb = 0;
  double mine = 0;
  const std::string believed = outcome.text.substr(outcome.text.find(" orb: ", line));
  ASSERT_EQ(std::sscanf(believed.c_str(), " orb: %lf mine: %lf", &orb, &mine), 2) << outcome.text;
  EXPECT_GT(mine, 0.3);
  EXPECT_GT(orb, 0.3);
}

class Example03 : public ::testing::Test {
 protected:
  Outcome RunOn(const std::string& images, const std::string& depth) {
    return RunExample(TUTTI_EXAMPLE_03, images + " '" + (folder_ / "state").string() + "' " + depth);
  }
  std::filesystem::path folder_ = testing::FreshFolder();
};

TEST_F(Example03, ASecondRunFindsThePlacesOfTheFirstWithTheirPoses) {
  const std::string first_walk = MakeFolder(folder_ / "first", 0, kWalkPlaces);
  const std::string second_walk = MakeFolder(folder_ / "second", kWalkPlaces, kWalkPlaces + 6);
  const Outcome first = RunOn(first_walk, "2.0");
  EXPECT_EQ(first.status, 0) << first.text;
  EXPECT_TRUE(first.Has("0 keyframes known\n")) << first.text;
  EXPECT_TRUE(first.Has("15 keyframes, 0 loops\n")) << first.text;

  const Outcome second = RunOn(second_walk, "2.0");
  EXPECT_EQ(second.status, 0) << second.text;
  EXPECT_TRUE(second.Has("15 keyframes known\n")) << second.text;
  const std::size_t line = second.text.find("keyframe 19 at 4: moved");
  ASSERT_NE(line, std::string::npos) << second.text;
  double x = 0, y = 0, z = 0, degrees = 0;
  ASSERT_EQ(std::sscanf(second.text.c_str() + line,
                        "keyframe 19 at 4: moved (%lf, %lf, %lf) m, turned by %lf", &x, &y, &z, &degrees),
            4)
      << second.text;
  // SeenAgain: 1.03 times as large, so at 2 m / 1.03 from the wall; turned by a degree; 4 of 320 px aside.
  const double expected_z = 2.0 - 2.0 / 1.03;
  const double aside = 4.0 / 320.0 * 2.0 / 1.03;
  EXPECT_NEAR(z, expected_z, 0.02) << second.text;
  EXPECT_NEAR(std::hypot(x, y), aside, 0.03) << second.text;
  EXPECT_NEAR(degrees, 1.0, 0.7) << second.text;
}

TEST_F(Example03, WithoutDepthALoopComesWithADirection) {
  const Outcome outcome = RunOn(MakeFolder(folder_ / "images", 0, 20), "");
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_TRUE(outcome.Has("keyframe 18 at 3: direction")) << outcome.text;
}

TEST_F(Example03, ADamagedStateIsAnErrorThatNamesTheFile) {
  std::ofstream(folder_ / "state") << "no detector";
  const Outcome outcome = RunOn(MakeFolder(folder_ / "images", 0, 2), "");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_TRUE(outcome.Has((folder_ / "state").string() + ": is no")) << outcome.text;
}

TEST(Examples, ABadFolderIsAnErrorNotACrash) {
  for (const char* program : {TUTTI_EXAMPLE_01, TUTTI_EXAMPLE_02}) {
    EXPECT_EQ(RunExample(program, "/nowhere/at/all").status, 1);
    EXPECT_EQ(RunExample(program, "one two").status, 1);
  }
  EXPECT_EQ(RunExample(TUTTI_EXAMPLE_03, "/nowhere/at/all /nowhere/state").status, 1);
  EXPECT_EQ(RunExample(TUTTI_EXAMPLE_03, "alone").status, 1);
}

}  // namespace
}  // namespace tutti
