#include "loopclosure/detector/detector_state.h"

#include <gtest/gtest.h>

#include "core/state_archive.h"
#include "tests/loopclosure/detector/shown_state.h"

namespace tutti::internal {
namespace {

using tutti::testing::OneMember;
using tutti::testing::Query;
using tutti::testing::RefusalOf;
using tutti::testing::Show;

TEST(DetectorState, EveryLocationHasItsViewUntilItIsDropped) {
  DetectorState state(OneMember());
  EXPECT_EQ(state.last_id(), -1);
  EXPECT_FALSE(state.HasView(0));
  const View& view = Show(state, Query(7, tutti::testing::WalkImage(0, 9)));
  EXPECT_EQ(view.id, 7);
  EXPECT_EQ(state.last_id(), 7);
  ASSERT_TRUE(state.HasView(0));
  EXPECT_EQ(state.view(0).id, 7);
  state.DropView(0);
  EXPECT_FALSE(state.HasView(0));
  state.PutViewWithoutFeatures(0);
  ASSERT_TRUE(state.HasView(0));
  EXPECT_TRUE(state.view(0).members.front().pixels.empty());
}

TEST(DetectorState, AQueryThatIsMergedAwayStillHasAViewForGeometry) {
  LoopDetectorOptions options = OneMember();
  options.stm_size = 3;
  options.rehearsal = true;
  DetectorState state(options);
  const cv::Mat image = tutti::testing::WalkImage(0, 9);
  Show(state, Query(0, image));
  const View& view = Show(state, Query(1, image));
  EXPECT_EQ(view.id, 1);
  EXPECT_FALSE(view.members.front().pixels.empty());
  EXPECT_FALSE(state.HasView(1));
  EXPECT_EQ(state.memory().Find(1), 0);
  EXPECT_EQ(Show(state, Query(2, tutti::testing::WalkImage(1, 9))).id, 2);
  EXPECT_EQ(state.view(2).id, 2);
}

TEST(DetectorState, AViewOfAnotherLocationOrOtherMembersOrAnotherKindIsRefused) {
  DetectorState state(OneMember());
  Show(state, 0, 2);
  const View good = state.view(1);
  EXPECT_NO_THROW(state.LoadView(1, good, "test"));
  EXPECT_NE(RefusalOf([&] { state.LoadView(0, good, "test"); }).find("another location"), std::string::npos);
  View bad = good;
  bad.members.push_back(bad.members.front());
  EXPECT_NE(RefusalOf([&] { state.LoadView(1, bad, "test"); }).find("other members"), std::string::npos);
  bad = good;
  bad.caller.pixels = {{1, 2}};
  bad.caller.descriptors = cv::Mat(1, 8, CV_8U, cv::Scalar(0));
  EXPECT_NE(RefusalOf([&] { state.LoadView(1, bad, "test"); }).find("another kind"), std::string::npos);
  EXPECT_EQ(StateBytes(state.view(1)), StateBytes(good));
}

TEST(DetectorState, ViewsGoToAStoreAndComeBackTheSame) {
  DetectorState state(OneMember());
  Show(state, 0, 2);
  LocationStore store("");
  state.StoreView(0, store);
  const std::string before = StateBytes(state.view(0));
  state.DropView(0);
  state.FetchView(0, store);
  EXPECT_EQ(StateBytes(state.view(0)), before);
  EXPECT_NE(RefusalOf([&] { state.FetchView(1, store); }).find("location 1 are missing"), std::string::npos);
  store.Put(LocationStore::Kind::kView, 0, 1, before.substr(0, before.size() / 2));
  EXPECT_THROW(state.FetchView(1, store), InputError);
}

TEST(DetectorState, StatisticsComeBackTheSameAndDamagedOnesAreRefused) {
  DetectorState state(OneMember());
  LoopQuery query = Query(4, tutti::testing::WalkImage(0, 9));
  query.features.keypoints = {{cv::Point2f(40, 100), 8}};
  query.features.descriptors = cv::Mat::zeros(1, 16, CV_32F);
  Show(state, query);
  const std::string bytes = StateBytes(state);
  DetectorState other(OneMember());
  ReadStateBytes(bytes, "test", other);
  EXPECT_EQ(other.last_id(), 4);
  EXPECT_EQ(other.callers_descriptors().type, CV_32F);
  EXPECT_EQ(other.callers_descriptors().width, 16);
  EXPECT_EQ(StateBytes(other), bytes);
  // The last location that they speak of is not there.
  EXPECT_NE(RefusalOf([&] { other.CheckMemories("test"); }).find("last location"), std::string::npos);
  EXPECT_EQ(RefusalOf([&] { state.CheckMemories("test"); }), "");
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    DetectorState cut(OneMember());
    EXPECT_THROW(ReadStateBytes(bytes.substr(0, length), "test", cut), InputError) << length;
  }
}

}  // namespace
}  // namespace tutti::internal
