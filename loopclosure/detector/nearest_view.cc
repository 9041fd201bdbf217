#include "loopclosure/detector/hypothesis_search.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/dense_solvers.h"
#include "core/numbers.h"

namespace tutti::internal {
namespace {

constexpr int kReach = 16;           // locations each way: further off, a view is none of the place
constexpr int kMostLooks = 6;        // beside those at the start and next to it
constexpr std::size_t kFewest = 10;  // features that a motion is told by
constexpr double kSure = 0.2;        // locations: by so little the nearest may be missed

// The ray of a pixel, of length 1. Without a camera, the focal length is a guess that most cameras are within
// a factor of two of; each of several cameras in one image has its own.
Eigen::Vector3d RayOf(const View& view, const cv::Point2f& pixel) {
  cv::Rect part({0, 0}, view.size);
  if (view.cameras.size() > 1) {
    for (const cv::Rect& camera : view.cameras) {
      if (camera.contains(cv::Point(pixel))) part = camera;
    }
  } else if (view.camera) {
    return view.camera->Unproject({pixel.x, pixel.y}).normalized();
  }
  const double focal = 0.8 * std::max(part.width, part.height);
  return Eigen::Vector3d(pixel.x - part.x - 0.5 * part.width, pixel.y - part.y - 0.5 * part.height, focal)
      .normalized();
}

// One feature of the query and what it is in a view.
struct RayPair {
  Eigen::Vector3d query, candidate;
};

// What is left of the rays' differences when the turn of the camera is taken out: the parallax, which is the
// way between the two views over the depth of each feature.
std::vector<Eigen::Vector3d> Parallax(const std::vector<RayPair>& rays) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const RayPair& pair : rays) sum += pair.query * pair.candidate.transpose();
  const Svd3 svd = SingularValues(sum);
  Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
  flip(2, 2) = (svd.u * svd.v.transpose()).determinant() < 0 ? -1 : 1;
  const Eigen::Matrix3d R_query_candidate = svd.u * flip * svd.v.transpose();
  std::vector<Eigen::Vector3d> parallax;
  parallax.reserve(rays.size());
  for (const RayPair& pair : rays) parallax.push_back(R_query_candidate * pair.candidate - pair.query);
  return parallax;
}

// An accepted view: its features by their pixel in the query.
struct SeenView {
  int slot = -1;
  std::map<std::pair<float, float>, RayPair> rays;
  double farness = 0;  // parallax per inlier: the nearer a view, the less has moved and the more is shared
};

SeenView See(const View& query, const View& candidate, int slot, const Verification& verification) {
  SeenView seen;
  seen.slot = slot;
  std::vector<RayPair> rays;
  for (const VerifiedMatch& match : verification.inlier_matches) {
    rays.push_back({RayOf(query, match.query), RayOf(candidate, match.candidate)});
    seen.rays[{match.query.x, match.query.y}] = rays.back();
  }
  double squares = 0;
  for (const Eigen::Vector3d& moved : Parallax(rays)) squares += moved.squaredNorm();
  const double count = static_cast<double>(std::max<std::size_t>(1, rays.size()));
  seen.farness = std::sqrt(squares / count) / std::max(1, verification.inliers);
  return seen;
}

// How far the query lies along the way from one view (0) to the other (1): where the parallax of what both
// share with it would be the least. Nothing where they share too little with it, or lie at one place.
std::optional<double> Along(const SeenView& from, const SeenView& to) {
  std::vector<RayPair> rays_from, rays_to;
  for (const auto& [pixel, pair] : from.rays) {
    const auto found = to.rays.find(pixel);
    if (found == to.rays.end()) continue;
    rays_from.push_back(pair);
    rays_to.push_back(found->second);
  }
  if (rays_from.size() < kFewest) return std::nullopt;
  const std::vector<Eigen::Vector3d> at_from = Parallax(rays_from);
  const std::vector<Eigen::Vector3d> at_to = Parallax(rays_to);
  double product = 0, squares = 0;
  for (std::size_t i = 0; i < at_from.size(); ++i) {
    const Eigen::Vector3d way = at_to[i] - at_from[i];
    product -= at_from[i].dot(way);
    squares += way.squaredNorm();
  }
  if (!(squares > 0)) return std::nullopt;
  return product / squares;
}

// Neighbours by odometry that are candidates.
std::vector<int> OnThePath(const LocationMemory& memory, int slot) {
  std::vector<int> slots;
  for (const LocationMemory::Link& link : memory.links(slot)) {
    if (link.type == LocationMemory::LinkType::kOdometry &&
        memory.state(link.slot) == LocationState::kWorking)
      slots.push_back(link.slot);
  }
  return slots;
}

// The path to a location's neighbour and on, as far as it reaches.
std::vector<int> Way(const LocationMemory& memory, int from, int neighbour) {
  std::vector<int> way = {neighbour};
  int last = from;
  while (way.size() < Index(kReach)) {
    const std::vector<int> on = OnThePath(memory, way.back());
    const auto further = std::find_if(on.begin(), on.end(), [&](int slot) { return slot != last; });
    if (further == on.end()) break;
    last = way.back();
    way.push_back(*further);
  }
  return way;
}

class NearestViewSearch {
 public:
  NearestViewSearch(const View& query, int start, const LocationMemory& memory,
                    const std::function<const View&(int)>& view_of, const LookAtSlot& look)
      : query_(query), view_of_(view_of), look_(look), path_({start}) {
    const std::vector<int> neighbours = OnThePath(memory, start);
    if (!neighbours.empty()) {
      const std::vector<int> one_way = Way(memory, start, neighbours.front());
      path_.insert(path_.begin(), one_way.rbegin(), one_way.rend());
    }
    start_ = static_cast<int>(path_.size()) - 1;
    if (neighbours.size() < 2) return;
    const std::vector<int> other_way = Way(memory, start, neighbours[1]);
    path_.insert(path_.end(), other_way.begin(), other_way.end());
  }

  int Find() {
    int here = start_;
    int other = -1;
    if (Look(here) == nullptr) return path_[Index(here)];
    for (const int beside : {start_ + 1, start_ - 1}) {
      if (other < 0 && Look(beside) != nullptr) other = beside;
    }
    for (int looks = 0; other >= 0 && looks < kMostLooks; ++looks) {
      const std::optional<double> along = Along(*Look(here), *Look(other));
      if (!along) break;
      const double last = static_cast<double>(path_.size()) - 1;
      const double goal = std::clamp(here + *along * (other - here), 0.0, last);
      int next = static_cast<int>(std::lround(goal));
      if (next == here && std::abs(goal - here) > kSure) next = goal > here ? here + 1 : here - 1;
      if (seen_.count(next) > 0) break;
      if (Look(next) == nullptr) {
        next = (next + here) / 2;
        if (seen_.count(next) > 0 || Look(next) == nullptr) break;
      }
      other = std::exchange(here, next);
      if (Look(other)->farness < Look(here)->farness) std::swap(here, other);
    }
    return Nearest();
  }

 private:
  // By the number on the path; nullptr where geometry does not accept it.
  const SeenView* Look(int number) {
    if (number < 0 || number >= static_cast<int>(path_.size())) return nullptr;
    const auto [found, is_new] = seen_.try_emplace(number);
    if (is_new) {
      const int slot = path_[Index(number)];
      const Verification& verification = look_(slot);
      if (verification.similar) found->second = See(query_, view_of_(slot), slot, verification);
    }
    return found->second ? &*found->second : nullptr;
  }

  int Nearest() {
    const SeenView* nearest = Look(start_);
    for (const auto& [number, view] : seen_) {
      if (view && view->farness < nearest->farness) nearest = &*view;
    }
    return nearest->slot;
  }

  const View& query_;
  const std::function<const View&(int)>& view_of_;
  const LookAtSlot& look_;
  std::vector<int> path_;  // slots along the odometry, both ways from the start
  int start_ = 0;          // its number on the path
  std::map<int, std::optional<SeenView>> seen_;
};

}  // namespace

int FindNearestView(const View& query, int start, const LocationMemory& memory,
                    const std::function<const View&(int)>& view_of, const LookAtSlot& look) {
  return NearestViewSearch(query, start, memory, view_of, look).Find();
}

}  // namespace tutti::internal
