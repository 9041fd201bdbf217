// How long closing loops holds up the tracking while a map grows, and how good the map is then:
//   build/release/bench/online_graph town|FILE.g2o [ceres|block] [SEED]
// Keyframes come one by one, each where its odometry edge from the last one puts it, one for every five
// frames at 30 Hz. Loops are closed as `tutti run` does (LoopCloser): the graph is copied and solved beside
// the tracking, the solution enters SolutionFrames() later, loops that come meanwhile wait. "town": 10,000
// keyframes on a drive round the blocks of a town. Prints CSV: graph, solver, keyframes, loops, solutions;
// what the tracking thread does for one (beginning it, entering it) [ms] as median, 99 % quantile and
// maximum; processor time of one solution [ms] as median, 99 % quantile and maximum; solutions that took
// longer than the frames until they enter (somebody would wait); longest delay from a loop to the map that
// fulfils it [frames]; and how far the last map is from the optimum of the whole graph: at most [m], and
// altogether in standard deviations (the root of the excess chi-square; a graph has thousands of them).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "apps/slam/loop_solver.h"
#include "bench/noisy_measurement.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/keyframe_graph.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

double ProcessorMilliseconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

constexpr double kStep = 2;  // between keyframes [m]
constexpr bench::Noise kNoise{0.02, 0.002};

/// A drive on streets 100 m apart in a square of 1.6 km, turning at random at the crossings.
std::vector<Similarity> DriveThroughTown(int keyframes, std::mt19937& random) {
  constexpr int kPerBlock = 50, kStreets = 16;
  const int dx[] = {1, 0, -1, 0}, dy[] = {0, 1, 0, -1};
  int x = kStreets / 2, y = kStreets / 2, heading = 0;
  std::vector<Similarity> out;
  while (static_cast<int>(out.size()) < keyframes) {
    for (int k = 0; k < kPerBlock && static_cast<int>(out.size()) < keyframes; ++k) {
      const double along = k * kStep;
      out.emplace_back(1.0, ExpSO3({0, 0, heading * M_PI / 2}),
                       Eigen::Vector3d(kPerBlock * kStep * x + along * dx[heading],
                                       kPerBlock * kStep * y + along * dy[heading], 0));
    }
    x += dx[heading];
    y += dy[heading];
    int turned = 0;
    do {
      const unsigned draw = random() % 4;  // straight on twice as often as left or right
      turned = (heading + (draw == 0 ? 1 : draw == 1 ? 3 : 0)) % 4;
    } while (x + dx[turned] < 0 || x + dx[turned] >= kStreets || y + dy[turned] < 0 ||
             y + dy[turned] >= kStreets);
    heading = turned;
  }
  return out;
}

/// The town's graph: edges to the three keyframes before; a loop for every fifth keyframe that comes within
/// 3 m of one that is 100 keyframes older or more.
PoseGraph MakeTown(int keyframes, unsigned seed) {
  std::mt19937 random(seed);
  const std::vector<Similarity> truth = DriveThroughTown(keyframes, random);
  PoseGraph graph;
  const Matrix7d information = MakeInformation(kNoise.translation, kNoise.rotation);
  std::map<std::pair<long, long>, std::vector<int>> places;
  for (int k = 0; k < keyframes; ++k) {
    const Similarity& here = truth[static_cast<std::size_t>(k)];
    graph.AddNode(k, here, k == 0);
    for (int older = std::max(0, k - 3); older < k; ++older) {
      graph.AddOdometry(older, k,
                        bench::Measured(truth[static_cast<std::size_t>(older)], here, kNoise, random),
                        information);
    }
    std::vector<int>& seen =
        places[{std::lround(here.translation.x() / 3), std::lround(here.translation.y() / 3)}];
    if (k % 5 == 0 && !seen.empty() && seen.front() + 100 <= k) {
      const int older = seen.front();
      graph.AddLoop(older, k, bench::Measured(truth[static_cast<std::size_t>(older)], here, kNoise, random),
                    information);
    }
    seen.push_back(k);
  }
  return graph;
}

/// A map that grows keyframe by keyframe and moves with its loops.
class GrowingMap {
 public:
  GrowingMap(const PoseGraph& file, const KeyframeGraphOptions& options) : file_(file), graph_(options) {
    for (const PoseGraphEdge& edge : file.edges()) {
      const bool forward = edge.from < edge.to;
      arriving_[static_cast<int>(std::max(edge.from, edge.to))].push_back(
          {static_cast<int>(std::min(edge.from, edge.to)),
           forward ? edge.measurement : edge.measurement.Inverse(), edge});
    }
  }

  void Run() {
    for (const PoseGraphNode& node : file_.nodes()) {
      frames_ += kFramesPerKeyframe;
      if (running_ && frames_ >= due_) Enter();
      Add(static_cast<int>(node.id));
      if (!running_ && !waiting_.empty()) Begin();
    }
    while (running_ || !waiting_.empty()) running_ ? Enter() : Begin();
  }

  /// The graph of the last map with its loops.
  PoseGraph Last() {
    graph_.Update(keyframes_, covisible_);
    return graph_.Graph(loops_);
  }

  std::vector<double> stalls_ms, solutions_ms;
  int late = 0;
  std::int64_t longest_delay = 0;
  std::size_t Loops() const { return loops_.size(); }

 private:
  static constexpr int kFramesPerKeyframe = 5;
  static constexpr double kFrameMs = 1000.0 / 30;
  struct Arriving {
    int older = 0;
    Similarity S_older_newer;
    PoseGraphEdge edge;
  };

  void Add(int id) {
    MapKeyframe keyframe{id, 0, file_.Node(id).pose.RigidPart()};
    int latest = -1;
    for (const Arriving& a : arriving_[id]) {
      if (a.edge.kind == EdgeKind::kLoop) {
        LoopEdge loop{a.older, id, 0, frames_, a.S_older_newer, a.edge.information, 10, 0};
        waiting_.push_back(loop);
        continue;
      }
      if (id - a.older > 1) covisible_.push_back({a.older, id, 100});
      if (a.older <= latest) continue;
      latest = a.older;
      keyframe.T_world_keyframe = PoseOf(a.older) * a.S_older_newer.RigidPart();
    }
    keyframes_.push_back(keyframe);
  }

  const Pose& PoseOf(int id) const {
    return std::lower_bound(keyframes_.begin(), keyframes_.end(), id,
                            [](const MapKeyframe& k, int value) { return k.id < value; })
        ->T_world_keyframe;
  }

  void Begin() {
    const double begin = ProcessorMilliseconds();
    then_ = keyframes_;
    graph_.Update(then_, covisible_);
    const KeyframeGraph copy = graph_;
    entering_ = std::exchange(waiting_, {});
    due_ = frames_ + SolutionFrames(then_.size());
    const double begun = ProcessorMilliseconds();
    solution_ = SolveLoops(copy, loops_, entering_, Options());
    const double solved = ProcessorMilliseconds();
    stalls_ms.push_back(begun - begin);
    solutions_ms.push_back(solved - begun);
    late += solved - begun > kFrameMs * static_cast<double>(due_ - frames_) ? 1 : 0;
    running_ = true;
  }

  void Enter() {
    const double begin = ProcessorMilliseconds();
    running_ = false;
    for (const LoopVerdict& verdict : solution_.verdicts) {
      if (verdict.reason.empty()) loops_.push_back(verdict.loop);
      longest_delay = std::max(longest_delay, frames_ - verdict.loop.query_frame);
    }
    if (solution_.moves) {
      const auto poses = Follow(solution_.correction, then_, keyframes_);
      graph_.Update(keyframes_, covisible_);
      graph_.Move(poses, {});
      for (MapKeyframe& k : keyframes_) k.T_world_keyframe = poses.at(k.id).RigidPart();
    }
    stalls_ms.push_back(ProcessorMilliseconds() - begin);
  }

  // No loop is refused: the towns' are all true.
  static SlamOptions Options() {
    SlamOptions options;
    options.loop_after_fraction = 1e9;
    options.loop_after_deg = 360;
    return options;
  }

  const PoseGraph& file_;
  KeyframeGraph graph_;
  std::map<int, std::vector<Arriving>> arriving_;
  std::vector<MapKeyframe> keyframes_, then_;
  std::vector<CovisiblePair> covisible_;
  std::vector<LoopEdge> waiting_, entering_, loops_;
  LoopSolution solution_;
  bool running_ = false;
  std::int64_t frames_ = 0, due_ = 0;
};

template <typename T>
T Quantile(std::vector<T> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size()))) - 1];
}

// As in a run (RunConfig).
PoseGraphOptions AsInARun(PoseGraphSolver solver) {
  PoseGraphOptions options;
  options.init = GraphInit::kFile;
  options.robust = RobustLoss::kHuber;
  options.max_iterations = 100;
  options.function_tolerance = 1e-6;
  options.solver = solver;
  return options;
}

void Run(const std::string& name, const std::string& how, unsigned seed) {
  const PoseGraph file = name == "town" ? MakeTown(10000, seed) : ReadG2o(name).graph;
  KeyframeGraphOptions options;
  options.kind = file.kind();
  options.solver = AsInARun(ParsePoseGraphSolver(how));
  GrowingMap map(file, options);
  map.Run();
  if (map.solutions_ms.empty()) throw InputError(name + ": has no loops");
  const PoseGraph last = map.Last();
  PoseGraph optimum = last;
  PoseGraphOptions tight = AsInARun(PoseGraphSolver::kBlock);
  tight.function_tolerance = 1e-12;
  const PoseGraphReport report = PoseGraphOptimizer(tight).Optimize(optimum);
  double off = 0;
  for (const PoseGraphNode& node : optimum.nodes())
    off = std::max(off, (node.pose.translation - last.Node(node.id).pose.translation).norm());
  const auto three = [](const std::vector<double>& ms) {
    char text[80];
    std::snprintf(text, sizeof text, "%.2f,%.2f,%.2f", Quantile(ms, 0.5), Quantile(ms, 0.99),
                  Quantile(ms, 1.0));
    return std::string(text);
  };
  std::printf("%s,%s,%zu,%zu,%zu,%s,%s,%d,%lld,%.3g,%.3g\n", name.c_str(), how.c_str(), file.nodes().size(),
              map.Loops(), map.solutions_ms.size(), three(map.stalls_ms).c_str(),
              three(map.solutions_ms).c_str(), map.late, static_cast<long long>(map.longest_delay), off,
              std::sqrt(std::max(0.0, report.initial_objective - report.objective)));
}

int Run(int argc, char** argv) {
  try {
    if (argc < 2) throw InputError("usage: online_graph town|FILE.g2o [ceres|block] [SEED]");
    Run(argv[1], argc > 2 ? argv[2] : "ceres", argc > 3 ? static_cast<unsigned>(std::atoi(argv[3])) : 1u);
    return 0;
  } catch (const InputError& error) {
    std::fprintf(stderr, "online_graph: %s\n", error.what());
    return 1;
  }
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) { return tutti::Run(argc, argv); }
