// A map without its redundant keyframes is as good as it was.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "apps/slam/map_state.h"
#include "tests/apps/slam/map_outcome.h"
#include "tests/support/error_of.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/slam/localizer.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// With the ensemble once, over two laps in stereo; else one member finds the loops.
RunConfig WithFewFeatures(bool ensemble) {
  RunConfig config;
  config.odometry.features = 800;
  if (!ensemble) config.loops.members = {"orb"};
  return config;
}

testing::Recording DriveLaps(SyntheticSensor sensor) {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.sensor = sensor;
  options.laps = 2.3;
  const testing::RenderedWorld world(options);
  return testing::Record(world, world.Size());
}

double FarthestApart(const Trajectory& a, const Trajectory& b) {
  if (a.size() != b.size()) return 1e9;
  double farthest = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    farthest = std::max(farthest, (a[i].pose.translation - b[i].pose.translation).norm());
  return farthest;
}

// Nodes that can be reached from the first one.
std::size_t Connected(const PoseGraph& graph) {
  std::map<NodeId, std::vector<NodeId>> neighbours;
  for (const PoseGraphEdge& edge : graph.edges()) {
    neighbours[edge.from].push_back(edge.to);
    neighbours[edge.to].push_back(edge.from);
  }
  std::set<NodeId> reached = {graph.nodes().front().id};
  std::vector<NodeId> next(reached.begin(), reached.end());
  while (!next.empty()) {
    const NodeId node = next.back();
    next.pop_back();
    for (const NodeId other : neighbours[node]) {
      if (reached.insert(other).second) next.push_back(other);
    }
  }
  return reached.size();
}

// Frames from `first` on that are located in the map, and how far they are from where `expected` has them.
std::pair<std::size_t, double> Locate(const SlamSystem& slam, const testing::Recording& recording,
                                      std::size_t first, const Trajectory& expected) {
  std::size_t found = 0;
  double worst = 0;
  Localizer localizer(slam);
  for (std::size_t i = first; i < recording.frames.size(); ++i) {
    const TrackResult result = localizer.Track(recording.frames[i]);
    if (result.state != TrackingState::kTracking) continue;
    ++found;
    const double stamp = recording.frames[i].stamp_s;
    const auto same = std::find_if(expected.begin(), expected.end(),
                                   [stamp](const StampedPose& pose) { return pose.stamp_s == stamp; });
    if (same == expected.end()) return {found, 1e9};
    worst = std::max(worst, (result.T_world_camera.translation - same->pose.translation).norm());
  }
  return {found, worst};
}

void ExpectOnePiece(const SlamSystem& slam) {
  EXPECT_EQ(FramePieces(slam.odometry()->map()).size(), 1u);
  EXPECT_EQ(Connected(slam.Graph()), slam.odometry()->map().KeyframeIds().size());
}

// What loops.csv says of them; their edges go over to keyframes that stay.
std::string RecordsOf(std::vector<Loop> loops) {
  for (Loop& loop : loops) {
    loop.edge = LoopEdge();
    loop.untied = false;
  }
  return StateOf(loops);
}

class Pruned : public ::testing::TestWithParam<SyntheticSensor> {};

// One test, for the sake of its time: two laps are mapped and pruned.
TEST_P(Pruned, MapIsSmallerAndKeepsPosesLoopsAndGraphAndGoesOnAndTellsWhereFramesAre) {
  const testing::Recording recording = DriveLaps(GetParam());
  const std::size_t n = recording.frames.size(), mapped = n - 45;
  SlamSystem slam(WithFewFeatures(GetParam() == SyntheticSensor::kStereo), recording.rig);
  for (std::size_t i = 0; i < mapped; ++i) slam.Track(recording.frames[i]);
  slam.Finish();
  const Trajectory trajectory = FrameTrajectory(slam.odometry()->map());
  const std::string loops = RecordsOf(slam.loops());
  const std::size_t accepted = CountAccepted(slam.loops());
  const std::vector<int> before = slam.odometry()->map().KeyframeIds();
  ASSERT_GT(accepted, 0u);

  const std::size_t removed = slam.Prune();
  const std::vector<int> ids = slam.odometry()->map().KeyframeIds();
  std::printf("  %zu of %zu keyframes removed\n", removed, before.size());
  EXPECT_GT(removed, before.size() / 12);
  EXPECT_EQ(ids.size() + removed, before.size());
  EXPECT_EQ(ids.front(), before.front());
  EXPECT_TRUE(std::includes(before.begin(), before.end(), ids.begin(), ids.end())) << "ids stay";
  EXPECT_LT(FarthestApart(FrameTrajectory(slam.odometry()->map()), trajectory), 1e-9);
  EXPECT_EQ(RecordsOf(slam.loops()) == loops, true) << "records stay";
  EXPECT_EQ(slam.Graph().nodes().size(), ids.size());
  EXPECT_EQ(Connected(slam.Graph()), ids.size());

  const fs::path file = testing::FreshFolder() / "map.tutti";
  slam.Snapshot().Write(file);
  const MapInfo info = ReadMapInfo(file);
  EXPECT_EQ(static_cast<std::size_t>(info.keyframes), ids.size());
  const auto loaded = LoadMap(file, info), located = LoadMap(file, info);
  EXPECT_LT(FarthestApart(FrameTrajectory(loaded->odometry()->map()), trajectory), 1e-9);
  for (SlamSystem* each : {&slam, loaded.get()}) {
    std::size_t lost = 0;
    for (std::size_t i = mapped; i < n; ++i)
      lost += each->Track(recording.frames[i]).state != TrackingState::kTracking ? 1 : 0;
    EXPECT_EQ(lost, 0u);
    each->Finish();
  }
  EXPECT_EQ(StateOf(loaded->loops()) == StateOf(slam.loops()), true) << "goes on as the one that was saved";
  EXPECT_EQ(loaded->odometry()->map().KeyframeIds(), slam.odometry()->map().KeyframeIds());
  EXPECT_GE(CountAccepted(slam.loops()), accepted);

  const auto [found, worst] = Locate(*located, recording, mapped, FrameTrajectory(slam.odometry()->map()));
  std::printf("  %zu of 45 frames located, at most %.3f from where they are\n", found, worst);
  EXPECT_GE(found, 43u);
  EXPECT_LT(worst, GetParam() == SyntheticSensor::kStereo ? 0.7 : 0.1);  // mono: units of the map

  slam.Prune();
  EXPECT_EQ(Connected(slam.Graph()), slam.odometry()->map().KeyframeIds().size()) << "pruned twice";

  // Another recording goes on in it, and it can be either side of a merge.
  const auto continued = LoadMap(file, info), other = LoadMap(file, info);
  continued->BeginSession(recording.rig);
  for (std::size_t i = mapped; i < n; ++i) continued->Track(recording.frames[i]);
  continued->Finish();
  EXPECT_GT(continued->Sessions().back().first_keyframe, before.back());
  ExpectOnePiece(*continued);
  std::string why;
  EXPECT_TRUE(Merge(continued.get(), other.get(), &why)) << why;
  EXPECT_GE(continued->Sessions().back().first_keyframe, continued->Sessions()[1].last_keyframe);
  ExpectOnePiece(*continued);
  continued->Snapshot().Write(file);
  ExpectOnePiece(*LoadMap(file, ReadMapInfo(file)));
}

INSTANTIATE_TEST_SUITE_P(Sensors, Pruned, ::testing::Values(SyntheticSensor::kStereo, SyntheticSensor::kMono),
                         [](const auto& param) {
                           return param.param == SyntheticSensor::kStereo ? "Stereo" : "Mono";
                         });

TEST(Prune, WhileRunningKeepsTheMapSmallAndARunThatGoesOnIsTheOneThatNeverStopped) {
  const testing::Recording recording = DriveLaps(SyntheticSensor::kStereo);
  RunConfig config = WithFewFeatures(false);
  config.run.threads = 2;
  SlamSystem whole(config, recording.rig);
  config.run.prune_every = 12;
  SlamSystem pruned(config, recording.rig);
  const fs::path file = testing::FreshFolder() / "map.tutti";
  std::size_t saved = 0;
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    whole.Track(recording.frames[i]);
    if (saved == 0 &&
        pruned.odometry()->map().KeyframeIds().size() < whole.odometry()->map().KeyframeIds().size() &&
        i > recording.frames.size() / 2) {
      pruned.Snapshot().Write(file);
      saved = i;
    }
    EXPECT_EQ(pruned.Track(recording.frames[i]).state, TrackingState::kTracking) << i;
  }
  const testing::MapOutcome outcome = testing::Finished(pruned);
  whole.Finish();
  const std::size_t left = pruned.odometry()->map().KeyframeIds().size(),
                    all = whole.odometry()->map().KeyframeIds().size();
  std::printf("  %zu keyframes, %zu if pruned while running\n", all, left);
  EXPECT_LT(left, all * 9 / 10);
  ExpectOnePiece(pruned);
  EXPECT_LT(
      FarthestApart(FrameTrajectory(pruned.odometry()->map()), FrameTrajectory(whole.odometry()->map())),
      0.5);

  ASSERT_GT(saved, 0u);
  MapInfo info = ReadMapInfo(file);
  info.config.run.threads = 1;
  const auto resumed = LoadMap(file, info);
  for (std::size_t i = saved; i < recording.frames.size(); ++i) resumed->Track(recording.frames[i]);
  testing::ExpectTheSame(testing::Finished(*resumed), outcome, "from frame " + std::to_string(saved));
}

TEST(Prune, WithoutPosesThereIsNothingToPrune) {
  CameraRig rig;
  rig.calibrated = false;
  RunConfig config;
  SlamSystem slam(config, rig);
  EXPECT_NE(testing::ErrorOf([&] { slam.Prune(); }).find("no keyframes"), std::string::npos);
}

}  // namespace
}  // namespace tutti
