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

// The decisions of a LoopCloser one by one.
class LoopCloserPeer {
 public:
  using Update = LoopCloser::Update;
  LoopCloserPeer(const RunConfig& config, const CameraRig& rig) : closer_(config, rig, nullptr) {}

  Update Consider(const Loop& loop, const Verification& verification, int candidate, int query,
                  const Odometry& odometry, std::int64_t frames) {
    return closer_.Consider(loop, verification, candidate, query, odometry, frames);
  }
  std::optional<Update> Solved(const Odometry& odometry, std::int64_t frames, bool at_once = false) {
    return closer_.Solved(odometry, frames,
                          at_once ? LoopCloser::Entering::kAtOnce : LoopCloser::Entering::kWhenDue);
  }
  void Take(const Update& update, Odometry* odometry, std::int64_t frames) {
    closer_.Take(update, odometry, frames);
  }
  bool CloseDeferred(const Odometry& odometry, std::int64_t frames) {
    return closer_.CloseDeferred(odometry, frames);
  }
  void TakeBack(std::int64_t query_frame) { closer_.Withdraw(query_frame, kTakenBack, true); }
  bool MayMove(std::int64_t frames) const { return closer_.MayMove(frames); }
  void Check(int end, const internal::SectionReader& file) const { closer_.Check(end, file); }
  LoopCloser* operator->() { return &closer_; }

 private:
  LoopCloser closer_;
};

namespace {

using ::testing::HasSubstr;
using Update = LoopCloserPeer::Update;

bool Waits(const Loop& loop) { return loop.state == LoopState::kWaiting; }

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
  void SetUp() override { ASSERT_GT(odometry_.map().KeyframeIds().size(), 25u); }

  static OdometryOptions OdometryConfig() {
    OdometryOptions options;
    options.features = 800;
    return options;
  }
  LoopCloserPeer Closer(bool global_adjustment = false) const {
    RunConfig config;
    config.run.loops = false;  // no detector proposes any
    config.run.global_adjustment = global_adjustment;
    return LoopCloserPeer(config, recording_.rig);
  }
  /// What the map says of the two keyframes, with the later one `off` [m] to the side.
  Similarity InMap(int candidate, int query, double off = 0) const {
    Pose T = odometry_.map().keyframe(candidate).T_world_camera.Inverse() *
             odometry_.map().keyframe(query).T_world_camera;
    T.translation.x() += off;
    return Similarity(T);
  }
  Loop Proposed(int candidate, int query, bool verified = true) const {
    Loop record;
    record.candidate = odometry_.map().keyframe(candidate).frame_index;
    record.query = odometry_.map().keyframe(query).frame_index;
    record.candidate_stamp_s = odometry_.map().keyframe(candidate).stamp_s;
    record.query_stamp_s = odometry_.map().keyframe(query).stamp_s;
    record.verified = verified;
    if (!verified) record.reason = "refused by geometry";
    return record;
  }
  Update Consider(LoopCloserPeer* closer, int candidate, int query, double off, int inliers = 0,
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
  void ConsiderTwo(LoopCloserPeer* closer, double off) const {
    EXPECT_FALSE(Consider(closer, kFirst, kLater, off).correction);
    EXPECT_FALSE(Consider(closer, kFirst, kLater + 1, off).correction);
  }
  /// Applies what is found by the time it is due at the latest.
  Update Solve(LoopCloserPeer* closer) {
    frames_ += SolutionFrames(odometry_.map().KeyframeIds().size());
    const std::optional<Update> update = closer->Solved(odometry_, frames_);
    EXPECT_TRUE(update);
    if (!update) return {};
    closer->Take(*update, &odometry_, frames_);
    return *update;
  }

  testing::Recording recording_;
  Odometry odometry_;
  std::int64_t frames_ = 0;
};

TEST_F(LoopCloserTest, WhatGeometryRefusesIsListedAndNothingElse) {
  LoopCloserPeer closer = Closer();
  const Update update =
      closer.Consider(Proposed(kFirst, kLater, false), {}, kFirst, kLater, odometry_, frames_);
  EXPECT_FALSE(update.correction);
  ASSERT_EQ(closer->loops().size(), 1u);
  EXPECT_EQ(closer->loops()[0].reason, "refused by geometry");
  EXPECT_FALSE(closer.MayMove(frames_ + 1000));
}

TEST_F(LoopCloserTest, ALoopWithinTheLocalMapIsNone) {
  LoopCloserPeer closer = Closer();
  Consider(&closer, kFirst, kFirst + 1, 0);
  EXPECT_THAT(closer->loops()[0].reason, HasSubstr("too recent"));
  EXPECT_FALSE(Waits(closer->loops()[0]));
}

// What a slip of the odometry has torn, in a blurred turn for example.
TEST_F(LoopCloserTest, ALoopWithinTheLocalMapMendsItWhereItIsTorn) {
  const auto said = [&](LoopCloserPeer* closer, int query, double off, int inliers) {
    Consider(closer, kFirst, query, off, inliers);
    return (*closer)->loops().back();
  };
  LoopCloserPeer sure = Closer();
  EXPECT_TRUE(Waits(said(&sure, kFirst + 1, 0.5, 200))) << "it waits for a second one, as all do";
  said(&sure, kFirst + 2, 0.5, 200);
  EXPECT_TRUE(Solve(&sure).correction);
  LoopCloserPeer weak = Closer(), whole = Closer();
  EXPECT_THAT(said(&weak, kFirst + 1, 0.5, 60).reason, HasSubstr("too recent")) << "few landmarks may err";
  EXPECT_THAT(said(&whole, kFirst + 1, 0, 200).reason, HasSubstr("too recent")) << "nothing is torn";
}

TEST_F(LoopCloserTest, ALoopAloneWaitsAndSaysSoInTheEnd) {
  LoopCloserPeer closer = Closer();
  Consider(&closer, kFirst, kLater, 1.0);
  EXPECT_TRUE(Waits(closer->loops()[0]));
  EXPECT_FALSE(closer.Solved(odometry_, frames_ + 1000));
  closer->Finish(&odometry_, frames_);
  EXPECT_FALSE(closer->loops()[0].accepted());
  EXPECT_THAT(closer->loops()[0].reason, HasSubstr("no second loop"));
}

// What the detector proposes without believing it: geometry found so many inliers, and the probability.
TEST_F(LoopCloserTest, ADoubtfulLoopWaitsForASureOneAndSaysWhoVouchedForIt) {
  const auto doubtful = [&](LoopCloserPeer* closer, int candidate, int query, int inliers,
                            double probability) {
    Loop record = Proposed(candidate, query, false);
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
    return (*closer)->loops().back();
  };
  LoopCloserPeer closer = Closer();
  EXPECT_FALSE(Waits(doubtful(&closer, kFirst, kLater - 3, 40, 0.2))) << "too improbable";
  EXPECT_FALSE(Waits(doubtful(&closer, kFirst, kLater - 3, 15, 0))) << "too few inliers for a motion";
  EXPECT_TRUE(Waits(doubtful(&closer, kFirst + 8, kLater + 8, 40, 0.5)));
  const Loop few = doubtful(&closer, kFirst + 8, kLater + 4, 25, 0);
  EXPECT_TRUE(Waits(few));
  EXPECT_THAT(few.reason, HasSubstr("by itself: probably not this place"));
  EXPECT_FALSE(closer.MayMove(frames_ + 1000)) << "they do not vouch for each other";
  Consider(&closer, kFirst, kLater, 0.5);
  EXPECT_TRUE(Solve(&closer).correction);
  EXPECT_EQ(CountAccepted(closer->loops()), 3u);
  EXPECT_EQ(closer->loops()[2].witness, "the loop of frame " + std::to_string(closer->loops()[4].query));
  EXPECT_FALSE(closer->loops()[2].verified);
  EXPECT_THAT(closer->loops()[4].witness, HasSubstr("the loop of frame"));
}

// Two images of a house that looks like another one agree with each other, however far that one is.
TEST_F(LoopCloserTest, LoopsThatAreOffByMoreThanHalfOfTheWayNeedMoreThanASecondOne) {
  LoopCloserPeer closer = Closer();
  ConsiderTwo(&closer, 100);
  EXPECT_FALSE(closer.MayMove(frames_ + 1000));
  EXPECT_TRUE(Waits(closer->loops()[1]));
}

// The walls of the next corridor but one: they agree for as long as they look alike.
TEST_F(LoopCloserTest, NoNumberOfLoopsTurnsTheMapByARightAngle) {
  LoopCloserPeer closer = Closer();
  for (int later = 0; later < 6; ++later) {
    const Update update = Consider(&closer, kFirst + later, kLater + later, 1, 200, 90);
    EXPECT_FALSE(update.correction);
    EXPECT_TRUE(closer->loops().back().revoked) << "for the detector to forget";
    EXPECT_THAT(closer->loops().back().reason, HasSubstr("turn by 90 deg"));
  }
  EXPECT_FALSE(closer.MayMove(frames_ + 1000));
  Consider(&closer, kFirst, kLater, 1, 200, 20);
  EXPECT_TRUE(Waits(closer->loops().back())) << "a bad odometry turns by as much as this";
}

TEST_F(LoopCloserTest, WhatTheDetectorTakesBackIsDroppedWhileItWaitsAndStaysWhereTheGateLetItIn) {
  LoopCloserPeer closer = Closer();
  Consider(&closer, kFirst, kLater, 0.5);
  closer.TakeBack(closer->loops()[0].query);
  EXPECT_FALSE(Waits(closer->loops()[0]));
  EXPECT_FALSE(closer->loops()[0].verified);
  EXPECT_THAT(closer->loops()[0].reason, HasSubstr("taken it back"));
  Consider(&closer, kFirst, kLater + 1, 0.5);
  EXPECT_FALSE(closer.MayMove(frames_ + 1000));
  Consider(&closer, kFirst, kLater + 2, 0.5);
  closer.TakeBack(closer->loops()[2].query);
  Solve(&closer);
  EXPECT_EQ(CountAccepted(closer->loops()), 2u);
  EXPECT_TRUE(closer->loops()[2].verified);
}

TEST_F(LoopCloserTest, AtTheEndOfARecordingASolutionEntersAtOnce) {
  LoopCloserPeer closer = Closer();
  ConsiderTwo(&closer, 0.5);
  EXPECT_FALSE(closer.Solved(odometry_, frames_));
  const std::optional<Update> update = closer.Solved(odometry_, frames_, true);
  ASSERT_TRUE(update);
  EXPECT_TRUE(update->correction);
}

TEST_F(LoopCloserTest, TwoThatAgreeMoveTheMapWhenTheirSolutionIsDueAndNotBefore) {
  LoopCloserPeer closer = Closer();
  const Pose before = odometry_.map().keyframe(kFirst).T_world_camera.Inverse() *
                      odometry_.map().keyframe(kLater).T_world_camera;
  ConsiderTwo(&closer, 0.5);
  const std::int64_t due = frames_ + SolutionFrames(odometry_.map().KeyframeIds().size());
  EXPECT_FALSE(closer.MayMove(due - 1));
  EXPECT_FALSE(closer.Solved(odometry_, due - 1));
  EXPECT_TRUE(closer.MayMove(due));
  const Update update = Solve(&closer);
  ASSERT_TRUE(update.correction);
  EXPECT_EQ(closer->Report().corrections, 1);
  EXPECT_EQ(CountAccepted(closer->loops()), 2u);
  EXPECT_GT(closer->loops()[0].weight, 0.5);
  const Pose after = odometry_.map().keyframe(kFirst).T_world_camera.Inverse() *
                     odometry_.map().keyframe(kLater).T_world_camera;
  const double moved = (after.translation - before.translation).x();
  EXPECT_GT(moved, 0.25) << "the loops and the odometry share what is missing";
  EXPECT_LT(moved, 0.5);
  EXPECT_EQ(closer->Graph(odometry_.map()).edges().back().to, kLater + 1);
}

TEST_F(LoopCloserTest, ASolutionIsProvedIfThatIsAskedFor) {
  for (const bool certify : {false, true}) {
    RunConfig config;
    config.run.global_adjustment = false;
    config.run.certify = certify;
    config.run.loops = false;
    LoopCloserPeer closer(config, recording_.rig);
    ConsiderTwo(&closer, 0.5);
    EXPECT_FALSE(closer->Report().graph_proof);
    ASSERT_TRUE(Solve(&closer).correction);
    ASSERT_EQ(closer->Report().graph_proof.has_value(), certify);
    if (!certify) continue;
    const KeyframeGraphProof proof = *closer->Report().graph_proof;
    EXPECT_EQ(proof.starts.size(), 3u);
    EXPECT_EQ(proof.best, GraphStart::kFile);
    EXPECT_FALSE(proof.better) << "no other start leads lower than the map";
    EXPECT_TRUE(proof.certificate.certified) << proof.certificate.reason;
    EXPECT_GT(proof.certificate.chordal, 0);
  }
}

TEST_F(LoopCloserTest, WhatTheMapFulfilsWaitsForACorrectionOrForTheEnd) {
  LoopCloserPeer closer = Closer();
  ConsiderTwo(&closer, 0);
  EXPECT_FALSE(closer.Solved(odometry_, frames_ + 1000));
  EXPECT_EQ(CountAccepted(closer->loops()), 0u);
  EXPECT_TRUE(closer.CloseDeferred(odometry_, frames_));
  EXPECT_FALSE(closer.CloseDeferred(odometry_, frames_));
  Solve(&closer);
  EXPECT_EQ(CountAccepted(closer->loops()), 2u);
}

TEST_F(LoopCloserTest, FulfilledLoopsBecomeOneMapWhereItIsAdjusted) {
  LoopCloserPeer closer = Closer(true);
  const Update update = Consider(&closer, kFirst, kLater, 0);  // the map itself vouches for it
  ASSERT_TRUE(update.correction);
  EXPECT_TRUE(update.correction->S_world_keyframe.empty());
  ASSERT_EQ(update.correction->fused.size(), 1u);
  EXPECT_EQ(update.correction->fused[0].newer, kLater);
}

TEST_F(LoopCloserTest, LoopsThatComeWhileTheGraphIsSolvedEnterAfterIt) {
  LoopCloserPeer closer = Closer();
  ConsiderTwo(&closer, 0.5);
  Consider(&closer, kFirst + 1, kLater + 2, 1.0);
  Consider(&closer, kFirst + 1, kLater + 3, 1.0);
  Solve(&closer);
  EXPECT_EQ(CountAccepted(closer->loops()), 2u);
  EXPECT_TRUE(closer.Solved(odometry_, frames_)) << "the next two begin";
  EXPECT_FALSE(closer.Solved(odometry_, frames_));
  Solve(&closer);
  for (const Loop& record : closer->loops()) EXPECT_TRUE(record.accepted() || !record.reason.empty());
  EXPECT_FALSE(closer.Solved(odometry_, frames_ + 1000)) << "nothing is left";
}

TEST_F(LoopCloserTest, LoopsOfKeyframesThatAreNotThereAreDamage) {
  LoopCloserPeer closer = Closer();
  ConsiderTwo(&closer, 0);  // they wait for a correction
  const auto path = testing::FreshFolder() / "map.tutti";
  internal::SectionWriter(path, kMapFile).Finish();
  const internal::SectionReader file(path, kMapFile);
  EXPECT_NO_THROW(closer.Check(odometry_.map().KeyframeCount(), file));
  EXPECT_THROW(closer.Check(kLater + 1, file), InputError);
}

TEST_F(LoopCloserTest, WhatTheMapContradictsIsRevokedOnceAndForTheDetectorToForget) {
  RunConfig config;
  config.run.global_adjustment = false;
  config.run.loop_gate_sigmas = 0.001;
  config.run.loops = false;
  LoopCloserPeer closer(config, recording_.rig);
  ConsiderTwo(&closer, 0.5);
  const Update update = Solve(&closer);
  EXPECT_FALSE(update.correction);
  for (const Loop& loop : closer->loops()) EXPECT_TRUE(loop.revoked);
  EXPECT_TRUE(closer->loops()[0].gate_sigmas);
  EXPECT_EQ(CountAccepted(closer->loops()), 0u);
}

TEST_F(LoopCloserTest, ALoopFromElsewherePassesTheGateButNotThePoseGraph) {
  LoopCloserPeer closer = Closer();
  const auto add = [&](int candidate, int query, double off, double sigma) {
    FoundLoop loop{candidate, query, {}, MakeInformation(sigma, sigma)};
    loop.verification.S_candidate_query = InMap(candidate, query, off);
    closer->AddLoop(loop, &odometry_, frames_);
  };
  add(kFirst, kLater, 0.3, 0.01);
  EXPECT_TRUE(Solve(&closer).correction);
  EXPECT_TRUE(closer->loops()[0].injected);
  EXPECT_TRUE(closer->loops()[0].accepted());
  // What the first two thirds of a lap cannot be bent to.
  add(kFirst + 1, kLater + 3, 20, 0.1);
  Solve(&closer);
  EXPECT_FALSE(closer->loops()[1].accepted());
  EXPECT_FALSE(closer->loops()[1].reason.empty());
  EXPECT_FALSE(closer->loops()[1].revoked) << "the detector never knew it";
}

}  // namespace
}  // namespace tutti
