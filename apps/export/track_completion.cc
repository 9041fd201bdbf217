// Cleaner and longer tracks, for programs that have nothing but tracks.
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <unordered_map>
#include <unordered_set>

#include "apps/export/colmap_model.h"
#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kMedians = 3;    // of distances from the projection
constexpr double kLeastPx = 0.5;  // no view is dropped for less
constexpr double kMostTurned = 40 * M_PI / 180;
constexpr double kMostScaled = 1.3;  // ratio of the distances of two views from the landmark
constexpr double kMostBackPx = 0.1;
constexpr int kWindow = 15;  // [px], a corner's surroundings
constexpr int kLevels = 2;   // above the image itself

/// Pyramids of keyframes' images; those that were asked for last are kept.
class Pyramids {
 public:
  Pyramids(const KeyframeImages& images, const MapModel& model) : images_(images), model_(model) {}

  /// The pyramid of keyframe number `k` of the model; empty if it has no image.
  const std::vector<cv::Mat>& Of(std::size_t k) {
    constexpr std::size_t kKept = 40;
    Entry& entry = kept_[k];
    entry.used = ++clock_;
    if (entry.pyramid.empty()) {
      const ColourImage read = images_.Read(model_.keyframes[k]);
      if (!read.error.empty()) return entry.pyramid;
      cv::Mat grey;
      cv::cvtColor(read.image, grey, cv::COLOR_BGR2GRAY);
      cv::buildOpticalFlowPyramid(grey, entry.pyramid, cv::Size(kWindow, kWindow), kLevels);
      if (kept_.size() > kKept) Forget();
    }
    return kept_[k].pyramid;
  }

 private:
  struct Entry {
    std::vector<cv::Mat> pyramid;
    std::size_t used = 0;
  };

  void Forget() {
    const auto oldest = std::min_element(kept_.begin(), kept_.end(), [](const auto& a, const auto& b) {
      return a.second.used < b.second.used;
    });
    kept_.erase(oldest);
  }

  const KeyframeImages& images_;
  const MapModel& model_;
  std::map<std::size_t, Entry> kept_;
  std::size_t clock_ = 0;
};

struct View {
  std::size_t keyframe;
  cv::Point2f pixel;
};

/// Landmarks to look for in one keyframe, from another one.
struct Search {
  std::vector<int> landmarks;
  std::vector<cv::Point2f> from, to;  // `to`: where the map says
};

class Completion {
 public:
  Completion(const KeyframeImages& images, const std::vector<std::size_t>& chosen, double most_px,
             MapModel* model)
      : most_px_(most_px), model_(model), pyramids_(images, *model), chosen_(chosen) {
    for (const std::size_t k : chosen) {
      for (const SeenLandmark& view : model->keyframes[k].views)
        views_[view.landmark].push_back({k, view.pixel});
    }
  }

  std::size_t Run() {
    std::size_t added = 0;
    std::map<std::size_t, std::vector<SeenLandmark>> found;  // entered at the end: the order does not matter
    for (const std::size_t k : chosen_) {
      for (const auto& [from, search] : SearchesIn(k)) Look(from, k, search, &found[k]);
    }
    for (const auto& [k, views] : found) {
      added += views.size();
      auto& all = model_->keyframes[k].views;
      all.insert(all.end(), views.begin(), views.end());
    }
    return added;
  }

 private:
  // By the keyframe whose views are to be followed.
  std::map<std::size_t, Search> SearchesIn(std::size_t k) const {
    const ModelKeyframe& keyframe = model_->keyframes[k];
    std::unordered_set<int> seen;
    for (const SeenLandmark& view : keyframe.views) seen.insert(view.landmark);
    const Pose T_camera_world = keyframe.T_world_camera.Inverse();
    std::map<std::size_t, Search> searches;
    for (const ModelLandmark& landmark : model_->landmarks) {
      const auto views = views_.find(landmark.id);
      if (views == views_.end() || seen.count(landmark.id) != 0) continue;
      const Eigen::Vector3d point = T_camera_world * landmark.position;
      if (!(point.z() > 0)) continue;
      const Eigen::Vector2d pixel = model_->camera.Project(point);
      if (!model_->camera.Contains(pixel, kWindow)) continue;
      const View* const like = MostLike(keyframe, landmark.position, views->second);
      if (like == nullptr) continue;
      Search& search = searches[like->keyframe];
      search.landmarks.push_back(landmark.id);
      search.from.push_back(like->pixel);
      search.to.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
    }
    return searches;
  }

  const View* MostLike(const ModelKeyframe& keyframe, const Eigen::Vector3d& landmark,
                       const std::vector<View>& views) const {
    const Eigen::Vector3d sight = landmark - keyframe.T_world_camera.translation;
    double most_like = std::cos(kMostTurned);
    const View* best = nullptr;
    for (const View& view : views) {
      const Eigen::Vector3d other = landmark - model_->keyframes[view.keyframe].T_world_camera.translation;
      const double ratio = sight.norm() / other.norm(),
                   like = sight.dot(other) / (sight.norm() * other.norm());
      if (ratio > kMostScaled || ratio * kMostScaled < 1 || like < most_like) continue;
      best = &view;
      most_like = like;
    }
    return best;
  }

  void Look(std::size_t from, std::size_t into, const Search& search, std::vector<SeenLandmark>* found) {
    const std::vector<cv::Mat> there = pyramids_.Of(from), here = pyramids_.Of(into);
    if (there.empty() || here.empty()) return;
    std::vector<cv::Point2f> to = search.to, back = search.from;
    std::vector<unsigned char> forth_good, back_good;
    const cv::Size window(kWindow, kWindow);
    const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 30, 0.01);
    cv::calcOpticalFlowPyrLK(there, here, search.from, to, forth_good, cv::noArray(), window, kLevels, until,
                             cv::OPTFLOW_USE_INITIAL_FLOW);
    cv::calcOpticalFlowPyrLK(here, there, to, back, back_good, cv::noArray(), window, kLevels, until,
                             cv::OPTFLOW_USE_INITIAL_FLOW);
    for (std::size_t i = 0; i < to.size(); ++i) {
      if (forth_good[i] == 0 || back_good[i] == 0) continue;
      if (cv::norm(to[i] - search.to[i]) > most_px_) continue;
      if (cv::norm(back[i] - search.from[i]) > kMostBackPx) continue;
      found->push_back({search.landmarks[i], to[i]});
    }
  }

  const double most_px_;
  MapModel* const model_;
  Pyramids pyramids_;
  const std::vector<std::size_t>& chosen_;
  std::unordered_map<int, std::vector<View>> views_;  // by landmark, ascending keyframes
};

// Distance of each view from the projection of its landmark, keyframe by keyframe [px].
std::vector<std::vector<double>> Distances(const MapModel& model) {
  std::unordered_map<int, const Eigen::Vector3d*> positions;
  for (const ModelLandmark& landmark : model.landmarks) positions[landmark.id] = &landmark.position;
  std::vector<std::vector<double>> distances;
  for (const ModelKeyframe& keyframe : model.keyframes) {
    distances.emplace_back();
    const Pose T_camera_world = keyframe.T_world_camera.Inverse();
    for (const SeenLandmark& view : keyframe.views) {
      const Eigen::Vector2d at = model.camera.Project(T_camera_world * *positions.at(view.landmark));
      distances.back().push_back((at - Eigen::Vector2d(view.pixel.x, view.pixel.y)).norm());
    }
  }
  return distances;
}

void DropFarViews(MapModel* model, TrackChanges* changes) {
  const std::vector<std::vector<double>> distances = Distances(*model);
  std::vector<double> all;
  for (const std::vector<double>& of_one : distances) all.insert(all.end(), of_one.begin(), of_one.end());
  changes->most_px = std::max(kLeastPx, kMedians * internal::Median(std::move(all)));
  for (std::size_t k = 0; k < model->keyframes.size(); ++k) {
    std::vector<SeenLandmark> near;
    for (std::size_t i = 0; i < distances[k].size(); ++i) {
      if (distances[k][i] <= changes->most_px) near.push_back(model->keyframes[k].views[i]);
    }
    changes->dropped += distances[k].size() - near.size();
    model->keyframes[k].views = std::move(near);
  }
}

}  // namespace

TrackChanges RefineTracks(const KeyframeImages& images, const std::vector<std::size_t>& chosen,
                          MapModel* model) {
  TrackChanges changes;
  DropFarViews(model, &changes);
  changes.added = Completion(images, chosen, changes.most_px, model).Run();
  return changes;
}

}  // namespace tutti
