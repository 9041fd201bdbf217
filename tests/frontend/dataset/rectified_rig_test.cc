#include "frontend/dataset/rectified_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {
using ::testing::AllOf, ::testing::HasSubstr;
using testing::ErrorOf, testing::With;

const cv::Size kSize(64, 48);

// A right camera 0.2 m to the right, with lenses.
DatasetOptions RawPairs() {
  DatasetOptions options = With(Sensor::kStereo, true);
  options.camera->distortion = Distortion::kRadTan;
  options.camera->coefficients = {-0.1, 0, 0, 0, 0};
  options.right = options.camera;
  options.T_right_left = {1, 0, 0, -0.2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  return options;
}

RectifiedRig Make(const DatasetOptions& options, std::vector<std::string>* warnings = nullptr) {
  std::vector<std::string> ignored;
  return RectifyRig("my data", options, kSize, 20, warnings != nullptr ? *warnings : ignored);
}

std::string Refusal(const DatasetOptions& options) {
  return ErrorOf([&] { Make(options); });
}

TEST(RectifiedRig, OfRawPairsHasItsBaselineFromTheTransform) {
  const RectifiedRig made = Make(RawPairs());
  EXPECT_NEAR(made.rig.baseline_m, 0.2, 1e-12);
  EXPECT_EQ(made.rig.rate_hz, 20);
  ASSERT_TRUE(made.left && made.right);
  EXPECT_EQ(made.left->Camera().Matrix(), made.right->Camera().Matrix());
}

TEST(RectifiedRig, OfOneCameraDoesNotNeedTheRightOne) {
  DatasetOptions options = RawPairs();
  options.sensor = Sensor::kMono;
  const RectifiedRig made = Make(options);
  EXPECT_TRUE(made.left);
  EXPECT_FALSE(made.right);
  EXPECT_EQ(made.rig.baseline_m, 0);
}

TEST(RectifiedRig, WithoutACalibrationSaysSo) {
  std::vector<std::string> warnings;
  const RectifiedRig made = Make(With(Sensor::kMono), &warnings);
  EXPECT_FALSE(made.rig.calibrated);
  EXPECT_EQ(made.rig.camera.width, 64);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0], AllOf(HasSubstr("my data"), HasSubstr("no calibration is given")));
}

TEST(RectifiedRig, ThatCantBeMadeIsRefusedWithTheRemedy) {
  DatasetOptions lens = RawPairs();
  lens.right.reset();
  EXPECT_THAT(Refusal(lens),
              AllOf(HasSubstr("my data: stereo pairs must be rectified"), HasSubstr("camera.right")));
  EXPECT_THAT(Refusal(With(Sensor::kStereo, true)), HasSubstr("set camera.baseline_m"));
  DatasetOptions alone = RawPairs();
  alone.camera.reset();
  EXPECT_THAT(Refusal(alone), HasSubstr("but not the left camera"));
  DatasetOptions both = RawPairs();
  both.baseline_m = 0.5;
  EXPECT_THAT(Refusal(both), HasSubstr("leave baseline_m out"));
  DatasetOptions large = RawPairs();
  large.right->width = 640;
  EXPECT_THAT(Refusal(large),
              HasSubstr("the right camera is calibrated for images of 640x48, but the images have 64x48"));
  DatasetOptions swapped = RawPairs();
  swapped.T_right_left[3] = 0.2;
  EXPECT_THAT(Refusal(swapped), HasSubstr("swap the two"));
}

TEST(RectifiedRig, OfAFolderOfRawPairsComesFromTheOptionsToo) {
  const std::filesystem::path folder = testing::FreshFolder();
  testing::MakeKitti(folder, 2, true);
  const auto dataset = OpenDataset(folder, RawPairs());
  EXPECT_NEAR(dataset->Rig().baseline_m, 0.2, 1e-12);
  EXPECT_EQ(dataset->Rig().camera.distortion, Distortion::kNone);
  EXPECT_FALSE(dataset->Read(0).frame->right.empty());
}

TEST(RightCamera, ThatCantBeUsedIsRefusedByItsKey) {
  const auto problem = [](auto&& change) {
    DatasetOptions options = RawPairs();
    change(options);
    return options.Validate();
  };
  EXPECT_EQ(problem([](DatasetOptions&) {}), "");
  EXPECT_THAT(problem([](DatasetOptions& o) { o.right->fx = -1; }), HasSubstr("camera.right.fx must be"));
  EXPECT_THAT(problem([](DatasetOptions& o) { o.right->cx = 1000; }),
              HasSubstr("camera.right: the principal point"));
  EXPECT_THAT(problem([](DatasetOptions& o) { o.T_right_left = {}; }), HasSubstr("T_right_left is missing"));
  EXPECT_THAT(problem([](DatasetOptions& o) { o.right.reset(); }), HasSubstr("needs the right camera's fx"));
  for (const auto& entry : {std::pair(0, 2.0), {0, -1.0}, {15, 0.0}})
    EXPECT_THAT(problem([&](DatasetOptions& o) {
                  o.T_right_left[static_cast<std::size_t>(entry.first)] = entry.second;
                }),
                HasSubstr("is not a rigid transform"));
  EXPECT_THAT(problem([](DatasetOptions& o) { o.T_right_left[3] = std::nan(""); }),
              HasSubstr("T_right_left"));
}

}  // namespace
}  // namespace tutti
