#include "frontend/geometry/image_aligner.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <vector>

#include "data/synthetic/synthetic_world.h"
#include "tests/support/recording.h"
#include "tests/support/small_room.h"

namespace tutti {
namespace {

// Two views of a room, of a camera that turned and moved between them.
class ImageAlignerTest : public ::testing::Test {
 protected:
  ImageAlignerTest() : world_(Options()), rig_(testing::RigOf(world_)) {
    Pose moved(ExpSO3({0.02, -0.04, 0.05}), {0.02, -0.01, 0.02});
    first_ = Features(world_.RenderFrom(10, world_.PoseOf(10)));
    T_camera_world_ = (world_.PoseOf(10) * moved).Inverse();
    second_ = world_.RenderFrom(10, T_camera_world_.Inverse());
    reference_ = {first_.get(), world_.PoseOf(10).Inverse(), {}};
    for (const float inverse : first_->inverse_depth)
      reference_.depth.push_back(inverse > 0 ? 1 / double(inverse) : 0);
    start_.T_camera_world = reference_.T_camera_world;
  }
  static SyntheticOptions Options() { return testing::SmallRgbdRoom(320, 240); }
  std::shared_ptr<const FrameFeatures> Features(const SyntheticFrame& rendered) const {
    InputFrame frame;
    frame.image = rendered.image;
    frame.depth_m = rendered.depth_m;
    return std::make_shared<const FrameFeatures>(ExtractFeatures(frame, rig_, OdometryOptions()));
  }
  double Error(const CameraMotion& found) const {
    return LogSE3(found.T_camera_world * T_camera_world_.Inverse()).norm();
  }

  SyntheticWorld world_;
  CameraRig rig_;
  std::shared_ptr<const FrameFeatures> first_;
  SyntheticFrame second_;
  ImageAligner::Reference reference_;
  CameraMotion start_;
  Pose T_camera_world_;
};

TEST_F(ImageAlignerTest, FindsHowTheCameraMoved) {
  EXPECT_GT(Error(start_), 0.06);
  const auto found = ImageAligner(rig_).Align(reference_, *Features(second_), start_, {});
  ASSERT_TRUE(found);
  EXPECT_LT(Error(*found), 0.004);
}

TEST_F(ImageAlignerTest, FindsItRoughlyThroughBlur) {
  cv::Mat line(1, 15, CV_32FC1, cv::Scalar(1.0 / 15));
  cv::filter2D(second_.image, second_.image, -1, line, {-1, -1}, 0, cv::BORDER_REPLICATE);
  const auto found = ImageAligner(rig_).Align(reference_, *Features(second_), start_, {});
  ASSERT_TRUE(found);
  EXPECT_LT(Error(*found), 0.4 * Error(start_));
}

TEST_F(ImageAlignerTest, AnImageOfSomethingElseIsRefused) {
  EXPECT_FALSE(
      ImageAligner(rig_).Align(reference_, *Features(world_.RenderFrom(10, world_.PoseOf(60))), start_, {}));
  second_.image = cv::Scalar(90);
  EXPECT_FALSE(ImageAligner(rig_).Align(reference_, *Features(second_), start_, {}));
}

TEST_F(ImageAlignerTest, WithoutImagesOrDepthsThereIsNothingToAlign) {
  EXPECT_FALSE(ImageAligner(rig_).Align(reference_, *WithoutImages(*Features(second_)), start_, {}));
  reference_.depth.assign(reference_.depth.size(), 0);
  EXPECT_FALSE(ImageAligner(rig_).Align(reference_, *Features(second_), start_, {}));
}

}  // namespace
}  // namespace tutti
