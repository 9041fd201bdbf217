// What of loops and frames goes into a saved map (core/state_archive.h).
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "apps/slam/loop_solver.h"
#include "apps/slam/loop_worker.h"
#include "core/section_file.h"
#include "core/state_archive.h"
#include "frontend/store/opencv_state.h"
#include "tutti/backend/keyframe_graph.h"
#include "tutti/core/imu.h"
#include "tutti/frontend/frame.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/slam/config.h"
#include "tutti/slam/loop.h"
#include "tutti/slam/map_file.h"

namespace tutti {

template <class Archive>
void State(Archive& archive, ImuCalibration& imu) {
  archive(imu.T_camera_imu, imu.time_offset_s, imu.gyro_noise, imu.gyro_random_walk, imu.acceleration_noise,
          imu.acceleration_random_walk);
}

template <class Archive>
void State(Archive& archive, ImuSample& sample) {
  archive(sample.stamp_s, sample.gyro, sample.acceleration);
}

template <class Archive>
void State(Archive& archive, CameraRig& rig) {
  archive(rig.sensor, rig.camera, rig.baseline_m, rig.T_body_camera, rig.rate_hz, rig.max_depth_m,
          rig.readout_s, rig.depth_delay_s, rig.calibrated, rig.imu);
}

template <class Archive>
void State(Archive& archive, RunConfig& config) {
  archive(config.dataset, config.odometry, config.loops, config.graph, config.run);
}

template <class Archive>
void State(Archive& archive, MapSession& s) {
  archive(s.note, s.frame_offset, s.frames, s.last_frame, s.first_piece, s.joined_at, s.keyframes,
          s.first_keyframe, s.last_keyframe, s.first_stamp_s, s.last_stamp_s);
}

template <class Archive>
void State(Archive& archive, MapInfo& i) {
  archive(i.program, i.note, i.config, i.rig, i.frames, i.last_frame, i.first_stamp_s, i.last_stamp_s,
          i.keyframes, i.landmarks, i.pieces, i.loops, i.sessions, i.least, i.most);
}

/// Without its features, which are those of the keyframe that it became.
template <class Archive>
void State(Archive& archive, InputFrame& frame) {
  std::int32_t rows = frame.depth_m.rows, columns = frame.depth_m.cols;
  std::vector<float> depth;
  if constexpr (!Archive::kReading) {
    for (int r = 0; r < rows; ++r)
      depth.insert(depth.end(), frame.depth_m.ptr<float>(r), frame.depth_m.ptr<float>(r) + columns);
  }
  archive(frame.index, frame.stamp_s, frame.image, frame.right, frame.mask, rows, columns, depth, frame.imu);
  if constexpr (Archive::kReading) {
    if (rows < 0 || columns < 0 || std::uint64_t(rows) * std::uint64_t(columns) != depth.size())
      archive.Damaged("a depth image of an impossible size");
    if (!depth.empty()) frame.depth_m = cv::Mat(rows, columns, CV_32FC1, depth.data()).clone();
  }
}

template <class Archive>
void State(Archive& archive, CandidateEvidence& e) {
  archive(e.location, e.score, e.likelihood, e.posterior);
}

template <class Archive>
void State(Archive& archive, MemberOpinion& m) {
  archive(m.name, m.took_part, m.features, m.words, m.hypothesis, m.best, m.weight, m.at_candidate,
          m.posterior_by_location, m.evidence);
}

template <class Archive>
void State(Archive& archive, VerifiedMatch& m) {
  archive(m.query.x, m.query.y, m.candidate.x, m.candidate.y, m.query_feature, m.candidate_feature);
}

template <class Archive>
void State(Archive& archive, Verification& v) {
  archive(v.candidate, v.similar, v.accepted, v.type, v.S_candidate_query, v.information, v.homography,
          v.matches, v.inliers, v.coverage, v.expected_inliers, v.log_nfa, v.motion_spread, v.mass, v.reason,
          v.inlier_matches);
}

template <class Archive>
void State(Archive& archive, LateLoop& l) {
  archive(l.query, l.accepted, l.withdrawn, l.probability, l.verification);
}

template <class Archive>
void State(Archive& archive, LoopResult& r) {
  archive(r.query, r.hypothesis, r.candidate, r.best, r.posterior, r.probability, r.proposed, r.accepted,
          r.reason, r.members, r.verification, r.tried, r.late, r.posterior_by_location, r.evidence,
          r.retrieved, r.transferred, r.warning, r.extract_ms, r.quantise_ms, r.likelihood_ms, r.filter_ms,
          r.verify_ms, r.memory_ms);
}

/// All but the detector's sections.
template <class Archive>
void State(Archive& archive, LoopWorker::Saved& s) {
  archive(s.results, s.unlinked, s.waited_ms);
}

template <class Archive>
void State(Archive& archive, LoopEdge& e) {
  archive(e.candidate, e.query, e.candidate_frame, e.query_frame, e.S_candidate_query, e.information, e.depth,
          e.record);
}

template <class Archive>
void State(Archive& archive, Loop& r) {
  archive(r.query, r.candidate, r.query_stamp_s, r.candidate_stamp_s, r.members, r.hypothesis, r.posterior,
          r.probability, r.matches, r.inliers, r.verified, r.state, r.injected, r.weight, r.gate_sigmas,
          r.revoked, r.correct, r.reason, r.witness, r.S_candidate_query, r.edge, r.untied, r.since);
}

template <class Archive>
void State(Archive& archive, EdgeOutcome& e) {
  archive(e.chi2, e.weight, e.down_weighted);
}

template <class Archive>
void State(Archive& archive, KeyframeCorrection& c) {
  archive(c.success, c.reason, c.S_world_keyframe, c.merges, c.loops);
}

template <class Archive>
void State(Archive& archive, StartOutcome& s) {
  archive(s.start, s.initial_objective, s.objective, s.spared);
}

template <class Archive>
void State(Archive& archive, Certificate& c) {
  archive(c.available, c.certified, c.reason, c.chordal, c.lower_bound, c.relative_gap,
          c.min_eigenvalue_bound, c.time_s);
}

template <class Archive>
void State(Archive& archive, KeyframeGraphProof& p) {
  archive(p.starts, p.best, p.better, p.correction, p.certificate);
}

template <class Archive>
void State(Archive& archive, LoopVerdict& v) {
  archive(v.loop, v.reason, v.contradicted, v.weight, v.gate_sigmas);
}

template <class Archive>
void State(Archive& archive, LoopSolution& s) {
  archive(s.verdicts, s.moves, s.correction, s.proof, s.time_ms);
}

/// A value as a section of its own.
template <class T>
std::string StateOf(const T& value) {
  internal::SharedObjectsOut shared;
  internal::StateWriter out(&shared);
  out(value);
  return out.Take();
}

/// The value that the next section of a file holds. Throws InputError.
template <class T, class Tag>
void ReadState(internal::SectionReader& file, Tag tag, T* value) {
  const std::string bytes = file.Expect(tag);
  internal::SharedObjectsIn shared;
  internal::StateReader in(bytes, file.name(), &shared);
  in(*value);
  in.ExpectEnd();
}

}  // namespace tutti
