// LoopDetector's memory: transfer, retrieval, members' own memories, and the file that outlives the process.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "tests/loopclosure/detector/two_laps.h"
#include "tests/support/full_disk.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/detector.h"

namespace tutti {
namespace {

using testing::CountFalse;
using testing::CountTrue;
using testing::SmallOptions;
using testing::Walk;

constexpr int kMemoryPlaces = 16;

class EveryMemory : public ::testing::TestWithParam<std::tuple<MemoryKind, std::string>> {
 protected:
  LoopDetectorOptions Options() const {
    LoopDetectorOptions options = SmallOptions();
    options.memory = std::get<0>(GetParam());
    SetRule(std::get<1>(GetParam()), options);
    return options;
  }
};
INSTANTIATE_TEST_SUITE_P(Kinds, EveryMemory,
                         ::testing::Combine(::testing::Values(MemoryKind::kShared, MemoryKind::kPerMember),
                                            ::testing::Values("mean", "majority", "product", "naive",
                                                              "orb")));

TEST_P(EveryMemory, WorkingMemoryIsBoundedAndLoopsAreFoundThroughRetrieval) {
  LoopDetectorOptions options = Options();
  options.wm_limit = 8;
  LoopDetector detector(options);
  std::vector<LoopResult> results = Walk(detector, 0, kMemoryPlaces, kMemoryPlaces);
  EXPECT_LE(detector.NumLocations(), 8u + 3u + (options.memory == MemoryKind::kShared ? 0u : 8u));
  EXPECT_GT(detector.NumLongTerm(), 0u);
  EXPECT_FALSE(results.back().transferred.empty());
  // The walk starts again where the memory still knows it, and what follows comes back as it is needed.
  results = Walk(detector, kMemoryPlaces + 8, 2 * kMemoryPlaces, kMemoryPlaces);
  EXPECT_EQ(CountFalse(results, kMemoryPlaces), 0);
  // In a memory of eight places the alias level is not learnt, and stays as cautious as it starts.
  if (std::get<1>(GetParam()) != "product" && std::get<1>(GetParam()) != "naive") {
    EXPECT_GE(CountTrue(results, kMemoryPlaces), 3);
  }
  for (const LoopResult& result : results) EXPECT_EQ(result.warning, "");
}

TEST_P(EveryMemory, TheSameForOneAndTwoThreads) {
  LoopDetectorOptions options = Options();
  options.wm_limit = 6;
  options.rehearsal = true;
  options.rehearsal_similarity = 0.2;
  options.threads = 1;
  LoopDetector one(options);
  options.threads = 2;
  LoopDetector two(options);
  testing::ExpectEqual(Walk(one, 0, 26, kMemoryPlaces), Walk(two, 0, 26, kMemoryPlaces));
}

TEST(LoopDetectorMemory, LocationsAndTheirWordsComeBackFromLongTermMemory) {
  LoopDetectorOptions options = SmallOptions();
  options.wm_limit = 6;
  LoopDetector detector(options);
  Walk(detector, 0, kMemoryPlaces, kMemoryPlaces);
  std::set<std::int64_t> retrieved;
  for (const LoopResult& result : Walk(detector, kMemoryPlaces + 6, 2 * kMemoryPlaces, kMemoryPlaces)) {
    retrieved.insert(result.retrieved.begin(), result.retrieved.end());
  }
  EXPECT_FALSE(retrieved.empty());
}

TEST(LoopDetectorMemory, MembersOwnMemoriesAgreeWithTheSharedOneWhileNothingLeaves) {
  LoopDetectorOptions options = SmallOptions();
  options.rule = CombinationRule::kMean;  // joint needs a shared memory
  LoopDetector shared(options);
  options.memory = MemoryKind::kPerMember;
  LoopDetector own(options);
  testing::ExpectEqual(Walk(shared, 0, 24, kMemoryPlaces), Walk(own, 0, 24, kMemoryPlaces));
}

TEST(LoopDetectorMemory, ATimeBudgetThatIsExceededShrinksWorkingMemory) {
  LoopDetectorOptions options = SmallOptions();
  options.wm_limit = 0;
  options.time_budget_ms = 1e-6;
  options.recent_share = 0;
  LoopDetector detector(options);
  Walk(detector, 0, kMemoryPlaces, kMemoryPlaces);
  // STM, what it is linked to, what is near the hypothesis, and what has just come back.
  EXPECT_LE(detector.NumLocations(), 3u + 1u + 5u + 2u);
}

TEST(LoopDetectorMemory, ImagesWithoutFeaturesAreNoLocationsIfToldSo) {
  LoopDetectorOptions options = SmallOptions();
  LoopDetector keeps(options);
  options.ignore_bad_signatures = true;
  LoopDetector ignores(options);
  const cv::Mat blank(180, 240, CV_8UC1, cv::Scalar(128));
  for (LoopDetector* detector : {&keeps, &ignores}) {
    Walk(*detector, 0, 4, kMemoryPlaces);
    for (int i = 4; i < 9; ++i) detector->Detect(blank, i);
  }
  EXPECT_EQ(keeps.NumLocations(), 9u);
  EXPECT_EQ(ignores.NumLocations(), 4u);
}

class DurableMemory : public ::testing::Test {
 protected:
  LoopDetectorOptions Options() const {
    LoopDetectorOptions options = SmallOptions();
    options.wm_limit = 10;
    options.ltm_file = (folder_ / "places.ltm").string();
    return options;
  }
  std::string Refusal(const LoopDetectorOptions& options) const {
    try {
      LoopDetector detector(options);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  std::filesystem::path folder_ = testing::FreshFolder();
};

TEST_F(DurableMemory, ALaterDetectorGoesOnWhereTheFirstOneStopped) {
  for (const MemoryKind memory : {MemoryKind::kShared, MemoryKind::kPerMember}) {
    LoopDetectorOptions options = Options();
    options.memory = memory;
    if (memory == MemoryKind::kPerMember) options.rule = CombinationRule::kMean;
    std::filesystem::remove(options.ltm_file);
    std::size_t locations = 0;
    std::size_t long_term = 0;
    {
      LoopDetector first(options);
      Walk(first, 0, kMemoryPlaces, kMemoryPlaces);
      locations = first.NumLocations();
      long_term = first.NumLongTerm();
    }
    LoopDetector second(options);
    EXPECT_EQ(second.NumLocations(), locations);
    EXPECT_EQ(second.NumLongTerm(), long_term);
    EXPECT_EQ(second.LastId(), kMemoryPlaces - 1);
    EXPECT_THROW(second.Detect(cv::Mat(), kMemoryPlaces - 1), InputError);  // ids go on, too
    const std::vector<LoopResult> results = Walk(second, kMemoryPlaces + 4, 2 * kMemoryPlaces, kMemoryPlaces);
    EXPECT_GE(CountTrue(results, kMemoryPlaces), 4);
    EXPECT_EQ(CountFalse(results, kMemoryPlaces), 0);
  }
}

TEST_F(DurableMemory, NothingIsLostWhenTheProcessDies) {
  const LoopDetectorOptions options = Options();
  const pid_t child = fork();
  if (child == 0) {
    LoopDetectorOptions own = options;
    own.threads = 1;
    LoopDetector detector(own);
    Walk(detector, 0, kMemoryPlaces, kMemoryPlaces);
    kill(getpid(), SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  LoopDetector detector(options);
  EXPECT_EQ(detector.LastId(), kMemoryPlaces - 1);
  EXPECT_EQ(detector.NumLocations() + detector.NumLongTerm(), static_cast<std::size_t>(kMemoryPlaces));
  EXPECT_GE(CountTrue(Walk(detector, kMemoryPlaces + 4, 2 * kMemoryPlaces, kMemoryPlaces), kMemoryPlaces), 4);
}

TEST_F(DurableMemory, AFileInUseOrOfOtherMembersOrDamagedIsRefused) {
  LoopDetectorOptions options = Options();
  {
    LoopDetector first(options);
    Walk(first, 0, 4, kMemoryPlaces);
    EXPECT_NE(Refusal(options).find("in use"), std::string::npos);
  }
  options.members = {"orb", "sift"};
  const std::string refusal = Refusal(options);
  EXPECT_NE(refusal.find("surf sift orb"), std::string::npos) << refusal;
  EXPECT_NE(refusal.find("orb sift"), std::string::npos) << refusal;
  options = Options();
  std::filesystem::resize_file(options.ltm_file, 8192);
  EXPECT_NE(Refusal(options).find(options.ltm_file), std::string::npos);
}

TEST_F(DurableMemory, AFullDiskIsAWarningAndNothingIsLost) {
  LoopDetectorOptions options = Options();
  {
    LoopDetector detector(options);
    Walk(detector, 0, 4, kMemoryPlaces);
    {
      const testing::FullDisk full(64 << 10);
      for (const LoopResult& result : Walk(detector, 4, kMemoryPlaces, kMemoryPlaces)) {
        EXPECT_NE(result.warning.find(options.ltm_file), std::string::npos);
        for (const std::int64_t id : result.transferred) EXPECT_LT(id, 4);  // what can't be stored stays
      }
      EXPECT_EQ(detector.NumLocations() + detector.NumLongTerm(), static_cast<std::size_t>(kMemoryPlaces));
    }
    const LoopResult after = detector.Detect(testing::WalkImage(kMemoryPlaces, kMemoryPlaces), kMemoryPlaces);
    EXPECT_EQ(after.warning, "");
  }
  LoopDetector again(options);
  EXPECT_EQ(again.LastId(), kMemoryPlaces);
  EXPECT_EQ(again.NumLocations() + again.NumLongTerm(), static_cast<std::size_t>(kMemoryPlaces) + 1);
}

}  // namespace
}  // namespace tutti
