// FLANN's indices as they are.
// center_chooser.h needs what is before it, and hierarchical_clustering_index.h needs it.
// clang-format off
#include <flann/algorithms/dist.h>
#include <flann/algorithms/kdtree_index.h>
#include <flann/algorithms/kmeans_index.h>
#include <flann/util/random.h>
#include <flann/algorithms/center_chooser.h>
#include <flann/algorithms/hierarchical_clustering_index.h>
#include <flann/algorithms/lsh_index.h>
// clang-format on

#include "bench/index_ways.h"
#include "loopclosure/features/distances.h"

namespace tutti {
namespace {

// A distance of FLANN's kind, by the library's own function (popcnt where the machine has it).
struct OwnHamming {
  using ElementType = unsigned char;
  using ResultType = unsigned int;
  ResultType operator()(const unsigned char* a, const unsigned char* b, std::size_t size,
                        int /*worst*/ = -1) const {
    float distance = 0;
    internal::HammingDistances(a, b, 1, static_cast<int>(size), 0, &distance);
    return static_cast<ResultType>(distance);
  }
};

template <typename Index>
std::unique_ptr<IndexWay> Make(const flann::IndexParams& parameters, int checks, float eps, float rebuild) {
  using Way =
      FlannWay<Index, flann::Matrix<typename Index::ElementType>,
               flann::ResultSet<typename Index::DistanceType>, flann::SearchParams, flann::IndexParams>;
  return std::make_unique<Way>(parameters, checks, eps, rebuild);
}

}  // namespace

std::unique_ptr<IndexWay> MakeFlannWay(const WaySpec& spec) {
  using Floats = flann::L2<float>;
  using Bits = OwnHamming;
  const int checks = static_cast<int>(spec.At(1, 32));
  const float eps = spec.At(2, 0);
  const float rebuild = spec.At(3, 2);
  if (spec.name == "forest") {
    const int trees = static_cast<int>(spec.At(0, 4));
    return Make<flann::KDTreeIndex<Floats>>(flann::KDTreeIndexParams(trees), checks, eps, rebuild);
  }
  if (spec.name == "kmeans") {
    const int branching = static_cast<int>(spec.At(0, 32));
    return Make<flann::KMeansIndex<Floats>>(
        flann::KMeansIndexParams(branching, 11, flann::FLANN_CENTERS_RANDOM, 0.4f), checks, eps, rebuild);
  }
  if (spec.name == "clusters") {
    const int trees = static_cast<int>(spec.At(0, 4));
    return Make<flann::HierarchicalClusteringIndex<Bits>>(
        flann::HierarchicalClusteringIndexParams(32, flann::FLANN_CENTERS_RANDOM, trees, 100), checks, eps,
        rebuild);
  }
  if (spec.name == "lsh") {
    const flann::LshIndexParams parameters(static_cast<unsigned>(spec.At(0, 12)),
                                           static_cast<unsigned>(spec.At(1, 20)),
                                           static_cast<unsigned>(spec.At(2, 1)));
    return Make<flann::LshIndex<Bits>>(parameters, 32, 0, 0);
  }
  return nullptr;
}

}  // namespace tutti
