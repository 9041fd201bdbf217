// The pose graph of a map's keyframes: what a SLAM pipeline needs for each accepted loop.
//
//   KeyframeGraphOptions options;  options.kind = GraphKind::kSim3;  // mono
//   KeyframeGraph graph(options);
//   graph.Update(keyframes, covisible);                              // the map as it is now
//   const KeyframeCorrection correction = graph.Optimize(loops);
//   graph.Move(correction.S_world_keyframe, correction.merges);      // and so does the map
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tutti/backend/certificate.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)
namespace tutti {

/// A keyframe as the map has it now.
struct MapKeyframe {
  int id = -1;
  int piece = 0;  ///< keyframes of different map pieces have no common frame of reference
  Pose T_world_keyframe;
  template <class Archive>
  void State(Archive& archive) {
    archive(id, piece, T_world_keyframe);
  }
};

/// Two keyframes that see the same landmarks.
struct CovisiblePair {
  int older = -1, newer = -1;
  int shared = 0;  ///< how many
};

/// A loop as an edge between two keyframes.
struct LoopEdge {
  int candidate = -1;                ///< keyframe id, the older one
  int query = -1;                    ///< keyframe id, the newer one (until Rehang)
  std::int64_t candidate_frame = 0;  ///< input frames that it was found between
  std::int64_t query_frame = 0;
  Similarity S_candidate_query;                 ///< maps points of the query camera into the candidate camera
  Matrix7d information = Matrix7d::Identity();  ///< of (translation, rotation, log scale)
  double depth = 1;        ///< median scene depth in the candidate's keyframe [m, mono: map units]
  std::size_t record = 0;  ///< the caller's number of it, e.g. of its line in a list
};

struct KeyframeGraphOptions {
  GraphKind kind = GraphKind::kSE3;        ///< kSE3: stereo, RGB-D; kSim3: mono
  PoseGraphOptions solver;                 ///< init should stay kFile: the odometry is the start
  double sigma_translation_ratio = 0.02;   ///< odometry error as a fraction of the distance moved [1]
  double sigma_translation_floor = 0.002;  ///< plus this fraction of the mean distance of an edge [1]
  double sigma_rotation_rad = 0.005;       ///< odometry's rotation error per edge [rad]
  double sigma_log_scale = 0.01;           ///< mono: drift of log scale per edge [1]
  int max_covisible = 3;                   ///< most covisibility edges of a keyframe to older ones
  KeyframeGraphOptions();
  std::string Validate() const;
};

struct KeyframeCorrection {
  bool success = false;
  std::string reason;                          ///< why not
  std::map<int, Similarity> S_world_keyframe;  ///< of every keyframe (scale 1 unless kSim3)
  std::map<int, int> merges;       ///< map pieces that loops joined: piece -> smallest piece of its group
  std::vector<EdgeOutcome> loops;  ///< in their order
};

/// What there is to say of a graph's solution as a whole.
struct KeyframeGraphProof {
  std::vector<StartOutcome> starts;  ///< the map as it is comes first
  GraphStart best = GraphStart::kFile;
  /// Another start leads lower than the map does, by more than rounding and convergence explain.
  bool better = false;
  KeyframeCorrection correction;  ///< from the best start
  Certificate certificate;        ///< of that solution
};

/// Nodes are keyframes; edges are consecutive keyframes, pairs that share many landmarks, and loops.
///
/// An odometry edge is measured from the map as it is, until a correction moves its two keyframes: from then
/// on the old measurement stays, since the corrected poses no longer say what the odometry saw. Mono: a
/// correction also rescales each keyframe's surroundings, so measurements are carried over to the new units
/// (S' = scale(s_a) S scale(1/s_b) for nodes a, b with corrected scales s_a, s_b).
///
/// A value: a copy can be optimised on another thread while the map grows.
class KeyframeGraph {
 public:
  /// Throws InputError if the options are not usable.
  explicit KeyframeGraph(const KeyframeGraphOptions& options = {});

  /// The map as it is now: all keyframes, ascending by id, and which of them see the same landmarks. Two of
  /// them get an odometry edge if they are consecutive, or of the strongest covisible pairs, and were of one
  /// piece when the newer one was new. A piece stays connected: what nothing else ties hangs on its last
  /// keyframe before.
  void Update(std::vector<MapKeyframe> keyframes, const std::vector<CovisiblePair>& covisible = {});

  /// Keyframes from this id on are of another recording, which did not begin where the one before ended: no
  /// odometry connects the two. What the map has become says more of the older ones than what was kept. They
  /// may be those of another map: further recordings begin in it as they do in its graph.
  void Append(int first_keyframe, const KeyframeGraph* other = nullptr);

  /// The graph with these loops; poses as they are in the map. Pieces that loops join are moved into the
  /// frame of the older one.
  PoseGraph Graph(const std::vector<LoopEdge>& loops) const;

  /// Optimises it. The map's poses stay, so that the call can be repeated with other loops.
  KeyframeCorrection Optimize(const std::vector<LoopEdge>& loops) const;

  /// Optimises from each start (the map, the odometry along a spanning tree, chordal), and a certificate of
  /// the best solution, as far as there is one for graphs of this kind. Huber's loss and the like count in
  /// what is the best, the certificate knows least squares alone.
  KeyframeGraphProof Prove(const std::vector<LoopEdge>& loops) const;

  /// Mahalanobis distance [1] of each entering loop from what the graph with the accepted ones knows of its
  /// relative pose; nothing where no edges connect its ends.
  std::vector<std::optional<double>> Distances(const std::vector<LoopEdge>& accepted,
                                               const std::vector<LoopEdge>& entering) const;

  /// Keyframes leave the map, and for each an older one stands: id -> the one that stands for it, which may
  /// leave as well. What was measured to a keyframe that leaves is from then on measured to the other one,
  /// over the edge between the two: uncertainties add up, and what was connected stays so. To be called after
  /// Update with all of them, and before Update without.
  void Remove(const std::map<int, int>& into);
  /// Leads a loop to the keyframes that stand for its ends; to be called before Remove. False if both of its
  /// ends become one keyframe.
  bool Rehang(const std::map<int, int>& into, LoopEdge* loop) const;

  /// To be called after Update and before the map takes these poses: keeps the measurements, in the new
  /// units.
  void Move(const std::map<int, Similarity>& S_world_keyframe, const std::map<int, int>& merges);

  /// Standard deviations of odometry edges, from now on (KeyframeGraphOptions). Throws InputError if they are
  /// not usable.
  void SetSigmas(double translation_ratio, double rotation_rad);
  /// How uncertain the odometry's motion to this keyframe is, since the one that was noted before it;
  /// ascending by id. An edge is at least as uncertain as all such motions between its ends.
  void NoteMotion(int keyframe, const MotionSigma& sigma);
  /// The newest keyframe whose motion was noted; -1: none.
  int LastNoted() const { return walked_.empty() ? -1 : walked_.back().first; }
  /// Nothing is known of the odometry's step to this keyframe: edges across it get no weight but what keeps
  /// the graph in one. Not part of State.
  void NoteJump(int keyframe) { jumps_.insert(keyframe); }
  /// The odometry is wrong at this keyframe alone: its edges get no weight, and the keyframes before and
  /// after it are tied to one another. Not part of State.
  void NoteOutlier(int keyframe) { outliers_.insert(keyframe); }

  /// The map as it is says more than what was kept (a bundle adjustment of all of it): edges are measured
  /// from it again.
  void MeasureAgain() { kept_.clear(); }

  /// All but the options, for saved maps (tutti::slam).
  template <class Archive>
  void State(Archive& archive) {
    archive(keyframes_, births_, merged_, edges_, kept_, carried_, sessions_, walked_);
  }

 private:
  struct Edge {
    int older = -1, newer = -1;
    Similarity S_older_newer;
    int steps = 1;   // edges that it was made of, over keyframes that have left
    double way = 0;  // sum of their lengths, in the older one's units; 0: its own length
    template <class Archive>
    void State(Archive& archive) {
      archive(older, newer, S_older_newer, steps, way);
    }
    double Way() const { return steps > 1 ? way : S_older_newer.translation.norm(); }
  };
  struct Birth {
    int id = -1;
    int piece = 0;  // when it was new
    template <class Archive>
    void State(Archive& archive) {
      archive(id, piece);
    }
  };
  struct Merge {
    int from = 0, to = 0;  // pieces
    int newest = -1;       // keyframe when it happened
    template <class Archive>
    void State(Archive& archive) {
      archive(from, to, newest);
    }
  };
  KeyframeCorrection CorrectionOf(const PoseGraph& graph, const PoseGraphReport& report,
                                  const std::vector<LoopEdge>& loops) const;
  bool OfOnePiece(int older, int newer) const;
  bool Begins(int keyframe) const;
  bool Follows(int older, int newer) const;
  void TieBeginnings();
  std::vector<CovisiblePair> Strongest(const std::vector<CovisiblePair>& covisible) const;
  static const Edge* FindEdge(const std::vector<Edge>& edges, int older, int newer);  // ascending
  Similarity Measured(int older, int newer) const;
  std::map<int, int> Merges(const std::vector<LoopEdge>& loops) const;
  std::map<int, Similarity> JoinedPieces(const std::vector<LoopEdge>& loops) const;
  const MapKeyframe& At(int id) const;
  bool Consecutive(int older, int newer) const;
  Eigen::Vector2d Walked(int keyframe) const;
  Eigen::Vector2d WalkedBetween(int older, int newer) const;
  bool Unknown(const Edge& edge) const;
  void TiePastOutliers();
  double SigmaFloor() const;
  Vector7d Sigmas(const Edge& edge, double floor) const;
  Edge Between(int older, int newer) const;
  Matrix7d Adjoint(const Similarity& S) const;

  // All ascending: a map of ten thousand keyframes is taken over between two frames.
  KeyframeGraphOptions options_;
  std::vector<MapKeyframe> keyframes_;
  std::vector<Birth> births_;
  std::vector<Merge> merged_;  // in order of time
  std::vector<Edge> edges_;    // odometry's, with their measurements
  std::vector<Edge> kept_;     // measurements from before the last correction, in present units
  std::vector<Edge> carried_;  // edges that were moved to what stands for keyframes that have left
  std::vector<int> sessions_;  // first keyframes of recordings but the first, ascending
  std::vector<std::pair<int, Eigen::Vector2d>> walked_;  // keyframes; variances of translation and rotation
                                                         // of the odometry's motion up to there
  std::set<int> jumps_, outliers_;                       // keyframes
};

/// Carries a loop over to the units of a corrected map (mono): S' = scale(s_c) S scale(1/s_q).
void Rescale(const std::map<int, Similarity>& S_world_keyframe, LoopEdge* loop);

}  // namespace tutti
#pragma GCC visibility pop
