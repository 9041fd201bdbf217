// What LoopDetector::Detect costs in C++, for bench/python_cost.py: processor time on the images of a folder,
// which are read before.
//
//   detect_cost IMAGE...
//
// Prints milliseconds of processor time per image, and a line of each result: id, place, probability.
#include <cstdio>
#include <ctime>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "tutti/loopclosure/detector.h"

int main(int argc, char** argv) {
  std::vector<cv::Mat> images;
  for (int i = 1; i < argc; ++i) images.push_back(cv::imread(argv[i], cv::IMREAD_GRAYSCALE));
  tutti::LoopDetector detector(tutti::LoopDetectorOptions{});
  std::vector<tutti::LoopResult> results;
  results.reserve(images.size());
  const std::clock_t before = std::clock();
  for (const cv::Mat& image : images) results.push_back(detector.Detect(image, detector.LastId() + 1));
  const double seconds = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
  std::printf("%.4f\n", 1e3 * seconds / static_cast<double>(images.size()));
  for (const tutti::LoopResult& result : results) {
    std::printf("%ld %ld %.17g\n", static_cast<long>(result.query), static_cast<long>(result.candidate),
                result.probability);
  }
  return 0;
}
