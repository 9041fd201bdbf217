#include "tutti/frontend/map.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

#include "core/numbers.h"
#include "frontend/features/features.h"
#include "frontend/map/patch_aligner.h"

namespace tutti {

Landmark& LandmarkStore::Append(Landmark landmark, int replaced_by) {
  const std::size_t c = ChunkOf(size_), place = PlaceOf(size_);
  if (place == 0) {
    chunks_.push_back(std::make_shared<Chunk>());
    chunks_.back()->at.fill(-1);
    chunks_.back()->landmarks.reserve(kChunk);
  }
  Chunk& chunk = Own(c);
  ++size_;
  chunk.replaced_by[place] = replaced_by;
  if (!landmark.alive) return gone_ = {};
  chunk.at[place] = static_cast<std::int16_t>(chunk.landmarks.size());
  return chunk.landmarks.emplace_back(std::move(landmark));
}

void LandmarkStore::Copy(std::size_t c) {
  auto copy = std::make_shared<Chunk>();
  copy->at = chunks_[c]->at;
  copy->replaced_by = chunks_[c]->replaced_by;
  if (c + 1 == chunks_.size()) copy->landmarks.reserve(kChunk);  // references stay good while it grows
  copy->landmarks.insert(copy->landmarks.end(), chunks_[c]->landmarks.begin(), chunks_[c]->landmarks.end());
  chunks_[c] = std::move(copy);
}

void LandmarkStore::Compact() {
  const auto is_alive = [](const Landmark& landmark) { return landmark.alive; };
  for (std::size_t c = 0; (c + 1) * kChunk <= static_cast<std::size_t>(size_); ++c) {  // the last one grows
    const std::vector<Landmark>& before = chunks_[c]->landmarks;
    const auto alive = std::count_if(before.begin(), before.end(), is_alive);
    if (static_cast<std::size_t>(alive) == before.size()) continue;
    auto kept = std::make_shared<Chunk>();
    kept->at.fill(-1);
    kept->replaced_by = chunks_[c]->replaced_by;
    kept->landmarks.reserve(static_cast<std::size_t>(alive));
    for (std::size_t place = 0; place < kChunk; ++place) {
      const int at = chunks_[c]->at[place];
      if (at < 0 || !before[static_cast<std::size_t>(at)].alive) continue;
      kept->at[place] = static_cast<std::int16_t>(kept->landmarks.size());
      kept->landmarks.push_back(before[static_cast<std::size_t>(at)]);
    }
    chunks_[c] = std::move(kept);
  }
}

std::vector<int> Map::KeyframeIds() const {
  std::vector<int> ids;
  ids.reserve(keyframes_.size());
  for (int id = 0; id < KeyframeCount(); ++id) {
    if (keyframe(id).replaced_by < 0) ids.push_back(id);
  }
  return ids;
}

std::vector<int> Map::LandmarkIds() const {
  std::vector<int> ids;
  for (int id = 0; id < LandmarkCount(); ++id) {
    if (landmark(id).alive) ids.push_back(id);
  }
  return ids;
}

int Map::AddKeyframe(Keyframe keyframe) {
  next_piece_ = std::max(next_piece_, keyframe.piece + 1);
  keyframe.id = static_cast<int>(keyframes_.size());
  keyframe.landmarks.assign(keyframe.features->size(), -1);
  keyframe.covisible.clear();
  return keyframes_.Append(std::move(keyframe)).id;
}

void Map::Restore(Keyframe keyframe) {
  next_piece_ = std::max(next_piece_, keyframe.piece + 1);
  keyframes_.Append(std::move(keyframe));
}

void Map::AddFrame(std::int64_t index, double stamp_s, int id, const Pose& T_camera_world, bool goes_on) {
  const auto keyframe = [this](int k) -> const Keyframe& { return std::as_const(*this).keyframe(k); };
  const auto hung_on = [&](int k) { return keyframe(k).T_world_camera.Inverse() * T_camera_world.Inverse(); };
  MapFrame frame{index, stamp_s, id, hung_on(id), -1, {}};
  const int before = goes_on && frames_.size() > 0 ? frames_[frames_.size() - 1].keyframe : id;
  if (before != id && keyframe(before).piece == keyframe(id).piece) {
    frame.before = before;
    frame.T_before_frame = hung_on(before);
  }
  frames_.Append(frame);
}

int Map::AddLandmark(const Eigen::Vector3d& position, int keyframe, int feature) {
  const int id = landmarks_.size();
  Landmark l;
  l.alive = true;
  l.position = position;
  l.reference = keyframe;
  l.visible = l.found = 1;
  if (rig_) l.patch = CutPatch(rig_->camera, *std::as_const(*this).keyframe(keyframe).features, feature);
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

void Map::ReplaceLandmark(int loser, int winner) {
  if (loser == winner) return;
  const std::vector<Observation> seen = landmark(loser).observations;
  const int visible = landmark(loser).visible, found = landmark(loser).found;
  RemoveLandmark(loser);
  landmarks_.SetReplacedBy(loser, winner);
  for (const Observation& o : seen) AddObservation(winner, o.keyframe, o.feature);
  landmark(winner).visible += visible;
  landmark(winner).found += found;
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

std::vector<std::pair<std::pair<int, int>, int>> Covisibility(const Map& map, int min_shared) {
  std::vector<std::pair<std::pair<int, int>, int>> out;
  for (int id = 0; id < map.KeyframeCount(); ++id) {
    for (const auto& [other, shared] : map.keyframe(id).covisible) {
      if (other > id && shared >= min_shared) out.push_back({{id, other}, shared});
    }
  }
  return out;
}

KeyframeView ViewOf(const Map& map, int id) {
  const Keyframe& k = map.keyframe(id);
  KeyframeView view;
  view.id = id;
  view.frame_index = k.frame_index;
  view.stamp_s = k.stamp_s;
  view.map_piece = k.piece;
  view.T_world_camera = k.T_world_camera;
  view.keypoints = k.features->keypoints;
  view.descriptors = k.features->descriptors;
  view.landmarks = k.landmarks;
  view.inverse_depth = k.features->inverse_depth;
  view.inverse_depth_sigma = k.features->inverse_depth_sigma;
  const Pose T_camera_world = k.T_world_camera.Inverse();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  view.points.assign(k.features->size(), Eigen::Vector3d::Constant(nan));
  for (std::size_t f = 0; f < k.features->size(); ++f) {
    const float inverse = k.features->inverse_depth[f];
    if (k.landmarks[f] >= 0) {
      const Eigen::Vector3d p = T_camera_world * map.landmark(k.landmarks[f]).position;
      if (p.z() > 0) view.points[f] = p;
    } else if (inverse > 0 && k.features->inverse_depth_sigma[f] < 0.1F * inverse) {
      const cv::Point2f& p = k.features->keypoints[f].pt;
      view.points[f] = map.rig().camera.Unproject({p.x, p.y}) / double(inverse);
    }
  }
  return view;
}

}  // namespace tutti
