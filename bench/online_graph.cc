// Time per accepted loop while a graph grows:
//   build/release/bench/online_graph town|FILE.g2o [run|parts|block|ceres] [SEED]
// Keyframes come one by one, each where its odometry edge from the last corrected pose puts it, with its
// edges to earlier ones; when one brings loops, the graph is optimised, as `tutti run` does (MapGraph): Huber
// on loops, from the present poses. run: OnlineOptimizer as `tutti run` has it by default, small graphs whole
// by Ceres, large ones in parts; parts: OnlineOptimizer, what changed alone; block, ceres: the whole graph
// each time. "town": 10,000 keyframes on a drive round the blocks of a town. Prints CSV: graph, how,
// keyframes, edges, loop events, their processor time [ms] as median, 99 % quantile and maximum, median and
// largest number of keyframes solved for, and how far the result ends from the optimum of the whole graph: at
// most [m], and altogether in standard deviations (the root of the excess chi-square; a graph has thousands
// of them).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "bench/noisy_measurement.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/online_optimizer.h"
#include "tutti/core/error.h"

namespace {

using namespace tutti;

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

/// The edges of a graph by the later of their two nodes, in the order of the nodes' ids.
std::map<int, std::vector<PoseGraphEdge>> EdgesByArrival(const PoseGraph& graph) {
  std::map<int, std::vector<PoseGraphEdge>> out;
  for (const PoseGraphNode& node : graph.nodes()) out[node.id];
  for (const PoseGraphEdge& edge : graph.edges()) out[std::max(edge.from, edge.to)].push_back(edge);
  return out;
}

/// Where the odometry from the last corrected keyframe puts the next one; the file's pose where there is
/// none.
Similarity Predicted(const PoseGraph& grown, const PoseGraph& file, int id,
                     const std::vector<PoseGraphEdge>& edges) {
  int latest = 0;
  Similarity pose = file.Node(id).pose;
  bool found = false;
  for (const PoseGraphEdge& edge : edges) {
    const bool forward = edge.to == id;
    const int other = forward ? edge.from : edge.to;
    if (edge.kind != EdgeKind::kOdometry || (found && other < latest)) continue;
    found = true;
    latest = other;
    pose = grown.Node(other).pose * (forward ? edge.measurement : edge.measurement.Inverse());
  }
  return pose;
}

struct Replay {
  PoseGraph graph;
  std::vector<double> milliseconds;
  std::vector<std::size_t> nodes;
};

Replay Grow(const PoseGraph& file, OnlineOptimizer& optimizer) {
  Replay out{PoseGraph(file.kind()), {}, {}};
  for (const auto& [id, edges] : EdgesByArrival(file)) {
    out.graph.AddNode(id, Predicted(out.graph, file, id, edges), out.graph.nodes().empty());
    bool loop = false;
    for (const PoseGraphEdge& edge : edges) {
      out.graph.AddEdge(edge);
      loop = loop || edge.kind == EdgeKind::kLoop;
    }
    if (!loop) continue;
    const double begin = ProcessorMilliseconds();
    const OnlineReport report = optimizer.Optimize(out.graph);
    out.milliseconds.push_back(ProcessorMilliseconds() - begin);
    out.nodes.push_back(report.nodes);
    if (!report.success) throw InputError("keyframe " + std::to_string(id) + ": " + report.reason);
  }
  const OnlineReport last = optimizer.Optimize(out.graph);  // the keyframes after the last loop
  if (!last.success) throw InputError("the last keyframes: " + last.reason);
  return out;
}

template <typename T>
T Quantile(std::vector<T> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size()))) - 1];
}

PoseGraphOptions AsInARun() {
  PoseGraphOptions options;
  options.init = GraphInit::kFile;
  options.robust = RobustLoss::kHuber;
  options.max_iterations = 100;
  options.function_tolerance = 1e-6;
  return options;
}

int Run(const std::string& name, const std::string& how, unsigned seed) {
  const PoseGraph file = name == "town" ? MakeTown(10000, seed) : ReadG2o(name).graph;
  PoseGraphOptions options = AsInARun();
  options.solver =
      how == "run" ? PoseGraphOptions().solver : ParsePoseGraphSolver(how == "parts" ? "block" : how);
  OnlineOptions online;
  if (how != "parts" && how != "run") online.always_whole = true;
  OnlineOptimizer optimizer(options, online);
  const Replay replay = Grow(file, optimizer);
  if (replay.milliseconds.empty()) throw InputError(name + ": has no loops");
  options.solver = PoseGraphSolver::kBlock;
  options.function_tolerance = 1e-12;
  PoseGraph optimum = replay.graph;
  const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(optimum);
  double off = 0;
  for (const PoseGraphNode& node : optimum.nodes())
    off = std::max(off, (node.pose.translation - replay.graph.Node(node.id).pose.translation).norm());
  std::printf("%s,%s,%zu,%zu,%zu,%.2f,%.2f,%.2f,%zu,%zu,%.3g,%.3g\n", name.c_str(), how.c_str(),
              file.nodes().size(), file.edges().size(), replay.milliseconds.size(),
              Quantile(replay.milliseconds, 0.5), Quantile(replay.milliseconds, 0.99),
              Quantile(replay.milliseconds, 1.0), Quantile(replay.nodes, 0.5), Quantile(replay.nodes, 1.0),
              off, std::sqrt(std::max(0.0, report.initial_objective - report.objective)));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc < 2) throw InputError("usage: online_graph town|FILE.g2o [run|parts|block|ceres] [SEED]");
    return Run(argv[1], argc > 2 ? argv[2] : "run",
               argc > 3 ? static_cast<unsigned>(std::atoi(argv[3])) : 1u);
  } catch (const InputError& error) {
    std::fprintf(stderr, "online_graph: %s\n", error.what());
    return 1;
  }
}
