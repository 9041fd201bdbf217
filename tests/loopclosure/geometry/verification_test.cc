#include "loopclosure/geometry/verification.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/loopclosure/geometry/append_rows.h"
#include "tests/support/plain_camera.h"

namespace tutti {
namespace {

constexpr int kPoints = 200;
constexpr std::uint32_t kSeed = 7;

PinholeCamera VerifiedCamera() { return testing::PlainCamera(500); }

// A cloud in front of the camera of the query, 4 to 12 m away.
std::vector<Eigen::Vector3d> Cloud() {
  std::mt19937 generator(kSeed);
  std::uniform_real_distribution<double> x(-3, 3), y(-2, 2), z(4, 12);
  std::vector<Eigen::Vector3d> cloud;
  cloud.reserve(kPoints);
  for (int i = 0; i < kPoints; ++i) {
    const double pz = z(generator), py = y(generator), px = x(generator);
    cloud.emplace_back(px, py, pz);
  }
  return cloud;
}

// What a camera at this pose sees of the cloud: every point with a descriptor of its own, and half a pixel of
// noise.
View See(const Pose& T_world_camera, std::int64_t id, bool calibrated, bool with_points) {
  const std::vector<Eigen::Vector3d> cloud = Cloud();
  std::mt19937 generator(static_cast<std::uint32_t>(100 + id));
  std::normal_distribution<double> noise(0, 0.5);
  View view;
  view.id = id;
  view.size = {640, 480};
  if (calibrated) view.camera = VerifiedCamera();
  View::Set set;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3d p = T_world_camera.Inverse() * cloud[i];
    const Eigen::Vector2d pixel = VerifiedCamera().Project(p);
    if (p.z() < 0.1 || !VerifiedCamera().Contains(pixel)) continue;
    std::mt19937 own(static_cast<std::uint32_t>(i + 1));
    cv::Mat row(1, 32, CV_8U);
    for (int c = 0; c < 32; ++c) row.at<std::uint8_t>(0, c) = static_cast<std::uint8_t>(own());
    testing::AppendRows(row, &set.descriptors);
    const double dy = noise(generator), dx = noise(generator);
    set.pixels.emplace_back(static_cast<float>(pixel.x() + dx), static_cast<float>(pixel.y() + dy));
    if (with_points) set.points.push_back(p.cast<float>());
  }
  view.members.push_back(set);
  return view;
}

Pose PoseAt(double x, double z, double turn = 0.0) { return Pose(ExpSO3({0, turn, 0}), {x, 0, z}); }

TEST(GeometricVerifier, WithMetricPointsTheConstraintIsTheRelativePose) {
  const GeometricVerifier verifier({}, 1);
  const Pose query = PoseAt(0.4, 0.2, 0.05);
  const Verification v = verifier.Verify(See(query, 9, true, true), See(Pose(), 1, true, true));
  ASSERT_TRUE(v.accepted) << v.reason;
  EXPECT_EQ(v.type, ConstraintType::kRigid);
  EXPECT_EQ(v.candidate, 1);
  EXPECT_LT((v.S_candidate_query.translation - query.translation).norm(), 0.02);
  EXPECT_EQ(v.S_candidate_query.scale, 1.0);
  EXPECT_GT(v.information.diagonal().minCoeff(), 0.0);
}

TEST(GeometricVerifier, WithCalibrationAloneTheDirectionIsKnown) {
  const GeometricVerifier verifier({}, 1);
  const Verification v = verifier.Verify(See(PoseAt(0.8, 0.0), 9, true, false), See(Pose(), 1, true, false));
  ASSERT_TRUE(v.accepted) << v.reason;
  EXPECT_EQ(v.type, ConstraintType::kEssential);
  EXPECT_NEAR(std::abs(v.S_candidate_query.translation.normalized().x()), 1.0, 0.02);
}

TEST(GeometricVerifier, EvidencePartsOnePlaceFromChanceWhateverIsDecided) {
  VerificationOptions strict;
  strict.min_spread = 0.9;  // nothing is accepted
  View chance = See(Pose(), 1, false, false);
  std::mt19937 generator(3);
  for (cv::Point2f& p : chance.members[0].pixels) {
    p = {static_cast<float>(generator() % 640u), static_cast<float>(generator() % 480u)};
  }
  const View query = See(PoseAt(0.8, 0.2), 9, false, false);
  const Verification same = GeometricVerifier(strict, 1).Verify(query, See(Pose(), 1, false, false));
  const Verification other = GeometricVerifier(strict, 1).Verify(query, chance);
  ASSERT_FALSE(same.accepted);
  ASSERT_FALSE(other.accepted);
  EXPECT_GT(same.coverage, 24);
  EXPECT_LT(other.coverage, same.coverage);
  EXPECT_LT(same.log_nfa, -100);
  EXPECT_GT(other.log_nfa, -5);
  EXPECT_GT(same.inliers, 10 * same.expected_inliers);
  EXPECT_GT(same.motion_spread, 0.005);  // parallax: 4 to 12 m away
}

TEST(GeometricVerifier, WithMetricPointsEvidenceIsByLinesAsWithout) {
  const Verification v =
      GeometricVerifier({}, 1).Verify(See(PoseAt(0.4, 0.2, 0.05), 9, true, true), See(Pose(), 1, true, true));
  ASSERT_EQ(v.type, ConstraintType::kRigid);
  EXPECT_LT(v.expected_inliers, 0.1 * v.matches);
  EXPECT_LT(v.log_nfa, -100);
  EXPECT_GT(v.coverage, 24);
}

// Descriptors of their own for features that belong to something else than the cloud.
cv::Mat Descriptor(std::uint32_t of) {
  std::mt19937 own(of);
  cv::Mat row(1, 32, CV_8U);
  for (int c = 0; c < 32; ++c) row.at<std::uint8_t>(0, c) = static_cast<std::uint8_t>(own());
  return row;
}

void AddFeature(View& view, const cv::Point2f& pixel, std::uint32_t descriptor) {
  view.members[0].pixels.push_back(pixel);
  testing::AppendRows(Descriptor(descriptor), &view.members[0].descriptors);
}

// Features all over the image that no other view has.
View SomewhereElse(std::uint32_t seed) {
  View view;
  view.id = seed;
  view.size = {640, 480};
  view.members.emplace_back();
  std::mt19937 generator(seed);
  for (std::uint32_t i = 0; i < kPoints; ++i) {
    const std::uint32_t y = generator() % 480u, x = generator() % 640u;
    AddFeature(view, cv::Point2f(static_cast<float>(x), static_cast<float>(y)), 100000 * seed + i);
  }
  return view;
}

enum class Overlay { kRim, kTexts, kBonnet };

// 40 corners that are in every image at the same pixel, to a fifth of a pixel.
void Add(Overlay overlay, View& view) {
  std::mt19937 generator(static_cast<std::uint32_t>(50 + view.id));
  std::normal_distribution<float> noise(0, 0.2f);
  for (std::uint32_t i = 0; i < 40; ++i) {
    const float along = static_cast<float>(i % 10) / 10;
    cv::Point2f p;
    if (overlay == Overlay::kRim) {
      p = i < 10   ? cv::Point2f(20 + 600 * along, 12)
          : i < 20 ? cv::Point2f(20 + 600 * along, 468)
          : i < 30 ? cv::Point2f(12, 20 + 440 * along)
                   : cv::Point2f(628, 20 + 440 * along);
    } else if (overlay == Overlay::kTexts) {  // one above, one below
      const int row = i / 10 % 2;
      p = {100 + 300 * along, (i < 20 ? 20.f : 440.f) + 12 * static_cast<float>(row)};
    } else {
      const int row = i / 10;
      p = {60 + 520 * along, 330 + 40 * static_cast<float>(row)};
    }
    const float dy = noise(generator), dx = noise(generator);
    AddFeature(view, p + cv::Point2f(dx, dy), 7000000 + i);
  }
}

class WithOverlay : public ::testing::TestWithParam<Overlay> {};
INSTANTIATE_TEST_SUITE_P(All, WithOverlay,
                         ::testing::Values(Overlay::kRim, Overlay::kTexts, Overlay::kBonnet));

TEST_P(WithOverlay, TwoPlacesAreNotOneByWhatTheCameraCarriesAlong) {
  View query = SomewhereElse(9), candidate = SomewhereElse(1);
  Add(GetParam(), query);
  Add(GetParam(), candidate);
  const Verification v = GeometricVerifier({}, 1).Verify(query, candidate);
  EXPECT_FALSE(v.accepted);
  EXPECT_NE(v.reason.find("do not move with the camera"), std::string::npos) << v.reason;
  VerificationOptions off;
  off.static_px = 0;
  EXPECT_TRUE(GeometricVerifier(off, 1).Verify(query, candidate).accepted);
}

TEST_P(WithOverlay, APlaceSeenAgainIsOneByWhatMoves) {
  View query = See(PoseAt(0.5, 0.3), 9, false, false), candidate = See(Pose(), 1, false, false);
  Add(GetParam(), query);
  Add(GetParam(), candidate);
  const Verification v = GeometricVerifier({}, 1).Verify(query, candidate);
  ASSERT_TRUE(v.accepted) << v.reason;
  EXPECT_GT(v.motion_spread, 0.005);
}

TEST_P(WithOverlay, ACameraThatStandsWhereItStoodClosesALoop) {
  View query = See(Pose(), 9, false, false), candidate = See(Pose(), 1, false, false);
  Add(GetParam(), query);
  Add(GetParam(), candidate);
  const Verification v = GeometricVerifier({}, 1).Verify(query, candidate);
  EXPECT_TRUE(v.accepted) << v.reason;
  const Verification same = GeometricVerifier({}, 1).Verify(query, query);
  EXPECT_TRUE(same.accepted) << same.reason;
}

class Turned : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Calibrated, Turned, ::testing::Bool());

TEST_P(Turned, OnTheSpotIsAcceptedByItsHomography) {
  const Pose query = PoseAt(0, 0, 0.2);
  const Verification v =
      GeometricVerifier({}, 1).Verify(See(query, 9, GetParam(), false), See(Pose(), 1, GetParam(), false));
  ASSERT_TRUE(v.accepted) << v.reason;
  EXPECT_TRUE(v.homography);
  EXPECT_GT(v.inliers, 0.9 * v.matches);
  EXPECT_EQ(v.type, GetParam() ? ConstraintType::kEssential : ConstraintType::kFundamental);
  if (GetParam()) {
    EXPECT_EQ(v.S_candidate_query.translation.norm(), 0);
    EXPECT_LT(v.S_candidate_query.rotation.angularDistance(query.rotation), 0.005);
  }
}

// All points seem to be on a plane that the camera looks at askance.
View SeeFlat(const Pose& T_world_camera, std::int64_t id, bool calibrated) {
  View view = See(Pose(), id, calibrated, false);
  View::Set& set = view.members[0];
  std::mt19937 generator(static_cast<std::uint32_t>(100 + id));
  std::normal_distribution<double> noise(0, 0.5);
  View::Set flat;
  for (std::size_t i = 0; i < set.pixels.size(); ++i) {
    const Eigen::Vector3d ray(std::cos(0.5 * static_cast<double>(i * i)),
                              std::sin(1.7 * static_cast<double>(i * i)) * 0.7, 1);
    const Eigen::Vector3d point(3 * ray.x(), 3 * ray.y(), 6 + ray.x());
    const Eigen::Vector2d pixel = VerifiedCamera().Project(T_world_camera.Inverse() * point);
    if (!VerifiedCamera().Contains(pixel)) continue;
    const double dy = noise(generator), dx = noise(generator);
    flat.pixels.emplace_back(static_cast<float>(pixel.x() + dx), static_cast<float>(pixel.y() + dy));
    testing::AppendRows(Descriptor(static_cast<std::uint32_t>(900000 + i)), &flat.descriptors);
  }
  set = flat;
  return view;
}

TEST_P(Turned, AFlatSceneIsAcceptedByItsHomography) {
  const Verification v = GeometricVerifier({}, 1).Verify(SeeFlat(PoseAt(0.8, 0.2, 0.1), 9, GetParam()),
                                                         SeeFlat(Pose(), 1, GetParam()));
  ASSERT_TRUE(v.accepted) << v.reason;
  EXPECT_TRUE(v.homography);
  if (GetParam()) {
    EXPECT_GT(v.S_candidate_query.translation.norm(), 0.9);  // it moved
  }
}

TEST_P(Turned, ChanceIsNoHomography) {
  View chance = See(Pose(), 1, GetParam(), false);
  std::mt19937 generator(3);
  for (cv::Point2f& p : chance.members[0].pixels)
    p = {static_cast<float>(generator() % 640u), static_cast<float>(generator() % 480u)};
  const Verification v = GeometricVerifier({}, 1).Verify(See(Pose(), 9, GetParam(), false), chance);
  EXPECT_FALSE(v.accepted);
  EXPECT_FALSE(v.reason.empty());
  EXPECT_LT(v.inliers, 20);
}

// Two cameras, the right one's image beside the left one's; each moves in its own image.
View SeeTwo(const Pose& left, const Pose& right, std::int64_t id, bool swapped) {
  View view = See(left, id, false, false);
  View second = See(right, id, false, false);
  for (cv::Point2f& p : (swapped ? view : second).members[0].pixels) p.x += 640;
  testing::AppendRows(~second.members[0].descriptors.Unpacked(), &view.members[0].descriptors);
  view.members[0].pixels.insert(view.members[0].pixels.end(), second.members[0].pixels.begin(),
                                second.members[0].pixels.end());
  view.size = {1280, 480};
  view.cameras = {{0, 0, 640, 480}, {640, 0, 640, 480}};
  return view;
}

class OfTwoCameras : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(OtherWay, OfTwoCameras, ::testing::Bool());

TEST_P(OfTwoCameras, ImagesHaveAGeometryEachAndTheirEvidenceAddsUp) {
  View query = SeeTwo(PoseAt(0.8, 0.1), Pose(ExpSO3({0, 0, 0.3}), {0, 0.8, -0.3}), 9, GetParam());
  View candidate = SeeTwo(Pose(), Pose(), 1, false);
  const Verification each = GeometricVerifier({}, 1).Verify(query, candidate);
  query.cameras.clear();
  const Verification one = GeometricVerifier({}, 1).Verify(query, candidate);
  ASSERT_TRUE(each.accepted) << each.reason;
  EXPECT_GT(each.inliers, 0.85 * each.matches);
  EXPECT_GT(each.inliers, 1.2 * one.inliers);
  EXPECT_LT(each.log_nfa, one.log_nfa);
}

TEST(GeometricVerifier, OneCameraDoesNotSpeakForTheOtherUnlessThatSeesNothing) {
  const View query = SeeTwo(PoseAt(0.8, 0.1), Pose(ExpSO3({0, 0, 0.3}), {0, 0.8, -0.3}), 9, false);
  View candidate = SeeTwo(Pose(), Pose(), 1, false);
  View::Set& set = candidate.members[0];
  std::mt19937 generator(3);
  View blind = candidate;
  blind.members[0] = View::Set();
  cv::Mat descriptors = set.descriptors.Unpacked().clone();
  for (std::size_t i = 0; i < set.pixels.size(); ++i) {
    if (set.pixels[i].x < 640) {
      blind.members[0].pixels.push_back(set.pixels[i]);
      testing::AppendRows(descriptors.row(static_cast<int>(i)), &blind.members[0].descriptors);
    } else {  // the right one stands before another house
      cv::Mat row = descriptors.row(static_cast<int>(i));
      Descriptor(static_cast<std::uint32_t>(500000 + i)).copyTo(row);
    }
  }
  set.descriptors = descriptors;
  const Verification v = GeometricVerifier({}, 1).Verify(query, candidate);
  EXPECT_FALSE(v.accepted);
  EXPECT_NE(v.reason.find("one of the cameras"), std::string::npos) << v.reason;
  const Verification seen = GeometricVerifier({}, 1).Verify(query, blind);
  EXPECT_TRUE(seen.accepted) << seen.reason;
}

TEST(GeometricVerifier, IsDeterministicForASeedAndAnyNumberOfThreads) {
  const GeometricVerifier verifier({}, 5);
  const View query = See(PoseAt(0.5, 0.3), 9, false, false), candidate = See(Pose(), 1, false, false);
  const Verification a = verifier.Verify(query, candidate, 1), b = verifier.Verify(query, candidate, 2);
  EXPECT_EQ(a.inliers, b.inliers);
  EXPECT_EQ(a.log_nfa, b.log_nfa);
}

}  // namespace
}  // namespace tutti
