// Scores and counts of places by descriptors of whole images, against their equations.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "core/state_archive.h"
#include "loopclosure/features/whole_image.h"
#include "loopclosure/memory/dense_model.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr int kWidthOfRandom = 12;

cv::Mat RandomDirection(cv::RNG& random) {
  cv::Mat descriptor(1, kWidthOfRandom, CV_32F);
  random.fill(descriptor, cv::RNG::NORMAL, 0.3, 1.0);
  return NormalisedDescriptor(descriptor);
}

double MedianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

// The equations of the header, of places with or without a descriptor; the newest is the image.
class PlacesByHand {
 public:
  std::vector<std::optional<cv::Mat>> descriptors;  // by slot; absent: none, or not in memory

  double Cosine(int a, int b) const {
    if (!Has(a) || !Has(b)) return 0;
    return At(a)->dot(*At(b));
  }
  // The mean is that of the image that is `back` before the newest, over the places.
  double Mean(const std::vector<int>& places, int back) const {
    double sum = 0;
    int known = 0;
    for (const int place : places) {
      sum += Cosine(Newest() - back, place);
      known += Has(place) ? 1 : 0;
    }
    return known > 0 ? sum / known : 0;
  }
  std::vector<double> Sums(const std::vector<int>& places) const {
    std::vector<double> sums;
    for (int place = 0; place <= Newest(); ++place) {
      double sum = 0;
      for (int back = 0; back < 10; ++back) {
        if (Has(Newest() - back) && Has(place - back))
          sum += (Cosine(Newest() - back, place - back) - Mean(places, back)) / 10;
      }
      sums.push_back(sum);
    }
    return sums;
  }
  static std::vector<double> Contrast(const std::vector<double>& scores, const std::vector<int>& places) {
    std::vector<double> of_places, deviations, counts;
    for (const int place : places) of_places.push_back(scores[static_cast<std::size_t>(place)]);
    const double median = MedianOf(of_places);
    for (const double score : of_places) deviations.push_back(std::abs(score - median));
    const double sigma = std::max(0.002, 1.4826 * MedianOf(deviations));
    for (const double score : scores) {
      const double z = std::max(0.0, (score - median) / sigma - 2);
      counts.push_back(20 * z / (z + 4));
    }
    return counts;
  }
  double MeanCosine(int place) const {
    double sum = 0;
    int terms = 0;
    for (int back = 0; back < 10; ++back) {
      if (!Has(Newest() - back) || !Has(place - back)) continue;
      sum += Cosine(Newest() - back, place - back);
      ++terms;
    }
    return Has(place) && terms > 0 ? std::max(0.0, sum / terms) : 0;
  }

  int Newest() const { return static_cast<int>(descriptors.size()) - 1; }

 private:
  bool Has(int slot) const { return slot >= 0 && At(slot).has_value(); }
  const std::optional<cv::Mat>& At(int slot) const { return descriptors[static_cast<std::size_t>(slot)]; }
};

void ExpectAllNear(const std::vector<double>& values, const std::vector<double>& expected, const char* what) {
  ASSERT_EQ(values.size(), expected.size()) << what;
  for (std::size_t i = 0; i < values.size(); ++i)
    EXPECT_NEAR(values[i], expected[i], 1e-4) << what << ", " << i;
}

// Every seventh image has nothing to see; one place of the middle leaves, and one of the last images.
class DenseModelByHand : public ::testing::Test {
 protected:
  DenseModelByHand() {
    cv::RNG random(3);
    for (int slot = 0; slot < 40; ++slot) {
      const bool nothing = slot % 7 == 5;
      // The path of slots 10 to 19 comes again, a little changed.
      cv::Mat descriptor = RandomDirection(random);
      if (slot >= 30 && by_hand_.descriptors[static_cast<std::size_t>(slot - 20)])
        descriptor = NormalisedDescriptor(*by_hand_.descriptors[static_cast<std::size_t>(slot - 20)] +
                                          0.5 * descriptor);
      if (nothing) descriptor = cv::Mat();
      model_.Add(descriptor);
      by_hand_.descriptors.push_back(nothing ? std::nullopt : std::optional<cv::Mat>(descriptor));
      if (slot < 29) places_.push_back(slot);  // an odd number: one is in the middle
    }
  }

  void Compare(const char* what) {
    ExpectAllNear(model_.Counts(places_), PlacesByHand::Contrast(by_hand_.Sums(places_), places_), what);
    std::vector<double> means;
    for (int slot = 0; slot <= by_hand_.Newest(); ++slot) means.push_back(by_hand_.MeanCosine(slot));
    ExpectAllNear(model_.Scores(), means, what);
  }

  DenseModel model_;
  PlacesByHand by_hand_;
  std::vector<int> places_;
};

TEST_F(DenseModelByHand, CountsAndScoresFollowTheEquations) {
  Compare("all");
  const std::vector<double> counts = model_.Counts(places_);
  EXPECT_EQ(std::max_element(counts.begin(), counts.begin() + 30) - counts.begin(), 19);
}

TEST_F(DenseModelByHand, PlacesThatLeaveAndReturnAreMissedMeanwhile) {
  for (const int slot : {13, 36}) {
    const cv::Mat descriptor = model_.descriptor(slot);
    model_.Remove(slot);
    EXPECT_FALSE(model_.Has(slot));
    by_hand_.descriptors[static_cast<std::size_t>(slot)].reset();
    Compare("left");
    model_.Restore(slot, descriptor);
    by_hand_.descriptors[static_cast<std::size_t>(slot)] = descriptor;
    Compare("returned");
  }
}

TEST_F(DenseModelByHand, AMergedImageCountsOnceAndIsNoPartOfThePathAfterIt) {
  cv::RNG random(4);
  const std::vector<double> before = model_.Counts(places_);
  model_.Drop(39);
  const std::vector<double> after = model_.Counts(places_);
  for (const int place : places_)
    EXPECT_EQ(after[static_cast<std::size_t>(place)], before[static_cast<std::size_t>(place)])
        << "its own image";
  by_hand_.descriptors.pop_back();
  by_hand_.descriptors.emplace_back(RandomDirection(random));
  model_.Add(*by_hand_.descriptors.back());
  std::vector<double> counts = model_.Counts(places_);
  counts.erase(counts.begin() + 39);
  ExpectAllNear(counts, PlacesByHand::Contrast(by_hand_.Sums(places_), places_),
                "path without the merged one");
}

TEST_F(DenseModelByHand, AnImageByItselfIsComparedAlone) {
  cv::RNG random(5);
  const cv::Mat image = RandomDirection(random);
  std::vector<double> cosines, above;
  for (int slot = 0; slot < 40; ++slot) {
    const cv::Mat& other = model_.descriptor(slot);
    cosines.push_back(other.empty() ? 0 : image.dot(other));
    above.push_back(std::max(0.0, cosines.back()));
  }
  ExpectAllNear(model_.CountsOf(image, places_), PlacesByHand::Contrast(cosines, places_), "counts");
  ExpectAllNear(model_.ScoresOf(image), above, "scores");
}

TEST_F(DenseModelByHand, NothingStandsOutAmongFewerThanTwelve) {
  for (const std::size_t few : {11u, 12u}) {
    places_.resize(few);
    const std::vector<double> counts = model_.Counts(places_);
    EXPECT_EQ(*std::max_element(counts.begin(), counts.end()) > 0, few == 12);
  }
}

TEST_F(DenseModelByHand, ALoadedOneSaysTheSame) {
  model_.Remove(13);
  DenseModel loaded;
  internal::ReadStateBytes(internal::StateBytes(model_), "memory", loaded);
  EXPECT_EQ(loaded.Counts(places_), model_.Counts(places_));
  EXPECT_EQ(loaded.Scores(), model_.Scores());
  cv::RNG random(6);
  const cv::Mat next = RandomDirection(random);
  loaded.Add(next);
  model_.Add(next);
  EXPECT_EQ(loaded.Counts(places_), model_.Counts(places_));
  EXPECT_THROW(loaded.Add(cv::Mat::eye(1, kWidthOfRandom + 1, CV_32F)), InputError);
}

}  // namespace
}  // namespace tutti
