#include "backend/solver/graph_initialization.h"

#include <Eigen/SVD>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <deque>

#include "backend/solver/chordal_descent.h"

namespace tutti::internal {
namespace {

using Triplets = std::vector<Eigen::Triplet<double>>;

/// Least squares over x_i in R^D (several right sides at once): sum of w ||x_j - M x_i - b||^2 over the
/// edges, by the normal equations. Constant nodes enter with their values.
template <int D, int Columns>
class LinearGraphProblem {
 public:
  using Block = Eigen::Matrix<double, D, D>;
  using Value = Eigen::Matrix<double, D, Columns>;

  LinearGraphProblem(const GraphStructure& structure, std::vector<Value> constants)
      : unknown_(NumberUnknowns(structure.constant, count_)), values_(std::move(constants)) {
    rhs_ = Eigen::MatrixXd::Zero(D * count_, Columns);
    diagonal_.assign(static_cast<std::size_t>(count_), Block::Zero());
    triplets_.reserve(structure.ends.size() * D * D + static_cast<std::size_t>(count_) * D * D);
  }

  void Add(const EdgeEnds& ends, double weight, const Block& M, const Value& b) {
    const int i = unknown_[ends.from], j = unknown_[ends.to];
    Value constant = -b;  // the residual x_j - M x_i - b without its unknowns
    if (i < 0) constant -= M * values_[ends.from];
    if (j < 0) constant += values_[ends.to];
    if (i >= 0) {
      diagonal_[static_cast<std::size_t>(i)] += weight * M.transpose() * M;
      rhs_.middleRows<D>(D * i) += weight * M.transpose() * constant;
    }
    if (j >= 0) {
      diagonal_[static_cast<std::size_t>(j)] += weight * Block::Identity();
      rhs_.middleRows<D>(D * j) -= weight * constant;
    }
    if (i >= 0 && j >= 0) {
      // Lower triangle only: the block at (row node, column node) of d2/dx_j dx_i = -w M.
      if (j > i) {
        Insert(j, i, -weight * M);
      } else {
        Insert(i, j, -weight * M.transpose());
      }
    }
  }

  /// False if the system is singular.
  bool Solve(std::vector<Value>& values) {
    values = values_;
    if (count_ == 0) return true;
    for (int i = 0; i < count_; ++i) Insert(i, i, diagonal_[static_cast<std::size_t>(i)]);
    Eigen::SparseMatrix<double> H(D * count_, D * count_);
    H.setFromTriplets(triplets_.begin(), triplets_.end());
    const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> llt(H);
    if (llt.info() != Eigen::Success) return false;
    const Eigen::MatrixXd x = llt.solve(rhs_);
    if (!x.allFinite()) return false;
    for (std::size_t k = 0; k < unknown_.size(); ++k) {
      if (unknown_[k] >= 0) values[k] = x.middleRows<D>(D * unknown_[k]);
    }
    return true;
  }

 private:
  void Insert(int row, int column, const Block& block) {
    for (int r = 0; r < D; ++r) {
      for (int c = 0; c < D; ++c) {
        if (row != column || r >= c) triplets_.emplace_back(D * row + r, D * column + c, block(r, c));
      }
    }
  }

  int count_ = 0;
  std::vector<int> unknown_;
  std::vector<Value> values_;
  std::vector<Block> diagonal_;
  Eigen::MatrixXd rhs_;
  Triplets triplets_;
};

/// Rotations. R_j = R_i R_ij holds row by row: x_j = R_ij^T x_i for each row x of R, so the three rows share
/// one system.
template <int D>
bool SolveRotations(const PoseGraph& graph, const GraphStructure& structure, std::vector<Similarity>& poses) {
  using Matrix = Eigen::Matrix<double, D, D>;
  std::vector<Matrix> rows;
  rows.reserve(poses.size());
  for (const Similarity& pose : poses) {
    rows.push_back(pose.rotation.toRotationMatrix().template topLeftCorner<D, D>().transpose());
  }
  LinearGraphProblem<D, D> problem(structure, std::move(rows));
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const PoseGraphEdge& edge = graph.edges()[e];
    const Matrix R = edge.measurement.rotation.toRotationMatrix().template topLeftCorner<D, D>();
    problem.Add(structure.ends[e], MakeChordalWeights(edge, graph.kind()).rotation, R.transpose(),
                Matrix::Zero());
  }
  std::vector<Matrix> solution;
  if (!problem.Solve(solution)) return false;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (structure.constant[k]) continue;
    Eigen::Matrix<double, 3, 4> padded = Eigen::Matrix<double, 3, 4>::Identity();
    if constexpr (D == 2) {
      // Nearest rotation of the plane: the mean of the two rows' headings, weighted by their lengths.
      const Matrix R = solution[k].transpose();
      const double heading = std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1));
      poses[k].rotation = Eigen::Quaterniond(std::cos(0.5 * heading), 0, 0, std::sin(0.5 * heading));
    } else {
      padded.template topLeftCorner<D, D>() = solution[k].transpose();
      poses[k].rotation = Pose::FromMatrix(padded).rotation;
    }
  }
  return true;
}

bool SolveScales(const PoseGraph& graph, const GraphStructure& structure, std::vector<Similarity>& poses) {
  using Scalar = Eigen::Matrix<double, 1, 1>;
  std::vector<Scalar> logs;
  logs.reserve(poses.size());
  for (const Similarity& pose : poses) logs.push_back(Scalar(std::log(pose.scale)));
  LinearGraphProblem<1, 1> problem(structure, std::move(logs));
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const PoseGraphEdge& edge = graph.edges()[e];
    problem.Add(structure.ends[e], edge.information(6, 6), Scalar(1.0),
                Scalar(std::log(edge.measurement.scale)));
  }
  std::vector<Scalar> solution;
  if (!problem.Solve(solution)) return false;
  for (std::size_t k = 0; k < poses.size(); ++k) poses[k].scale = std::exp(solution[k](0));
  return true;
}

bool SolveTranslations(const PoseGraph& graph, const GraphStructure& structure,
                       std::vector<Similarity>& poses) {
  using Row = Eigen::Matrix<double, 1, 3>;
  std::vector<Row> rows;
  rows.reserve(poses.size());
  for (const Similarity& pose : poses) rows.push_back(pose.translation.transpose());
  LinearGraphProblem<1, 3> problem(structure, std::move(rows));
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const PoseGraphEdge& edge = graph.edges()[e];
    const Similarity& i = poses[structure.ends[e].from];
    const Row step = (i.scale * (i.rotation * edge.measurement.translation)).transpose();
    const double weight = MakeChordalWeights(edge, graph.kind()).translation / (i.scale * i.scale);
    problem.Add(structure.ends[e], weight, Eigen::Matrix<double, 1, 1>(1.0), step);
  }
  std::vector<Row> solution;
  if (!problem.Solve(solution)) return false;
  for (std::size_t k = 0; k < poses.size(); ++k) poses[k].translation = solution[k].transpose();
  return true;
}

std::vector<Similarity> PresentPoses(const PoseGraph& graph) {
  std::vector<Similarity> poses;
  poses.reserve(graph.nodes().size());
  for (const PoseGraphNode& node : graph.nodes()) poses.push_back(node.pose);
  return poses;
}

}  // namespace

std::vector<Similarity> OdometryInitialization(const PoseGraph& graph, const GraphStructure& structure) {
  const std::size_t n = graph.nodes().size();
  std::vector<Similarity> poses = PresentPoses(graph);
  std::vector<std::vector<std::size_t>> edges_of(n);
  for (std::size_t e = 0; e < structure.ends.size(); ++e) {
    edges_of[structure.ends[e].from].push_back(e);
    edges_of[structure.ends[e].to].push_back(e);
  }
  std::vector<bool> known = structure.constant;
  // Half-used edges wait in two queues; loops are crossed only when no odometry is left.
  std::deque<std::size_t> odometry, loops;
  const auto push = [&](std::size_t node) {
    for (std::size_t e : edges_of[node]) {
      (graph.edges()[e].kind == EdgeKind::kOdometry ? odometry : loops).push_back(e);
    }
  };
  for (std::size_t k = 0; k < n; ++k) {
    if (known[k]) push(k);
  }
  while (!odometry.empty() || !loops.empty()) {
    std::deque<std::size_t>& queue = odometry.empty() ? loops : odometry;
    const std::size_t e = queue.front();
    queue.pop_front();
    const EdgeEnds& ends = structure.ends[e];
    if (known[ends.from] && known[ends.to]) continue;
    const Similarity& measurement = graph.edges()[e].measurement;
    const std::size_t next = known[ends.from] ? ends.to : ends.from;
    poses[next] = known[ends.from] ? poses[ends.from] * measurement : poses[ends.to] * measurement.Inverse();
    poses[next].rotation.normalize();
    known[next] = true;
    push(next);
  }
  return poses;
}

std::vector<Similarity> ChordalInitialization(const PoseGraph& graph, const GraphStructure& structure,
                                              std::string& reason) {
  std::vector<Similarity> poses = PresentPoses(graph);
  const bool rotations = graph.kind() == GraphKind::kSE2 ? SolveRotations<2>(graph, structure, poses)
                                                         : SolveRotations<3>(graph, structure, poses);
  if (!rotations) reason = "the linear system of the rotations can't be solved (singular)";
  if (rotations && graph.kind() == GraphKind::kSim3 && !SolveScales(graph, structure, poses)) {
    reason = "the linear system of the scales can't be solved (singular)";
  } else if (rotations && !SolveTranslations(graph, structure, poses)) {
    reason = "the linear system of the translations can't be solved (singular)";
  }
  if (!reason.empty()) poses.clear();
  return poses;
}

}  // namespace tutti::internal
