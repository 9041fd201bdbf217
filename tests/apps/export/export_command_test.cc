// `tutti export` on what `tutti run` left, by the real executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/export/colmap_files.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll, testing::RunTutti;

SyntheticOptions SmallTown() {
  SyntheticOptions options;
  options.sensor = SyntheticSensor::kStereo;
  options.width = 480;
  options.height = 240;
  options.supersample = 1;
  options.frames = 25;
  return options;
}

class ExportCommand : public ::testing::Test {
 protected:
  ExportCommand()
      : town_(testing::GeneratedDataset(SmallTown())),
        folder_(testing::FreshFolder()),
        run_(folder_ / "run") {
    fs::copy(testing::RunMadeOnce(town_ / "config.yaml", town_, {"--no-report", "--no-loops"}), run_,
             fs::copy_options::recursive);
  }

  fs::path town_, folder_, run_;
};

TEST_F(ExportCommand, WritesWhatTheRunKnowsAndSaysWithWhatToOpenIt) {
  const fs::path model = folder_ / "model";
  const testing::ProcessResult said =
      RunTutti({"export", run_, "--landmarks", folder_ / "map.ply", "--colmap", model, "--transforms",
                model / "transforms.json", "--g2o", folder_ / "map.g2o", "--tum", folder_ / "map.tum"});
  ASSERT_EQ(said.status, 0) << said.output;
  EXPECT_EQ(ReadAll(folder_ / "map.tum"), ReadAll(run_ / "trajectory.txt"));
  EXPECT_EQ(ReadAll(folder_ / "map.g2o"), ReadAll(run_ / "graph.g2o"));
  EXPECT_FALSE(testing::ImagePoses(model / "sparse/0/images.txt").empty());
  EXPECT_THAT(ReadAll(folder_ / "map.ply"), HasSubstr("property uint observations"));
  for (const char* program : {"MeshLab", "colmap gui", "ns-train", "g2o_viewer", "evo_traj"})
    EXPECT_THAT(said.output, HasSubstr(program));
}

TEST_F(ExportCommand, ImagesThatWereMovedAreNamed) {
  const fs::path there = folder_ / "there";
  fs::copy(town_, there, fs::copy_options::recursive);
  ASSERT_EQ(RunTutti(testing::RunArguments(there / "config.yaml", there, run_, {"--no-report", "--no-loops"}))
                .status,
            0);
  fs::rename(there, folder_ / "moved");
  const testing::ProcessResult grey =
      RunTutti({"export", run_ / "map.tutti", "--landmarks", folder_ / "map.ply"});
  EXPECT_EQ(grey.status, 0) << grey.output;
  EXPECT_THAT(grey.output, HasSubstr("all landmarks are grey"));
  const std::vector<std::string> colmap = {"export", run_, "--colmap", folder_ / "model"};
  const testing::ProcessResult refused = RunTutti(colmap);
  EXPECT_EQ(refused.status, 1);
  EXPECT_FALSE(fs::exists(folder_ / "model"));
  std::vector<std::string> given = colmap;
  given.insert(given.end(), {"--dataset", folder_ / "moved"});
  const testing::ProcessResult found = RunTutti(given);
  EXPECT_EQ(found.status, 0) << found.output;
}

TEST_F(ExportCommand, BadCallsAreOneLineThatSaysWhatToDo) {
  EXPECT_THAT(RunTutti({"export", run_}).output, HasSubstr("give --landmarks, --colmap"));
  fs::remove(run_ / "map.tutti");
  const testing::ProcessResult none = RunTutti({"export", run_, "--tum", folder_ / "map.tum"});
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.output, HasSubstr("map.tutti: is not there"));
  EXPECT_EQ(RunTutti({"export", run_, "--images", "1", "--colmap", folder_ / "model"}).status, 1);
}

}  // namespace
}  // namespace tutti
