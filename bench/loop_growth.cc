// How the loop detector's time and memory grow with the number of locations.
//
//   loop_growth [LOCATIONS [WM_LIMIT [FEATURES]]]      (20000, 0: no limit, 400)
//
// The images are synthetic signatures: a walk past landmarks whose descriptors are drawn at random, of which
// every location sees the last ones of the one before and as many new ones; after every 1,000 locations it
// returns to an earlier stretch for 100. Three members as in the ensemble: 64 and 128 floats, 32 bytes.
// Extraction and verification are not part of it. Prints the median of each stage over the last 1,000
// locations.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "tutti/loopclosure/detector.h"

namespace {

constexpr int kStretch = 1000;  // locations between returns
constexpr int kReturn = 100;    // locations of a return

// Spreads the bits of a number (splitmix64): neighbouring landmarks have nothing in common.
std::uint64_t Mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

// Descriptor of a landmark for a member, with noise of its own at each sight.
class Landmarks {
 public:
  explicit Landmarks(int features) : features_(features) {}

  // Features of the place with this number: landmarks place * n/2 .. place * n/2 + n.
  tutti::Features See(int member, std::int64_t place, std::uint64_t sight) const {
    tutti::Features result;
    const int width = member == 0 ? 64 : member == 1 ? 128 : 32;
    result.descriptors.create(features_, width, member == 2 ? CV_8U : CV_32F);
    for (int i = 0; i < features_; ++i) {
      const std::uint64_t landmark = static_cast<std::uint64_t>(place * (features_ / 2) + i);
      std::minstd_rand generator(
          static_cast<std::uint32_t>(Mixed(3 * landmark + static_cast<unsigned>(member))));
      std::minstd_rand noise(static_cast<std::uint32_t>(sight * 977 + static_cast<std::uint64_t>(i) + 1));
      result.keypoints.emplace_back(static_cast<float>(i % 20) * 30.0f, static_cast<float>(i / 20) * 20.0f,
                                    10.0f);
      if (member == 2) {
        std::uint8_t* row = result.descriptors.ptr(i);
        for (int c = 0; c < width; ++c) row[c] = static_cast<std::uint8_t>(generator() >> 8);
        for (int flip = 0; flip < 12; ++flip)
          row[noise() % 32u] ^= static_cast<std::uint8_t>(1u << (noise() % 8u));
      } else {
        float* row = result.descriptors.ptr<float>(i);
        for (int c = 0; c < width; ++c) {
          row[c] = static_cast<float>(generator() >> 8 & 255u) + static_cast<float>(noise() % 21u) - 10.0f;
        }
      }
    }
    return result;
  }

 private:
  int features_;
};

double ResidentMb() {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    double kb = 0;
    if (word == "VmRSS:" && status >> kb) return kb / 1024.0;
  }
  return 0;
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

int Number(int argc, char** argv, int index, int otherwise) {
  return argc > index ? std::max(0, std::atoi(argv[index])) : otherwise;
}

}  // namespace

int main(int argc, char** argv) {
  const int locations = Number(argc, argv, 1, 20000);
  const int limit = Number(argc, argv, 2, 0);
  const int features = std::max(2, Number(argc, argv, 3, 400));
  tutti::LoopDetectorOptions options;
  options.external_members = options.members = {"floats64", "floats128", "bytes32"};
  options.verification.enabled = false;
  options.loop_threshold = 1.0;  // nothing is accepted: the graph stays a chain
  options.wm_limit = limit;
  tutti::LoopDetector detector(options);
  const Landmarks landmarks(features);

  std::printf("%d locations, %s, %d features for each of 3 members\n", locations,
              limit > 0 ? ("working memory of " + std::to_string(limit)).c_str() : "no limit", features);
  std::printf("%9s %7s %9s %9s %10s %8s %8s %8s %9s %8s %10s\n", "locations", "in WM", "words", "quantise",
              "likelihood", "filter", "memory", "total ms", "p99 ms", "RSS MB", "KB each");
  std::map<std::string, std::vector<double>> times;
  const double before = ResidentMb();
  std::int64_t place = 0;
  for (int i = 0; i < locations; ++i) {
    const int phase = i % (kStretch + kReturn);
    const std::int64_t seen =
        phase < kStretch ? place++ : std::max<std::int64_t>(0, place - 800) + (phase - kStretch);
    tutti::LoopQuery query;
    query.id = i;
    for (int k = 0; k < 3; ++k) {
      query.member_features[options.members[static_cast<std::size_t>(k)]] =
          landmarks.See(k, seen, static_cast<std::uint64_t>(i));
    }
    const tutti::LoopResult result = detector.Detect(query);
    times["quantise"].push_back(result.quantise_ms);
    times["likelihood"].push_back(result.likelihood_ms);
    times["filter"].push_back(result.filter_ms);
    times["memory"].push_back(result.memory_ms);
    times["total"].push_back(result.quantise_ms + result.likelihood_ms + result.filter_ms + result.memory_ms);
    if ((i + 1) % 1000 != 0) continue;
    std::vector<double> total = times["total"];
    std::sort(total.begin(), total.end());
    long words = 0;
    for (const tutti::MemberOpinion& member : result.members) words += member.words;
    const double mb = ResidentMb();
    std::printf("%9d %7zu %9ld %9.2f %10.2f %8.2f %8.2f %8.2f %9.2f %8.0f %10.1f\n", i + 1,
                detector.NumLocations(), words, Median(times["quantise"]), Median(times["likelihood"]),
                Median(times["filter"]), Median(times["memory"]), Median(total),
                total[total.size() * 99 / 100], mb, (mb - before) * 1024.0 / (i + 1));
    std::fflush(stdout);
    times.clear();
  }
  return 0;
}
