// Loop closure alone, from an installed tutti: what was learnt is saved, loaded and gone on with.
#include <tutti/loopclosure/detector.h>

#include <cstdio>
#include <filesystem>

namespace {

// Rectangles of many greys; another seed is another place.
cv::Mat Place(unsigned seed) {
  cv::Mat image(240, 320, CV_8UC1);
  unsigned state = seed * 2654435761u + 1;
  for (int y = 0; y < image.rows; y += 12) {
    for (int x = 0; x < image.cols; x += 16) {
      state = state * 1664525u + 1013904223u;
      image(cv::Rect(x, y, 16, 12)).setTo((state >> 16) & 255u);
    }
  }
  return image;
}

int Fail(const char* what) {
  std::fprintf(stderr, "%s\n", what);
  return 1;
}

}  // namespace

int main() {
  constexpr int kPlaces = 16;
  tutti::LoopDetectorOptions options;
  options.members = {"orb", "surf"};
  tutti::LoopDetector first(options);
  for (int i = 0; i < kPlaces; ++i) {
    if (first.Detect(Place(static_cast<unsigned>(i)), i).accepted) return Fail("a loop among new places");
  }
  const std::filesystem::path file = "places.tutti";
  first.Save(file);

  tutti::LoopDetector second(options);
  second.Load(file);
  std::filesystem::remove(file);
  if (second.NumLocations() != kPlaces || second.LastId() != kPlaces - 1) return Fail("Load lost locations");
  int loops = 0;
  for (int i = 0; i < 4; ++i) {
    const tutti::LoopResult loop = second.Detect(Place(static_cast<unsigned>(i)), kPlaces + i);
    if (loop.accepted && loop.candidate == i) ++loops;
  }
  std::printf("locations: %zu, loops with saved places: %d of 4\n", second.NumLocations(), loops);
  return loops > 0 ? 0 : Fail("no loop with what was loaded");
}
