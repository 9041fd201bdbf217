// Loop closure alone, from an installed tutti.
#include <tutti/loopclosure/detector.h>

#include <cstdio>

int main() {
  tutti::LoopDetectorOptions options;
  options.members = {"orb"};
  tutti::LoopDetector detector(options);
  cv::Mat image(240, 320, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x)
      image.at<unsigned char>(y, x) = static_cast<unsigned char>((x / 7 * 31 + y / 9 * 57) & 255);
  }
  tutti::LoopQuery query;
  query.image = image;
  const tutti::LoopResult result = detector.Detect(query);
  std::printf("locations: %zu, proposed: %d\n", detector.NumLocations(), result.proposed ? 1 : 0);
  return detector.NumLocations() == 1 && !result.proposed ? 0 : 1;
}
