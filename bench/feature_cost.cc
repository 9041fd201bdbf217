// What the features of an image cost, and what a whole image costs the loop detector, in units of S: the
// processor time of cv::SIFT with its defaults on one thread, per image, on the same images in the same run.
//
//   feature_cost IMAGE...
//
// Prints milliseconds per image and ratios to S: processor time and time on the clock. Extraction runs on one
// thread each, "members on 2 threads" extracts all of the ensemble's, and "detector" is LoopDetector::Detect
// with its defaults (2 threads, verification included) over all images in their order; its median and p99 are
// times on the clock.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <functional>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "core/parallel.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/loopclosure/features.h"

namespace {

double Milliseconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

struct Cost {
  double processor_ms = 0;      // mean per image
  std::vector<double> wall_ms;  // of each image, ascending

  double Quantile(double share) const {
    return wall_ms[static_cast<std::size_t>(share * static_cast<double>(wall_ms.size() - 1))];
  }
};

Cost Measure(std::size_t images, const std::function<void(std::size_t)>& work) {
  Cost cost;
  const double before = Milliseconds(CLOCK_PROCESS_CPUTIME_ID);
  for (std::size_t i = 0; i < images; ++i) {
    const double start = Milliseconds(CLOCK_MONOTONIC);
    work(i);
    cost.wall_ms.push_back(Milliseconds(CLOCK_MONOTONIC) - start);
  }
  cost.processor_ms = (Milliseconds(CLOCK_PROCESS_CPUTIME_ID) - before) / static_cast<double>(images);
  std::sort(cost.wall_ms.begin(), cost.wall_ms.end());
  return cost;
}

void Print(const std::string& name, const Cost& cost, double unit) {
  std::printf("%-22s %9.2f %9.2f %9.2f   %6.3f %6.3f %6.3f\n", name.c_str(), cost.processor_ms,
              cost.Quantile(0.5), cost.Quantile(0.99), cost.processor_ms / unit, cost.Quantile(0.5) / unit,
              cost.Quantile(0.99) / unit);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<cv::Mat> images;
  for (int i = 1; i < argc; ++i) {
    images.push_back(tutti::ToGrey8(cv::imread(argv[i], cv::IMREAD_UNCHANGED)));
    if (images.back().empty()) {
      std::fprintf(stderr, "%s: can't be read as an image\n", argv[i]);
      return 1;
    }
  }
  if (images.empty()) {
    std::fprintf(stderr, "feature_cost IMAGE...\n");
    return 1;
  }
  const tutti::LoopDetectorOptions options;
  cv::setNumThreads(1);
  const Cost unit = Measure(images.size(), [&](std::size_t i) {
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;
    cv::SIFT::create()->detectAndCompute(images[i], cv::noArray(), keypoints, descriptors);
  });
  const double s = unit.processor_ms;
  std::printf("%d images, the first %d x %d\n", static_cast<int>(images.size()), images[0].cols,
              images[0].rows);
  std::printf("%-22s %9s %9s %9s   %6s %6s %6s\n", "", "processor", "median", "p99 [ms]", "proc.", "median",
              "p99 [S]");
  Print("cv::SIFT, S", unit, s);

  std::vector<tutti::FeatureExtractor> extractors;
  for (const std::string& member : options.members) {
    extractors.emplace_back(member, options.extraction);
    double found = 0;
    const Cost cost = Measure(images.size(), [&](std::size_t i) {
      found += static_cast<double>(extractors.back().Extract(images[i]).keypoints.size());
    });
    const double mean = found / static_cast<double>(images.size());
    Print(member + ", " + std::to_string(static_cast<int>(mean)) + " features", cost, s);
  }
  Print("members on 2 threads",
        Measure(images.size(),
                [&](std::size_t i) {
                  tutti::RunParallel(static_cast<int>(extractors.size()), 2, [&](int member) {
                    extractors[static_cast<std::size_t>(member)].Extract(images[i]);
                  });
                }),
        s);
  cv::setNumThreads(2);
  tutti::LoopDetector detector(options);
  Print("detector",
        Measure(images.size(),
                [&](std::size_t i) {
                  tutti::LoopQuery query;
                  query.id = static_cast<int>(i);
                  query.image = images[i];
                  detector.Detect(query);
                }),
        s);
  return 0;
}
