// What becomes of loops, in their records: the bookkeeping of LoopCloser.
#include <algorithm>
#include <string>

#include "apps/slam/loop_closer.h"
#include "loopclosure/detector/hypothesis_search.h"

namespace tutti {
namespace {

// With fewer inliers the place is mostly right, but the motion is not: it is off by 6 degrees and more, where
// by 2 with 30.
constexpr int kFewestInliers = 20;
// Below this, what geometry lets pass is wrong as often as right; with a verified loop that agrees with it
// within centimetres and a degree, that is evidence enough.
constexpr double kLeastProbability = 0.3;

}  // namespace

void LoopCloser::Check(int end, const internal::SectionReader& file) const {
  for (const auto* loops : {&accepted_, &deferred_, &queued_, &gate_.waiting()}) {
    for (const LoopEdge& loop : *loops) {
      internal::CheckIndex(loop.candidate, 0, end, file);
      internal::CheckIndex(loop.query, 0, end, file);
      if (loop.record >= records_.size()) file.Damaged("a loop that is not listed");
    }
  }
  for (const MapKeyframe& keyframe : solved_keyframes_) internal::CheckIndex(keyframe.id, 0, end, file);
  for (const std::size_t record : untied_) {
    if (record >= records_.size()) file.Damaged("a loop that is not listed");
  }
}

void LoopCloser::BeginSession(const CameraRig& rig, std::int64_t first_frame, int first_keyframe) {
  rig_ = rig;
  sessions_.push_back(first_frame);
  graph_.BeginSession(first_keyframe);
  proof_.reset();
  corrections_ = adjustments_ = 0;
  stages_.clear();
}

void LoopCloser::Append(const LoopCloser& other, std::int64_t first_frame, int first_keyframe) {
  BeginSession(rig_, first_frame, first_keyframe);
  graph_.Append(other.graph_, first_keyframe);
  for (const std::int64_t begin : other.sessions_) sessions_.push_back(first_frame + begin);
  const std::size_t first_record = records_.size();
  for (LoopRecord record : other.records_) {
    record.query += first_frame;
    record.candidate += first_frame;
    records_.push_back(std::move(record));
  }
  for (LoopEdge loop : other.accepted_) {
    loop.candidate += first_keyframe;
    loop.query += first_keyframe;
    loop.candidate_frame += first_frame;
    loop.query_frame += first_frame;
    loop.record += first_record;
    accepted_.push_back(loop);
  }
  for (const std::size_t record : other.untied_) untied_.insert(first_record + record);
}

// Time stamps of different recordings do not compare.
bool LoopCloser::OfOneSession(std::int64_t frame, std::int64_t other) const {
  const auto session = [this](std::int64_t f) {
    return std::upper_bound(sessions_.begin(), sessions_.end(), f) - sessions_.begin();
  };
  return session(frame) == session(other);
}

// What the detector does not believe, though geometry does, or would with a few more inliers.
bool LoopCloser::IsWitness(const LoopRecord& record, const Verification& verification) const {
  if (verification.accepted) return record.probability >= kLeastProbability;
  if (verification.type == ConstraintType::kNone || verification.inliers < kFewestInliers) return false;
  const bool rigid = verification.type == ConstraintType::kRigid || verification.homography;
  const VerificationOptions& bars = detector_.verification;
  // Geometry refuses more of them for another reason than their number.
  if (verification.inliers >= (rigid ? bars.min_inliers : bars.min_epipolar_inliers)) return false;
  return internal::LoopProbability(verification) >= kLeastProbability;
}

// The newest came last, and agrees with the witness; the others agree with it.
void LoopCloser::NoteWitnesses(const LoopGate::Admitted& admitted) {
  const auto of = [](const LoopEdge& loop) {
    return "the loop of frame " + std::to_string(loop.query_frame);
  };
  const LoopEdge& newest = admitted.loops.back();
  for (const LoopEdge& loop : admitted.loops) {
    std::string& witness = records_[loop.record].witness;
    if (loop.record != newest.record) {
      witness = of(newest);
    } else if (admitted.witness) {
      witness = of(*admitted.witness);
    } else if (options_.loop_confirmations > 1 || !records_[loop.record].verified) {
      witness = "the map";
    }
  }
}

void LoopCloser::Withdraw(std::int64_t query_frame, const std::string& reason, bool has_graph) {
  gate_.Withdraw(query_frame);
  for (LoopRecord& record : records_) {
    if (record.query != query_frame || !(record.pending || (record.accepted && !has_graph))) continue;
    record.pending = record.accepted = record.verified = false;
    record.reason = reason;
  }
}

// Into the map, or out.
void LoopCloser::Settle(const LoopVerdict& verdict, LoopUpdate* update) {
  LoopRecord& record = records_[verdict.loop.record];
  record.pending = false;
  record.reason = verdict.reason;
  record.weight = verdict.weight;
  record.gate_sigmas = verdict.gate_sigmas;
  record.accepted = verdict.reason.empty();
  if (record.accepted) {
    accepted_.push_back(verdict.loop);
  } else {
    untied_.erase(verdict.loop.record);
    if (verdict.contradicted) Revoke(verdict.loop.record, update);
  }
}

void LoopCloser::Revoke(std::size_t record, LoopUpdate* update) {
  if (records_[record].injected || records_[record].revoked) return;
  records_[record].revoked = true;
  update->revoked.push_back(record);
}

void LoopCloser::Finish() {
  for (LoopRecord& record : records_) {
    if (!record.pending) continue;
    record.pending = false;
    record.reason = record.verified ? "no second loop nearby agreed with it"
                                    : "no verified loop nearby agreed with it, and by itself it is doubtful";
  }
}

}  // namespace tutti
