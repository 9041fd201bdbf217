#include "apps/slam/submap_joiner.h"

#include <algorithm>
#include <map>
#include <opencv2/features2d.hpp>
#include <utility>

#include "apps/slam/landmark_matches.h"

namespace tutti {
namespace {

constexpr int kQueries = 40;          // keyframes of a submap that are compared, evenly chosen
constexpr int kSampled = 96;          // landmarks of a query that choose its candidates
constexpr int kNearBits = 40;         // bits: two descriptors that are nearer are the same landmark's, likely
constexpr double kRatio = 0.8;        // and the second nearest is that much farther
constexpr int kLeastVotes = 4;        // of the sampled landmarks
constexpr std::size_t kCompared = 6;  // of a query, those with the most votes
constexpr int kSurelyFound = 20;      // of a loop between submaps, as LoopCloser asks of a witness

}  // namespace

// A keyframe, and the descriptors of its landmarks.
struct SubmapJoiner::View {
  KeyframeView keyframe;
  cv::Mat descriptors;  // of its landmarks, N x 32
};

void SubmapJoiner::Join() {
  const std::vector<MapMerge::Proposal> proposals = Search();
  if (proposals.empty()) return;
  MapMerge::Close(proposals, config_, frames_, &loops_, odometry_);
  loops_.Finish(&odometry_, frames_);
}

std::vector<MapMerge::Proposal> SubmapJoiner::Search() const {
  const Map& map = odometry_.map();
  const std::vector<int> keyframes = map.KeyframeIds();
  const auto elsewhere = [&](int id) { return map.keyframe(id).piece != map.keyframe(keyframes[0]).piece; };
  if (std::none_of(keyframes.begin(), keyframes.end(), elsewhere)) return {};  // the usual case
  std::vector<View> views;
  std::map<int, std::vector<std::size_t>> of_piece;
  for (const int id : keyframes) {
    View view{ViewOf(map, id), {}};
    for (int f = 0; f < view.keyframe.descriptors.rows; ++f) {
      if (view.keyframe.points[static_cast<std::size_t>(f)].allFinite())
        view.descriptors.push_back(view.keyframe.descriptors.row(f));
    }
    of_piece[view.keyframe.map_piece].push_back(views.size());
    views.push_back(std::move(view));
  }
  std::vector<MapMerge::Proposal> proposals;
  for (auto piece = std::next(of_piece.begin()); piece != of_piece.end(); ++piece) {
    const std::vector<std::size_t>& ids = piece->second;
    const std::size_t count = std::min<std::size_t>(ids.size(), kQueries);
    for (std::size_t i = 0; i < count; ++i) {
      const View& query = views[ids[i * ids.size() / count]];
      for (const View* other : AlikeTo(query, views)) {
        // A loop leads from an older keyframe to a newer one.
        const bool newer = query.keyframe.id > other->keyframe.id;
        const KeyframeView &b = newer ? query.keyframe : other->keyframe,
                           &a = newer ? other->keyframe : query.keyframe;
        MapMerge::Proposal proposal;
        proposal.verification = VerifyLandmarks(a, b, map.rig(), config_.loops);
        if (!proposal.verification.accepted || proposal.verification.inliers < kSurelyFound) continue;
        proposal.candidate = a.id;
        proposal.query = b.id;
        Loop& loop = proposal.loop;
        loop.query = b.frame_index;
        loop.candidate = a.frame_index;
        loop.query_stamp_s = b.stamp_s;
        loop.candidate_stamp_s = a.stamp_s;
        loop.matches = proposal.verification.matches;
        loop.inliers = proposal.verification.inliers;
        loop.verified = true;
        proposals.push_back(std::move(proposal));
      }
    }
  }
  return proposals;
}

// Keyframes of older submaps in which most of the query's landmarks seem to be seen, by descriptors alone.
std::vector<const SubmapJoiner::View*> SubmapJoiner::AlikeTo(const View& query,
                                                             const std::vector<View>& views) const {
  cv::Mat sampled;
  const int rows = query.descriptors.rows, count = std::min(rows, kSampled);
  for (int i = 0; i < count; ++i) sampled.push_back(query.descriptors.row(i * rows / count));
  std::vector<std::pair<int, const View*>> ranked;
  for (const View& other : views) {
    if (other.keyframe.map_piece >= query.keyframe.map_piece || other.descriptors.rows < 2 || count == 0 ||
        !loops_.OfOneSession(query.keyframe.frame_index, other.keyframe.frame_index))
      continue;
    std::vector<std::vector<cv::DMatch>> nearest;
    cv::BFMatcher(cv::NORM_HAMMING).knnMatch(sampled, other.descriptors, nearest, 2);
    const auto votes = std::count_if(nearest.begin(), nearest.end(), [](const std::vector<cv::DMatch>& two) {
      return two.size() == 2 && two[0].distance < kNearBits && two[0].distance < kRatio * two[1].distance;
    });
    if (votes >= kLeastVotes) ranked.emplace_back(-static_cast<int>(votes), &other);
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  if (ranked.size() > kCompared) ranked.resize(kCompared);
  std::vector<const View*> alike;
  for (const auto& [votes, view] : ranked) alike.push_back(view);
  return alike;
}

}  // namespace tutti
