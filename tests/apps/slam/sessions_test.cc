// Several recordings in one map: going on in it, and merging two maps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "apps/slam/map_state.h"
#include "tests/support/each_sensor.h"
#include "tests/support/error_of.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/slam/localizer.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::Recording;

SyntheticOptions SessionTown(SyntheticSensor sensor, std::uint64_t seed = 1) {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.sensor = sensor;
  options.laps = 1.4;
  options.seed = seed;
  return options;
}

// Frames first..end of a world, as a recording of another day: its numbers begin at 0, its time stamps here.
Recording Part(const testing::RenderedWorld& world, std::size_t first, std::size_t end, double stamp_s = 0) {
  Recording part;
  part.rig = testing::RigOf(world);
  for (std::size_t i = first; i < std::min(end, world.Size()); ++i) part.Add(world.Render(i));
  const double begin_s = part.truth.front().stamp_s - stamp_s;
  for (InputFrame& frame : part.frames) frame.stamp_s -= begin_s;
  return part;
}

RunConfig Configured(int threads = 2) {
  RunConfig config;
  config.odometry.features = 800;
  config.run.threads = threads;
  return config;
}

// With one member: the ensemble once is enough.
RunConfig WithOneMember() {
  RunConfig config = Configured();
  config.loops.members = {"orb"};
  return config;
}

void TrackAll(const Recording& recording, SlamSystem* slam, std::size_t first = 0) {
  for (std::size_t i = first; i < recording.frames.size(); ++i) slam->Track(recording.frames[i]);
  slam->Finish();
}

// Largest distance of a session's frames from the truth, in the frame of reference of `origin`. Mono: after
// the scale that fits the map's first session best is not asked for; only metric sensors are compared.
double WorstError(const SlamSystem& slam, const MapSession& session, const Recording& recording,
                  const Pose& origin) {
  FrameRange range;
  range.first = session.frame_offset;
  range.last = session.frame_offset + session.last_frame;
  const Trajectory found = FrameTrajectory(slam.odometry()->map(), -1, range);
  const std::vector<std::int64_t> numbers = FrameIndices(slam.odometry()->map(), -1, range);
  double worst = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto frame = static_cast<std::size_t>(numbers[i] - session.frame_offset);
    const Eigen::Vector3d expected = origin.Inverse() * recording.truth[frame].pose.translation;
    worst = std::max(worst, (found[i].pose.translation - expected).norm());
  }
  return worst;
}

std::size_t PosedFrames(const SlamSystem& slam, const MapSession& session) {
  FrameRange range;
  range.first = session.frame_offset;
  range.last = session.frame_offset + session.last_frame;
  return FrameIndices(slam.odometry()->map(), -1, range).size();
}

std::string StateOfAll(const SlamSystem& slam) {
  std::vector<std::pair<double, Pose>> poses;
  for (const StampedPose& pose : FrameTrajectory(slam.odometry()->map()))
    poses.emplace_back(pose.stamp_s, pose.pose);
  return StateOf(poses) + StateOf(slam.loops());
}

constexpr std::size_t kLap = 150;  // frames: a lap and a bit

class Sessions : public ::testing::TestWithParam<SyntheticSensor> {
 protected:
  // A map of one lap, in a file.
  fs::path MapOfALap(const Recording& day) const {
    SlamSystem slam(GetParam() == SyntheticSensor::kStereo ? Configured() : WithOneMember(), day.rig);
    TrackAll(day, &slam);
    fs::path file = testing::FreshFolder() / "map.tutti";
    slam.Snapshot().Write(file);
    return file;
  }
};

INSTANTIATE_TEST_SUITE_P(Sensors, Sessions, testing::EachSensor(), testing::SensorName);

TEST_P(Sessions, AnotherRecordingJoinsTheMapWhoseFrameOfReferenceStaysWithTheSameBytesForAnyThreads) {
  const testing::RenderedWorld world(SessionTown(GetParam()));
  const Recording day = Part(world, 0, kLap), next = Part(world, kLap, world.Size());
  const fs::path map = MapOfALap(day);
  std::string first_bytes;
  for (const int threads : {1, 2}) {
    MapInfo info = ReadMapInfo(map);
    info.config.run.threads = threads;
    const auto slam = LoadMap(map, info);
    const Pose before = slam->odometry()->map().keyframe(0).T_world_camera;
    const std::size_t submaps = FramePieces(slam->odometry()->map()).size();
    slam->BeginSession(next.rig);
    TrackAll(next, slam.get());
    const std::vector<MapSession> sessions = slam->Sessions();
    ASSERT_EQ(sessions.size(), 2u);
    EXPECT_EQ(sessions[0].frames, static_cast<std::int64_t>(day.frames.size()));
    EXPECT_EQ(sessions[1].frames, static_cast<std::int64_t>(next.frames.size()));
    EXPECT_GT(sessions[1].frame_offset, sessions[0].last_frame);
    EXPECT_GT(sessions[1].first_keyframe, sessions[0].last_keyframe);
    ASSERT_TRUE(sessions[1].joined_at.has_value());
    EXPECT_LE(FramePieces(slam->odometry()->map()).size(), submaps) << "the session is in one of the map's";
    EXPECT_GE(PosedFrames(*slam, sessions[1]), next.frames.size() * 9 / 10);
    const Pose moved = before.Inverse() * slam->odometry()->map().keyframe(0).T_world_camera;
    EXPECT_LT(moved.translation.norm(), 0.05);
    EXPECT_LT(moved.Angle(), 0.003);
    if (GetParam() != SyntheticSensor::kMono) {
      const double worst = WorstError(*slam, sessions[1], next, day.truth.front().pose);
      EXPECT_LT(worst, 1.5);
      std::printf("  joined at frame %lld, worst %.2f m\n", static_cast<long long>(*sessions[1].joined_at),
                  worst);
    }
    const std::string bytes = StateOfAll(*slam);
    if (threads == 1) first_bytes = bytes;
    EXPECT_EQ(bytes == first_bytes, true) << "another result with more threads";
  }
}

TEST(SessionsOfAMap, GoOnFromAFileAndTheMapOfTwoSessionsCanBeLocalizedIn) {
  const testing::RenderedWorld world(SessionTown(SyntheticSensor::kStereo));
  const Recording day = Part(world, 0, 120), next = Part(world, 100, 200);
  const fs::path folder = testing::FreshFolder();
  SlamSystem whole(WithOneMember(), day.rig);
  TrackAll(day, &whole);
  whole.BeginSession(next.rig);
  constexpr std::size_t kSaved = 30;
  for (std::size_t i = 0; i < kSaved; ++i) whole.Track(next.frames[i]);
  whole.Snapshot().Write(folder / "within");
  TrackAll(next, &whole, kSaved);
  whole.Snapshot().Write(folder / "map");
  const auto again = LoadMap(folder / "within", ReadMapInfo(folder / "within"));
  TrackAll(next, again.get(), kSaved);
  EXPECT_EQ(StateOfAll(*again) == StateOfAll(whole), true) << "saved within the second session";
  const MapInfo info = ReadMapInfo(folder / "map");
  ASSERT_EQ(info.sessions.size(), 2u);
  EXPECT_EQ(info.sessions[0].keyframes + info.sessions[1].keyframes, info.keyframes);
  EXPECT_TRUE(info.sessions[1].joined_at.has_value());
  const auto where = LoadMap(folder / "map", info);
  Localizer localizer(*where);
  int found = 0;
  for (std::size_t i = 40; i < 80; ++i)
    found += localizer.Track(next.frames[i]).state == TrackingState::kTracking ? 1 : 0;
  EXPECT_GE(found, 38);
}

TEST(SessionsOfAMap, AnotherCameraGoesOnInItsOwnPixels) {
  const testing::RenderedWorld world(SessionTown(SyntheticSensor::kStereo));
  SyntheticOptions other_options = SessionTown(SyntheticSensor::kStereo);
  other_options.width = 400;
  other_options.height = 180;
  other_options.focal_px = 210;  // 186 px in the other
  const testing::RenderedWorld other(other_options);
  const Recording day = Part(world, 0, kLap), next = Part(other, kLap, other.Size());
  SlamSystem slam(WithOneMember(), day.rig);
  TrackAll(day, &slam);
  slam.BeginSession(next.rig);
  EXPECT_EQ(slam.odometry()->map().rig().camera.width, 400);
  TrackAll(next, &slam);
  const std::vector<MapSession> sessions = slam.Sessions();
  ASSERT_TRUE(sessions[1].joined_at.has_value());
  EXPECT_EQ(FramePieces(slam.odometry()->map()).size(), 1u);
  EXPECT_LT(WorstError(slam, sessions[1], next, day.truth.front().pose), 1.5);
}

TEST(SessionsOfAMap, OtherPlacesStandApartAndOtherSensorsAreRefused) {
  const testing::RenderedWorld world(SessionTown(SyntheticSensor::kStereo)),
      elsewhere(SessionTown(SyntheticSensor::kStereo, 7));
  const Recording day = Part(world, 0, 60), next = Part(elsewhere, 0, 60);
  SlamSystem slam(WithOneMember(), day.rig);
  EXPECT_NE(testing::ErrorOf([&] { slam.BeginSession(next.rig); }).find("there is no map"),
            std::string::npos);
  TrackAll(day, &slam);
  const std::string before = StateOfAll(slam);
  CameraRig mono = next.rig;
  mono.sensor = Sensor::kMono;
  EXPECT_NE(testing::ErrorOf([&] { slam.BeginSession(mono); }).find("another kind of sensor"),
            std::string::npos);
  CameraRig tele = next.rig;
  tele.camera.fx = tele.camera.fy = 4 * tele.camera.fx;
  EXPECT_NE(testing::ErrorOf([&] { slam.BeginSession(tele); }).find("focal length"), std::string::npos);
  EXPECT_EQ(slam.Sessions().size(), 1u);
  slam.BeginSession(next.rig);
  TrackAll(next, &slam);
  const std::vector<MapSession> sessions = slam.Sessions();
  EXPECT_FALSE(sessions[1].joined_at.has_value());
  FrameRange own;
  own.first = sessions[1].frame_offset;
  std::size_t posed = 0;
  for (const int piece : FramePieces(slam.odometry()->map(), own)) {
    EXPECT_GE(piece, sessions[1].first_piece);
    posed += FrameTrajectory(slam.odometry()->map(), piece, own).size();
  }
  EXPECT_GE(posed, 45u);
  // What was there is as it was.
  FrameRange old;
  old.last = sessions[1].frame_offset - 1;
  std::vector<std::pair<double, Pose>> poses;
  for (const StampedPose& pose : FrameTrajectory(slam.odometry()->map(), -1, old))
    poses.emplace_back(pose.stamp_s, pose.pose);
  EXPECT_EQ(StateOf(poses) == before.substr(0, StateOf(poses).size()), true);
}

constexpr double kLater_s = 1000;  // a recording that began after the other one

class Merging : public ::testing::Test {
 protected:
  static std::unique_ptr<SlamSystem> MapOf(const Recording& recording,
                                           const RunConfig& config = WithOneMember()) {
    auto slam = std::make_unique<SlamSystem>(config, recording.rig);
    TrackAll(recording, slam.get());
    return slam;
  }
};

TEST_F(Merging, TwoMapsWithCommonPlacesAreOneForAnyThreads) {
  const testing::RenderedWorld world(SessionTown(SyntheticSensor::kStereo));
  const Recording a = Part(world, 0, 140), b = Part(world, 90, 240, kLater_s);
  std::unique_ptr<SlamSystem> map = MapOf(a, Configured()), other = MapOf(b, Configured());
  const fs::path folder = testing::FreshFolder();
  map->Snapshot().Write(folder / "a");
  other->Snapshot().Write(folder / "b");
  std::string first_bytes;
  for (const int threads : {2, 1}) {
    if (threads == 1) {  // from files, as `tutti merge` has them
      const auto loaded = [&](const char* name) {
        MapInfo info = ReadMapInfo(folder / name);
        info.config.run.threads = threads;
        return LoadMap(folder / name, info);
      };
      map = loaded("a");
      other = loaded("b");
    }
    ASSERT_TRUE(Merge(map.get(), other.get()));
    EXPECT_EQ(FramePieces(map->odometry()->map()).size(), 1u);
    const std::string bytes = StateOfAll(*map);
    if (threads == 2) first_bytes = bytes;
    EXPECT_EQ(bytes == first_bytes, true) << "another result with one thread, from files";
    const std::vector<MapSession> sessions = map->Sessions();
    ASSERT_EQ(sessions.size(), 2u);
    EXPECT_LT(WorstError(*map, sessions[1], b, a.truth.front().pose), 1.5);
    // Goes on, and is there again from a file.
    if (threads == 1) continue;
    const fs::path file = folder / "merged.tutti";
    map->Snapshot().Write(file);
    const auto again = LoadMap(file, ReadMapInfo(file));
    const Recording third = Part(world, 60, 110);
    again->BeginSession(third.rig);
    TrackAll(third, again.get());
    EXPECT_EQ(again->Sessions().size(), 3u);
    EXPECT_TRUE(again->Sessions()[2].joined_at.has_value());
  }
}

// The same but for the frame of reference, which is that of the map that another one is merged into.
TEST_F(Merging, WhichMapComesFirstDecidesTheFrameOfReferenceAlone) {
  const testing::RenderedWorld world(SessionTown(SyntheticSensor::kStereo));
  const Recording a = Part(world, 0, 140), b = Part(world, 90, 240, kLater_s);
  const fs::path folder = testing::FreshFolder(), a_file = folder / "a", b_file = folder / "b";
  const auto first = MapOf(a), to_first = MapOf(b);
  first->Snapshot().Write(a_file);
  to_first->Snapshot().Write(b_file);
  const auto second = LoadMap(b_file, ReadMapInfo(b_file)), to_second = LoadMap(a_file, ReadMapInfo(a_file));
  const Pose first_begin = first->odometry()->map().keyframe(0).T_world_camera,
             second_begin = second->odometry()->map().keyframe(0).T_world_camera;
  int heard = 0;
  second->SetListeners({[&heard](const LoopResult&) { ++heard; }, {}, {}});
  ASSERT_TRUE(Merge(first.get(), to_first.get()));
  ASSERT_TRUE(Merge(second.get(), to_second.get()));
  EXPECT_EQ(StateOf(first->loops()) == StateOf(second->loops()), true);
  const std::vector<int> ids = first->odometry()->map().KeyframeIds();
  ASSERT_EQ(second->odometry()->map().KeyframeIds(), ids);
  ASSERT_EQ(FramePieces(first->odometry()->map()).size(), 1u);
  // Sessions stand in the order of their time stamps.
  for (const SlamSystem* map : {first.get(), second.get()})
    EXPECT_LT(map->Sessions()[0].first_stamp_s, map->Sessions()[1].first_stamp_s);
  const int b_begin = first->Sessions()[1].first_keyframe;
  const auto apart = [](const Pose& x, const Pose& y) {
    const Pose off = x.Inverse() * y;
    return off.translation.norm() + off.Angle();
  };
  EXPECT_LT(apart(first->odometry()->map().keyframe(0).T_world_camera, first_begin), 1e-9);
  EXPECT_LT(apart(second->odometry()->map().keyframe(b_begin).T_world_camera, second_begin), 1e-9);
  // From its begin all is where it is in the other one.
  const auto from = [&](const SlamSystem& map, int id) {
    return map.odometry()->map().keyframe(b_begin).T_world_camera.Inverse() *
           map.odometry()->map().keyframe(id).T_world_camera;
  };
  for (const int id : ids) ASSERT_LT(apart(from(*second, id), from(*first, id)), 1e-6) << id;
  // It goes on as ever, with the listeners that it had.
  heard = 0;
  const Recording third = Part(world, 60, 110);
  second->BeginSession(third.rig);
  TrackAll(third, second.get());
  EXPECT_TRUE(second->Sessions()[2].joined_at.has_value());
  EXPECT_GT(heard, 0);
}

// Two maps share a stretch in the middle of a round, and the second one ends where the first one began.
struct MergedRound {
  static constexpr std::size_t kRound = 141, kBegin = 70;  // frames of the world
  static constexpr std::int64_t kEnd = kRound - kBegin;    // of the second recording
  Recording first, second;

  // The first ends at frame `end`, the second `past` frames after the round.
  MergedRound(std::size_t end, std::size_t past) {
    const testing::RenderedWorld world(SessionTown(SyntheticSensor::kStereo));
    first = Part(world, 0, end);
    second = Part(world, kBegin, kRound + past, kLater_s);
  }

  // Loops of the merged map that close the round.
  static std::vector<Loop> Closing(const SlamSystem& map) {
    const std::int64_t offset = map.Sessions()[1].frame_offset;
    constexpr std::int64_t kNear = 20;  // frames
    std::vector<Loop> closing;
    for (const Loop& loop : map.loops()) {
      if (loop.accepted() && loop.candidate < kNear && std::abs(loop.query - offset - kEnd) < kNear)
        closing.push_back(loop);
    }
    return closing;
  }

  // Where the round ends, how far its end is from its begin, and how far in truth.
  void ExpectTrueGap(const SlamSystem& map) const {
    const auto position = [&](std::int64_t number) {
      FrameRange one;
      one.first = one.last = number;
      return FrameTrajectory(map.odometry()->map(), -1, one).at(0).pose.translation;
    };
    constexpr std::int64_t kThere = 4, kAgain = kEnd + kThere;
    const double gap = (position(map.Sessions()[1].frame_offset + kAgain) - position(kThere)).norm(),
                 truth =
                     (second.truth[kAgain].pose.translation - first.truth[kThere].pose.translation).norm();
    std::printf("  where the round ends: %.3f m from its begin, in truth %.3f m\n", gap, truth);
    EXPECT_NEAR(gap, truth, 0.1);
  }
};

// Where the second one comes to the round's begin, its detector or the other map's finds it, or the search of
// the joined map. The gap is small either way: it tells whether what was found is true.
TEST_F(Merging, TheOpenEndOfARoundIsClosed) {
  const MergedRound round(90, 10);
  const auto map = MapOf(round.first), other = MapOf(round.second);
  ASSERT_TRUE(Merge(map.get(), other.get()));
  EXPECT_GE(MergedRound::Closing(*map).size(), 1u);
  round.ExpectTrueGap(*map);
}

// The detectors know every fourth keyframe and propose what they hardly doubt, enough to join the maps in the
// middle, and nothing where the round ends. The search looks at all keyframes.
TEST_F(Merging, WhatTheDetectorsMissedIsFoundInTheJoinedMap) {
  RunConfig config = WithOneMember();
  config.run.loop_every_keyframes = 4;
  config.loops.propose_threshold = 0.95;
  const MergedRound round(110, 19);
  const auto map = MapOf(round.first, config), other = MapOf(round.second, config);
  ASSERT_TRUE(Merge(map.get(), other.get()));
  const std::vector<Loop> closing = MergedRound::Closing(*map);
  EXPECT_GE(closing.size(), 2u);
  EXPECT_GE(
      std::count_if(closing.begin(), closing.end(), [](const Loop& loop) { return loop.hypothesis == 0; }), 1)
      << "what no detector proposed";
  round.ExpectTrueGap(*map);
}

TEST_F(Merging, MapsWithoutACommonPlaceAreNotOne) {
  const testing::RenderedWorld world(SessionTown(SyntheticSensor::kStereo)),
      elsewhere(SessionTown(SyntheticSensor::kStereo, 7));
  const auto map = MapOf(Part(world, 0, 60)), other = MapOf(Part(elsewhere, 0, 60));
  std::string reason;
  EXPECT_FALSE(Merge(map.get(), other.get(), &reason));
  EXPECT_NE(reason.find("between them"), std::string::npos) << reason;
}

}  // namespace
}  // namespace tutti
