#include "apps/slam/map_merge.h"

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include "apps/slam/joining_loops.h"
#include "apps/slam/loop_constraint.h"
#include "apps/slam/loop_reach.h"
#include "apps/slam/map_connection.h"
#include "apps/slam/map_state.h"
#include "frontend/map/append.h"

namespace tutti {
namespace {

// A loop from a place of the map, shown to the other one's detector with frame numbers from `offset` on, to a
// place of that one: turned round, and in the numbers of the merged map.
void TurnRound(std::int64_t offset, std::int64_t first_frame, int first_keyframe,
               MapMerge::Proposal* proposal) {
  Loop& loop = proposal->loop;
  proposal->verification = Reversed(proposal->verification, loop.query - offset);
  std::swap(loop.query, loop.candidate);
  std::swap(loop.query_stamp_s, loop.candidate_stamp_s);
  loop.query += first_frame;
  loop.candidate -= offset;
  std::swap(proposal->query, proposal->candidate);
  proposal->query += first_keyframe;
}

}  // namespace

bool ComesAfter(const MapInfo& map, const MapInfo& other) {
  const auto settings = [](const MapInfo& info) {
    RunConfig config = info.config;
    config.dataset = {};
    return StateOf(config) + StateOf(info.rig);
  };
  if (settings(map) != settings(other)) return false;
  const auto key = [](const MapInfo& i) {
    return std::tuple(i.first_stamp_s, i.last_stamp_s, i.frames, i.keyframes, i.landmarks, i.loops,
                      i.least.norm(), i.most.norm());
  };
  return key(other) < key(map);
}

void MapMerge::Append() {
  places_ = PlacesOf(&map_.loops);
  others_ = PlacesOf(&other_.loops);
  first_frame_ = map_.sessions.NextOffset(map_.odometry.map());
  first_keyframe_ = map_.odometry.map().KeyframeCount();
  first_piece_ = map_.odometry.map().NextPiece();
  Map both = map_.odometry.map();
  tutti::Append(other_.odometry.map(), first_frame_, &both);
  map_.odometry =
      Odometry(map_.odometry, std::move(both), first_frame_ + other_.odometry.LastView().frame_offset);
  map_.sessions.Append(other_.sessions, first_frame_, first_piece_);
  AppendLoops();
}

// The other map's loops count if they are in that map.
void MapMerge::AppendLoops() {
  LoopCloser& loops = map_.loops;
  const LoopCloser& others = other_.loops;
  loops.session_ = first_frame_;
  loops.sessions_.push_back(first_frame_);
  for (const std::int64_t begin : others.sessions_) loops.sessions_.push_back(first_frame_ + begin);
  loops.graph_.Append(first_keyframe_, &others.graph_);
  loops.proof_.reset();
  loops.corrections_ = loops.adjustments_ = 0;
  const std::size_t first_loop = loops.loops_.size();
  for (Loop loop : others.loops_) {
    loop.query += first_frame_;
    loop.candidate += first_frame_;
    loop.since += loops.changes_;
    loop.edge.candidate += first_keyframe_;
    loop.edge.query += first_keyframe_;
    loop.edge.candidate_frame += first_frame_;
    loop.edge.query_frame += first_frame_;
    loop.edge.record += first_loop;
    if (!loop.accepted()) loop.state = LoopState::kRejected;
    loops.loops_.push_back(std::move(loop));
  }
  loops.changes_ += others.changes_;
}

bool MapMerge::Join(std::int64_t frames, std::string* reason) {
  *reason = Close(LoopsBetween(), config_, frames, &map_.loops, map_.odometry);
  map_.loops.Finish(&map_.odometry, frames);
  const Map& map = map_.odometry.map();
  const std::vector<int> ids = map.KeyframeIds();
  const auto joined = std::find_if(std::lower_bound(ids.begin(), ids.end(), first_keyframe_), ids.end(),
                                   [&](int id) { return map.keyframe(id).piece < first_piece_; });
  if (joined == ids.end()) {
    if (reason->empty()) *reason = "the loops between them contradict the maps";
    return false;
  }
  MapConnection(config_, frames, &map_.loops, &map_.odometry).Connect(map.keyframe(*joined).piece);
  return true;
}

std::string MapMerge::Close(const std::vector<Proposal>& proposed, const RunConfig& config,
                            std::int64_t frames, LoopCloser* loops, const Odometry& odometry) {
  LoopCloser& closer = *loops;
  const Map& map = odometry.map();
  std::vector<LoopEdge> edges;
  for (const Proposal& proposal : proposed) {
    closer.loops_.push_back(proposal.loop);
    Loop& loop = closer.loops_.back();
    if (!loop.verified) continue;
    const LoopConstraint constraint =
        closer.Measure(proposal.verification, proposal.candidate, proposal.query, map);
    loop.reason = constraint.reason;
    if (!constraint.usable) continue;
    loop.edge = constraint.edge;
    loop.edge.record = closer.loops_.size() - 1;
    loop.S_candidate_query = loop.edge.S_candidate_query;
    if (closer.OfOneSession(loop.query, loop.candidate))
      loop.reason = WhyImpossible(loop.edge, map, closer.rig_.sensor);
    if (loop.reason.empty()) edges.push_back(loop.edge);
  }
  JoiningLoops joining = ChooseJoiningLoops(edges, PlacesIn(map), closer.Graph(map), config.run);
  const auto differs = [&](std::size_t i, std::size_t j) {
    const auto piece = [&](int keyframe) { return map.keyframe(keyframe).piece; };
    return piece(edges[i].candidate) == piece(edges[j].candidate) &&
           piece(edges[i].query) == piece(edges[j].query) &&
           LoopGate::Independent(edges[i], edges[j], PlacesIn(map));
  };
  std::vector<std::size_t> entering;
  for (const std::size_t i : joining.chosen) {
    const bool one_recording = closer.OfOneSession(edges[i].query_frame, edges[i].candidate_frame);
    const bool proven = !one_recording || std::any_of(joining.chosen.begin(), joining.chosen.end(),
                                                      [&](std::size_t j) { return differs(i, j); });
    if (!proven) joining.reasons[i] = "the loops that agree with it have all seen the same";
    if (proven) entering.push_back(edges[i].record);
  }
  for (std::size_t i = 0; i < edges.size(); ++i) {
    Loop& loop = closer.loops_[edges[i].record];
    loop.reason = joining.reasons[i];
    if (!loop.reason.empty()) closer.Revoke(&loop);
  }
  for (const std::size_t loop : entering) closer.loops_[loop].untied = true;
  if (!entering.empty()) closer.Solve(entering, odometry, frames);
  return joining.reason;
}

// By both detectors, each pair of places once.
std::vector<MapMerge::Proposal> MapMerge::LoopsBetween() {
  std::vector<Proposal> proposals = ProposedByMap();
  for (Proposal& proposal : ProposedByOther()) {
    const auto known = std::find_if(proposals.begin(), proposals.end(), [&proposal](const Proposal& p) {
      return p.candidate == proposal.candidate && p.query == proposal.query;
    });
    if (known == proposals.end()) {
      proposals.push_back(std::move(proposal));
    } else if (proposal.loop.verified && !known->loop.verified) {
      *known = std::move(proposal);
    }
  }
  return proposals;
}

std::vector<MapMerge::Proposal> MapMerge::ProposedByMap() {
  return Compare(
      std::move(others_), first_frame_,
      [&](std::int64_t frame) {
        const int keyframe = other_.loops.KeyframeOf(frame);
        return keyframe >= 0 ? std::optional(ViewOf(map_.odometry.map(), first_keyframe_ + keyframe))
                             : std::nullopt;
      },
      &map_.loops);
}

// The other map's detector is shown the places of this one, as the recording that comes next there.
std::vector<MapMerge::Proposal> MapMerge::ProposedByOther() {
  const std::int64_t offset = other_.sessions.NextOffset(other_.odometry.map());
  int pieces = 0;  // there; those of this map are others
  for (const int id : other_.odometry.map().KeyframeIds())
    pieces = std::max(pieces, other_.odometry.map().keyframe(id).piece + 1);
  other_.loops.BeginSession(map_.rig, offset, other_.odometry.map().KeyframeCount());
  std::vector<Proposal> proposals = Compare(
      std::move(places_), offset,
      [&](std::int64_t frame) -> std::optional<KeyframeView> {
        const int keyframe = map_.loops.KeyframeOf(frame);
        if (keyframe < 0) return std::nullopt;
        KeyframeView view = ViewOf(map_.odometry.map(), keyframe);
        view.map_piece += pieces;
        return view;
      },
      &other_.loops);
  for (Proposal& proposal : proposals) TurnRound(offset, first_frame_, first_keyframe_, &proposal);
  return proposals;
}

std::vector<MapMerge::Proposal> MapMerge::Compare(
    std::vector<LoopPlace> places, std::int64_t first_frame,
    const std::function<std::optional<KeyframeView>(std::int64_t frame)>& view, LoopCloser* loops) {
  loops->worker_->Detector().BeginSession();
  std::vector<Proposal> proposals;
  const auto propose = [&](Loop loop, const Verification& verification) {
    if (loop.candidate >= first_frame) return;  // loops within the other map are known
    const int candidate = loops->KeyframeOf(loop.candidate), query = loops->KeyframeOf(loop.query);
    if (candidate < 0 || query < 0) return;  // of a detector whose file was changed
    proposals.push_back({std::move(loop), verification, candidate, query});
  };
  const auto take = [&] {
    const LoopResult result = loops->TakeResult();
    if (result.late) {
      for (Proposal& proposal : proposals) {
        if (proposal.loop.query != result.late->query || !result.late->withdrawn) continue;
        proposal.loop.verified = false;
        proposal.loop.reason = kTakenBack;
      }
      if (result.late->accepted) propose(loops->Proposed(*result.late), result.late->verification);
    }
    if (result.proposed) propose(loops->Proposed(result), result.verification);
  };
  for (LoopPlace& place : places) {
    const std::optional<KeyframeView> of = view(place.id);
    if (!of) continue;
    LoopQuery query;
    query.metric = loops->rig_.sensor != Sensor::kMono;
    query.id = first_frame + place.id;
    query.stamp_s = of->stamp_s;
    query.member_features = std::move(place.member_features);
    if (place.camera) {  // an earlier session's may be another one than that of the keyframes' pixels
      const PinholeCamera &from = *place.camera, &to = loops->rig_.camera;
      for (auto& [name, features] : query.member_features) {
        for (cv::KeyPoint& k : features.keypoints) {
          k.pt.x = static_cast<float>((double(k.pt.x) - from.cx) / from.fx * to.fx + to.cx);
          k.pt.y = static_cast<float>((double(k.pt.y) - from.cy) / from.fy * to.fy + to.cy);
        }
      }
    }
    loops->Ask(std::move(query), &*of, 0);
    while (loops->submitted_.size() > static_cast<std::size_t>(loops->options_.loop_delay_frames)) take();
  }
  while (!loops->submitted_.empty()) take();
  return proposals;
}

void MapMerge::MoveAll(const std::map<int, Similarity>& S_world_keyframe, LoopCloser* loops,
                       Odometry* odometry) {
  if (loops->worker_) loops->worker_->Detector().ForgetPositions();
  loops->graph_.Update(KeyframesOf(odometry->map()), loops->Covisible(odometry->map()));
  loops->graph_.Move(S_world_keyframe, {});
  loops->Rescale(S_world_keyframe);
  LoopCloser::Update update;
  update.correction.emplace();
  update.correction->S_world_keyframe = S_world_keyframe;
  loops->Take(update, odometry, 0);
}

}  // namespace tutti
