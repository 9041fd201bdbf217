// `tutti loops` on pairs of images that it joins, as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "data/synthetic/synthetic_world.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;
using testing::WriteAll;

constexpr int kPairs = 14;

// A few pairs of small images that look to both sides of a street.
std::filesystem::path SidesOfAStreet() {
  SyntheticOptions options;
  options.sensor = SyntheticSensor::kSides;
  options.width = 160;
  options.height = 120;
  options.rate_hz = 2;
  options.frames = kPairs;
  options.supersample = 1;
  std::filesystem::path folder = testing::FreshFolder() / "sides";
  WriteSyntheticDataset(SyntheticWorld(options), folder);
  return folder;
}

// A text matrix without loops.
std::string Zeros(int size) {
  std::string row;
  for (int i = 0; i < size; ++i) row += "0 ";
  std::string text;
  for (int i = 0; i < size; ++i) text += row + "\n";
  return text;
}

TEST(LoopsPairs, JoinsPairsAndTakesTruthOfPairsOrOfSingleImages) {
  const std::filesystem::path folder = SidesOfAStreet();
  WriteAll(folder / "pairs.txt", Zeros(kPairs));
  WriteAll(folder / "singles.txt", Zeros(2 * kPairs));
  for (const char* truth : {"poses.txt", "pairs.txt", "singles.txt"}) {
    const auto out = folder / "out";
    const auto run = RunTutti({"loops", "--images", folder / "images", "--join-pairs", "--ground-truth",
                               folder / truth, "--rule", "orb", "--out", out});
    ASSERT_EQ(run.status, 0) << run.output;
    const auto json = nlohmann::json::parse(ReadAll(out / "results.json"));
    EXPECT_EQ(json["images"], kPairs) << truth;
    EXPECT_EQ(json["images_damaged"], 0);
    EXPECT_FALSE(std::filesystem::exists(out / "posteriors.csv"));
  }
}

TEST(LoopsPairs, KeepPosteriorWritesWhatEachMemberBelieves) {
  const std::filesystem::path folder = SidesOfAStreet();
  const auto run = RunTutti({"loops", "--images", folder / "images", "--join-pairs", "--ground-truth",
                             folder / "poses.txt", "--keep-posterior", "--out", folder / "out"});
  ASSERT_EQ(run.status, 0) << run.output;
  const std::string csv = ReadAll(folder / "out/posteriors.csv");
  EXPECT_THAT(csv, HasSubstr("image,location,truth,combined,surf,sift,orb\n"));
  // Ten images are in short-term memory: the twelfth is the first with a candidate other than the first
  // image.
  EXPECT_THAT(csv, HasSubstr("\n11,1,"));
}

TEST(LoopsPairs, AnOddNumberOfImagesCanNotBeJoined) {
  const std::filesystem::path folder = SidesOfAStreet();
  std::filesystem::remove(folder / "images/000005.png");
  const auto run = RunTutti({"loops", "--images", folder / "images", "--join-pairs", "--ground-truth",
                             folder / "poses.txt", "--out", folder / "out"});
  EXPECT_NE(run.status, 0);
  EXPECT_THAT(run.output, HasSubstr("27 images"));
  EXPECT_THAT(run.output, HasSubstr("--join-pairs"));
}

}  // namespace
}  // namespace tutti
