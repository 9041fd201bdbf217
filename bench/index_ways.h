// Ways to search words that bench/index_cost compares.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "loopclosure/vocabulary/descriptor_index.h"

namespace tutti {

/// One way to keep words and to search them: rows of a matrix that stays where it is; the row number is the
/// id.
class IndexWay {
 public:
  virtual ~IndexWay() = default;
  virtual void Add(int first, const cv::Mat& rows) = 0;
  virtual std::vector<TwoNearest> Search(const cv::Mat& descriptors) const = 0;
};

/// "name/number/number...": what it is and what it is made with.
struct WaySpec {
  std::string name;
  std::vector<float> numbers;
  float At(std::size_t i, float otherwise) const { return i < numbers.size() ? numbers[i] : otherwise; }
};

/// The two nearest as a ResultSet of FLANN.
template <typename ResultSet, typename Distance>
class FlannNearestTwo : public ResultSet {
 public:
  bool full() const override { return nearest_.second >= 0; }
  void addPoint(Distance distance, std::size_t index) override {
    const float value = static_cast<float>(distance);
    if (value <= nearest_.second_distance) nearest_.Offer(static_cast<int>(index), value);
  }
  Distance worstDist() const override {
    return full() ? static_cast<Distance>(nearest_.second_distance) : std::numeric_limits<Distance>::max();
  }
  TwoNearest Result() const { return nearest_; }

 private:
  TwoNearest nearest_;
};

/// An index of FLANN that is built of the first image's words and takes the others in as they come; built
/// anew when it has grown by the factor `rebuild` (0: never).
template <typename Index, typename Matrix, typename ResultSet, typename SearchParams, typename Parameters>
class FlannWay : public IndexWay {
 public:
  FlannWay(const Parameters& parameters, int checks, float eps, float rebuild)
      : parameters_(parameters), search_(checks, eps), rebuild_(rebuild) {}

  void Add(int /*first*/, const cv::Mat& rows) override {
    // FLANN's matrices are not const; it only reads.
    const Matrix points(const_cast<Element*>(rows.ptr<Element>()), static_cast<std::size_t>(rows.rows),
                        static_cast<std::size_t>(rows.cols));
    if (index_) {
      index_->addPoints(points, rebuild_);
      return;
    }
    index_ = std::make_unique<Index>(points, parameters_);
    index_->buildIndex();
  }

  std::vector<TwoNearest> Search(const cv::Mat& descriptors) const override {
    std::vector<TwoNearest> found;
    for (int i = 0; i < descriptors.rows; ++i) {
      FlannNearestTwo<ResultSet, typename Index::DistanceType> result;
      index_->findNeighbors(result, descriptors.ptr<Element>(i), search_);
      found.push_back(result.Result());
      if (descriptors.type() != CV_32F) continue;
      found.back().first_distance = std::sqrt(found.back().first_distance);
      found.back().second_distance = std::sqrt(found.back().second_distance);
    }
    return found;
  }

 private:
  using Element = typename Index::ElementType;
  Parameters parameters_;
  SearchParams search_;
  float rebuild_;
  std::unique_ptr<Index> index_;
};

/// FLANN's own: forest/TREES/CHECKS/EPS/REBUILD, kmeans/BRANCHING/CHECKS/EPS/REBUILD,
/// clusters/TREES/CHECKS/EPS/REBUILD, lsh/TABLES/KEY_BITS/PROBES. nullptr for other names.
std::unique_ptr<IndexWay> MakeFlannWay(const WaySpec& spec);

/// light/TREES/CHECKS/EPS/REBUILD: flann_light.h, with the library's own distances. nullptr for other names.
std::unique_ptr<IndexWay> MakeLightWay(const WaySpec& spec);

}  // namespace tutti
