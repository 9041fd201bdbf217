// Example 06, as a user would run it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/slam/map_file.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;
using testing::RunProgramAndSignal;

TEST(MapExample, MapsALapAndLocatesTheNextFramesInIt) {
  constexpr int kLap = 142;
  const std::filesystem::path town = testing::GeneratedDataset(testing::SmallStereoTownWithALoop(320, 160));
  const std::filesystem::path map = testing::FreshFolder() / "map.tutti";
  const auto run =
      RunProgramAndSignal(TUTTI_EXAMPLE_06, {town / "config.yaml", town, std::to_string(kLap), map}, "", 0);
  EXPECT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("map of 142 frames: "));
  EXPECT_THAT(run.output, HasSubstr(" landmarks, sigma 0.0"));
  EXPECT_THAT(run.output, HasSubstr(" frames are in the map\n"));
  EXPECT_EQ(ReadMapInfo(map).frames, kLap) << "the map has none of the frames that were located in it";
}

TEST(MapExample, SaysWhatIsWrong) {
  const std::filesystem::path nothing = testing::FreshFolder() / "nothing";
  EXPECT_THAT(RunProgramAndSignal(TUTTI_EXAMPLE_06, {}, "", 0).output, HasSubstr("usage: "));
  const auto run = RunProgramAndSignal(TUTTI_EXAMPLE_06, {nothing, nothing, "5", nothing}, "", 0);
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, HasSubstr(nothing.string()));
}

}  // namespace
}  // namespace tutti
