#include "frontend/geometry/image_aligner.h"

#include <gtest/gtest.h>

#include <algorithm>
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
    reference_.features = first_.get();
    reference_.camera.T_camera_world = world_.PoseOf(10).Inverse();
    for (const float inverse : first_->inverse_depth)
      reference_.depth.push_back(inverse > 0 ? 1 / double(inverse) : 0);
    start_.T_camera_world = reference_.camera.T_camera_world;
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
  const auto found = ImageAligner(rig_).Align(reference_, *Features(second_), start_, {}, 0);
  ASSERT_TRUE(found);
  EXPECT_LT(Error(*found), 0.004);
}

TEST_F(ImageAlignerTest, FindsItRoughlyThroughBlur) {
  cv::Mat line(1, 15, CV_32FC1, cv::Scalar(1.0 / 15));
  cv::filter2D(second_.image, second_.image, -1, line, {-1, -1}, 0, cv::BORDER_REPLICATE);
  const auto found = ImageAligner(rig_).Align(reference_, *Features(second_), start_, {}, 0);
  ASSERT_TRUE(found);
  EXPECT_LT(Error(*found), 0.4 * Error(start_));
}

// A camera that begins to turn: three frames at 30 Hz, each exposed for 30 ms.
class BlurredImages : public ImageAlignerTest {
 protected:
  static constexpr double kExposure = 0.03, kStep = 1.0 / 30;

  BlurredImages() {
    Vector6d before, step;  // mean motions to the first image, and to the second
    before << 0.1, 0.0, 0.1, -0.4, -1.6, 0.3;
    step << 0.1, 0.1, 0.2, 0.4, -2.4, 1.2;
    const Vector6d change = (step - before) / kStep;
    CameraMotion camera{world_.PoseOf(10).Inverse(), 0.5 * (step + before), change};
    blurred_first_ = Blurred(camera);
    reference_.features = blurred_first_.get();
    reference_.since_s = kStep;
    reference_.step = before;
    T_camera_world_ = ExpSE3(step * kStep) * camera.T_camera_world;
    blurred_second_ = Blurred({T_camera_world_, 1.5 * step - 0.5 * before, change});
    reference_.camera = camera;
    start_.T_camera_world = ExpSE3(before * kStep) * camera.T_camera_world;
    true_motion_ = 1.5 * step - 0.5 * before;
  }

  // The mean of what is seen while the image is exposed; depth as in the middle of it.
  std::shared_ptr<const FrameFeatures> Blurred(const CameraMotion& camera) const {
    constexpr int kViews = 31;
    cv::Mat sum(240, 320, CV_32FC1, cv::Scalar(0));
    SyntheticFrame middle;
    for (int i = 0; i < kViews; ++i) {
      const Pose then = camera.Then(kExposure * ((i + 0.5) / kViews - 0.5)) * camera.T_camera_world;
      const SyntheticFrame view = world_.RenderFrom(10, then.Inverse());
      cv::Mat grey;
      view.image.convertTo(grey, CV_32FC1, 1.0 / kViews);
      sum += grey;
      if (i == kViews / 2) middle = view;
    }
    sum.convertTo(middle.image, CV_8UC1);
    return Features(middle);
  }

  std::shared_ptr<const FrameFeatures> blurred_first_, blurred_second_;
  Vector6d true_motion_;
};

TEST_F(BlurredImages, AreAlignedCloselyOnceTheExposureIsKnown) {
  const ImageAligner aligner(rig_);
  const auto rough = aligner.Align(reference_, *blurred_second_, start_, {}, 0);
  const auto close = aligner.Align(reference_, *blurred_second_, start_, {}, kExposure);
  ASSERT_TRUE(rough && close);
  EXPECT_LT(Error(*close), 0.005);
  EXPECT_LT(Error(*close), 0.4 * Error(*rough));
  EXPECT_LT((close->motion - true_motion_).norm(), 0.2) << "that of the second image, not of the step to it";
}

TEST_F(BlurredImages, TellHowLongTheyWereExposed) {
  const ImageAligner aligner(rig_);
  const auto found = aligner.Align(reference_, *blurred_second_, start_, {}, kExposure);
  ASSERT_TRUE(found);
  const auto misfits = aligner.Misfits(reference_, *blurred_second_, *found);
  const auto least = std::min_element(misfits.begin(), misfits.end());
  EXPECT_DOUBLE_EQ(ImageAligner::Exposure(static_cast<int>(least - misfits.begin())), kExposure);
  EXPECT_LT(*least, 0.2 * misfits[0]);
}

TEST_F(BlurredImages, ThatAreNotThereTellNothing) {
  const auto nothing = ImageAligner(rig_).Misfits(reference_, *WithoutImages(*blurred_second_), start_);
  for (const double misfit : nothing) EXPECT_EQ(misfit, 0);
}

TEST_F(ImageAlignerTest, AnImageOfSomethingElseIsRefused) {
  EXPECT_FALSE(ImageAligner(rig_).Align(reference_, *Features(world_.RenderFrom(10, world_.PoseOf(60))),
                                        start_, {}, 0));
  second_.image = cv::Scalar(90);
  EXPECT_FALSE(ImageAligner(rig_).Align(reference_, *Features(second_), start_, {}, 0));
}

TEST_F(ImageAlignerTest, WithoutImagesOrDepthsThereIsNothingToAlign) {
  EXPECT_FALSE(ImageAligner(rig_).Align(reference_, *WithoutImages(*Features(second_)), start_, {}, 0));
  const std::shared_ptr<FrameFeatures> flat = std::make_shared<FrameFeatures>(*first_);
  flat->depth_grid.reset();
  reference_.features = flat.get();
  EXPECT_TRUE(ImageAligner(rig_).Align(reference_, *Features(second_), start_, {}, 0)) << "by its features";
  reference_.depth.assign(reference_.depth.size(), 0);
  EXPECT_FALSE(ImageAligner(rig_).Align(reference_, *Features(second_), start_, {}, 0));
}

}  // namespace
}  // namespace tutti
