// Pose-graph optimisation: analytic Jacobians, sparse Cholesky (Ceres' or one of its own), robust losses on
// loop edges.
//
// With E = S_from_to^-1 S_world_from^-1 S_world_to the objective is the sum over the edges of rho(e^T Omega
// e) (no 1/2):
//   chi2     e = (t(E), vec(q(E)) with w >= 0)      in 2D (t(E), wrapped heading)       what g2o files mean
//   chi2log  e = (t(E), rotation vector of E)       in 2D the same as chi2
//   Sim(3) appends log(scale(E)) to both.
// chordal is an evaluation only: sum kappa ||R_j - R_i R_ij||_F^2 + tau ||t_j - t_i - s_i R_i t_ij||^2 with
// tau = 3 / trace(I_tt^-1), kappa = 3 / (2 trace(I_rr^-1)); 2D: tau = 2 / trace(I_tt^-1), kappa = I_heading
// (SE-Sync's costs).
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/core/options.h"

#pragma GCC visibility push(default)
namespace tutti {

enum class GraphObjective { kChi2, kChi2Log };

/// What is done about false loops; acts on loop edges only. kHuber: down-weights linearly (Huber 1964).
/// kCauchy: the log of a Cauchy distribution, no bound. kDcs: dynamic covariance scaling (Agarwal et al.,
/// ICRA 2013). kGnc: graduated non-convexity with the Geman-McClure surrogate (Yang et al., RA-L 2020), then
/// truncated least squares decide for each loop: inlier or outlier. docs/backend.md compares them.
enum class RobustLoss { kNone, kHuber, kCauchy, kDcs, kGnc };

/// kFile: poses as they are in the graph. kOdometry: spanning tree, odometry edges first. kChordal: linear
/// relaxation (Carlone et al., ICRA 2015); with least squares (no robust loss), where it leaves large
/// residuals, the optimum of the chordal objective that follows from it, too, and the better result counts.
/// kAuto: whichever of them has the lowest objective (robust loss included).
enum class GraphInit { kAuto, kFile, kOdometry, kChordal };

/// The poses that a solution started from. kChordalRelaxation: of the linear relaxation. kChordalOptimum: of
/// the lowest chordal objective that Newton's method finds from there.
enum class GraphStart { kFile, kOdometry, kChordalRelaxation, kChordalOptimum };
const char* ToString(GraphStart start);

/// Who solves the least-squares problems. kCeres: Ceres Solver (Agarwal, Mierle et al.) with CHOLMOD. kBlock:
/// the same Levenberg-Marquardt with a Cholesky factorisation of the nodes' blocks: the same optimum in a
/// fraction of the time (docs/backend.md). Graphs with landmarks or priors are always solved by Ceres.
enum class PoseGraphSolver { kCeres, kBlock };

/// Words of the command line and the YAML files ("chi2log", "gnc", "chordal", ...).
EnumWords<GraphObjective> WordsOf(GraphObjective);
EnumWords<RobustLoss> WordsOf(RobustLoss);
EnumWords<GraphInit> WordsOf(GraphInit);
EnumWords<PoseGraphSolver> WordsOf(PoseGraphSolver);
/// Throw InputError for another word.
GraphObjective ParseGraphObjective(const std::string& name);
RobustLoss ParseRobustLoss(const std::string& name);
GraphInit ParseGraphInit(const std::string& name);
PoseGraphSolver ParsePoseGraphSolver(const std::string& name);
const char* ToString(GraphObjective objective);
const char* ToString(RobustLoss robust);
const char* ToString(GraphInit init);
const char* ToString(PoseGraphSolver solver);

/// Options of PoseGraphOptimizer: section `graph:` of the YAML files.
struct PoseGraphOptions {
  TUTTI_OPTION(GraphObjective, objective, GraphObjective::kChi2Log,
               "rotation error as vector part of the quaternion (chi2, as `tutti optimize` takes it) or as "
               "rotation vector in rad (chi2log)");
  TUTTI_OPTION(RobustLoss, robust, RobustLoss::kNone, "loss on loop edges", Basic());
  TUTTI_OPTION(double, robust_chi2, 0,
               "chi-square beyond which a loop is an outlier (Huber's delta^2, DCS' Phi, GNC's c^2); 0: the "
               "99 % quantile of the chi-square distribution for the edge's degrees of freedom (11.34, "
               "16.81, 18.48)",
               From(0));
  TUTTI_OPTION(PoseGraphSolver, solver, PoseGraphSolver::kCeres,
               "who solves it: ceres, or block (own block Cholesky: the same optimum in less time; `tutti "
               "optimize` takes it)");
  TUTTI_OPTION(GraphInit, init, GraphInit::kAuto,
               "start from the present poses (file), odometry, chordal relaxation, or the best of them "
               "(auto)");
  TUTTI_OPTION(int, max_iterations, 200,
               "most iterations of Levenberg-Marquardt, in each round that is to converge", From(1));
  TUTTI_OPTION(double, function_tolerance, 1e-9,
               "stop when an iteration lowers the cost by less than this share", Above(0), Below(1));
  TUTTI_OPTION(double, max_time_s, 0,
               "stop after this time; 0: no limit (a limit makes the result depend on the machine)",
               Unit("s"), From(0));
  TUTTI_OPTIONS_END;

  /// The chordal optimum is wanted anyway, since CertifyOptimum follows: kChordal starts from it, however
  /// near the relaxation is.
  bool will_certify = false;

  /// Empty if usable, else what is wrong.
  std::string Validate() const { return OutOfRange(*this, "pose graph: "); }
};

/// The three costs of a graph at its present poses, all edges with weight 1, no robust loss. chi2 and chi2log
/// have the measurements of landmarks and the priors in them, chordal has not.
struct GraphCosts {
  double chi2 = 0;
  double chi2log = 0;
  double chordal = 0;
};
GraphCosts EvaluateCosts(const PoseGraph& graph);

/// e^T Omega e of one edge at the present poses.
double EdgeChi2(const PoseGraph& graph, const PoseGraphEdge& edge, GraphObjective objective);

/// What became of one edge.
struct EdgeOutcome {
  double chi2 = 0;             ///< e^T Omega e in the optimiser's objective, weight not applied
  double weight = 1;           ///< final weight, 0 to 1 (1 on odometry edges)
  bool down_weighted = false;  ///< weight < 0.5: the optimiser does not believe this loop
};

/// One connected part of the graph.
struct GraphComponent {
  NodeId anchor = 0;  ///< id of the node that holds it in place (the first fixed one, else the smallest id)
  std::size_t nodes = 0;
  bool by_priors = false;  ///< priors or fixed landmarks hold it, and no node is fixed
};

/// What a start came to.
struct StartOutcome {
  GraphStart start = GraphStart::kFile;
  double initial_objective = 0;  ///< there (robust loss included)
  double objective = 0;          ///< of its solution; where that was spared, of the one that it leads to
  bool spared = false;           ///< not solved: the objective falls all along the straight way to a solution
};

struct PoseGraphReport {
  bool success = false;  ///< the poses are usable (converged, or stopped at a limit with a lower cost)
  std::string reason;    ///< why not; empty on success
  GraphStart start = GraphStart::kFile;  ///< the one whose solution was taken
  std::vector<StartOutcome> starts;      ///< all that were tried, in that order
  /// Where the chordal objective has its minimum near the result, parallel to the nodes; empty if another
  /// start was taken than that one.
  std::vector<Similarity> chordal_optimum;
  PoseGraphSolver solver = PoseGraphSolver::kCeres;  ///< who solved it
  std::string solver_note;       ///< why another one than was asked for; empty if it was that one
  GraphCosts initial_costs;      ///< at the initialisation that was taken
  GraphCosts costs;              ///< of the result
  double initial_objective = 0;  ///< what was minimised (robust loss included), before
  double objective = 0;          ///< and after
  int iterations = 0;            ///< of all starts, those on the chordal objective included
  int gnc_rounds = 0;
  std::string
      termination;  ///< "converged", "iteration limit", "time limit", "nothing to do", "stopped", "failed"
  double init_time_s = 0;
  double time_s = 0;                       ///< wall time, initialisation included
  std::vector<EdgeOutcome> edges;          ///< parallel to PoseGraph::edges()
  std::vector<GraphComponent> components;  ///< more than one: they are not connected to each other
  std::size_t down_weighted = 0;           ///< loop edges with weight < 0.5
};

/// Optimises pose graphs. Deterministic: one thread, fixed orders; the same graph gives the same bits.
class PoseGraphOptimizer {
 public:
  /// Throws InputError if the options are not usable.
  explicit PoseGraphOptimizer(const PoseGraphOptions& options = {});

  /// Moves the nodes of `graph` to the optimum. On failure the graph keeps its poses and the report says why.
  /// A component without a fixed node and without priors is anchored at its smallest id, which keeps its
  /// pose. `stop` is asked before each iteration: true gives up, which is a failure with the termination
  /// "stopped".
  PoseGraphReport Optimize(PoseGraph& graph, const std::function<bool()>& stop = {}) const;

  const PoseGraphOptions& options() const { return options_; }

 private:
  PoseGraphOptions options_;
};

}  // namespace tutti
#pragma GCC visibility pop
