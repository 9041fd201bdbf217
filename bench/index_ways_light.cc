// FLANN's kd-forest without what its searches pay for the size of the index.
#include "bench/flann_light.h"
#include "bench/index_ways.h"
#include "loopclosure/features/distances.h"

namespace tutti {
namespace {

// A distance of FLANN's kind, by the library's own function.
struct OwnSquaredDistance {
  using is_kdtree_distance = bool;
  using ElementType = float;
  using ResultType = float;
  float operator()(const float* a, const float* b, std::size_t size, float /*worst*/ = -1) const {
    float distance = 0;
    internal::SquaredDistances(a, b, 1, static_cast<int>(size), 0, &distance);
    return distance;
  }
  float accum_dist(float a, float b, int /*dimension*/) const { return (a - b) * (a - b); }
};

}  // namespace

std::unique_ptr<IndexWay> MakeLightWay(const WaySpec& spec) {
  if (spec.name != "light") return nullptr;
  using Way = FlannWay<flann_light::KDTreeIndex<OwnSquaredDistance>, flann_light::Matrix<float>,
                       flann_light::ResultSet<float>, flann_light::SearchParams, flann_light::IndexParams>;
  return std::make_unique<Way>(flann_light::KDTreeIndexParams(static_cast<int>(spec.At(0, 4))),
                               static_cast<int>(spec.At(1, 32)), spec.At(2, 0), spec.At(3, 2));
}

}  // namespace tutti
