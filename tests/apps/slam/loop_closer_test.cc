#include "apps/slam/loop_closer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/slam/map_parts.h"
#include "core/numbers.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Half a lap, and loops between its keyframes that claim what a test wants.
class LoopCloserTest : public ::testing::Test {
 protected:
  static constexpr int kFirst = 1, kLater = 20;  // keyframes: ends of the loops

  LoopCloserTest()
      : recording_(testing::Record(testing::RenderedWorld(testing::SmallRgbdTown(320, 160)), 100)),
        odometry_(OdometryConfig(), recording_.rig) {
    for (const InputFrame& frame : recording_.frames) odometry_.Track(frame);
    odometry_.FinishMapping();
    frames_ = static_cast<std::int64_t>(recording_.frames.size());
  }
  void SetUp() override { ASSERT_GT(odometry_.KeyframeIds().size(), 25u); }

  static OdometryOptions OdometryConfig() {
    OdometryOptions options;
    options.features = 800;
    return options;
  }
  LoopCloser Closer(bool global_adjustment = false) const {
    RunConfig config;
    config.run.global_adjustment = global_adjustment;
    return LoopCloser(config, recording_.rig, nullptr);
  }
  /// What the map says of the two keyframes, with the later one `off` [m] to the side.
  Similarity InMap(int candidate, int query, double off = 0) const {
    Pose T = odometry_.KeyframePose(candidate).Inverse() * odometry_.KeyframePose(query);
    T.translation.x() += off;
    return Similarity(T);
  }
  LoopRecord Proposed(int candidate, int query, bool verified = true) const {
    LoopRecord record;
    record.candidate = odometry_.KeyframeFrameIndex(candidate);
    record.query = odometry_.KeyframeFrameIndex(query);
    record.candidate_stamp_s = odometry_.KeyframeStamp(candidate);
    record.query_stamp_s = odometry_.KeyframeStamp(query);
    record.verified = verified;
    if (!verified) record.reason = "refused by geometry";
    return record;
  }
  LoopUpdate Consider(LoopCloser* closer, int candidate, int query, double off, int inliers = 0,
                      double turned_deg = 0) const {
    Verification verification;
    verification.type = ConstraintType::kRigid;
    verification.S_candidate_query = InMap(candidate, query, off);
    verification.S_candidate_query.rotation *=
        Eigen::Quaterniond(Eigen::AngleAxisd(turned_deg * internal::kRadians, Eigen::Vector3d::UnitY()));
    verification.information = 1e4 * Matrix6d::Identity();
    verification.inliers = inliers;
    return closer->Consider(Proposed(candidate, query), verification, candidate, query, odometry_, frames_);
  }
  /// Two loops that agree: the later keyframes are `off` [m] beside where the map has them.
  void ConsiderTwo(LoopCloser* closer, double off) const {
    EXPECT_FALSE(Consider(closer, kFirst, kLater, off).correction);
    EXPECT_FALSE(Consider(closer, kFirst, kLater + 1, off).correction);
  }
  /// Applies what is found by the time it is due at the latest.
  LoopUpdate Solve(LoopCloser* closer) {
    frames_ += SolutionFrames(odometry_.KeyframeIds().size());
    const std::optional<LoopUpdate> update = closer->Solved(odometry_, frames_);
    EXPECT_TRUE(update);
    if (!update) return {};
    if (update->correction)
      closer->Applied(*update, Apply(*update->correction, &odometry_), odometry_, frames_);
    return *update;
  }

  testing::Recording recording_;
  Odometry odometry_;
  std::int64_t frames_ = 0;
};

TEST_F(LoopCloserTest, WhatGeometryRefusesIsListedAndNothingElse) {
  LoopCloser closer = Closer();
  const LoopUpdate update =
      closer.Consider(Proposed(kFirst, kLater, false), {}, kFirst, kLater, odometry_, frames_);
  EXPECT_FALSE(update.correction);
  ASSERT_EQ(closer.records().size(), 1u);
  EXPECT_EQ(closer.records()[0].reason, "refused by geometry");
  EXPECT_FALSE(closer.MayMove(frames_ + 1000));
}

TEST_F(LoopCloserTest, ALoopWithinTheLocalMapIsNone) {
  LoopCloser closer = Closer();
  Consider(&closer, kFirst, kFirst + 1, 0);
  EXPECT_THAT(closer.records()[0].reason, HasSubstr("too recent"));
  EXPECT_FALSE(closer.records()[0].pending);
}

// What a slip of the odometry has torn, in a blurred turn for example.
TEST_F(LoopCloserTest, ALoopWithinTheLocalMapMendsItWhereItIsTorn) {
  const auto said = [&](LoopCloser* closer, int query, double off, int inliers) {
    Consider(closer, kFirst, query, off, inliers);
    return closer->records().back();
  };
  LoopCloser sure = Closer();
  EXPECT_TRUE(said(&sure, kFirst + 1, 0.5, 200).pending) << "it waits for a second one, as all do";
  said(&sure, kFirst + 2, 0.5, 200);
  EXPECT_TRUE(Solve(&sure).correction);
  LoopCloser weak = Closer(), whole = Closer();
  EXPECT_THAT(said(&weak, kFirst + 1, 0.5, 60).reason, HasSubstr("too recent")) << "few landmarks may err";
  EXPECT_THAT(said(&whole, kFirst + 1, 0, 200).reason, HasSubstr("too recent")) << "nothing is torn";
}

TEST_F(LoopCloserTest, ALoopAloneWaitsAndSaysSoInTheEnd) {
  LoopCloser closer = Closer();
  Consider(&closer, kFirst, kLater, 1.0);
  EXPECT_TRUE(closer.records()[0].pending);
  EXPECT_FALSE(closer.Solved(odometry_, frames_ + 1000));
  closer.Finish();
  EXPECT_FALSE(closer.records()[0].pending);
  EXPECT_FALSE(closer.records()[0].accepted);
  EXPECT_THAT(closer.records()[0].reason, HasSubstr("no second loop"));
}

// What the detector proposes without believing it: geometry found so many inliers, and the probability.
TEST_F(LoopCloserTest, ADoubtfulLoopWaitsForASureOneAndSaysWhoVouchedForIt) {
  const auto doubtful = [&](LoopCloser* closer, int candidate, int query, int inliers, double probability) {
    LoopRecord record = Proposed(candidate, query, false);
    record.probability = probability;
    record.reason = "probably not this place";
    Verification verification;
    verification.accepted = inliers >= 30;
    verification.type = ConstraintType::kRigid;
    verification.S_candidate_query = InMap(candidate, query, 0.5);
    verification.information = 1e4 * Matrix6d::Identity();
    verification.inliers = inliers;
    verification.mass = 0.5;
    verification.log_nfa = -30;
    closer->Consider(record, verification, candidate, query, odometry_, frames_);
    return closer->records().back();
  };
  LoopCloser closer = Closer();
  EXPECT_FALSE(doubtful(&closer, kFirst, kLater - 3, 40, 0.2).pending) << "too improbable";
  EXPECT_FALSE(doubtful(&closer, kFirst, kLater - 3, 15, 0).pending) << "too few inliers for a motion";
  EXPECT_TRUE(doubtful(&closer, kFirst + 8, kLater + 8, 40, 0.5).pending);
  const LoopRecord few = doubtful(&closer, kFirst + 8, kLater + 4, 25, 0);
  EXPECT_TRUE(few.pending);
  EXPECT_THAT(few.reason, HasSubstr("by itself: probably not this place"));
  EXPECT_FALSE(closer.MayMove(frames_ + 1000)) << "they do not vouch for each other";
  Consider(&closer, kFirst, kLater, 0.5);
  EXPECT_TRUE(Solve(&closer).correction);
  EXPECT_EQ(CountAccepted(closer.records()), 3u);
  EXPECT_EQ(closer.records()[2].witness, "the loop of frame " + std::to_string(closer.records()[4].query));
  EXPECT_FALSE(closer.records()[2].verified);
  EXPECT_THAT(closer.records()[4].witness, HasSubstr("the loop of frame"));
}

// Two images of a house that looks like another one agree with each other, however far that one is.
TEST_F(LoopCloserTest, LoopsThatAreOffByMoreThanHalfOfTheWayNeedMoreThanASecondOne) {
  LoopCloser closer = Closer();
  ConsiderTwo(&closer, 100);
  EXPECT_FALSE(closer.MayMove(frames_ + 1000));
  EXPECT_TRUE(closer.records()[1].pending);
}

// The walls of the next corridor but one: they agree for as long as they look alike.
TEST_F(LoopCloserTest, NoNumberOfLoopsTurnsTheMapByARightAngle) {
  LoopCloser closer = Closer();
  for (int later = 0; later < 6; ++later) {
    const LoopUpdate update = Consider(&closer, kFirst + later, kLater + later, 1, 200, 90);
    EXPECT_FALSE(update.correction);
    EXPECT_THAT(update.revoked, ElementsAre(static_cast<std::size_t>(later))) << "for the detector to forget";
    EXPECT_THAT(closer.records().back().reason, HasSubstr("turn by 90 deg"));
  }
  EXPECT_FALSE(closer.MayMove(frames_ + 1000));
  Consider(&closer, kFirst, kLater, 1, 200, 20);
  EXPECT_TRUE(closer.records().back().pending) << "a bad odometry turns by as much as this";
}

TEST_F(LoopCloserTest, WhatTheDetectorTakesBackIsDroppedWhileItWaitsAndStaysWhereTheGateLetItIn) {
  LoopCloser closer = Closer();
  Consider(&closer, kFirst, kLater, 0.5);
  closer.Withdraw(closer.records()[0].query, kTakenBack, true);
  EXPECT_FALSE(closer.records()[0].pending);
  EXPECT_FALSE(closer.records()[0].verified);
  EXPECT_THAT(closer.records()[0].reason, HasSubstr("taken it back"));
  Consider(&closer, kFirst, kLater + 1, 0.5);
  EXPECT_FALSE(closer.MayMove(frames_ + 1000));
  Consider(&closer, kFirst, kLater + 2, 0.5);
  closer.Withdraw(closer.records()[2].query, kTakenBack, true);
  Solve(&closer);
  EXPECT_EQ(CountAccepted(closer.records()), 2u);
  EXPECT_TRUE(closer.records()[2].verified);
}

TEST_F(LoopCloserTest, AtTheEndOfARecordingASolutionEntersAtOnce) {
  LoopCloser closer = Closer();
  ConsiderTwo(&closer, 0.5);
  EXPECT_FALSE(closer.Solved(odometry_, frames_));
  const std::optional<LoopUpdate> update = closer.Solved(odometry_, frames_, Entering::kAtOnce);
  ASSERT_TRUE(update);
  EXPECT_TRUE(update->correction);
}

TEST_F(LoopCloserTest, TwoThatAgreeMoveTheMapWhenTheirSolutionIsDueAndNotBefore) {
  LoopCloser closer = Closer();
  const Pose before = odometry_.KeyframePose(kFirst).Inverse() * odometry_.KeyframePose(kLater);
  ConsiderTwo(&closer, 0.5);
  const std::int64_t due = frames_ + SolutionFrames(odometry_.KeyframeIds().size());
  EXPECT_FALSE(closer.MayMove(due - 1));
  EXPECT_FALSE(closer.Solved(odometry_, due - 1));
  EXPECT_TRUE(closer.MayMove(due));
  const LoopUpdate update = Solve(&closer);
  ASSERT_TRUE(update.correction);
  EXPECT_EQ(closer.Corrections(), 1);
  EXPECT_EQ(CountAccepted(closer.records()), 2u);
  EXPECT_GT(closer.records()[0].weight, 0.5);
  const Pose after = odometry_.KeyframePose(kFirst).Inverse() * odometry_.KeyframePose(kLater);
  const double moved = (after.translation - before.translation).x();
  EXPECT_GT(moved, 0.25) << "the loops and the odometry share what is missing";
  EXPECT_LT(moved, 0.5);
  EXPECT_EQ(closer.Graph(odometry_).edges().back().to, kLater + 1);
}

TEST_F(LoopCloserTest, ASolutionIsProvedIfThatIsAskedFor) {
  for (const bool certify : {false, true}) {
    RunConfig config;
    config.run.global_adjustment = false;
    config.run.certify = certify;
    LoopCloser closer(config, recording_.rig, nullptr);
    ConsiderTwo(&closer, 0.5);
    EXPECT_FALSE(closer.proof());
    ASSERT_TRUE(Solve(&closer).correction);
    ASSERT_EQ(closer.proof().has_value(), certify);
    if (!certify) continue;
    EXPECT_EQ(closer.proof()->starts.size(), 3u);
    EXPECT_EQ(closer.proof()->best, GraphStart::kFile);
    EXPECT_FALSE(closer.proof()->better) << "no other start leads lower than the map";
    EXPECT_TRUE(closer.proof()->certificate.certified) << closer.proof()->certificate.reason;
    EXPECT_GT(closer.proof()->certificate.chordal, 0);
  }
}

TEST_F(LoopCloserTest, WhatTheMapFulfilsWaitsForACorrectionOrForTheEnd) {
  LoopCloser closer = Closer();
  ConsiderTwo(&closer, 0);
  EXPECT_FALSE(closer.Solved(odometry_, frames_ + 1000));
  EXPECT_EQ(CountAccepted(closer.records()), 0u);
  EXPECT_TRUE(closer.CloseDeferred(odometry_, frames_));
  EXPECT_FALSE(closer.CloseDeferred(odometry_, frames_));
  Solve(&closer);
  EXPECT_EQ(CountAccepted(closer.records()), 2u);
}

TEST_F(LoopCloserTest, FulfilledLoopsBecomeOneMapWhereItIsAdjusted) {
  LoopCloser closer = Closer(true);
  const LoopUpdate update = Consider(&closer, kFirst, kLater, 0);  // the map itself vouches for it
  ASSERT_TRUE(update.correction);
  EXPECT_TRUE(update.correction->S_world_keyframe.empty());
  ASSERT_EQ(update.correction->fused.size(), 1u);
  EXPECT_EQ(update.correction->fused[0].query, kLater);
}

TEST_F(LoopCloserTest, LoopsThatComeWhileTheGraphIsSolvedEnterAfterIt) {
  LoopCloser closer = Closer();
  ConsiderTwo(&closer, 0.5);
  Consider(&closer, kFirst + 1, kLater + 2, 1.0);
  Consider(&closer, kFirst + 1, kLater + 3, 1.0);
  Solve(&closer);
  EXPECT_EQ(CountAccepted(closer.records()), 2u);
  EXPECT_TRUE(closer.Solved(odometry_, frames_)) << "the next two begin";
  EXPECT_FALSE(closer.Solved(odometry_, frames_));
  Solve(&closer);
  for (const LoopRecord& record : closer.records()) EXPECT_TRUE(record.accepted || !record.reason.empty());
  EXPECT_FALSE(closer.Solved(odometry_, frames_ + 1000)) << "nothing is left";
}

TEST_F(LoopCloserTest, LoopsOfKeyframesThatAreNotThereAreDamage) {
  LoopCloser closer = Closer();
  ConsiderTwo(&closer, 0);  // they wait for a correction
  const auto path = testing::FreshFolder() / "map.tutti";
  internal::SectionWriter(path, kMapFile).Finish();
  const internal::SectionReader file(path, kMapFile);
  EXPECT_NO_THROW(closer.Check(odometry_.NextKeyframeId(), file));
  EXPECT_THROW(closer.Check(kLater + 1, file), InputError);
}

TEST_F(LoopCloserTest, WhatTheMapContradictsIsRevokedOnceAndForTheDetectorToForget) {
  RunConfig config;
  config.run.global_adjustment = false;
  config.run.loop_gate_sigmas = 0.001;
  LoopCloser closer(config, recording_.rig, nullptr);
  ConsiderTwo(&closer, 0.5);
  const LoopUpdate update = Solve(&closer);
  EXPECT_FALSE(update.correction);
  EXPECT_THAT(update.revoked, ElementsAre(0u, 1u));
  EXPECT_TRUE(closer.records()[0].revoked);
  EXPECT_TRUE(closer.records()[0].gate_sigmas);
  EXPECT_EQ(CountAccepted(closer.records()), 0u);
}

TEST_F(LoopCloserTest, ALoopFromElsewherePassesTheGateButNotThePoseGraph) {
  LoopCloser closer = Closer();
  closer.Add(kFirst, kLater, InMap(kFirst, kLater, 0.3), MakeInformation(0.01, 0.01), odometry_, frames_);
  EXPECT_TRUE(Solve(&closer).correction);
  EXPECT_TRUE(closer.records()[0].injected);
  EXPECT_TRUE(closer.records()[0].accepted);
  // What the first two thirds of a lap cannot be bent to.
  closer.Add(kFirst + 1, kLater + 3, InMap(kFirst + 1, kLater + 3, 20), MakeInformation(0.1, 0.1), odometry_,
             frames_);
  const LoopUpdate update = Solve(&closer);
  EXPECT_FALSE(closer.records()[1].accepted);
  EXPECT_FALSE(closer.records()[1].reason.empty());
  EXPECT_THAT(update.revoked, IsEmpty()) << "the detector never knew it";
}

}  // namespace
}  // namespace tutti
