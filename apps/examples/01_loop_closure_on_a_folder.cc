// Example 01: loop closure alone. Reads the images of a folder in order and says where the camera was before.
//
//   01_loop_closure_on_a_folder [DIR]     # without one: a generated town
//
// Three calls: construct a LoopDetector, give it each image, read the result.
#include <cstdio>
#include <exception>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "image_folder.h"
#include "tutti/loopclosure/detector.h"
#include "world.h"

namespace {

int Run(const std::string& folder) {
  tutti::LoopDetectorOptions options;  // SURF, SIFT and ORB, and one Bayes filter on all of them
  tutti::LoopDetector detector(options);

  const std::vector<std::string> files = examples::FilesInOrder(folder);
  int loops = 0;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const cv::Mat image = cv::imread(files[i], cv::IMREAD_GRAYSCALE);
    const tutti::LoopResult result = detector.Detect(image, static_cast<std::int64_t>(i));
    if (result.accepted) {
      const tutti::Verification& v = result.verification;
      std::printf("image %zu is where image %lld was (H = %.2f, %d of %d matches fit)\n", i,
                  static_cast<long long>(v.candidate), result.hypothesis, v.inliers, v.matches);
      ++loops;
    } else if (result.proposed) {
      std::printf("image %zu: no loop with %lld: %s\n", i, static_cast<long long>(result.candidate),
                  result.reason.c_str());
    }
  }
  std::printf("%zu images, %d loops\n", files.size(), loops);
  return files.empty() ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 2) {
    std::fprintf(stderr, "usage: %s [DIR]\n", argv[0]);
    return 1;
  }
  try {
    return Run(argc > 1 ? argv[1] : examples::Town(argv[0], "mono") + "/image_0");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
