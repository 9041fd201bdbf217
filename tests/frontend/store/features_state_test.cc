#include "frontend/store/features_state.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

#include "core/state_archive.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

template <class T>
std::string Bytes(T& value) {
  internal::SharedObjectsOut shared;
  internal::StateWriter out(&shared);
  out(value);
  return out.Take();
}

template <class T>
T Read(const std::string& bytes) {
  internal::SharedObjectsIn shared;
  internal::StateReader in(bytes, "f", &shared);
  T value;
  in(value);
  in.ExpectEnd();
  return value;
}

struct Repeated {
  std::vector<float> values;
  template <class Archive>
  void State(Archive& archive) {
    std::uint64_t size = values.size();
    archive(size);
    internal::StateOfRepeated(archive, size, &values);
  }
};

TEST(FeaturesState, RepeatedNumbersTakeAByteAndKeepTheirBits) {
  std::vector<float> many, few;
  for (int i = 0; i < 1000; ++i) {
    many.push_back(0.1F * static_cast<float>(i));
    few.push_back(i % 3 == 0 ? -0.0F : static_cast<float>(i % 250));
  }
  for (const std::vector<float>& values : {many, few, std::vector<float>(1000, 0.5F), std::vector<float>(),
                                           std::vector<float>(few.begin(), few.begin() + 1)}) {
    Repeated written{values};
    const std::vector<float> read = Read<Repeated>(Bytes(written)).values;
    ASSERT_EQ(read, values);
    for (std::size_t i = 0; i < read.size(); ++i) EXPECT_EQ(std::signbit(read[i]), std::signbit(values[i]));
  }
  Repeated of_many{many}, of_few{few}, of_one{std::vector<float>(1000, 0.5F)};
  EXPECT_GT(Bytes(of_many).size(), 4000U);
  EXPECT_LT(Bytes(of_few).size(), 2100U);
  EXPECT_LT(Bytes(of_one).size(), 50U);
}

FrameFeatures OfATown() {
  const testing::RenderedWorld world(testing::SmallStereoTown(400, 200));
  const SyntheticFrame rendered = world.Render(0);
  CameraRig rig;
  rig.sensor = Sensor::kStereo;
  rig.camera = world.Camera();
  rig.baseline_m = world.Options().baseline_m;
  InputFrame frame;
  frame.image = rendered.image;
  frame.right = rendered.right;
  return ExtractFeatures(frame, rig, OdometryOptions());
}

TEST(FeaturesState, WhatARollingShutterMovedIsKept) {
  FrameFeatures written = OfATown();
  EXPECT_TRUE(Read<FrameFeatures>(Bytes(written)).rolled.empty());
  for (std::size_t f = 0; f < written.size(); ++f)
    written.rolled.emplace_back(0.5F * static_cast<float>(f), -1.25F);
  EXPECT_EQ(Read<FrameFeatures>(Bytes(written)).rolled, written.rolled);
  written.rolled.pop_back();
  EXPECT_THROW(Read<FrameFeatures>(Bytes(written)), InputError);
}

TEST(FeaturesState, PyramidAndGridAreMadeAgainAsTheyWere) {
  FrameFeatures written = OfATown();
  FrameFeatures read = Read<FrameFeatures>(Bytes(written));
  ASSERT_GT(read.size(), 500U);
  const std::vector<cv::Mat>&again = read.pyramid->Levels(), &first = written.pyramid->Levels();
  ASSERT_EQ(again.size(), first.size());
  ASSERT_GT(again.size(), 3U);
  for (std::size_t l = 0; l < again.size(); ++l) EXPECT_EQ(cv::norm(again[l], first[l], cv::NORM_L1), 0) << l;
  for (const float radius : {5.0F, 40.0F, 1000.0F}) {
    std::vector<int> a, b;
    written.InArea({150, 90}, radius, 0, 3, &a);
    read.InArea({150, 90}, radius, 0, 3, &b);
    EXPECT_EQ(a, b);
    EXPECT_FALSE(b.empty());
  }
  EXPECT_EQ(Bytes(read), Bytes(written));
}

TEST(FeaturesState, WithoutImageOrFeaturesItIsWhatItWas) {
  FrameFeatures written = OfATown();
  const FrameFeatures read = Read<FrameFeatures>([&] {
    FrameFeatures bare = *WithoutImages(written);
    return Bytes(bare);
  }());
  EXPECT_EQ(read.pyramid, nullptr);
  EXPECT_EQ(read.size(), written.size());
  FrameFeatures none;
  EXPECT_EQ(Read<FrameFeatures>(Bytes(none)).size(), 0U);
  none.BuildGrid(40, 20);
  EXPECT_EQ(Read<FrameFeatures>(Bytes(none)).size(), 0U);
}

TEST(FeaturesState, CutOffAnywhereItIsRefused) {
  FrameFeatures written = OfATown();
  const std::string bytes = Bytes(written);
  for (std::size_t size = 0; size < bytes.size(); size += 997)
    EXPECT_THROW(Read<FrameFeatures>(bytes.substr(0, size)), InputError) << size;
}

TEST(FeaturesState, ImpossibleFeaturesAreRefused) {
  const FrameFeatures right = OfATown();
  const auto expect_refused = [&](const auto& change) {
    FrameFeatures wrong = right;
    change(wrong);
    EXPECT_THROW(Read<FrameFeatures>(Bytes(wrong)), InputError);
  };
  expect_refused([](FrameFeatures& f) { f.keypoints[7].pt.x = std::nanf(""); });
  expect_refused([](FrameFeatures& f) { f.keypoints[7].pt.y = 1e9F; });
  expect_refused([](FrameFeatures& f) { f.keypoints[7].angle = 1e9F; });
  expect_refused([](FrameFeatures& f) { f.keypoints.pop_back(); });
  expect_refused([](FrameFeatures& f) { f.descriptors = f.descriptors.rowRange(0, 5).clone(); });
  expect_refused([](FrameFeatures& f) { f.descriptors = f.descriptors.colRange(0, 16).clone(); });
  expect_refused([](FrameFeatures& f) { f.inverse_depth[0] = -1; });
  expect_refused([](FrameFeatures& f) { f.inverse_depth_sigma.pop_back(); });
  expect_refused([](FrameFeatures& f) { f.lens.x() = std::nan(""); });
  expect_refused([](FrameFeatures& f) { f.BuildGrid(1 << 20, 10); });
  expect_refused([](FrameFeatures& f) {
    const std::vector<cv::Mat>& levels = f.pyramid->Levels();
    f.pyramid = std::make_shared<const Pyramid>(std::vector<cv::Mat>(levels.rbegin(), levels.rend()));
  });
}

struct WithGrid {
  std::shared_ptr<const DepthGrid> grid;
  template <class Archive>
  void State(Archive& archive) {
    internal::StateOfDepthGrid(archive, &grid);
  }
};

TEST(FeaturesState, DepthGridsAreAsTheyWere) {
  WithGrid none;
  EXPECT_FALSE(Read<WithGrid>(Bytes(none)).grid);
  WithGrid written{std::make_shared<const DepthGrid>(DepthGrid{8, 2, {0.5F, -0.25F, 0, 1}})};
  const WithGrid read = Read<WithGrid>(Bytes(written));
  ASSERT_TRUE(read.grid);
  EXPECT_EQ(read.grid->step, 8);
  EXPECT_EQ(read.grid->columns, 2);
  EXPECT_EQ(read.grid->inverse_depth, written.grid->inverse_depth);
}

TEST(FeaturesState, DepthGridsThatAreNoneAreRefused) {
  for (const DepthGrid& grid :
       {DepthGrid{0, 2, {1, 1}}, DepthGrid{8, 0, {1, 1}}, DepthGrid{8, 3, {1, 1}}, DepthGrid{8, 1, {}},
        DepthGrid{8, 1, {std::numeric_limits<float>::quiet_NaN()}}}) {
    WithGrid damaged{std::make_shared<const DepthGrid>(grid)};
    const std::string bytes = Bytes(damaged);
    EXPECT_THROW(Read<WithGrid>(bytes), InputError);
  }
}

}  // namespace
}  // namespace tutti
