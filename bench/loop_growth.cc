// How the loop detector's time and memory grow with the number of locations.
//
//   loop_growth [LOCATIONS [WM_LIMIT [FEATURES [FOLDER]]]]      (20000, 0: no limit, 400, none)
//
// The images are synthetic signatures: a walk past landmarks whose descriptors are drawn at random, of which
// every location sees the last ones of the one before and as many new ones; after every 1,000 locations it
// returns to where it was 800 ago and walks back from there for 200: with a limit of 1,000 out of working
// memory into what long-term memory has. Three members as in the ensemble: 64 and 128 floats, 32 bytes.
// Extraction and verification are not part of it. Prints CSV, a line for each 1,000 locations: medians over
// these; cpu_ms is processor time of all threads in one Detect, which other programs' load changes little.
// With a FOLDER, long-term memory is a file in it, where every image is stored, and at the end the detector
// is saved there and loaded again.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "data/synthetic/synthetic_random.h"
#include "tutti/loopclosure/detector.h"

namespace {

constexpr int kStretch = 1000;  // locations between returns
constexpr int kReturn = 200;    // locations of a return
constexpr int kReturnTo = 800;  // places back, where it starts

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
      // Mixed first: neighbouring landmarks have nothing in common.
      std::minstd_rand generator(static_cast<std::uint32_t>(
          tutti::synthetic::Random(3 * landmark + static_cast<unsigned>(member)).Bits()));
      std::minstd_rand noise(static_cast<std::uint32_t>(sight * 977 + static_cast<std::uint64_t>(i) + 1));
      const int line = i / 20;
      result.keypoints.emplace_back(static_cast<float>(i % 20) * 30.0f, static_cast<float>(line) * 20.0f,
                                    10.0f);
      if (member == 2) {
        std::uint8_t* row = result.descriptors.ptr(i);
        for (int c = 0; c < width; ++c) row[c] = static_cast<std::uint8_t>(generator() >> 8);
        for (int flip = 0; flip < 12; ++flip)
          row[noise() % 32u] ^= static_cast<std::uint8_t>(1u << (noise() % 8u));
      } else {
        float* row = result.descriptors.ptr<float>(i);
        for (int c = 0; c < width; ++c) {
          const float value =
              static_cast<float>(generator() >> 8 & 255u) + static_cast<float>(noise() % 21u) - 10.0f;
          row[c] = std::min(255.0f, std::max(0.0f, value));  // whole numbers, as SIFT's are
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

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

int Number(int argc, char** argv, int index, int otherwise) {
  return argc > index ? std::max(0, std::atoi(argv[index])) : otherwise;
}

// What happened over the last 1,000 locations.
struct Window {
  std::map<std::string, std::vector<double>> ms;
  std::size_t retrieved = 0;
  std::size_t transferred = 0;

  void Take(const tutti::LoopResult& result, double cpu_ms) {
    ms["quantise"].push_back(result.quantise_ms);
    ms["likelihood"].push_back(result.likelihood_ms);
    ms["filter"].push_back(result.filter_ms);
    ms["memory"].push_back(result.memory_ms);
    ms["total"].push_back(result.quantise_ms + result.likelihood_ms + result.filter_ms + result.memory_ms);
    ms["cpu"].push_back(cpu_ms);
    retrieved += result.retrieved.size();
    transferred += result.transferred.size();
  }
  double Median(const std::string& stage) const { return Quantile(ms.at(stage), 0.5); }
};

// The walk: which place the i-th image shows.
class Walk {
 public:
  std::int64_t Next() {
    const int phase = step_++ % (kStretch + kReturn);
    if (phase < kStretch) return place_++;
    return std::max<std::int64_t>(0, place_ - kReturnTo - (phase - kStretch));
  }

 private:
  int step_ = 0;
  std::int64_t place_ = 0;
};

tutti::LoopDetectorOptions Options(int limit, const std::string& folder) {
  tutti::LoopDetectorOptions options;
  options.external_members = options.members = {"floats64", "floats128", "bytes32"};
  options.verification.enabled = false;
  options.loop_threshold = 1.0;  // nothing is accepted: the graph stays a chain
  options.wm_limit = limit;
  if (!folder.empty()) options.ltm_file = folder + "/growth.ltm";
  return options;
}

// Kilobytes of the long-term memory's file and its log.
double DiskKb(const std::string& folder) {
  double bytes = 0;
  for (const char* end : {"", "-wal"}) {
    const std::filesystem::path file = folder + "/growth.ltm" + end;
    if (!folder.empty() && std::filesystem::exists(file)) {
      bytes += static_cast<double>(std::filesystem::file_size(file));
    }
  }
  return bytes / 1024.0;
}

void Report(int locations, std::size_t in_wm, long words, double resident_mb, double disk_kb,
            const Window& window) {
  std::printf("%d,%zu,%ld,%.2f,%.2f,%.2f,%.2f,%.2f,%.2f,%.2f,%.2f,%zu,%zu,%.1f,%.1f\n", locations, in_wm,
              words, window.Median("quantise"), window.Median("likelihood"), window.Median("filter"),
              window.Median("memory"), window.Median("total"), Quantile(window.ms.at("total"), 0.99),
              window.Median("cpu"), Quantile(window.ms.at("cpu"), 0.99), window.transferred, window.retrieved,
              resident_mb, disk_kb / locations);
  std::fflush(stdout);
}

double CpuMs() { return 1000.0 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void SaveAndLoad(const tutti::LoopDetector& detector, const tutti::LoopDetectorOptions& options,
                 const std::string& folder, double detect_ms) {
  const std::filesystem::path file = folder + "/growth.detector";
  const double start = CpuMs();
  detector.Save(file);
  const double saved = CpuMs();
  tutti::LoopDetectorOptions loaded_options = options;
  loaded_options.ltm_file.clear();
  tutti::LoopDetector loaded(loaded_options);
  loaded.Load(file);
  const double end = CpuMs();
  std::printf("# save_s,%.1f,load_s,%.1f,detect_s,%.1f,file_mb,%.1f\n", (saved - start) / 1000.0,
              (end - saved) / 1000.0, detect_ms / 1000.0,
              static_cast<double>(std::filesystem::file_size(file)) / 1048576.0);
  std::filesystem::remove(file);
}

}  // namespace

int main(int argc, char** argv) {
  const int locations = Number(argc, argv, 1, 20000);
  const int limit = Number(argc, argv, 2, 0);
  const Landmarks landmarks(std::max(2, Number(argc, argv, 3, 400)));
  const std::string folder = argc > 4 ? argv[4] : "";
  const tutti::LoopDetectorOptions options = Options(limit, folder);
  tutti::LoopDetector detector(options);
  std::printf(
      "locations,in_memory,words,quantise_ms,likelihood_ms,filter_ms,memory_ms,total_ms,total_p99_ms,"
      "cpu_ms,cpu_p99_ms,transferred,retrieved,resident_mb,disk_kb_per_location\n");
  const double resident_before = ResidentMb();
  Walk walk;
  Window window;
  double detect_ms = 0;
  for (int i = 0; i < locations; ++i) {
    const std::int64_t place = walk.Next();
    tutti::LoopQuery query;
    query.id = i;
    for (int k = 0; k < 3; ++k) {
      query.member_features[options.members[static_cast<std::size_t>(k)]] =
          landmarks.See(k, place, static_cast<std::uint64_t>(i));
    }
    const double before = CpuMs();
    const tutti::LoopResult result = detector.Detect(query);
    const double cpu_ms = CpuMs() - before;
    detect_ms += cpu_ms;
    window.Take(result, cpu_ms);
    if ((i + 1) % 1000 != 0) continue;
    long words = 0;
    for (const tutti::MemberOpinion& member : result.members) words += member.words;
    Report(i + 1, detector.NumLocations(), words, ResidentMb() - resident_before, DiskKb(folder), window);
    window = Window();
  }
  if (!folder.empty()) SaveAndLoad(detector, options, folder, detect_ms);
  return 0;
}
