#include "tutti/backend/graph_covariance.h"

#include <Eigen/SparseCholesky>
#include <array>
#include <string>
#include <vector>

#include "backend/solver/weighted_graph.h"
#include "core/dense_solvers.h"
#include "tutti/core/error.h"

namespace tutti {

class GraphCovariance::Impl {
 public:
  virtual ~Impl() = default;
  virtual Eigen::MatrixXd OfPose(int id) const = 0;
  virtual Eigen::MatrixXd OfRelativePose(int from, int to) const = 0;
  virtual double SquaredDistance(const PoseGraphEdge& measurement) const = 0;
  virtual bool Connected(int from, int to) const = 0;
};

namespace {

template <int N>
class CovarianceOf final : public GraphCovariance::Impl {
  using Square = Eigen::Matrix<double, N, N>;
  using Error = Eigen::Matrix<double, N, 1>;

 public:
  explicit CovarianceOf(const PoseGraph& graph)
      : graph_(graph),
        structure_(internal::AnalyseGraph(graph_)),
        unknown_(internal::NumberUnknowns(structure_.constant, unknowns_)),
        problem_(graph_, structure_, options_) {
    std::vector<Similarity> poses;
    for (const PoseGraphNode& node : graph_.nodes()) poses.push_back(node.pose);
    problem_.SetPoses(poses);
    if (unknowns_ == 0) return;
    factor_.compute(problem_.InformationMatrix(unknown_));
    if (factor_.info() != Eigen::Success)
      throw InputError("covariance: the graph's information matrix is singular");
  }

  Eigen::MatrixXd OfPose(int id) const override {
    const std::size_t k = graph_.IndexOf(id);
    if (unknown_[k] < 0) return Eigen::MatrixXd::Zero(N, N);
    return InPublicOrder(Rows(Columns(k), k));
  }

  bool Connected(int from, int to) const override {
    return structure_.component_of[graph_.IndexOf(from)] == structure_.component_of[graph_.IndexOf(to)];
  }

  Eigen::MatrixXd OfRelativePose(int from, int to) const override {
    PoseGraphEdge exact{from, to, graph_.Node(from).pose.Inverse() * graph_.Node(to).pose,
                        Matrix7d::Identity(), EdgeKind::kLoop};
    Error error;
    return InPublicOrder(Predicted(exact, error));
  }

  double SquaredDistance(const PoseGraphEdge& measurement) const override {
    Error error;
    const Square predicted = Predicted(measurement, error);
    const Square S = internal::EdgeError<N>(measurement, options_.objective).sqrt_information;
    const Square own = internal::Inverse(S.transpose() * S);
    return error.dot(internal::SolveLdlt<N>(predicted + own, error));
  }

 private:
  /// The columns of H^-1 that belong to node k.
  Eigen::MatrixXd Columns(std::size_t k) const {
    Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(N * unknowns_, N);
    rhs.middleRows<N>(N * unknown_[k]).setIdentity();
    return factor_.solve(rhs);
  }
  Square Rows(const Eigen::MatrixXd& columns, std::size_t k) const {
    return columns.middleRows<N>(N * unknown_[k]);
  }

  /// Error of a measurement at the present poses, and its covariance as far as the poses cause it.
  Square Predicted(const PoseGraphEdge& edge, Error& error) const {
    const std::size_t k[2] = {graph_.IndexOf(edge.from), graph_.IndexOf(edge.to)};
    if (structure_.component_of[k[0]] != structure_.component_of[k[1]]) {
      throw InputError("covariance: no edges connect node " + std::to_string(edge.from) + " with node " +
                       std::to_string(edge.to));
    }
    Square J[2];
    internal::EdgeError<N>(edge, options_.objective)
        .Evaluate(problem_.Block(k[0]), problem_.Block(k[1]), error, &J[0], &J[1]);
    Square covariance = Square::Zero();
    for (int b = 0; b < 2; ++b) {
      if (unknown_[k[b]] < 0) continue;
      const Eigen::MatrixXd columns = Columns(k[b]);
      for (int a = 0; a < 2; ++a) {
        if (unknown_[k[a]] >= 0) covariance += J[a] * Rows(columns, k[a]) * J[b].transpose();
      }
    }
    return covariance;
  }

  /// (x, y, heading) or (translation, rotation[, log scale]) from the solver's order.
  static Eigen::MatrixXd InPublicOrder(const Square& m) {
    Eigen::MatrixXd out = m;
    const std::array<int, N> order = internal::SolverOrder<N>();
    if constexpr (N == 7) out(order, order) = m;
    return out;
  }

  const PoseGraph graph_;
  const PoseGraphOptions options_;  // all edges of weight 1, rotation vectors
  const internal::GraphStructure structure_;
  int unknowns_ = 0;
  const std::vector<int> unknown_;
  internal::WeightedGraph<N> problem_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor_;
};

}  // namespace

GraphCovariance::GraphCovariance(const PoseGraph& graph)
    : impl_(internal::WithDimension(graph.kind(), [&](auto n) -> std::unique_ptr<Impl> {
        return std::make_unique<CovarianceOf<n>>(graph);
      })) {}
GraphCovariance::~GraphCovariance() = default;

Eigen::MatrixXd GraphCovariance::OfPose(int id) const { return impl_->OfPose(id); }
Eigen::MatrixXd GraphCovariance::OfRelativePose(int from, int to) const {
  return impl_->OfRelativePose(from, to);
}
double GraphCovariance::SquaredDistance(const PoseGraphEdge& measurement) const {
  return impl_->SquaredDistance(measurement);
}
bool GraphCovariance::Connected(int from, int to) const { return impl_->Connected(from, to); }

}  // namespace tutti
