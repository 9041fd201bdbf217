// `tutti loops` with the long-term memory of an earlier run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/loops_fixture.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::kLoopPlaces;
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;
using testing::WriteAll;

class LoopsMemory : public testing::LoopsFixture {};

TEST_F(LoopsMemory, ALaterRunWithTheSameMemoryFindsLoopsIntoTheImagesOfTheFirst) {
  WriteImages(kLoopPlaces);
  constexpr int kAgain = 4;
  const fs::path later = folder_ / "later";
  fs::create_directories(later);
  for (int i = 0; i < kAgain; ++i)
    cv::imwrite((later / (std::to_string(i) + ".png")).string(),
                testing::SeenAgain(testing::TexturedImage(static_cast<std::uint32_t>(i))));
  const fs::path memory = folder_ / "memory", out = folder_ / "later_out";
  const std::vector<std::vector<std::string>> ways = {{"--set", "ltm_file=" + memory.string() + ".ltm"},
                                                      {"--places", memory.string() + ".places"}};
  for (const std::vector<std::string>& way : ways) {
    ASSERT_EQ(Run(Truth({}, kLoopPlaces), out_, way).status, 0);
    EXPECT_FALSE(fs::exists(out_ / "earlier_loops.csv"));
    const auto go_on = [&] {
      return RunTutti({"loops", "--images", later.string(), "--ground-truth", Truth({}, kAgain).string(),
                       "--out", out.string(), way[0], way[1]});
    };
    const auto run = go_on();
    ASSERT_EQ(run.status, 0) << run.output;
    EXPECT_THAT(run.output, HasSubstr("4 images, into 15"));
    const nlohmann::json json = Json(out / "results.json");
    EXPECT_EQ(json["earlier"]["images"], kLoopPlaces);
    EXPECT_EQ(json["earlier"]["loops"], kAgain);
    EXPECT_EQ(json["images"], kAgain);
    EXPECT_EQ(json["accepted"]["false"], 0) << "the ground truth does not know the earlier images";
    const std::vector<std::string> lines = SplitText(ReadAll(out / "earlier_loops.csv"), "\n");
    ASSERT_EQ(lines.size(), 1u + kAgain);
    for (int i = 0; i < kAgain; ++i) {
      const std::string name = std::to_string(i) + ".png";
      EXPECT_THAT(lines[static_cast<std::size_t>(i) + 1],
                  StartsWith(std::to_string(i) + ",\"" + name + "\"," + std::to_string(i) + ",\"" +
                             (images_ / name).string() + "\","));
    }
    EXPECT_THAT(ReadAll(out / "hypotheses.csv"), HasSubstr((images_ / "0.png").string()));
    ASSERT_EQ(go_on().status, 0);
    EXPECT_EQ(Json(out / "results.json")["earlier"]["images"], kLoopPlaces + kAgain) << "numbers go on";
  }
}

TEST_F(LoopsMemory, AMemoryThatIsOfNoUseIsNamed) {
  WriteImages(3);
  const std::string memory = (folder_ / "memory.ltm").string(), set = "ltm_file=" + memory;
  const fs::path truth = Truth({}, 3);
  const auto table = Run(truth, out_, {"--set", set, "--table"});
  EXPECT_EQ(table.status, 1);
  EXPECT_THAT(table.output, AllOf(HasSubstr(memory), HasSubstr("--table")));
  ASSERT_EQ(Run(truth, out_, {"--set", set}).status, 0);
  const auto other = Run(truth, out_, {"--set", set, "--rule", "orb"});
  EXPECT_EQ(other.status, 1);
  EXPECT_THAT(other.output, AllOf(HasSubstr(memory), HasSubstr("another configuration")));
  WriteAll(memory + ".images.csv", "image,file\nthree,x.png\n");
  const auto damaged = Run(truth, out_, {"--set", set});
  EXPECT_EQ(damaged.status, 1);
  EXPECT_THAT(damaged.output, HasSubstr(memory + ".images.csv:2"));
  fs::remove(memory + ".images.csv");
  EXPECT_EQ(Run(truth, out_, {"--set", set}).status, 0) << "without names";
}

}  // namespace
}  // namespace tutti
