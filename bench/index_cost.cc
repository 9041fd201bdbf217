// What indices of words cost and find, by the number of places: bench/index_study makes a document of it.
//
// Words are descriptors of landmarks, each a blend of two descriptors of real images; every place brings 170
// new ones. An image that searches has 400 descriptors: 240 are sights, with noise, of landmarks that have a
// word, the others of landmarks that have none. Prints CSV; times are processor time of one thread, per
// image: adding over the last half of the places (building anew included), searching at that size. The ways
// take turns.
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <sstream>

#include "bench/index_ways.h"
#include "data/synthetic/synthetic_random.h"
#include "loopclosure/features/distances.h"
#include "tutti/core/error.h"
#include "tutti/core/span_recorder.h"
#include "tutti/loopclosure/detector_options.h"
#include "tutti/loopclosure/features.h"

namespace tutti {
namespace {

constexpr int kWordsPerPlace = 170;  // new ones, as in bench/loop_growth
constexpr int kFeatures = 400;       // of an image
constexpr int kSeen = 240;           // of them, of landmarks that have a word
constexpr int kTogether = 50;        // images that one way adds before it is another's turn

// An index of the library, as the vocabulary makes it.
class LibraryWay : public IndexWay {
 public:
  explicit LibraryWay(std::unique_ptr<DescriptorIndex> index) : index_(std::move(index)) {}
  void Add(int first, const cv::Mat& rows) override {
    std::vector<int> words(static_cast<std::size_t>(rows.rows));
    std::iota(words.begin(), words.end(), first);
    index_->Add(words, rows);
  }
  std::vector<TwoNearest> Search(const cv::Mat& descriptors) const override {
    return index_->Search(descriptors);
  }

 private:
  std::unique_ptr<DescriptorIndex> index_;
};

std::unique_ptr<IndexWay> MakeWay(const std::string& text, const cv::Mat& sample) {
  const VocabularyOptions options;
  if (text == "default") {
    return std::make_unique<LibraryWay>(
        sample.type() == CV_8U ? MakeHammingIndex(sample.cols, options.hash_tables, 1)
                               : MakeKdForestIndex(sample.cols, options.trees, options.checks, 1));
  }
  if (text == "flann") {
    return std::make_unique<LibraryWay>(MakeFlannIndex(sample.cols, options.trees, options.checks, 1));
  }
  std::istringstream parts(text);
  WaySpec spec;
  std::getline(parts, spec.name, '/');
  for (std::string number; std::getline(parts, number, '/');) {
    spec.numbers.push_back(std::strtof(number.c_str(), nullptr));
  }
  std::unique_ptr<IndexWay> way = MakeFlannWay(spec);
  if (!way) way = MakeLightWay(spec);
  if (!way) throw InputError("no way is called '" + text + "'; see index_ways.h");
  return way;
}

double HeapMb() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1048576.0;
}

// Landmarks whose descriptors are blends of two real ones, and sights of them.
class Landmarks {
 public:
  explicit Landmarks(cv::Mat real) : real_(std::move(real)) {}

  void Write(std::uint64_t landmark, void* row) const {
    std::minstd_rand random(static_cast<std::uint32_t>(synthetic::Random(landmark).Bits()));
    const int a = Pick(random);
    const int b = Pick(random);
    if (real_.type() == CV_32F) {
      const float share = 0.5f + 0.5f * Unit(random);
      Blend(a, b, share, static_cast<float*>(row));
      return;
    }
    std::uint8_t* out = static_cast<std::uint8_t*>(row);
    for (int i = 0; i < real_.cols; ++i)
      out[i] = Unit(random) < 0.7f ? real_.at<uchar>(a, i) : real_.at<uchar>(b, i);
  }

  void WriteSight(std::uint64_t landmark, std::uint64_t sight, void* row) const {
    Write(landmark, row);
    std::minstd_rand random(static_cast<std::uint32_t>(synthetic::Random(sight).Bits()));
    if (real_.type() == CV_32F) {
      const float* other = real_.ptr<float>(Pick(random));
      float* out = static_cast<float*>(row);
      for (int i = 0; i < real_.cols; ++i) out[i] = Rounded(0.8f * out[i] + 0.2f * other[i]);
      return;
    }
    std::uint8_t* out = static_cast<std::uint8_t*>(row);
    for (int flip = 0; flip < 20; ++flip) {
      out[random() % static_cast<unsigned>(real_.cols)] ^=
          static_cast<std::uint8_t>(1u << (random() >> 8 & 7u));
    }
  }

 private:
  static float Unit(std::minstd_rand& random) { return static_cast<float>(random()) / 2147483648.0f; }
  int Pick(std::minstd_rand& random) const {
    return static_cast<int>(synthetic::Random(random()).Bits() % static_cast<std::uint64_t>(real_.rows));
  }
  // SIFT's values are whole numbers, SURF's are below 1.
  float Rounded(float value) const { return real_.cols == 128 ? std::round(value) : value; }
  void Blend(int a, int b, float share, float* out) const {
    const float* x = real_.ptr<float>(a);
    const float* y = real_.ptr<float>(b);
    for (int i = 0; i < real_.cols; ++i) out[i] = Rounded(share * x[i] + (1 - share) * y[i]);
  }
  cv::Mat real_;
};

cv::Mat RealDescriptors(const std::string& kind, const std::vector<std::string>& files) {
  const FeatureExtractor extractor(kind, ExtractionOptions());
  cv::Mat all;
  for (const std::string& file : files) {
    const cv::Mat image = ToGrey8(cv::imread(file, cv::IMREAD_UNCHANGED));
    if (!image.empty()) all.push_back(extractor.Extract(image).descriptors);
  }
  return all;
}

std::vector<TwoNearest> Exact(const cv::Mat& queries, const cv::Mat& words) {
  std::vector<TwoNearest> nearest(static_cast<std::size_t>(queries.rows));
  constexpr int kBlock = 64;
  float distances[kBlock];
  for (int begin = 0; begin < words.rows; begin += kBlock) {
    const int count = std::min(kBlock, words.rows - begin);
    for (int i = 0; i < queries.rows; ++i) {
      if (words.type() == CV_32F) {
        internal::SquaredDistances(queries.ptr<float>(i), words.ptr<float>(begin), count, words.cols,
                                   words.step1(), distances);
      } else {
        internal::HammingDistances(queries.ptr(i), words.ptr(begin), count, words.cols, words.step[0],
                                   distances);
      }
      TwoNearest& best = nearest[static_cast<std::size_t>(i)];
      for (int k = 0; k < count; ++k) {
        if (distances[k] < best.second_distance) best.Offer(begin + k, distances[k]);
      }
    }
  }
  if (words.type() != CV_32F) return nearest;
  for (TwoNearest& best : nearest) {
    best.first_distance = std::sqrt(best.first_distance);
    best.second_distance = std::sqrt(best.second_distance);
  }
  return nearest;
}

// The word that a vocabulary would give, -1: a new one.
int Word(const TwoNearest& nearest) {
  const VocabularyOptions options;
  return nearest.second < 0 ||
                 nearest.first_distance > static_cast<float>(options.nndr) * nearest.second_distance
             ? -1
             : nearest.first;
}

struct Cost {
  std::string name;
  std::unique_ptr<IndexWay> way;
  double add_ms = 0;    // since the last size
  double worst_ms = 0;  // of one image, since the last size
  double memory_mb = 0;
  double search_ms = 0;
  std::vector<TwoNearest> found;
};

class Study {
 public:
  Study(std::string kind, Landmarks landmarks, const cv::Mat& sample, int places, int images, int exact)
      : kind_(std::move(kind)),
        landmarks_(std::move(landmarks)),
        words_(places * kWordsPerPlace, sample.cols, sample.type()),
        images_(images),
        exact_(exact) {}

  void Take(const std::string& name, std::unique_ptr<IndexWay> way) {
    costs_.emplace_back();
    costs_.back().name = name;
    costs_.back().way = std::move(way);
  }

  void GrowTo(int places) {
    for (Cost& cost : costs_) cost.add_ms = cost.worst_ms = 0;
    counted_from_ = std::max(places_, places / 2);
    while (places_ < places) {
      const int end =
          std::min({places, places_ + kTogether, counted_from_ > places_ ? counted_from_ : places});
      for (int row = places_ * kWordsPerPlace; row < end * kWordsPerPlace; ++row) {
        landmarks_.Write(static_cast<std::uint64_t>(row), words_.ptr(row));
      }
      for (Cost& cost : costs_) AddImages(end, cost);
      places_ = end;
    }
  }

  void Report() {
    const int words = places_ * kWordsPerPlace;
    cv::Mat queries(images_ * kFeatures, words_.cols, words_.type());
    for (int i = 0; i < queries.rows; ++i) {
      const std::uint64_t chance = synthetic::Random(static_cast<std::uint64_t>(i) + 7919).Bits();
      const bool seen = i % kFeatures < kSeen;
      const std::uint64_t landmark =
          seen ? chance % static_cast<std::uint64_t>(words) : (1ull << 40) + chance % (1ull << 30);
      landmarks_.WriteSight(landmark, static_cast<std::uint64_t>(i) + (1ull << 50), queries.ptr(i));
    }
    for (Cost& cost : costs_) cost.search_ms = 0, cost.found.clear();
    for (int image = 0; image < images_; ++image) {
      for (Cost& cost : costs_) {
        const double start = ThreadCpuMilliseconds();
        std::vector<TwoNearest> found =
            cost.way->Search(queries.rowRange(image * kFeatures, (image + 1) * kFeatures));
        cost.search_ms += ThreadCpuMilliseconds() - start;
        cost.found.insert(cost.found.end(), found.begin(), found.end());
      }
    }
    const std::vector<TwoNearest> exact =
        Exact(queries.rowRange(0, exact_ * kFeatures), words_.rowRange(0, words));
    for (const Cost& cost : costs_) Print(cost, exact);
  }

 private:
  void AddImages(int end, Cost& cost) {
    const double memory = HeapMb();
    for (int place = places_; place < end; ++place) {
      const int first = place * kWordsPerPlace;
      const double start = ThreadCpuMilliseconds();
      cost.way->Add(first, words_.rowRange(first, first + kWordsPerPlace));
      const double ms = ThreadCpuMilliseconds() - start;
      cost.worst_ms = std::max(cost.worst_ms, ms);
      if (place >= counted_from_) cost.add_ms += ms;
    }
    cost.memory_mb += HeapMb() - memory;
  }

  void Print(const Cost& cost, const std::vector<TwoNearest>& exact) const {
    int nearest = 0;
    int seen_nearest = 0;
    int seen = 0;
    int same = 0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
      // Another word at the same distance is as near; sums in another order differ in the last digits.
      const bool found = cost.found[i].first_distance <= exact[i].first_distance * (1 + 1e-5f);
      nearest += found ? 1 : 0;
      same += Word(cost.found[i]) == Word(exact[i]) ? 1 : 0;
      if (Word(exact[i]) < 0) continue;
      ++seen;
      seen_nearest += found ? 1 : 0;
    }
    const double add = cost.add_ms / (places_ - counted_from_);
    const double search = cost.search_ms / images_;
    const double n = static_cast<double>(exact.size());
    std::printf("%s,%d,%d,%s,%.3f,%.3f,%.3f,%.1f,%.2f,%.2f,%.2f,%.1f\n", kind_.c_str(), places_,
                places_ * kWordsPerPlace, cost.name.c_str(), search, add, search + add, cost.worst_ms,
                100 * nearest / n, 100.0 * seen_nearest / std::max(1, seen), 100 * same / n, cost.memory_mb);
    std::fflush(stdout);
  }

  std::string kind_;
  Landmarks landmarks_;
  cv::Mat words_;
  int images_;
  int exact_;
  int places_ = 0;
  int counted_from_ = 0;
  std::vector<Cost> costs_;
};

int Run(int argc, char** argv) {
  CLI::App app("What indices of words cost and find, by the number of places");
  std::string kind = "sift";
  std::vector<int> sizes = {100, 1000, 5000};
  std::vector<std::string> ways = {"default"};
  std::vector<std::string> files;
  int images = 20;
  int exact = 10;
  app.add_option("--kind", kind, "surf, sift or orb");
  app.add_option("--places", sizes, "sizes, ascending")->delimiter(',')->allow_extra_args(false);
  app.add_option("--ways", ways, "default, flann (the library's), or as in bench/index_ways.h")
      ->delimiter(',');
  app.add_option("--images", images, "images searched at each size");
  app.add_option("--exact", exact, "of them, compared with exact search");
  app.add_option("image", files, "where real descriptors come from")->required();
  CLI11_PARSE(app, argc, argv);

  const cv::Mat real = RealDescriptors(kind, files);
  if (real.empty()) throw InputError("no features in these images");
  Study study(kind, Landmarks(real), real, sizes.back(), images, std::min(images, exact));
  for (const std::string& way : ways) study.Take(way, MakeWay(way, real));
  std::printf(
      "kind,places,words,way,search_ms,add_ms,total_ms,worst_add_ms,nearest,nearest_of_words,same_word,mb\n");
  for (const int places : sizes) {
    study.GrowTo(places);
    study.Report();
  }
  return 0;
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) {
  try {
    return tutti::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "index_cost: %s\n", error.what());
    return 1;
  }
}
