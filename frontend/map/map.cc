#include "frontend/map/map.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

#include "core/numbers.h"
#include "frontend/map/patch_aligner.h"

namespace tutti {

int Map::AddKeyframe(Keyframe keyframe) {
  keyframe.id = static_cast<int>(keyframes_.size());
  keyframe.landmarks.assign(keyframe.features->size(), -1);
  keyframe.covisible.clear();
  return keyframes_.Append(std::move(keyframe)).id;
}

int Map::AddLandmark(const Eigen::Vector3d& position, int keyframe, int feature) {
  const int id = landmarks_.size();
  Landmark l;
  l.alive = true;
  l.position = position;
  l.reference = keyframe;
  l.visible = l.found = 1;
  if (camera_) l.patch = CutPatch(*camera_, *std::as_const(*this).keyframe(keyframe).features, feature);
  l.patch_source = {keyframe, feature};
  landmarks_.Append(std::move(l));
  AddObservation(id, keyframe, feature);
  return id;
}

void Map::AddObservation(int landmark_id, int keyframe_id, int feature) {
  Landmark& l = landmark(landmark_id);
  Keyframe& k = keyframe(keyframe_id);
  for (const Observation& o : l.observations) {
    if (o.keyframe == keyframe_id) return;  // one keyframe sees a landmark once
  }
  for (const Observation& o : l.observations) {
    ++k.covisible[o.keyframe];
    ++keyframe(o.keyframe).covisible[keyframe_id];
  }
  k.landmarks[static_cast<std::size_t>(feature)] = landmark_id;
  const auto place = std::upper_bound(l.observations.begin(), l.observations.end(), keyframe_id,
                                      [](int id, const Observation& o) { return id < o.keyframe; });
  l.observations.insert(place, {keyframe_id, feature});
}

void Map::RemoveObservation(int landmark_id, int keyframe_id) {
  Landmark& l = landmark(landmark_id);
  const auto at = std::find_if(l.observations.begin(), l.observations.end(),
                               [&](const Observation& o) { return o.keyframe == keyframe_id; });
  if (at == l.observations.end()) return;
  Keyframe& k = keyframe(keyframe_id);
  k.landmarks[static_cast<std::size_t>(at->feature)] = -1;
  l.observations.erase(at);
  const auto decrease = [](std::map<int, int>& counts, int id) {
    const auto it = counts.find(id);
    if (it != counts.end() && --it->second <= 0) counts.erase(it);
  };
  for (const Observation& o : l.observations) {
    decrease(k.covisible, o.keyframe);
    decrease(keyframe(o.keyframe).covisible, keyframe_id);
  }
  if (l.observations.empty()) {
    l.alive = false;
  } else if (l.reference == keyframe_id) {
    l.reference = l.observations.front().keyframe;
  }
}

void Map::RemoveLandmark(int landmark_id) {
  while (!landmark(landmark_id).observations.empty()) {
    RemoveObservation(landmark_id, landmark(landmark_id).observations.back().keyframe);
  }
  Landmark& l = landmark(landmark_id);
  l.alive = false;
  l.observations.shrink_to_fit();
  l.patch.reset();
}

void Map::RemoveKeyframe(int id, int into, std::size_t least_views) {
  const std::vector<int> seen = std::as_const(*this).keyframe(id).landmarks;
  for (const int l : seen) {
    if (l < 0) continue;
    RemoveObservation(l, id);
    if (std::as_const(*this).landmark(l).observations.size() < least_views) RemoveLandmark(l);
  }
  Keyframe& k = keyframe(id);
  k.features = std::make_shared<const FrameFeatures>();
  k.landmarks.clear();
  k.covisible.clear();
  k.replaced_by = into;
}

int Map::PresentKeyframe(int id) const {
  while (keyframe(id).replaced_by >= 0) id = keyframe(id).replaced_by;
  return id;
}

void Map::Merge(int loser, int winner) {
  if (loser == winner) return;
  const std::vector<Observation> seen = landmark(loser).observations;
  const int visible = landmark(loser).visible, found = landmark(loser).found;
  RemoveLandmark(loser);
  landmarks_.SetReplacedBy(loser, winner);
  for (const Observation& o : seen) AddObservation(winner, o.keyframe, o.feature);
  landmark(winner).visible += visible;
  landmark(winner).found += found;
}

namespace {

// Features whose alignment with landmarks is told by other numbers.
std::shared_ptr<const FrameFeatures> Renumbered(const std::shared_ptr<const FrameFeatures>& features,
                                                int landmarks) {
  const auto is_landmark = [](int id) { return id >= 0; };
  if (std::none_of(features->aligned.begin(), features->aligned.end(), is_landmark)) return features;
  auto renumbered = std::make_shared<FrameFeatures>(*features);
  for (int& id : renumbered->aligned) id += id >= 0 ? landmarks : 0;
  return renumbered;
}

}  // namespace

void Map::Append(const Map& other, std::int64_t frame_offset, int first_piece) {
  const int keyframes = KeyframeCount(), landmarks = LandmarkCount();
  for (int id = 0; id < other.KeyframeCount(); ++id) {
    Keyframe k = other.keyframe(id);
    k.id += keyframes;
    k.frame_index += frame_offset;
    k.piece += first_piece;
    if (k.replaced_by >= 0) k.replaced_by += keyframes;
    k.features = Renumbered(k.features, landmarks);
    for (int& l : k.landmarks) l += l >= 0 ? landmarks : 0;
    std::map<int, int> covisible;
    for (const auto& [neighbour, shared] : k.covisible) covisible[neighbour + keyframes] = shared;
    k.covisible = std::move(covisible);
    keyframes_.Append(std::move(k));
  }
  for (int id = 0; id < other.LandmarkCount(); ++id) {
    Landmark l = other.landmark(id);
    for (Observation& o : l.observations) o.keyframe += keyframes;
    if (l.reference >= 0) l.reference += keyframes;
    if (l.patch_source.keyframe >= 0) l.patch_source.keyframe += keyframes;
    const int replaced_by = other.ReplacedBy(id);
    landmarks_.Append(std::move(l), replaced_by >= 0 ? replaced_by + landmarks : -1);
  }
}

int Map::Present(int id) const {
  while (id >= 0 && !landmark(id).alive) id = ReplacedBy(id);
  return id;
}

namespace {
// Whether the landmark's patch was cut out of this very view.
bool HasItsPatchFrom(const Landmark& l, int keyframe, int feature) {
  return l.patch && l.patch_source.keyframe == keyframe && l.patch_source.feature == feature;
}
}  // namespace

double Map::RelativeSigma(const FrameFeatures& features, int keyframe, int feature, int id) const {
  const std::size_t f = static_cast<std::size_t>(feature);
  const double corner = scales_[static_cast<std::size_t>(features.keypoints[f].octave)];
  const Landmark& l = landmark(id);
  const bool source = HasItsPatchFrom(l, keyframe, feature);
  const bool aligned = f < features.aligned.size() && features.aligned[f] == id;
  return source || aligned ? aligned_sigma_ * corner : corner;
}

bool Map::Doubtful(const Observation& view, int id) const {
  const Landmark& l = landmark(id);
  if (!l.patch || HasItsPatchFrom(l, view.keyframe, view.feature)) return false;
  const std::vector<int>& aligned = keyframe(view.keyframe).features->aligned;
  const std::size_t f = static_cast<std::size_t>(view.feature);
  return f >= aligned.size() || aligned[f] < 0;
}

void Map::UpdateGeometry(int id) {
  const auto keyframe = [this](int k) -> const Keyframe& { return std::as_const(*this).keyframe(k); };
  Landmark& l = landmark(id);
  if (!l.alive || l.observations.empty()) return;
  l.normal.setZero();
  for (const Observation& o : l.observations) {
    l.normal += (l.position - keyframe(o.keyframe).T_world_camera.translation).normalized();
  }
  l.normal.normalize();
  const auto reference = std::find_if(l.observations.begin(), l.observations.end(),
                                      [&](const Observation& o) { return o.keyframe == l.reference; });
  const Observation& r = reference != l.observations.end() ? *reference : l.observations.front();
  const Keyframe& k = keyframe(r.keyframe);
  const int octave = k.features->keypoints[static_cast<std::size_t>(r.feature)].octave;
  const double distance = (l.position - k.T_world_camera.translation).norm();
  l.max_distance = static_cast<float>(distance * scales_[static_cast<std::size_t>(octave)]);
  l.min_distance = l.max_distance / scales_.back();
}

void Map::UpdateGeometry() {
  for (int l = 0; l < LandmarkCount(); ++l) {
    if (std::as_const(*this).landmark(l).alive) UpdateGeometry(l);
  }
}

void Map::UpdateLandmark(int id) {
  UpdateGeometry(id);
  const auto keyframe = [this](int k) -> const Keyframe& { return std::as_const(*this).keyframe(k); };
  Landmark& l = landmark(id);
  if (!l.alive || l.observations.empty()) return;
  // The descriptor with the least median distance to the others; more than the newest dozen teach nothing
  // new.
  const std::size_t first = l.observations.size() > 12 ? l.observations.size() - 12 : 0;
  int best_median = std::numeric_limits<int>::max();
  const std::uint8_t* best = nullptr;
  const auto descriptor = [&](std::size_t i) {
    return keyframe(l.observations[i].keyframe).features->Descriptor(l.observations[i].feature);
  };
  for (std::size_t i = first; i < l.observations.size(); ++i) {
    std::vector<int> distances;
    for (std::size_t j = first; j < l.observations.size(); ++j)
      distances.push_back(HammingDistance(descriptor(i), descriptor(j)));
    std::nth_element(distances.begin(),
                     distances.begin() + static_cast<std::ptrdiff_t>((distances.size() - 1) / 2),
                     distances.end());
    const int median = distances[(distances.size() - 1) / 2];
    if (median < best_median) {
      best_median = median;
      best = descriptor(i);
    }
  }
  std::memcpy(l.descriptor.data(), best, 32);
}

std::vector<int> Map::BestCovisible(int id, int count, int min_shared) const {
  std::vector<std::pair<int, int>> order;
  for (const auto& [other, shared] : keyframe(id).covisible) {
    if (shared >= min_shared) order.emplace_back(-shared, -other);
  }
  std::sort(order.begin(), order.end());
  std::vector<int> out;
  for (const auto& [shared, other] : order) {
    if (static_cast<int>(out.size()) >= count) break;
    out.push_back(-other);
  }
  return out;
}

std::vector<int> Map::LandmarksOf(const std::vector<int>& keyframes) const {
  constexpr std::size_t kBits = 64;
  std::vector<std::uint64_t> seen;  // a bit for each landmark: much faster than to sort the many
  std::size_t count = 0;
  for (int id : keyframes) {
    for (int l : keyframe(id).landmarks) {
      if (l < 0) continue;
      const auto bit = static_cast<std::size_t>(l);
      if (bit / kBits >= seen.size()) seen.resize(bit / kBits + 1, 0);
      seen[bit / kBits] |= std::uint64_t{1} << (bit % kBits);
      ++count;
    }
  }
  std::vector<int> out;
  out.reserve(count);
  for (std::size_t word = 0; word < seen.size(); ++word) {
    for (std::uint64_t bits = seen[word]; bits != 0; bits &= bits - 1) {
      out.push_back(static_cast<int>(word * kBits) + __builtin_ctzll(bits));
    }
  }
  return out;
}

double Map::MedianDepth(int id) const {
  const Keyframe& k = keyframe(id);
  const Pose T_camera_world = k.T_world_camera.Inverse();
  std::vector<double> depths;
  for (int l : k.landmarks) {
    if (l >= 0) depths.push_back((T_camera_world * landmark(l).position).z());
  }
  return internal::Median(std::move(depths));
}

}  // namespace tutti
