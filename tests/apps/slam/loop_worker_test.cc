// The detector beside the odometry: the order of what it is told, and that threads do not change it.
#include "apps/slam/loop_worker.h"

#include <gtest/gtest.h>

#include <optional>
#include <utility>
#include <vector>

#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"

namespace tutti {
namespace {

using testing::Recording;
using Pair = std::pair<std::int64_t, std::int64_t>;

// Round a small block and on: a second time past what was seen.
const Recording& LapAndMore() {
  static const Recording recording = [] {
    SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
    options.laps = 1.25;
    const testing::RenderedWorld world(options);
    return testing::Record(world, world.Size());
  }();
  return recording;
}

LoopQuery QueryOf(const InputFrame& frame) {
  LoopQuery query;
  query.id = frame.index;
  query.image = frame.image;
  return query;
}

// One member: what is told to the detector, and when, does not depend on their number; the time does.
LoopDetectorOptions OneMember() {
  LoopDetectorOptions options;
  options.members = {"orb"};
  options.threads = 1;
  return options;
}

struct Told {
  std::optional<Pair> first_loop;  // that was accepted
  std::vector<double> hypotheses;  // of the images from the second after it on
  std::vector<double> probabilities;
};

// Each answer is taken `delay` images later, as SlamSystem does; the first loop is taken back then.
Told ToldOnADrive(bool own_thread, bool unlink) {
  constexpr std::size_t kDelay = 2;
  LoopWorker worker(OneMember(), own_thread);
  Told told;
  const std::vector<InputFrame>& frames = LapAndMore().frames;
  for (std::size_t i = 0; i < frames.size() + kDelay; ++i) {
    if (i < frames.size()) worker.Submit(QueryOf(frames[i]));
    if (i < kDelay) continue;
    const LoopResult result = worker.Take();
    if (told.first_loop && result.query > told.first_loop->first + static_cast<std::int64_t>(kDelay)) {
      told.hypotheses.push_back(result.hypothesis);
      told.probabilities.push_back(result.probability);
    }
    if (!result.accepted || told.first_loop) continue;
    told.first_loop = Pair(result.query, result.verification.candidate);
    if (unlink) worker.Unlink(told.first_loop->first, told.first_loop->second);
  }
  return told;
}

// What the detector itself says when it is told at the same place in the order of images.
Told DriveDetector() {
  constexpr std::int64_t kDelay = 2;
  LoopDetector detector(OneMember());
  Told told;
  for (const InputFrame& frame : LapAndMore().frames) {
    if (told.first_loop && frame.index == told.first_loop->first + kDelay + 1)
      detector.Unlink(told.first_loop->first, told.first_loop->second);
    const LoopResult result = detector.Detect(QueryOf(frame));
    if (told.first_loop && frame.index > told.first_loop->first + kDelay) {
      told.hypotheses.push_back(result.hypothesis);
      told.probabilities.push_back(result.probability);
    }
    if (result.accepted && !told.first_loop)
      told.first_loop = Pair(result.query, result.verification.candidate);
  }
  return told;
}

TEST(LoopWorker, ALoopThatIsTakenBackIsUnlinkedBeforeTheNextImage) {
  const Told expected = DriveDetector();
  ASSERT_TRUE(expected.first_loop);
  ASSERT_FALSE(expected.hypotheses.empty());
  for (const bool own_thread : {false, true}) {
    const Told told = ToldOnADrive(own_thread, true);
    EXPECT_EQ(told.first_loop, expected.first_loop);
    EXPECT_EQ(told.hypotheses, expected.hypotheses) << own_thread;
    EXPECT_EQ(told.probabilities, expected.probabilities) << own_thread;
  }
  EXPECT_NE(ToldOnADrive(false, false).hypotheses, expected.hypotheses) << "it was linked";
}

TEST(LoopWorker, UnlinkingWhatWasNeverALoopChangesNothing) {
  LoopDetectorOptions options;
  LoopWorker with(options, true), without(options, true);
  for (std::size_t i = 0; i < 20; ++i) {
    with.Unlink(static_cast<std::int64_t>(i) + 5, 1000);
    with.Submit(QueryOf(LapAndMore().frames[i]));
    without.Submit(QueryOf(LapAndMore().frames[i]));
    EXPECT_EQ(with.Take().hypothesis, without.Take().hypothesis);
  }
}

}  // namespace
}  // namespace tutti
