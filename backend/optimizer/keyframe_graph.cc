#include "tutti/backend/keyframe_graph.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <tuple>
#include <utility>

#include "tutti/backend/graph_covariance.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr int kRecentKeyframes = 20;  // ids apart: common landmarks are the odometry's own

Similarity Rescaled(const Similarity& s, double scale_a, double scale_b) {
  return Similarity(scale_a * s.scale / scale_b, s.rotation, scale_a * s.translation);
}

double ScaleOf(const std::map<int, Similarity>& poses, int id) {
  const auto found = poses.find(id);
  return found == poses.end() ? 1.0 : found->second.scale;
}

// The element with this id of a vector that ascends by id; nearly always ids have no gaps.
template <typename T>
const T* Find(const std::vector<T>& sorted, int id) {
  if (sorted.empty() || id < sorted.front().id) return nullptr;
  const auto guess = static_cast<std::size_t>(id - sorted.front().id);
  if (guess < sorted.size() && sorted[guess].id == id) return &sorted[guess];
  const auto at =
      std::lower_bound(sorted.begin(), sorted.end(), id, [](const T& a, int value) { return a.id < value; });
  return at != sorted.end() && at->id == id ? &*at : nullptr;
}

template <typename E>
bool Before(const E& a, const E& b) {
  return std::pair(a.older, a.newer) < std::pair(b.older, b.newer);
}

}  // namespace

void Rescale(const std::map<int, Similarity>& S_world_keyframe, LoopEdge* loop) {
  const double scale_c = ScaleOf(S_world_keyframe, loop->candidate);
  const double scale_q = ScaleOf(S_world_keyframe, loop->query);
  loop->S_candidate_query = Rescaled(loop->S_candidate_query, scale_c, scale_q);
  loop->depth *= scale_c;
  // The residual lives in the query's frame, and so does the information.
  loop->information.topLeftCorner<3, 7>() /= scale_q;
  loop->information.topLeftCorner<7, 3>() /= scale_q;
}

KeyframeGraphOptions::KeyframeGraphOptions() {
  solver.init = GraphInit::kFile;
  solver.objective = GraphObjective::kChi2Log;
  solver.robust = RobustLoss::kGnc;
  solver.max_iterations = 50;
  solver.function_tolerance = 1e-6;
}

std::string KeyframeGraphOptions::Validate() const {
  if (kind == GraphKind::kSE2) return "keyframe graph: kind must be kSE3 or kSim3";
  if (!(sigma_translation_ratio >= 0) || !(sigma_translation_floor > 0)) {
    return "keyframe graph: sigma_translation_ratio must be >= 0 and sigma_translation_floor > 0";
  }
  if (!(sigma_rotation_rad > 0)) return "keyframe graph: sigma_rotation_rad must be positive";
  if (!(sigma_log_scale > 0)) return "keyframe graph: sigma_log_scale must be positive";
  if (max_covisible < 0) return "keyframe graph: max_covisible must not be negative";
  return solver.Validate();
}

KeyframeGraph::KeyframeGraph(const KeyframeGraphOptions& options) : options_(options) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
}

const MapKeyframe& KeyframeGraph::At(int id) const {
  const MapKeyframe* keyframe = Find(keyframes_, id);
  if (keyframe == nullptr) throw InputError("keyframe graph: there is no keyframe " + std::to_string(id));
  return *keyframe;
}

// Nothing was ever between them, also not what has left.
bool KeyframeGraph::Consecutive(int older, int newer) const {
  const Birth* a = Find(births_, older);
  return a != nullptr && a != &births_.back() && (a + 1)->id == newer;
}

// When the newer one was new; pieces may have been joined since.
bool KeyframeGraph::OfOnePiece(int older, int newer) const {
  const Birth *a = Find(births_, older), *b = Find(births_, newer);
  if (a == nullptr || b == nullptr) return false;
  int piece = a->piece;
  for (const Merge& merge : merged_) {
    if (merge.newest >= older && merge.newest < newer && merge.from == piece) piece = merge.to;
  }
  return piece == b->piece;
}

const KeyframeGraph::Edge* KeyframeGraph::FindEdge(const std::vector<Edge>& edges, int older, int newer) {
  const Edge wanted{older, newer, {}};
  const auto at = std::lower_bound(edges.begin(), edges.end(), wanted, Before<Edge>);
  return at != edges.end() && at->older == older && at->newer == newer ? &*at : nullptr;
}

// Kept from before a correction, or as the map is.
Similarity KeyframeGraph::Measured(int older, int newer) const {
  const Edge* kept = FindEdge(kept_, older, newer);
  return kept != nullptr ? kept->S_older_newer
                         : Similarity(At(older).T_world_keyframe.Inverse() * At(newer).T_world_keyframe);
}

void KeyframeGraph::Update(std::vector<MapKeyframe> keyframes, const std::vector<CovisiblePair>& covisible) {
  const auto ascending = [](const MapKeyframe& a, const MapKeyframe& b) { return a.id >= b.id; };
  if (std::adjacent_find(keyframes.begin(), keyframes.end(), ascending) != keyframes.end())
    throw InputError("keyframe graph: keyframes must come in ascending order of their ids");
  keyframes_ = std::move(keyframes);
  for (const MapKeyframe& keyframe : keyframes_) {
    if (births_.empty() || births_.back().id < keyframe.id) births_.push_back({keyframe.id, keyframe.piece});
  }
  edges_.clear();
  for (std::size_t i = 1; i < keyframes_.size(); ++i) {
    const int older = keyframes_[i - 1].id, newer = keyframes_[i].id;
    if (Follows(older, newer)) edges_.push_back({older, newer, {}});
  }
  for (const CovisiblePair& c : Strongest(covisible)) edges_.push_back({c.older, c.newer, {}});
  TieBeginnings();
  TiePastOutliers();
  std::sort(edges_.begin(), edges_.end(), Before<Edge>);
  if (!carried_.empty()) {
    std::vector<Edge> all;
    std::set_union(edges_.begin(), edges_.end(), carried_.begin(), carried_.end(), std::back_inserter(all),
                   Before<Edge>);
    edges_ = std::move(all);
  }
  for (Edge& edge : edges_) edge.S_older_newer = Measured(edge.older, edge.newer);
}

void KeyframeGraph::Append(int first_keyframe, const KeyframeGraph* other) {
  MeasureAgain();
  sessions_.push_back(first_keyframe);
  if (other == nullptr) return;
  const Eigen::Vector2d before = walked_.empty() ? Eigen::Vector2d::Zero() : walked_.back().second;
  for (const auto& [keyframe, walked] : other->walked_)
    walked_.emplace_back(first_keyframe + keyframe, before + walked);
  for (const int begin : other->sessions_) sessions_.push_back(first_keyframe + begin);
}

bool KeyframeGraph::Begins(int keyframe) const {
  return std::binary_search(sessions_.begin(), sessions_.end(), keyframe);
}

// The odometry led from the one to the other.
bool KeyframeGraph::Follows(int older, int newer) const {
  return Consecutive(older, newer) && !Begins(newer) && OfOnePiece(older, newer);
}

// A keyframe that does not follow the one before (a recording began in the map, or a lost camera was found
// again in an earlier piece) hangs on what it saw there; on the last keyframe of that piece, if that is not
// much.
void KeyframeGraph::TieBeginnings() {
  std::vector<int> tied;
  for (const std::vector<Edge>* edges : {&edges_, &carried_}) {
    for (const Edge& edge : *edges) tied.push_back(edge.newer);
  }
  std::sort(tied.begin(), tied.end());
  for (auto newer = keyframes_.begin(); newer != keyframes_.end(); ++newer) {
    if (std::binary_search(tied.begin(), tied.end(), newer->id)) continue;
    const auto before = std::find_if(std::make_reverse_iterator(newer), keyframes_.rend(),
                                     [&](const MapKeyframe& k) { return OfOnePiece(k.id, newer->id); });
    if (before != keyframes_.rend()) edges_.push_back({before->id, newer->id, {}});
  }
}

void KeyframeGraph::TiePastOutliers() {
  const auto good = [&](const MapKeyframe& k) { return outliers_.count(k.id) == 0; };
  for (const int outlier : outliers_) {
    const auto place = std::partition_point(keyframes_.begin(), keyframes_.end(),
                                            [&](const MapKeyframe& k) { return k.id < outlier; });
    const auto next = std::find_if(place, keyframes_.end(), good);
    const auto before = std::find_if(std::make_reverse_iterator(place), keyframes_.rend(), good);
    if (next == keyframes_.end() || before == keyframes_.rend() || !OfOnePiece(before->id, next->id))
      continue;
    const auto same = [&](const Edge& e) { return e.older == before->id && e.newer == next->id; };
    if (std::none_of(edges_.begin(), edges_.end(), same)) edges_.push_back({before->id, next->id, {}});
  }
}

// The strongest few of each keyframe, without those that are consecutive: more would count the same landmarks
// again and again.
std::vector<CovisiblePair> KeyframeGraph::Strongest(const std::vector<CovisiblePair>& covisible) const {
  std::vector<CovisiblePair> candidates;
  for (const CovisiblePair& c : covisible) {
    // Keyframes that a loop brought together see common landmarks too; that is the loop's edge, not the
    // odometry's.
    const bool recent =
        kept_.empty() || c.newer - c.older < kRecentKeyframes || FindEdge(kept_, c.older, c.newer) != nullptr;
    if (recent && !Follows(c.older, c.newer) && OfOnePiece(c.older, c.newer)) candidates.push_back(c);
  }
  std::sort(candidates.begin(), candidates.end(), [](const CovisiblePair& a, const CovisiblePair& b) {
    return std::tuple(a.newer, -a.shared, a.older) < std::tuple(b.newer, -b.shared, b.older);
  });
  std::vector<CovisiblePair> strongest;
  int of_this = 0;
  for (const CovisiblePair& c : candidates) {
    of_this = strongest.empty() || strongest.back().newer != c.newer ? 0 : of_this;
    if (of_this++ < options_.max_covisible) strongest.push_back(c);
  }
  return strongest;
}

std::map<int, int> KeyframeGraph::Merges(const std::vector<LoopEdge>& loops) const {
  std::map<int, int> root;  // piece -> smallest piece of its group
  const auto find = [&](int piece) {
    while (root.count(piece) != 0) piece = root[piece];
    return piece;
  };
  for (const LoopEdge& loop : loops) {
    const int a = find(At(loop.candidate).piece), b = find(At(loop.query).piece);
    if (a != b) root[std::max(a, b)] = std::min(a, b);
  }
  std::map<int, int> merges;
  for (const auto& [piece, ignored] : root) merges[piece] = find(piece);
  return merges;
}

// A joined piece starts where its first loop puts it: all that is known of its place, for it may begin
// anywhere.
std::map<int, Similarity> KeyframeGraph::JoinedPieces(const std::vector<LoopEdge>& loops) const {
  std::map<int, Similarity> S_root_piece;
  for (bool grown = true; grown;) {
    grown = false;
    for (const LoopEdge& loop : loops) {
      const MapKeyframe &c = At(loop.candidate), &q = At(loop.query);
      if (c.piece == q.piece) continue;
      const bool query_moves = c.piece < q.piece;
      const int from = query_moves ? c.piece : q.piece, moved = query_moves ? q.piece : c.piece;
      if (S_root_piece.count(moved) != 0) continue;
      const Similarity S_c(c.T_world_keyframe), S_q(q.T_world_keyframe);
      const Similarity S_from_moved = query_moves ? S_c * loop.S_candidate_query * S_q.Inverse()
                                                  : S_q * loop.S_candidate_query.Inverse() * S_c.Inverse();
      const auto base = S_root_piece.find(from);
      S_root_piece[moved] = (base == S_root_piece.end() ? Similarity() : base->second) * S_from_moved;
      grown = true;
    }
  }
  return S_root_piece;
}

double KeyframeGraph::SigmaFloor() const {
  double mean_length = 0, known = 0;
  for (const Edge& edge : edges_) {
    if (Unknown(edge)) continue;
    mean_length += edge.S_older_newer.translation.norm();
    ++known;
  }
  mean_length /= std::max(1.0, known);
  return options_.sigma_translation_floor * mean_length + 1e-6;
}

void KeyframeGraph::SetSigmas(double translation_ratio, double rotation_rad) {
  KeyframeGraphOptions options = options_;
  options.sigma_translation_ratio = translation_ratio;
  options.sigma_rotation_rad = rotation_rad;
  const std::string problem = options.Validate();
  if (!problem.empty()) throw InputError(problem);
  options_ = options;
}

void KeyframeGraph::NoteMotion(int keyframe, const MotionSigma& sigma) {
  constexpr double kMost_m = 1e4;  // the sum of variances keeps those of millimetres after a jump of any size
  const Eigen::Vector2d before = walked_.empty() ? Eigen::Vector2d::Zero() : walked_.back().second;
  const Eigen::Vector2d step(std::min(sigma.translation_m, kMost_m), sigma.rotation_rad);
  walked_.emplace_back(keyframe, before + step.cwiseAbs2());
}

// Variances of translation and rotation since the first keyframe.
Eigen::Vector2d KeyframeGraph::Walked(int keyframe) const {
  const auto after = std::upper_bound(walked_.begin(), walked_.end(), keyframe,
                                      [](int id, const auto& walked) { return id < walked.first; });
  return after == walked_.begin() ? Eigen::Vector2d::Zero() : std::prev(after)->second;
}

// Variances from one keyframe to another, but for the steps to outliers and from them.
Eigen::Vector2d KeyframeGraph::WalkedBetween(int older, int newer) const {
  Eigen::Vector2d walked = Walked(newer) - Walked(older);
  std::set<int> steps;  // keyframes that they lead to
  for (auto outlier = outliers_.upper_bound(older); outlier != outliers_.end() && *outlier < newer;
       ++outlier) {
    steps.insert(*outlier);
    const auto next = std::upper_bound(births_.begin(), births_.end(), *outlier,
                                       [](int id, const Birth& birth) { return id < birth.id; });
    if (next != births_.end() && next->id <= newer) steps.insert(next->id);
  }
  for (const int step : steps) walked -= Walked(step) - Walked(step - 1);
  return walked.cwiseMax(0);
}

// Across a jump, or to an outlier.
bool KeyframeGraph::Unknown(const Edge& edge) const {
  const auto jump = jumps_.upper_bound(edge.older);
  return (jump != jumps_.end() && *jump <= edge.newer) || outliers_.count(edge.older) != 0 ||
         outliers_.count(edge.newer) != 0;
}

// Standard deviations of (translation, rotation, log scale). Over several steps errors of length add up as if
// they were all in one direction: that makes up for what the turns between them do to the end.
Vector7d KeyframeGraph::Sigmas(const Edge& edge, double floor) const {
  const double steps = std::sqrt(edge.steps);
  const Eigen::Vector2d walked = WalkedBetween(edge.older, edge.newer).cwiseSqrt();
  const bool unknown = Unknown(edge);
  const double ratio = unknown ? 1 : options_.sigma_translation_ratio,
               rotation_rad = unknown ? 1 : options_.sigma_rotation_rad;
  Vector7d sigmas;
  sigmas << Eigen::Vector3d::Constant(std::max(walked[0], ratio * edge.Way() + steps * floor)),
      Eigen::Vector3d::Constant(std::max(walked[1], steps * rotation_rad)), steps * options_.sigma_log_scale;
  return sigmas;
}

PoseGraph KeyframeGraph::Graph(const std::vector<LoopEdge>& loops) const {
  const std::map<int, Similarity> S_root_piece = JoinedPieces(loops);
  PoseGraph graph(options_.kind);
  // The first node holds the graph in place; an outlier can't.
  const auto good = [&](const MapKeyframe& k) { return outliers_.count(k.id) == 0; };
  const auto first = std::find_if(keyframes_.begin(), keyframes_.end(), good);
  for (const MapKeyframe& keyframe : keyframes_) {
    Similarity pose(keyframe.T_world_keyframe);
    const auto moved = S_root_piece.find(keyframe.piece);
    if (moved != S_root_piece.end()) pose = moved->second * pose;
    if (options_.kind == GraphKind::kSE3) pose.scale = 1;
    graph.AddNode(keyframe.id, pose,
                  first != keyframes_.begin() && first != keyframes_.end() && &keyframe == &*first);
  }
  const double floor = SigmaFloor();
  for (const Edge& edge : edges_) {
    const Vector7d sigma = Sigmas(edge, floor);
    graph.AddOdometry(edge.older, edge.newer, edge.S_older_newer,
                      MakeInformation(sigma[0], sigma[3], sigma[6]));
  }
  for (const LoopEdge& loop : loops)
    graph.AddLoop(loop.candidate, loop.query, loop.S_candidate_query, loop.information);
  return graph;
}

KeyframeCorrection KeyframeGraph::CorrectionOf(const PoseGraph& graph, const PoseGraphReport& report,
                                               const std::vector<LoopEdge>& loops) const {
  KeyframeCorrection correction;
  correction.success = report.success;
  correction.reason = report.reason;
  if (!report.success) return correction;
  for (const PoseGraphNode& node : graph.nodes())
    correction.S_world_keyframe.emplace(static_cast<int>(node.id), node.pose);
  correction.merges = Merges(loops);
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    if (graph.edges()[e].kind == EdgeKind::kLoop) correction.loops.push_back(report.edges[e]);
  }
  return correction;
}

KeyframeCorrection KeyframeGraph::Optimize(const std::vector<LoopEdge>& loops) const {
  PoseGraph graph = Graph(loops);
  const PoseGraphReport report = PoseGraphOptimizer(options_.solver).Optimize(graph);
  return CorrectionOf(graph, report, loops);
}

KeyframeGraphProof KeyframeGraph::Prove(const std::vector<LoopEdge>& loops) const {
  // A share of the objective, and in its unit: another valley, not another end of the same.
  constexpr double kLower = 1e-3, kLeast = 1e-3;
  KeyframeGraphProof out;
  std::optional<PoseGraph> best;
  PoseGraphReport taken;
  for (const GraphInit init : {GraphInit::kFile, GraphInit::kOdometry, GraphInit::kChordal}) {
    PoseGraphOptions options = options_.solver;
    options.init = init;
    options.will_certify = true;
    PoseGraph graph = Graph(loops);
    const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph);
    if (!report.success) continue;
    out.starts.insert(out.starts.end(), report.starts.begin(), report.starts.end());
    if (best && !(report.objective < (1 - kLower) * taken.objective - kLeast)) continue;
    out.better = best.has_value();
    best = std::move(graph);
    taken = report;
  }
  if (!best) {
    out.certificate.reason = "the pose graph could not be solved";
    return out;
  }
  out.best = taken.start;
  out.correction = CorrectionOf(*best, taken, loops);
  out.certificate = CertifyOptimum(*best, {}, taken.chordal_optimum);
  return out;
}

std::vector<std::optional<double>> KeyframeGraph::Distances(const std::vector<LoopEdge>& accepted,
                                                            const std::vector<LoopEdge>& entering) const {
  const GraphCovariance known(Graph(accepted));
  std::vector<std::optional<double>> out;
  for (const LoopEdge& loop : entering) {
    out.emplace_back();
    if (!known.Connected(loop.candidate, loop.query)) continue;
    const PoseGraphEdge edge{loop.candidate, loop.query, loop.S_candidate_query, loop.information,
                             EdgeKind::kLoop};
    out.back() = std::sqrt(known.SquaredDistance(edge));
  }
  return out;
}

void KeyframeGraph::Move(const std::map<int, Similarity>& S_world_keyframe,
                         const std::map<int, int>& merges) {
  for (Edge& edge : edges_) {
    edge.S_older_newer = Rescaled(edge.S_older_newer, ScaleOf(S_world_keyframe, edge.older),
                                  ScaleOf(S_world_keyframe, edge.newer));
  }
  kept_ = edges_;
  Eigen::Vector2d before = Eigen::Vector2d::Zero(), scaled = Eigen::Vector2d::Zero();
  for (auto& [keyframe, walked] : walked_) {
    const double scale = ScaleOf(S_world_keyframe, keyframe);
    scaled += (walked - before).cwiseProduct(Eigen::Vector2d(scale * scale, 1));
    before = std::exchange(walked, scaled);
  }
  for (Edge& edge : carried_) edge.way *= ScaleOf(S_world_keyframe, edge.older);
  for (const auto& [from, to] : merges) {
    if (from != to) merged_.push_back({from, to, keyframes_.empty() ? -1 : keyframes_.back().id});
  }
}

}  // namespace tutti
