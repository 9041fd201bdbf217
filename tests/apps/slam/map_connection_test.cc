#include "apps/slam/map_connection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tutti/slam/loop.h"

namespace tutti {
namespace {

constexpr std::size_t kUnclosedRound = 141, kUnclosedFrames = kUnclosedRound + 10;

SyntheticOptions UnclosedTown() {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.laps = 1.4;
  return options;
}

// A map of a round whose end nobody recognised: no detector was asked.
struct UnclosedMap {
  explicit UnclosedMap(const RunConfig& configured)
      : config(configured),
        round(testing::Record(testing::RenderedWorld(UnclosedTown()), kUnclosedFrames)),
        odometry(config.odometry, round.rig),
        loops(config, round.rig, nullptr) {
    for (const InputFrame& frame : round.frames) odometry.Track(frame);
    odometry.FinishMapping();
    connection = std::make_unique<MapConnection>(config, std::int64_t{kUnclosedFrames}, &loops, &odometry);
  }
  const std::vector<Loop>& Records() const { return loops.loops(); }

  RunConfig config;
  testing::Recording round;
  Odometry odometry;
  LoopCloser loops;
  std::unique_ptr<MapConnection> connection;
};

RunConfig WithoutDetector() {
  RunConfig config;
  config.odometry.features = 800;
  config.run.threads = 1;
  config.run.loops = false;
  return config;
}

TEST(MapConnection, WhereARoundEndsItIsClosedThoughNoDetectorWasAsked) {
  UnclosedMap open(WithoutDetector());
  open.connection->Connect(0);
  EXPECT_GE(CountAccepted(open.Records()), 2u);
  constexpr std::int64_t kNear = 20;  // frames
  for (const Loop& loop : open.Records()) {
    if (!loop.accepted()) continue;
    EXPECT_LT(loop.candidate, kNear);
    EXPECT_GT(loop.query, std::int64_t{kUnclosedRound} - kNear);
  }
}

// A loop that waits for a second one would be that second one itself if it came again.
TEST(MapConnection, APairThatWaitsIsOfferedOnce) {
  RunConfig config = WithoutDetector();
  config.run.loop_confirmations = 1000;  // all wait
  config.run.loop_defer_fraction = 0;    // however well the map fulfils them
  config.run.global_adjustment = false;  // the map stays, and with it what is searched
  UnclosedMap open(config);
  open.connection->Connect(0);
  const std::size_t offered = open.Records().size();
  EXPECT_GE(offered, 2u);
  EXPECT_EQ(CountAccepted(open.Records()), 0u);
  open.connection->Connect(0);
  EXPECT_EQ(open.Records().size(), offered);
}

}  // namespace
}  // namespace tutti
