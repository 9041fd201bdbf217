// Example 02: features of your own as a member of the ensemble. ORB is taken from the image by tutti; "mine"
// is whatever you extract: here corners with a normalised patch of grey values, in your program perhaps a
// network.
//
//   02_own_descriptors [DIR]     # without one: a generated town
//
// What it takes: the name in options.external_members, and keypoints with descriptors in each query. A member
// may also describe an image as a whole, by one vector: "whole" does, a stand-in for a place-recognition
// network. Its name is in options.dense_members, too, and it has no keypoints.
// (A detector that is a cv::Feature2D can also be registered once by name, and is then called by tutti: see
// RegisterFeatureType in tutti/loopclosure/features.h.)
#include <cstdio>
#include <exception>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "image_folder.h"
#include "tutti/loopclosure/detector.h"
#include "world.h"

namespace {

// Any descriptor will do that is CV_8U (compared by Hamming distance) or CV_32F (Euclidean), with one row for
// each keypoint and the same type and width in every image.
tutti::Features MyFeatures(const cv::Mat& grey) {
  constexpr int kCorners = 300;
  constexpr int kPatch = 24;  // side of the patch [px]
  constexpr int kCells = 8;   // it is averaged into 8 x 8 values
  tutti::Features features;
  if (grey.empty()) return features;
  std::vector<cv::KeyPoint> corners;
  cv::GFTTDetector::create(kCorners, 0.01, 5.0)->detect(grey, corners);
  for (const cv::KeyPoint& corner : corners) {
    cv::Mat patch;
    cv::getRectSubPix(grey, cv::Size(kPatch, kPatch), corner.pt, patch, CV_32F);
    cv::resize(patch, patch, cv::Size(kCells, kCells), 0, 0, cv::INTER_AREA);
    patch -= cv::mean(patch);  // neither brightness nor contrast matters
    const double length = cv::norm(patch);
    if (length < 1.0) continue;
    features.keypoints.push_back(corner);
    features.descriptors.push_back(cv::Mat(patch.reshape(1, 1) / length));
  }
  return features;  // none at all is fine: the member sits this image out
}

// One row of CV_32F, as wide in every image. Its length does not matter.
tutti::Features WholeImage(const cv::Mat& grey) {
  tutti::Features features;
  if (grey.empty()) return features;
  cv::Mat small;
  cv::resize(grey, small, cv::Size(24, 18), 0, 0, cv::INTER_AREA);
  small.convertTo(small, CV_32F);
  small -= cv::mean(small);
  features.descriptors = small.reshape(1, 1);
  return features;
}

int Run(const std::string& folder) {
  tutti::LoopDetectorOptions options;
  options.members = {"orb", "mine", "whole"};
  options.external_members = {"mine", "whole"};
  options.dense_members = {"whole"};
  tutti::LoopDetector detector(options);

  const std::vector<std::string> files = examples::FilesInOrder(folder);
  int loops = 0;
  for (std::size_t i = 0; i < files.size(); ++i) {
    tutti::LoopQuery query;
    query.id = static_cast<std::int64_t>(i);
    query.image = cv::imread(files[i], cv::IMREAD_GRAYSCALE);  // for ORB
    query.member_features["mine"] = MyFeatures(query.image);
    query.member_features["whole"] = WholeImage(query.image);

    const tutti::LoopResult result = detector.Detect(query);
    if (!result.accepted) continue;
    ++loops;
    std::printf("image %zu is where image %lld was; hypotheses", i, static_cast<long long>(result.candidate));
    for (const tutti::MemberOpinion& member : result.members)
      std::printf(" %s: %.2f", member.name.c_str(), member.hypothesis);
    std::printf("\n");
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
