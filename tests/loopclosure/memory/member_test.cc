// Which images a member sits out.
#include "loopclosure/memory/member.h"

#include <gtest/gtest.h>

#include <initializer_list>

#include "core/state_archive.h"

namespace tutti {
namespace {

Member OrbMember(double bad_signature_ratio) {
  LoopDetectorOptions options;
  options.bad_signature_ratio = bad_signature_ratio;
  return {"orb", options, 1};
}

Features WithKeypoints(int count) {
  Features features;
  features.keypoints.resize(static_cast<std::size_t>(count));
  return features;
}

Features OneRow(std::initializer_list<float> values) { return {{}, cv::Mat_<float>(values).reshape(1, 1)}; }

TEST(Member, TwoFeaturesAreEnoughWhereOtherImagesHaveNoMore) {
  for (const double ratio : {0.0, 0.5}) {
    Member member = OrbMember(ratio);
    EXPECT_TRUE(member.Judge(WithKeypoints(2)));
    EXPECT_FALSE(member.Judge(WithKeypoints(1)));
    EXPECT_FALSE(member.Judge(WithKeypoints(0)));
    EXPECT_TRUE(member.Judge(WithKeypoints(2)));
  }
}

TEST(Member, AnImageWithFewerThanItsShareOfTheMeanIsBad) {
  Member member = OrbMember(0.5);
  EXPECT_TRUE(member.Judge(WithKeypoints(100)));
  EXPECT_TRUE(member.Judge(WithKeypoints(100)));
  EXPECT_FALSE(member.Judge(WithKeypoints(39)));  // of a mean of 79.7, which counts it
  EXPECT_FALSE(member.Judge(WithKeypoints(33)));  // of 68
  EXPECT_TRUE(member.Judge(WithKeypoints(32)));   // of 60.8
}

TEST(Member, TheMeanIsSavedWithIt) {
  Member member = OrbMember(0.5), again = OrbMember(0.5);
  EXPECT_TRUE(member.Judge(WithKeypoints(100)));
  internal::ReadStateBytes(internal::StateBytes(member), "test", again);
  EXPECT_FALSE(again.Judge(WithKeypoints(30)));
  EXPECT_TRUE(OrbMember(0.5).Judge(WithKeypoints(30)));
}

TEST(Member, ADenseOneNeedsADescriptorThatHasALength) {
  Member member("hog", LoopDetectorOptions(), 1);
  ASSERT_TRUE(member.dense());
  EXPECT_FALSE(member.Judge({}));
  EXPECT_FALSE(member.Judge(OneRow({0, 0, 0})));
  EXPECT_TRUE(member.Judge(OneRow({0, 1, 0, 2})));
  EXPECT_EQ(member.width(), 4);
}

}  // namespace
}  // namespace tutti
