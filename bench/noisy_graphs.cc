// Does the chordal start lead to the global optimum of graphs that nobody has tuned for?
//   build/release/bench/noisy_graphs sphere|torus|streets POSES ROTATION_SIGMA_DEG [SEED [FILE.g2o]]
// sphere, torus: wound round the surface, each pose tied to the one before and to the one of the winding
// before (SE(3)); streets: a planar walk at random on a grid, tied where it comes back to a crossing (SE(2)).
// Solved from the chordal start, and from the truth, which a robot does not have: the chordal start is good
// if it ends no higher. Prints CSV: graph, poses, edges, sigma [deg], seed, chi2 from the chordal start, its
// excess over the lower of the two [1], relative gap of the certificate [1], certified (0, 1), time of the
// chordal solution [s]. With a file, the graph is written there with the odometry's poses, and not solved.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "bench/noisy_measurement.h"
#include "tutti/backend/certificate.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr double kTranslationSigma = 0.05;  // [m]

struct World {
  GraphKind kind = GraphKind::kSE3;
  std::vector<Similarity> truth;
  std::vector<std::pair<int, int>> loops;
};

/// A camera frame at `position` that looks along `ahead`, its down axis along `inward`.
Similarity Looking(const Eigen::Vector3d& position, const Eigen::Vector3d& ahead,
                   const Eigen::Vector3d& inward) {
  Eigen::Matrix3d R;
  R.col(2) = ahead.normalized();
  R.col(1) = (inward - inward.dot(R.col(2)) * R.col(2)).normalized();
  R.col(0) = R.col(1).cross(R.col(2));
  return Similarity(1, Eigen::Quaterniond(R), position);
}

/// Windings round the axis of a sphere of 50 m, or round the tube of a torus of 50 and 20 m.
World MakeWound(bool torus, int poses) {
  World world;
  const int per_winding = static_cast<int>(std::lround(std::sqrt(poses)));
  const auto position = [&](double k) {
    const double round = 2 * M_PI * k / per_winding, along = k / poses;
    if (torus) {
      const double big = 2 * M_PI * along, r = 50 + 20 * std::cos(round);
      return Eigen::Vector3d(r * std::cos(big), r * std::sin(big), 20 * std::sin(round));
    }
    const double latitude = M_PI * (0.9 * along - 0.45);
    return Eigen::Vector3d(50 * std::cos(latitude) * std::cos(round),
                           50 * std::cos(latitude) * std::sin(round), 50 * std::sin(latitude));
  };
  for (int k = 0; k < poses; ++k) {
    const Eigen::Vector3d here = position(k);
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    if (torus) middle = 50 * Eigen::Vector3d(here.x(), here.y(), 0).normalized();
    world.truth.push_back(Looking(here, position(k + 0.1) - here, middle - here));
    if (k >= per_winding) world.loops.emplace_back(k - per_winding, k);
  }
  return world;
}

World MakeStreets(int poses, std::mt19937& random) {
  World world;
  world.kind = GraphKind::kSE2;
  const int side = std::max(4, static_cast<int>(std::sqrt(poses) / 4));
  std::map<std::pair<int, int>, int> last_at;
  int x = 0, y = 0, heading = 0;
  for (int k = 0; k < poses; ++k) {
    world.truth.emplace_back(1.0, ExpSO3({0, 0, M_PI / 2 * heading}), Eigen::Vector3d(x, y, 0));
    const auto seen = last_at.find({x, y});
    if (seen != last_at.end() && seen->second + 2 < k) world.loops.emplace_back(seen->second, k);
    last_at[{x, y}] = k;
    if (random() % 4 == 0) heading += random() % 2 == 0 ? 1 : 3;
    const auto step = [&] {
      return std::pair(heading % 4 == 0   ? 1
                       : heading % 4 == 2 ? -1
                                          : 0,
                       heading % 4 == 1   ? 1
                       : heading % 4 == 3 ? -1
                                          : 0);
    };
    while (std::abs(x + step().first) > side || std::abs(y + step().second) > side) ++heading;
    x += step().first;
    y += step().second;
  }
  return world;
}

PoseGraph Measure(const World& world, const bench::Noise& noise, std::mt19937& random) {
  PoseGraph graph(world.kind);
  const int poses = static_cast<int>(world.truth.size());
  for (int k = 0; k < poses; ++k) graph.AddNode(k, world.truth[static_cast<std::size_t>(k)], k == 0);
  const Matrix7d information = MakeInformation(noise.translation, noise.rotation);
  const auto measured = [&](int a, int b) {
    Similarity out = bench::Measured(world.truth[static_cast<std::size_t>(a)],
                                     world.truth[static_cast<std::size_t>(b)], noise, random);
    if (world.kind != GraphKind::kSE2) return out;
    out.translation.z() = 0;
    out.rotation = Eigen::Quaterniond(out.rotation.w(), 0, 0, out.rotation.z()).normalized();
    return out;
  };
  for (int k = 1; k < poses; ++k) graph.AddOdometry(k - 1, k, measured(k - 1, k), information);
  for (const auto& [a, b] : world.loops) graph.AddLoop(a, b, measured(a, b), information);
  return graph;
}

double Solve(PoseGraph& graph, GraphInit init, double& seconds) {
  PoseGraphOptions options;
  options.objective = GraphObjective::kChi2;
  options.solver = PoseGraphSolver::kBlock;
  options.init = init;
  const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph);
  if (!report.success) throw InputError(report.reason);
  seconds = report.time_s;
  return report.costs.chi2;
}

/// As a robot would write it: poses along the measurements from one node to the next.
void WriteMeasured(PoseGraph graph, const std::string& file) {
  for (const PoseGraphEdge& edge : graph.edges()) {
    if (edge.kind == EdgeKind::kOdometry)
      graph.SetPose(edge.to, graph.Node(edge.from).pose * edge.measurement);
  }
  WriteG2o(file, graph);
}

int Run(const std::string& name, int poses, double sigma_deg, unsigned seed, const std::string& file) {
  std::mt19937 random(seed);
  if (name != "sphere" && name != "torus" && name != "streets") throw InputError("unknown graph: " + name);
  const World world = name == "streets" ? MakeStreets(poses, random) : MakeWound(name == "torus", poses);
  PoseGraph chordal = Measure(world, {kTranslationSigma, sigma_deg * M_PI / 180}, random);
  if (!file.empty()) {
    WriteMeasured(chordal, file);
    return 0;
  }
  PoseGraph from_truth = chordal;
  double seconds = 0, unused = 0;
  const double reached = Solve(chordal, GraphInit::kChordal, seconds);
  const double best = std::min(reached, Solve(from_truth, GraphInit::kFile, unused));
  const Certificate certificate = CertifyOptimum(chordal);
  std::printf("%s,%d,%zu,%g,%u,%.8g,%.2g,%.2g,%d,%.2f\n", name.c_str(), poses, chordal.edges().size(),
              sigma_deg, seed, reached, (reached - best) / best, certificate.relative_gap,
              certificate.certified ? 1 : 0, seconds);
  return 0;
}

int Run(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr,
                 "usage: noisy_graphs sphere|torus|streets POSES ROTATION_SIGMA_DEG [SEED [FILE.g2o]]\n");
    return 1;
  }
  try {
    return Run(argv[1], std::max(100, std::atoi(argv[2])), std::atof(argv[3]),
               argc > 4 ? static_cast<unsigned>(std::atoi(argv[4])) : 1u, argc > 5 ? argv[5] : "");
  } catch (const InputError& error) {
    std::fprintf(stderr, "noisy_graphs: %s\n", error.what());
    return 1;
  }
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) { return tutti::Run(argc, argv); }
