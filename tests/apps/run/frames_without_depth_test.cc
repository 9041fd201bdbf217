// Runs on RGB-D data where some colour images have no depth, and the numbers of frames in their files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/test_data.h"
#include "tutti/core/text.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;
using testing::WriteAll;

// Once around a room and a bit more, with loops.
const fs::path& Room() {
  static const fs::path room = testing::GeneratedDataset([] {
    SyntheticOptions options;
    options.scene = SyntheticScene::kRoom;
    options.sensor = SyntheticSensor::kRgbd;
    options.width = 400;
    options.height = 300;
    options.rate_hz = 8;
    options.laps = 1.15;
    return options;
  }());
  return room;
}

// Lines of a list without its comment, each "stamp file".
std::vector<std::string> Lines(const fs::path& list) {
  std::vector<std::string> lines;
  std::istringstream in(ReadAll(list));
  for (std::string line; std::getline(in, line);) {
    if (line[0] != '#') lines.push_back(line);
  }
  return lines;
}

class FramesWithoutDepth : public ::testing::Test {
 protected:
  FramesWithoutDepth() {
    fs::create_directories(room_);
    for (const char* part : {"rgb", "depth"}) fs::create_directory_symlink(Room() / part, room_ / part);
    for (const char* list : {"rgb.txt", "depth.txt", "groundtruth.txt", "config.yaml"})
      fs::copy_file(Room() / list, room_ / list);
    all_ = Lines(room_ / "rgb.txt").size();
  }

  // Keeps the lines of a list for whose place `keep` holds.
  template <typename Keep>
  void Thin(const char* list, const Keep& keep) const {
    const std::vector<std::string> lines = Lines(room_ / list);
    std::string text;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (keep(i)) text += lines[i] + "\n";
    }
    WriteAll(room_ / list, text);
  }
  // Depth files of their own, which a test may damage.
  void OwnDepthFiles() const {
    fs::remove(room_ / "depth");
    fs::copy(Room() / "depth", room_ / "depth");
  }
  fs::path DepthFile(std::size_t i) const {
    return room_ / SplitText(Lines(Room() / "depth.txt").at(i)).at(1);
  }

  testing::ProcessResult Run(std::vector<std::string> more = {}) const {
    more.insert(more.begin(), "--no-report");
    return RunTutti(testing::RunArguments(room_ / "config.yaml", room_, out_, more));
  }
  nlohmann::json Summary() const { return nlohmann::json::parse(ReadAll(out_ / "summary.json")); }
  static double AteOf(const nlohmann::json& summary) {
    return summary["evaluation"]["slam"]["ate_rmse_m"].get<double>();
  }
  // The summary of a run on the whole room, made once.
  const nlohmann::json& Complete() const {
    static const nlohmann::json complete = [this] {
      EXPECT_EQ(Run().status, 0);
      return Summary();
    }();
    return complete;
  }

  // The lines of loops.csv name images of rgb.txt by their places; returns how many lines there are.
  std::size_t ExpectLoopsCountImages() const {
    const std::vector<std::string> images = Lines(room_ / "rgb.txt");
    const std::vector<std::string> loops = Lines(out_ / "loops.csv");
    for (std::size_t i = 1; i < loops.size(); ++i) {
      const std::vector<std::string> cells = SplitText(loops[i], ",");
      for (const std::size_t end : {0U, 1U}) {
        const std::string& image = images.at(static_cast<std::size_t>(*ParseInteger(cells.at(end))));
        EXPECT_NEAR(*ParseDouble(cells.at(end + 2)), *ParseDouble(SplitText(image).at(0)), 1e-6) << loops[i];
      }
    }
    EXPECT_EQ(Summary()["loops"]["proposed"].get<std::size_t>(), loops.size() - 1);
    return loops.size() - 1;
  }

  const fs::path folder_ = testing::FreshFolder();
  const fs::path room_ = folder_ / "room", out_ = folder_ / "out";
  std::size_t all_ = 0;
};

TEST_F(FramesWithoutDepth, EveryThirdMissingChangesLittleAndEveryImageCounts) {
  const double complete = AteOf(Complete());
  EXPECT_EQ(Complete()["frames"]["without_depth"], 0);
  Thin("depth.txt", [](std::size_t i) { return i % 3 != 1; });
  const auto run = Run();
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, AllOf(HasSubstr("63 of 189 colour images have no depth image"),
                                HasSubstr("63 without depth image")));
  const nlohmann::json frames = Summary()["frames"];
  EXPECT_EQ(frames["total"], all_);
  EXPECT_EQ(frames["in_dataset"], all_);
  EXPECT_EQ(frames["tracked"], all_);
  EXPECT_EQ(frames["without_depth"], 63);
  EXPECT_TRUE(frames["bad_depth"].empty());
  EXPECT_EQ(ReadTrajectory(out_ / "trajectory.txt", TrajectoryFormat::kTum).size(), all_);
  EXPECT_LT(AteOf(Summary()), 1.3 * complete + 0.002);
  EXPECT_GT(ExpectLoopsCountImages(), 2U);
  EXPECT_GT(Summary()["loops"]["accepted"], 0);
}

TEST_F(FramesWithoutDepth, TheFirstFiveAreCountedAndPosedOnceThereIsDepth) {
  Thin("depth.txt", [](std::size_t i) { return i >= 5; });
  ASSERT_EQ(Run({"--end", "30"}).status, 0);
  const nlohmann::json frames = Summary()["frames"];
  EXPECT_EQ(frames["total"], 30);
  EXPECT_EQ(frames["tracked"], 30);
  EXPECT_EQ(frames["lost"], 5) << "when they came";
  EXPECT_EQ(frames["lost_stretches"][0]["first"], 0);
  EXPECT_EQ(frames["lost_stretches"][0]["last"], 4);
  EXPECT_THAT(frames["lost_stretches"][0]["reason"], HasSubstr("waiting for a frame with depth"));
  EXPECT_LT(AteOf(Summary()), 0.02);
}

TEST_F(FramesWithoutDepth, DamagedDepthIsNamedByTheNumberOfItsImage) {
  OwnDepthFiles();
  WriteAll(DepthFile(14), "no image");
  fs::remove(DepthFile(20));
  fs::remove(room_ / "rgb");
  fs::copy(Room() / "rgb", room_ / "rgb");
  WriteAll(room_ / SplitText(Lines(room_ / "rgb.txt").at(26)).at(1), "no image");
  const auto run = Run({"--start", "8", "--end", "40", "--stride", "2"});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, AllOf(HasSubstr("frame 14 is tracked without its depth image"),
                                HasSubstr("frame 26 is skipped")));
  const nlohmann::json frames = Summary()["frames"];
  EXPECT_EQ(frames["total"], 16);
  EXPECT_EQ(frames["tracked"], 15);
  EXPECT_EQ(frames["without_depth"], 2);
  ASSERT_EQ(frames["bad_depth"].size(), 2U);
  EXPECT_EQ(frames["bad_depth"][0]["index"], 14);
  EXPECT_EQ(frames["bad_depth"][1]["index"], 20);
  EXPECT_THAT(frames["bad_depth"][1]["error"], AllOf(HasSubstr("depth/"), HasSubstr("missing")));
  ASSERT_EQ(frames["bad_frames"].size(), 1U);
  EXPECT_EQ(frames["bad_frames"][0]["index"], 26);
}

TEST_F(FramesWithoutDepth, NoUsableDepthAtAllIsAVoidRunThatSaysSo) {
  OwnDepthFiles();
  for (std::size_t i = 0; i < 12; ++i) WriteAll(DepthFile(i), "no image");
  const auto run = Run({"--end", "12"});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, AllOf(HasSubstr("not one frame has a depth image"),
                                HasSubstr(DepthFile(0).filename().string() + ": is damaged")));
  EXPECT_EQ(Summary()["frames"]["without_depth"], 12);
  Thin("depth.txt", [](std::size_t i) { return i >= 40; });
  const auto part = Run({"--end", "12"});
  EXPECT_EQ(part.status, 1);
  EXPECT_THAT(part.output, HasSubstr("not one frame has a depth image"));
  Thin("depth.txt", [](std::size_t) { return false; });
  const auto empty = Run();
  EXPECT_EQ(empty.status, 1);
  EXPECT_THAT(empty.output, AllOf(HasSubstr("depth.txt"), HasSubstr("lists no images")));
}

TEST_F(FramesWithoutDepth, LoopsToAnImageBeforeTheGroundTruthAreJudgedWithinHalfAFrame) {
  const nlohmann::json& complete = Complete()["loops"];
  ASSERT_GT(complete["true"], 0);
  ASSERT_EQ(complete["without_ground_truth"], 0);
  // The camera began 50 ms before the ground truth; 62.5 ms are half a frame.
  Trajectory truth = ReadTrajectory(room_ / "groundtruth.txt", TrajectoryFormat::kTum);
  const double first_s = truth.front().stamp_s;
  truth.front().stamp_s += 0.05;
  WriteTrajectory(room_ / "groundtruth.txt", truth, TrajectoryFormat::kTum);
  ASSERT_EQ(Run().status, 0);
  EXPECT_EQ(Summary()["loops"]["true"], complete["true"]);
  EXPECT_EQ(Summary()["loops"]["without_ground_truth"], 0);
  truth.front().stamp_s = first_s + 0.07;
  WriteTrajectory(room_ / "groundtruth.txt", truth, TrajectoryFormat::kTum);
  ASSERT_EQ(Run().status, 0);
  EXPECT_GT(Summary()["loops"]["without_ground_truth"], 0);
}

}  // namespace
}  // namespace tutti
