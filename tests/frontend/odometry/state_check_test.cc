#include "frontend/odometry/state_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "tests/frontend/map/point_scene.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

constexpr internal::SectionFileKind kMapFile = {
    {'T', 'E', 'S', 'T', 'O', 'D', 'O', '\n'}, 1, "test", "a test"};

// Two keyframes that see the same points.
class MapCheck : public ::testing::Test, protected testing::PointScene {
 protected:
  MapCheck() {
    MakeLandmarks();
    std::vector<int> order;
    const int second = AddKeyframe(Pose(Eigen::Quaterniond::Identity(), {0.1, 0, 0}), &order);
    for (std::size_t f = 0; f < order.size(); ++f) {
      const auto seen = std::find(order_.begin(), order_.end(), order[f]);
      if (seen != order_.end())
        map_.AddObservation(static_cast<int>(seen - order_.begin()), second, static_cast<int>(f));
    }
  }
  std::string Complaint() const {
    const auto file = testing::FreshFolder() / "map.tutti";
    internal::SectionWriter(file, kMapFile).Finish();
    return testing::ErrorOf([&] { map_.Check(internal::SectionReader(file, kMapFile)); });
  }
  // What is said of the map after a change, which is taken back.
  template <class Change>
  std::string With(const Change& change) {
    const Map before = map_;
    change();
    std::string complaint = Complaint();
    map_ = before;
    return complaint;
  }
};

TEST_F(MapCheck, AMapIsWhatItMustBeAlsoAfterMergers) {
  EXPECT_EQ(Complaint(), "no error");
  map_.ReplaceLandmark(4, 3);
  map_.ReplaceLandmark(3, 9);
  map_.ReplaceLandmark(9, 2);
  map_.RemoveLandmark(7);
  map_.RemoveObservation(8, 0);
  EXPECT_EQ(Complaint(), "no error");
}

TEST_F(MapCheck, LandmarksThatReplacedEachOtherAreRefused) {
  map_.RemoveLandmark(4);
  map_.RemoveLandmark(5);
  map_.RemoveLandmark(6);
  const auto complaint = [this](const std::map<int, int>& replaced_by) {
    return With([&] {
      const Map before = map_;
      map_ = Map(before.scales());
      for (int id = 0; id < before.KeyframeCount(); ++id) map_.Restore(before.keyframe(id));
      for (int id = 0; id < before.LandmarkCount(); ++id)
        map_.Restore(before.landmark(id), replaced_by.count(id) != 0 ? replaced_by.at(id) : -1);
    });
  };
  EXPECT_EQ(complaint({{4, 5}, {5, 6}, {6, 7}}), "no error");
  EXPECT_THAT(complaint({{4, 5}, {5, 6}, {6, 4}}), HasSubstr("replaced each other"));
  EXPECT_THAT(complaint({{5, 5}}), HasSubstr("replaced each other"));
  EXPECT_THAT(complaint({{5, map_.LandmarkCount()}}), HasSubstr("out of range"));
}

TEST_F(MapCheck, KeyframesThatDoNotFitAreRefused) {
  const auto keyframe = [this](const auto& change) { return With([&] { change(map_.keyframe(1)); }); };
  EXPECT_THAT(keyframe([](Keyframe& k) { k.features = nullptr; }), HasSubstr("without features"));
  EXPECT_THAT(keyframe([](Keyframe& k) { k.landmarks.pop_back(); }), HasSubstr("landmarks of another"));
  EXPECT_THAT(keyframe([](Keyframe& k) { k.landmarks[0] = 1 << 20; }), HasSubstr("out of range"));
  EXPECT_THAT(keyframe([](Keyframe& k) { k.covisible[1] = 3; }), HasSubstr("its own neighbour"));
  EXPECT_THAT(keyframe([](Keyframe& k) { k.covisible[2] = 3; }), HasSubstr("out of range"));
  EXPECT_THAT(keyframe([](Keyframe& k) { k.covisible[0] = -3; }), HasSubstr("out of range"));
  EXPECT_THAT(keyframe([](Keyframe& k) { k.piece = -1; }), HasSubstr("out of range"));
  EXPECT_THAT(keyframe([](Keyframe& k) { k.T_world_camera.rotation.w() = 7; }), HasSubstr("rotation"));
  EXPECT_THAT(keyframe([](Keyframe& k) {
                auto features = std::make_shared<FrameFeatures>(*k.features);
                features->keypoints[3].octave = 8;
                k.features = features;
              }),
              HasSubstr("out of range"));
  EXPECT_THAT(With([&] {
                map_.RemoveLandmark(0);
                map_.keyframe(0).landmarks[1] = 0;
              }),
              HasSubstr("sees what is gone"));
}

TEST_F(MapCheck, FramesThatHangOnNoKeyframeAreRefused) {
  map_.AddFrame(5, 0.5, 0, Pose());
  EXPECT_THAT(With([this] { map_.frame(0).keyframe = 2; }), HasSubstr("out of range"));
  EXPECT_THAT(With([this] { map_.frame(0).before = 2; }), HasSubstr("out of range"));
  EXPECT_THAT(With([this] { map_.frame(0).T_before_frame.rotation.w() = 7; }), HasSubstr("rotation"));
}

TEST_F(MapCheck, KeyframesAndLandmarksKnowOfEachOther) {
  const Observation view = std::as_const(map_).landmark(2).observations[0];
  const auto seen = [&](int landmark) {
    return With(
        [&] { map_.keyframe(view.keyframe).landmarks[static_cast<std::size_t>(view.feature)] = landmark; });
  };
  EXPECT_EQ(seen(2), "no error");
  EXPECT_THAT(seen(-1), HasSubstr("another's"));
  EXPECT_THAT(seen(3), HasSubstr("another's"));
  EXPECT_THAT(With([&] { map_.landmark(2).observations.pop_back(); }), HasSubstr("does not know of it"));
}

TEST_F(MapCheck, LandmarksThatDoNotFitAreRefused) {
  const auto landmark = [this](const auto& change) { return With([&] { change(map_.landmark(2)); }); };
  const float nan = std::nanf("");
  EXPECT_THAT(landmark([](Landmark& l) { l.observations.clear(); }), HasSubstr("nothing sees"));
  EXPECT_THAT(landmark([](Landmark& l) { l.observations[0].feature = 1 << 20; }), HasSubstr("out of range"));
  EXPECT_THAT(landmark([](Landmark& l) { l.observations[1].keyframe = 0; }), HasSubstr("out of range"));
  EXPECT_THAT(landmark([](Landmark& l) { l.observations[1].keyframe = 2; }), HasSubstr("out of range"));
  EXPECT_THAT(landmark([](Landmark& l) { l.reference = -1; }), HasSubstr("out of range"));
  EXPECT_THAT(landmark([](Landmark& l) { l.visible = -1; }), HasSubstr("out of range"));
  EXPECT_THAT(landmark([&](Landmark& l) { l.position.x() = nan; }), HasSubstr("place"));
  EXPECT_THAT(landmark([&](Landmark& l) { l.normal.x() = nan; }), HasSubstr("direction"));
  EXPECT_THAT(landmark([&](Landmark& l) { l.max_distance = nan; }), HasSubstr("distance"));
  const auto patch = [&](const auto& change) {
    return landmark([&](Landmark& l) {
      auto made = std::make_shared<Patch>();
      change(*made, l);
      l.patch = made;
    });
  };
  EXPECT_EQ(patch([](Patch&, Landmark&) {}), "no error");
  EXPECT_THAT(patch([&](Patch& p, Landmark&) { p.offset_x = nan; }), HasSubstr("patch"));
  EXPECT_THAT(patch([](Patch& p, Landmark&) { p.scale_y = 0; }), HasSubstr("patch"));
  EXPECT_THAT(patch([](Patch&, Landmark& l) { l.patch_source.keyframe = -1; }), HasSubstr("out of range"));
}

}  // namespace
}  // namespace tutti
