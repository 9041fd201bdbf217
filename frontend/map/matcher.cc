#include "frontend/map/matcher.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "frontend/geometry/two_view.h"

namespace tutti {
namespace {

// Keeps matches whose change of orientation is that of the majority: three of thirty bins of a histogram.
// `angle(i)` gives the change [deg], `drop(i)` removes match i.
template <typename Angle, typename Drop>
int KeepConsistentOrientation(std::size_t count, Angle angle, Drop drop) {
  constexpr int kBins = 30;
  std::array<std::vector<std::size_t>, kBins> bins;
  for (std::size_t i = 0; i < count; ++i) {
    double a = std::fmod(angle(i) + 720.0, 360.0);
    bins[static_cast<std::size_t>(std::min(kBins - 1, static_cast<int>(a / 360.0 * kBins)))].push_back(i);
  }
  std::array<std::size_t, kBins> order{};
  for (std::size_t b = 0; b < kBins; ++b) order[b] = b;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return bins[a].size() > bins[b].size(); });
  int kept = 0;
  for (std::size_t rank = 0; rank < kBins; ++rank) {
    const auto& bin = bins[order[rank]];
    const bool keep = rank < 3 && bin.size() * 10 > bins[order[0]].size();
    if (keep)
      kept += static_cast<int>(bin.size());
    else
      for (std::size_t i : bin) drop(i);
  }
  return kept;
}

int PredictOctave(const Map& map, double max_distance, double distance) {
  const double step = std::log(map.scales().size() > 1 ? map.scales()[1] : 1.2);
  const int octave = static_cast<int>(std::ceil(std::log(max_distance / distance) / step));
  return std::clamp(octave, 0, static_cast<int>(map.scales().size()) - 1);
}

struct Seen {
  cv::Point2f pixel;
  double cosine = 0;
  int octave = 0;
};

// Whether a landmark should be visible from a pose, and where.
bool Visible(const Map& map, const PinholeCamera& camera, const Pose& T_camera_world,
             const Eigen::Vector3d& centre, const Landmark& landmark, Seen* seen) {
  const Eigen::Vector3d p = T_camera_world * landmark.position;
  if (p.z() <= 0) return false;
  const Eigen::Vector2d pixel = camera.Project(p);
  if (!camera.Contains(pixel)) return false;
  const Eigen::Vector3d ray = landmark.position - centre;
  const double distance = ray.norm();
  if (distance < 0.8 * landmark.min_distance || distance > 1.2 * landmark.max_distance) return false;
  seen->cosine = ray.dot(landmark.normal) / distance;
  if (seen->cosine < 0.5) return false;
  seen->pixel = cv::Point2f(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
  seen->octave = PredictOctave(map, landmark.max_distance, distance);
  return true;
}

struct Best {
  int distance = std::numeric_limits<int>::max(), feature = -1, octave = -1;
  int second = std::numeric_limits<int>::max(), second_octave = -1;
  void Offer(int d, int f, int o) {
    if (d < distance) {
      second = distance;
      second_octave = octave;
      distance = d;
      feature = f;
      octave = o;
    } else if (d < second) {
      second = d;
      second_octave = o;
    }
  }
};

}  // namespace

int MatchToLastFrame(const Map& map, const PinholeCamera& camera, const Pose& T_camera_world,
                     const FrameMatches& last, float radius_px, FrameMatches* current) {
  std::vector<std::pair<int, int>> matches;  // feature of last, feature of current
  std::vector<int> near;
  for (std::size_t i = 0; i < last.landmarks.size(); ++i) {
    const int id = last.landmarks[i];
    if (id < 0 || !map.landmark(id).alive) continue;
    const Landmark& l = map.landmark(id);
    const Eigen::Vector3d p = T_camera_world * l.position;
    if (p.z() <= 0) continue;
    const Eigen::Vector2d pixel = camera.Project(p);
    if (!camera.Contains(pixel)) continue;
    const int octave = last.features->keypoints[i].octave;
    current->features->InArea(cv::Point2f(static_cast<float>(pixel.x()), static_cast<float>(pixel.y())),
                              radius_px * map.scales()[static_cast<std::size_t>(octave)], octave - 1,
                              octave + 1, &near);
    Best best;
    for (int f : near) {
      if (current->landmarks[static_cast<std::size_t>(f)] >= 0) continue;
      best.Offer(HammingDistance(l.descriptor.data(), current->features->Descriptor(f)), f, 0);
    }
    if (best.distance > kLooseDistance) continue;
    current->landmarks[static_cast<std::size_t>(best.feature)] = id;
    matches.emplace_back(static_cast<int>(i), best.feature);
  }
  return KeepConsistentOrientation(
      matches.size(),
      [&](std::size_t m) {
        return double(last.features->keypoints[static_cast<std::size_t>(matches[m].first)].angle) -
               current->features->keypoints[static_cast<std::size_t>(matches[m].second)].angle;
      },
      [&](std::size_t m) { current->landmarks[static_cast<std::size_t>(matches[m].second)] = -1; });
}

int MatchToLandmarks(const Map& map, const PinholeCamera& camera, const Pose& T_camera_world,
                     const std::vector<int>& landmarks, float radius_factor, FrameMatches* current,
                     std::vector<int>* visible) {
  const Eigen::Vector3d centre = T_camera_world.Inverse().translation;
  std::vector<int> near;
  int count = 0;
  for (int id : landmarks) {
    const Landmark& l = map.landmark(id);
    Seen seen;
    if (!l.alive || !Visible(map, camera, T_camera_world, centre, l, &seen)) continue;
    visible->push_back(id);
    const float radius = radius_factor * (seen.cosine > 0.998 ? 2.5F : 4.0F) *
                         map.scales()[static_cast<std::size_t>(seen.octave)];
    current->features->InArea(seen.pixel, radius, seen.octave - 1, seen.octave, &near);
    Best best;
    for (int f : near) {
      if (current->landmarks[static_cast<std::size_t>(f)] >= 0) continue;
      best.Offer(HammingDistance(l.descriptor.data(), current->features->Descriptor(f)), f,
                 current->features->keypoints[static_cast<std::size_t>(f)].octave);
    }
    if (best.distance > kLooseDistance) continue;
    if (best.octave == best.second_octave && best.distance >= 0.8 * best.second) continue;
    current->landmarks[static_cast<std::size_t>(best.feature)] = id;
    ++count;
  }
  return count;
}

int MatchToKeyframe(const Map& map, const Keyframe& keyframe, FrameMatches* current) {
  std::vector<int> taken(current->features->size(),
                         std::numeric_limits<int>::max());  // distance of the match of a feature
  std::vector<int> source(current->features->size(), -1);
  for (std::size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const int id = keyframe.landmarks[i];
    if (id < 0 || !map.landmark(id).alive) continue;
    Best best;
    const std::uint8_t* d = keyframe.features->Descriptor(static_cast<int>(i));
    for (std::size_t f = 0; f < current->features->size(); ++f) {
      best.Offer(HammingDistance(d, current->features->Descriptor(static_cast<int>(f))), static_cast<int>(f),
                 0);
    }
    if (best.distance > kStrictDistance + 10 || best.distance >= 0.8 * best.second) continue;
    const std::size_t f = static_cast<std::size_t>(best.feature);
    if (best.distance < taken[f]) {
      taken[f] = best.distance;
      source[f] = static_cast<int>(i);
    }
  }
  std::vector<std::size_t> matched;
  for (std::size_t f = 0; f < source.size(); ++f) {
    if (source[f] < 0) continue;
    current->landmarks[f] = keyframe.landmarks[static_cast<std::size_t>(source[f])];
    matched.push_back(f);
  }
  return KeepConsistentOrientation(
      matched.size(),
      [&](std::size_t m) {
        return double(keyframe.features->keypoints[static_cast<std::size_t>(source[matched[m]])].angle) -
               current->features->keypoints[matched[m]].angle;
      },
      [&](std::size_t m) { current->landmarks[matched[m]] = -1; });
}

std::vector<std::pair<int, int>> MatchTwoViews(const FrameFeatures& first, const FrameFeatures& second,
                                               float radius_px, std::vector<cv::Point2f>* centres) {
  std::vector<int> source(second.size(), -1), taken(second.size(), std::numeric_limits<int>::max());
  std::vector<int> near;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const int octave = first.keypoints[i].octave;
    if (octave > 3) continue;  // coarse corners are not precise enough for the first geometry
    second.InArea((*centres)[i], radius_px, octave, octave, &near);
    Best best;
    for (int f : near)
      best.Offer(HammingDistance(first.Descriptor(static_cast<int>(i)), second.Descriptor(f)), f, 0);
    if (best.distance > kStrictDistance || best.distance >= 0.9 * best.second) continue;
    const std::size_t f = static_cast<std::size_t>(best.feature);
    if (best.distance < taken[f]) {
      taken[f] = best.distance;
      source[f] = static_cast<int>(i);
    }
  }
  std::vector<std::pair<int, int>> matches;
  for (std::size_t f = 0; f < source.size(); ++f) {
    if (source[f] >= 0) matches.emplace_back(source[f], static_cast<int>(f));
  }
  std::vector<char> drop(matches.size(), 0);
  KeepConsistentOrientation(
      matches.size(),
      [&](std::size_t m) {
        return double(first.keypoints[static_cast<std::size_t>(matches[m].first)].angle) -
               second.keypoints[static_cast<std::size_t>(matches[m].second)].angle;
      },
      [&](std::size_t m) { drop[m] = 1; });
  std::vector<std::pair<int, int>> out;
  for (std::size_t m = 0; m < matches.size(); ++m) {
    if (drop[m]) continue;
    out.push_back(matches[m]);
    (*centres)[static_cast<std::size_t>(matches[m].first)] =
        second.keypoints[static_cast<std::size_t>(matches[m].second)].pt;
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::vector<std::pair<int, int>> MatchEpipolar(const Map& map, const PinholeCamera& camera,
                                               const Keyframe& first, const Keyframe& second,
                                               double median_depth) {
  const Pose T_second_first = second.T_world_camera.Inverse() * first.T_world_camera;
  const Eigen::Matrix3d k_inverse = camera.Matrix().inverse();
  const Eigen::Matrix3d fundamental = k_inverse.transpose() * Skew(T_second_first.translation) *
                                      T_second_first.rotation.toRotationMatrix() * k_inverse;
  const Eigen::Vector2d epipole = T_second_first.translation.z() > 1e-9
                                      ? camera.Project(T_second_first.translation)
                                      : Eigen::Vector2d(-1e6, -1e6);
  std::vector<int> source(second.features->size(), -1),
      taken(second.features->size(), std::numeric_limits<int>::max());
  for (std::size_t i = 0; i < first.features->size(); ++i) {
    if (first.landmarks[i] >= 0) continue;
    const cv::KeyPoint& k = first.features->keypoints[i];
    const Eigen::Vector3d ray = camera.Unproject({k.pt.x, k.pt.y});
    // The part of the epipolar line between a near and a far depth.
    const Eigen::Vector3d near_point = T_second_first * Eigen::Vector3d(0.25 * median_depth * ray);
    const Eigen::Vector3d far_point = T_second_first.rotation * ray;
    if (far_point.z() <= 0) continue;
    const Eigen::Vector2d b = camera.Project(far_point);
    Eigen::Vector2d a = near_point.z() > 0.02 * median_depth ? camera.Project(near_point) : b;
    if (near_point.z() <= 0.02 * median_depth)
      a = camera.Project(T_second_first * Eigen::Vector3d(0.6 * median_depth * ray));
    const Eigen::Vector3d line = fundamental * Eigen::Vector3d(k.pt.x, k.pt.y, 1);
    const double line_norm = line.head<2>().norm();
    if (line_norm < 1e-12) continue;
    const double just_above_norm = line_norm * (1 + 1e-9);
    // Walk along the segment in steps, so that only features near the line are looked at.
    const double length = std::min((a - b).norm(), double(camera.width));
    const int steps = std::max(1, static_cast<int>(std::ceil(length / 24.0)));
    const Eigen::Vector2d direction = (a - b).normalized();
    const std::uint8_t* const descriptor = first.features->Descriptor(static_cast<int>(i));
    Best best;
    int last_seen = -1;
    for (int s = 0; s <= steps; ++s) {
      const Eigen::Vector2d p = b + direction * (length * s / steps);
      if (!p.allFinite() || !camera.Contains(p, -20)) continue;
      second.features->ForEachInArea(
          cv::Point2f(static_cast<float>(p.x()), static_cast<float>(p.y())), 14.0F, k.octave - 1,
          k.octave + 1, [&](const cv::Point2f& q, int octave, int f) {
            // The cheapest test that most fail comes first.
            const double sigma = map.scales()[static_cast<std::size_t>(octave)];
            const double off = std::abs(line.dot(Eigen::Vector3d(q.x, q.y, 1)));
            if (off > 1.96 * sigma * just_above_norm) return;  // most, without a division
            if (off / line_norm > 1.96 * sigma) return;
            if (f == last_seen || f == best.feature || second.landmarks[static_cast<std::size_t>(f)] >= 0)
              return;
            if ((Eigen::Vector2d(q.x, q.y) - epipole).squaredNorm() < 100 * sigma)
              return;  // no parallax there
            const int d = HammingDistance(descriptor, second.features->Descriptor(f));
            if (d <= kStrictDistance) best.Offer(d, f, 0);
            last_seen = f;
          });
    }
    if (best.feature < 0) continue;
    const std::size_t j = static_cast<std::size_t>(best.feature);
    if (best.distance < taken[j]) {
      taken[j] = best.distance;
      source[j] = static_cast<int>(i);
    }
  }
  std::vector<std::pair<int, int>> matches;
  for (std::size_t j = 0; j < source.size(); ++j) {
    if (source[j] >= 0) matches.emplace_back(source[j], static_cast<int>(j));
  }
  std::vector<char> drop(matches.size(), 0);
  KeepConsistentOrientation(
      matches.size(),
      [&](std::size_t m) {
        return double(first.features->keypoints[static_cast<std::size_t>(matches[m].first)].angle) -
               second.features->keypoints[static_cast<std::size_t>(matches[m].second)].angle;
      },
      [&](std::size_t m) { drop[m] = 1; });
  std::vector<std::pair<int, int>> out;
  for (std::size_t m = 0; m < matches.size(); ++m) {
    if (!drop[m]) out.push_back(matches[m]);
  }
  return out;
}

std::vector<std::pair<int, int>> MatchForFusion(const Map& map, const PinholeCamera& camera,
                                                const Keyframe& keyframe, const std::vector<int>& landmarks,
                                                float largest_error) {
  const Pose T_camera_world = keyframe.T_world_camera.Inverse();
  const Eigen::Vector3d centre = keyframe.T_world_camera.translation;
  std::vector<std::pair<int, int>> out;
  std::vector<int> near;
  for (int id : landmarks) {
    const Landmark& l = map.landmark(id);
    Seen seen;
    if (!l.alive || !Visible(map, camera, T_camera_world, centre, l, &seen)) continue;
    const bool known = std::any_of(l.observations.begin(), l.observations.end(),
                                   [&](const Observation& o) { return o.keyframe == keyframe.id; });
    if (known) continue;
    keyframe.features->InArea(seen.pixel, largest_error * map.scales()[static_cast<std::size_t>(seen.octave)],
                              seen.octave - 1, seen.octave, &near);
    Best best;
    for (int f : near) {
      const cv::KeyPoint& k = keyframe.features->keypoints[static_cast<std::size_t>(f)];
      const cv::Point2f e = k.pt - seen.pixel;
      const float sigma = map.scales()[static_cast<std::size_t>(k.octave)];
      if (e.dot(e) > largest_error * largest_error * sigma * sigma) continue;
      best.Offer(HammingDistance(l.descriptor.data(), keyframe.features->Descriptor(f)), f, k.octave);
    }
    if (best.distance <= kStrictDistance) out.emplace_back(id, best.feature);
  }
  return out;
}

}  // namespace tutti
