// SIFT's points: against OpenCV, and as the paper defines them.
#include "loopclosure/features/sift.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <set>
#include <vector>

#include "tests/loopclosure/features/angles.h"

namespace tutti::internal {
namespace {

using testing::AnglesApart;

// Structure of every size and no symmetry, which would leave the orientation to rounding.
cv::Mat Clouds() {
  cv::Mat sum = cv::Mat::zeros(243, 321, CV_32F);
  std::mt19937 generator(5);
  for (const double size : {1.0, 2.0, 4.0, 8.0, 16.0}) {
    cv::Mat noise(sum.size(), CV_32F);
    for (int y = 0; y < noise.rows; ++y) {
      for (int x = 0; x < noise.cols; ++x) noise.at<float>(y, x) = static_cast<float>(generator() % 1000);
    }
    cv::GaussianBlur(noise, noise, cv::Size(0, 0), size);
    sum += size * noise;
  }
  cv::normalize(sum, sum, 0, 255, cv::NORM_MINMAX, CV_8U);
  return sum;
}

// OpenCV's first octave is of the image enlarged twice: ours gets the same, to start from the same values.
class SiftOfOpenCv : public ::testing::Test {
 protected:
  SiftOfOpenCv() {
    const cv::Mat image = Clouds();
    // OpenCV rounds half of the contrast down to whole grey levels: here it is one.
    const double contrast = 1.0001 * 2 * 3 / 255.0;
    cv::SIFT::create(0, 3, contrast)
        ->detectAndCompute(image, cv::noArray(), theirs_.keypoints, theirs_.descriptors);
    cv::Mat large;
    image.convertTo(large, CV_32F);
    cv::resize(large, large, cv::Size(), 2, 2, cv::INTER_LINEAR);
    SiftOptions options;
    options.features = 100000;
    options.contrast = options.least_contrast = contrast;
    SiftScratch scratch;
    ours_ = ExtractSift(large, 1.0, options, scratch);
    for (cv::KeyPoint& keypoint : ours_.keypoints) {
      keypoint.pt *= 0.5f;
      keypoint.size *= 0.5f;
    }
  }

  static bool IsSamePlace(const cv::KeyPoint& ours, const cv::KeyPoint& theirs) {
    return cv::norm(ours.pt - theirs.pt) < 0.03 * theirs.size &&
           std::abs(ours.size / theirs.size - 1) < 0.03 &&
           std::abs(ours.response / (255 * theirs.response) - 1) < 0.03;
  }

  // Position among OpenCV's points of the one that is the same, -1 if there is none.
  int InTheirs(const cv::KeyPoint& ours) const {
    const auto same =
        std::find_if(theirs_.keypoints.begin(), theirs_.keypoints.end(), [&](const cv::KeyPoint& theirs) {
          return IsSamePlace(ours, theirs) && AnglesApart(ours.angle, theirs.angle) < 3;
        });
    return same == theirs_.keypoints.end() ? -1 : static_cast<int>(same - theirs_.keypoints.begin());
  }

  Features ours_, theirs_;
};

// Share of `some` that `found` finds.
double ShareFound(const std::vector<cv::KeyPoint>& some,
                  const std::function<bool(const cv::KeyPoint&)>& found) {
  return static_cast<double>(std::count_if(some.begin(), some.end(), found)) /
         static_cast<double>(some.size());
}

// But for a few at a bound: OpenCV's kernels reach over 4 standard deviations, ours over 3.
TEST_F(SiftOfOpenCv, FindsTheSamePlacesScalesAndContrasts) {
  const auto& ours = ours_.keypoints;
  const auto& theirs = theirs_.keypoints;
  ASSERT_GT(theirs.size(), 2500u);
  const auto in_theirs = [&](const cv::KeyPoint& a) {
    return std::any_of(theirs.begin(), theirs.end(),
                       [&](const cv::KeyPoint& b) { return IsSamePlace(a, b); });
  };
  const auto in_ours = [&](const cv::KeyPoint& b) {
    return std::any_of(ours.begin(), ours.end(), [&](const cv::KeyPoint& a) { return IsSamePlace(a, b); });
  };
  EXPECT_GT(ShareFound(ours, in_theirs), 0.98);
  EXPECT_GT(ShareFound(theirs, in_ours), 0.975);
}

TEST_F(SiftOfOpenCv, FindsTheSameOrientations) {
  std::set<int> found;
  for (const cv::KeyPoint& point : ours_.keypoints) found.insert(InTheirs(point));
  found.erase(-1);
  const auto same = static_cast<double>(found.size());
  EXPECT_GT(same / static_cast<double>(ours_.keypoints.size()), 0.975);
  EXPECT_GT(same / static_cast<double>(theirs_.keypoints.size()), 0.972);
}

// Ours samples each point's surroundings at as many places for all scales, and not around the nearest whole
// pixel.
TEST_F(SiftOfOpenCv, DescribesThePointsAlmostAlike) {
  double sum = 0, least = 1;
  int points = 0;
  for (std::size_t i = 0; i < ours_.keypoints.size(); ++i) {
    const int k = InTheirs(ours_.keypoints[i]);
    if (k < 0) continue;
    const cv::Mat a = ours_.descriptors.row(static_cast<int>(i)), b = theirs_.descriptors.row(k);
    const double cosine = a.dot(b) / (cv::norm(a) * cv::norm(b));
    sum += cosine;
    least = std::min(least, cosine);
    ++points;
  }
  EXPECT_GT(sum / points, 0.995);
  EXPECT_GT(least, 0.97);
}

// What the definition finds in a pyramid: a point of an octave, in its own pixels, and of a layer.
struct ExtremePoint {
  int octave;
  double x, y, layer, contrast;
};

// Differences of neighbouring images of an octave.
class Differences {
 public:
  explicit Differences(const SiftScratch::Octave& octave) {
    for (std::size_t i = 0; i + 1 < octave.size(); ++i) {
      cv::Mat difference = octave[i + 1] - octave[i];
      difference.convertTo(layers_[i], CV_64F);
    }
  }
  int rows() const { return layers_[0].rows; }
  int cols() const { return layers_[0].cols; }
  double At(const cv::Vec3i& p) const {
    return layers_[static_cast<std::size_t>(p[2])].at<double>(p[1], p[0]);
  }

  // An extremum is the largest or the smallest of its 27 in place and layer.
  bool IsExtreme(const cv::Vec3i& p) const {
    for (int k = 0; k < 27; ++k) {
      const double other = At(p + cv::Vec3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
      if (At(p) > 0 ? other > At(p) : other < At(p)) return false;
    }
    return true;
  }
  cv::Vec3d Slope(const cv::Vec3i& p) const {
    cv::Vec3d slope;
    for (int a = 0; a < 3; ++a) slope[a] = (At(p + Step(a)) - At(p - Step(a))) / 2;
    return slope;
  }
  cv::Matx33d Curvature(const cv::Vec3i& p) const {
    cv::Matx33d curvature;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        curvature(a, b) = a == b ? At(p + Step(a)) + At(p - Step(a)) - 2 * At(p)
                                 : (At(p + Step(a) + Step(b)) + At(p - Step(a) - Step(b)) -
                                    At(p + Step(a) - Step(b)) - At(p - Step(a) + Step(b))) /
                                       4;
      }
    }
    return curvature;
  }
  bool Holds(const cv::Vec3i& p) const {
    return p[0] >= 5 && p[0] < cols() - 5 && p[1] >= 5 && p[1] < rows() - 5 && p[2] >= 1 && p[2] <= 3;
  }

 private:
  static cv::Vec3i Step(int axis) { return {axis == 0 ? 1 : 0, axis == 1 ? 1 : 0, axis == 2 ? 1 : 0}; }
  std::array<cv::Mat, SiftScratch::kBlurs - 1> layers_;
};

// The top of the parabola around a place, after at most five steps towards it: not where it is faint, or
// where it is an edge, with principal curvatures of more than one to ten.
std::optional<ExtremePoint> Top(const Differences& differences, cv::Vec3i p, double least) {
  for (int step = 0; step < 5 && differences.Holds(p); ++step) {
    const cv::Matx33d curvature = differences.Curvature(p);
    const cv::Vec3d slope = differences.Slope(p), offset = -(curvature.inv() * slope);
    if (cv::norm(offset, cv::NORM_INF) < 0.5) {
      const double contrast = std::abs(differences.At(p) + 0.5 * slope.dot(offset));
      const double trace = curvature(0, 0) + curvature(1, 1),
                   determinant = curvature(0, 0) * curvature(1, 1) - curvature(0, 1) * curvature(0, 1);
      if (contrast < least || determinant <= 0 || trace * trace / determinant >= 12.1) return {};
      return ExtremePoint{0, p[0] + offset[0], p[1] + offset[1], p[2] + offset[2], contrast};
    }
    p += cv::Vec3i(cvRound(offset[0]), cvRound(offset[1]), cvRound(offset[2]));
  }
  return {};
}

std::vector<ExtremePoint> PointsByDefinition(const SiftScratch& scratch, double least) {
  std::vector<ExtremePoint> points;
  for (std::size_t o = 0; o < scratch.pyramid.size(); ++o) {
    const Differences differences(scratch.pyramid[o]);
    for (int i = 0; i < 3 * differences.rows() * differences.cols(); ++i) {
      const cv::Vec3i p(i / 3 % differences.cols(), i / 3 / differences.cols(), 1 + i % 3);
      if (!differences.Holds(p) || std::abs(differences.At(p)) < 0.5 * least || !differences.IsExtreme(p))
        continue;
      std::optional<ExtremePoint> point = Top(differences, p, least);
      if (!point) continue;
      point->octave = static_cast<int>(o);
      points.push_back(*point);
    }
  }
  return points;
}

bool IsAt(const ExtremePoint& point, const cv::KeyPoint& keypoint) {
  const double zoom = std::pow(2, point.octave), size = 2 * 1.6 * std::pow(2, point.layer / 3) * zoom;
  return keypoint.octave == point.octave && std::abs(keypoint.pt.x - zoom * point.x) < 0.01 * size &&
         std::abs(keypoint.pt.y - zoom * point.y) < 0.01 * size &&
         std::abs(keypoint.size / size - 1) < 0.01 && std::abs(keypoint.response / point.contrast - 1) < 0.01;
}

// But for what is on a bound of the definition, up to rounding.
TEST(Sift, PointsAreTheTopsOfAllExtremesInPlaceAndScale) {
  SiftOptions options;
  options.features = 100000;
  options.contrast = options.least_contrast = 0.01;
  SiftScratch scratch;
  const std::vector<cv::KeyPoint> ours = ExtractSift(Clouds(), 0.5, options, scratch).keypoints;
  const std::vector<ExtremePoint> expected = PointsByDefinition(scratch, 0.01 * 255 / 3);
  ASSERT_GT(expected.size(), 300u);
  const auto in_ours = [&](const ExtremePoint& point) {
    return std::any_of(ours.begin(), ours.end(), [&](const cv::KeyPoint& k) { return IsAt(point, k); });
  };
  const auto in_expected = [&](const cv::KeyPoint& k) {
    return std::any_of(expected.begin(), expected.end(),
                       [&](const ExtremePoint& point) { return IsAt(point, k); });
  };
  EXPECT_LE(std::count_if(expected.begin(), expected.end(), std::not_fn(in_ours)), 2);
  EXPECT_LE(std::count_if(ours.begin(), ours.end(), std::not_fn(in_expected)), 2);
}

// Each image of an octave has the blur that its place says, whatever it was made from.
TEST(Sift, ImagesOfAnOctaveDoubleTheirBlurInThreeSteps) {
  cv::Mat dot = cv::Mat::zeros(128, 128, CV_8U);
  dot.at<std::uint8_t>(64, 64) = 255;
  SiftScratch scratch;
  ExtractSift(dot, 0.5, SiftOptions(), scratch);
  ASSERT_EQ(scratch.pyramid.size(), 5u) << "down to eight pixels";
  for (std::size_t o = 0; o < 3; ++o) {
    const double zoom = std::pow(2, o);
    for (std::size_t i = 0; i < 6; ++i) {
      const cv::Mat& image = scratch.pyramid[o][i];
      EXPECT_EQ(image.cols, std::lround(128 / zoom));
      const int middle = static_cast<int>(64 / zoom);
      double sum = 0, squares = 0;
      for (int x = 0; x < image.cols; ++x) {
        const double value = cv::sum(image.col(x))[0];
        sum += value;
        squares += value * (x - middle) * (x - middle);
      }
      // A dot is no picture of a scene, which would have the half pixel of blur from the start.
      const double sigma = 1.6 * std::pow(2, static_cast<double>(i) / 3);
      EXPECT_NEAR(std::sqrt(squares / sum) / std::sqrt(sigma * sigma - 0.25 / zoom / zoom), 1, 0.03)
          << "octave " << o << ", image " << i;
    }
  }
}

// Where fewer than wanted reach the contrast, the next ones by contrast fill up.
TEST(Sift, FaintPointsAreTakenWhereThereAreTooFewOthers) {
  const cv::Mat image = Clouds();
  SiftOptions options;
  SiftScratch scratch;
  const auto contrasts = [&](int features) {
    options.features = features;
    const Features found = ExtractSift(image, 0.5, options, scratch);
    EXPECT_EQ(found.descriptors.rows, static_cast<int>(found.keypoints.size()));
    std::vector<float> sorted;
    for (const cv::KeyPoint& keypoint : found.keypoints) sorted.push_back(keypoint.response);
    std::sort(sorted.begin(), sorted.end());
    return sorted;
  };
  options.contrast = options.least_contrast = 0.003;
  const std::vector<float> all = contrasts(100000);
  const int number = static_cast<int>(all.size());
  const float median = all[all.size() / 2];
  options.contrast = static_cast<double>(median) * 3 / 255;
  const std::vector<float> few = contrasts(number / 4), many = contrasts(3 * number / 4);
  EXPECT_EQ(static_cast<int>(few.size()), number / 4);
  EXPECT_GE(few.front(), 0.999f * median);
  EXPECT_EQ(static_cast<int>(many.size()), 3 * number / 4);
  EXPECT_LT(many.front(), 0.999f * median);
  options.least_contrast = options.contrast;
  EXPECT_GE(contrasts(number).front(), 0.999f * median);
}

}  // namespace
}  // namespace tutti::internal
