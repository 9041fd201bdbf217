// The table of published figures is well-formed, and sequences are found in paths.
#include "apps/tutti/published.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/error_of.h"

namespace tutti::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tutti::testing::ErrorOf;

TEST(Published, EveryRowHasItsSourceSensorAndAlignment) {
  EXPECT_THAT(PublishedBenchmarks(), ElementsAre("euroc", "tum", "kitti"));
  for (const PublishedRow& row : PublishedRows()) {
    EXPECT_FALSE(row.source.empty() || row.protocol.empty() || row.ate_m.empty()) << row.system;
    EXPECT_THAT(row.sensor, ::testing::AnyOf("mono", "stereo", "rgbd", "stereo-inertial"));
    EXPECT_EQ(row.alignment, row.sensor == "mono" ? "sim3" : "se3") << row.system;
  }
  EXPECT_EQ(PublishedSequences("euroc").size(), 11u);
  EXPECT_EQ(PublishedSequences("kitti").size(), 11u);
}

TEST(Published, AMalformedLineIsNamed) {
  const auto error = [](const std::string& figures) {
    return ErrorOf([&] { ParsePublished("# head\neuroc\tA\tmono\tsim3\tsource\tprotocol\t" + figures); });
  };
  EXPECT_THAT(error("MH01=0.1 MH02"), HasSubstr("published.tsv:2:"));
  EXPECT_THAT(error("MH01=-1"), HasSubstr("MH01=-1"));
  EXPECT_THAT(error("MH01=1 MH01=2"), HasSubstr("second figure"));
  EXPECT_THAT(ErrorOf([] { ParsePublished("euroc\tA\tmono\n"); }), HasSubstr("3 columns"));
  EXPECT_FALSE(ParsePublished("euroc\tA\tmono\tsim3\ts\tp\tMH01=x").front().Of("MH01")->has_value());
}

TEST(Published, SequencesAreFoundInTheNamesThatDataSetsHave) {
  EXPECT_EQ(SequenceInPath("euroc", "/data/MH_01_easy/mav0/state_groundtruth_estimate0/data.csv"), "MH01");
  EXPECT_EQ(SequenceInPath("euroc", "euroc/V2_03_difficult/gt.txt"), "V203");
  EXPECT_EQ(SequenceInPath("euroc", "out/v102.txt"), "V102");
  EXPECT_EQ(SequenceInPath("tum", "rgbd_dataset_freiburg1_desk2/groundtruth.txt"), "fr1_desk2");
  EXPECT_EQ(SequenceInPath("tum", "rgbd_dataset_freiburg1_desk/groundtruth.txt"), "fr1_desk");
  EXPECT_EQ(SequenceInPath("tum", "rgbd_dataset_freiburg3_long_office_household/groundtruth.txt"),
            "fr3_office");
  EXPECT_EQ(SequenceInPath("tum", "fr2_xyz-groundtruth.txt"), "fr2_xyz");
  EXPECT_EQ(SequenceInPath("kitti", "dataset/poses/05.txt"), "05");
  EXPECT_EQ(SequenceInPath("kitti", "KITTI_00_gt.txt"), "00");
  EXPECT_EQ(SequenceInPath("kitti", "run_2005/trajectory.txt"), "");
  EXPECT_EQ(SequenceInPath("tum", "redkitchen/groundtruth.txt"), "");
}

}  // namespace
}  // namespace tutti::cli
