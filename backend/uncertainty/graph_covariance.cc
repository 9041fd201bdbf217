#include "tutti/backend/graph_covariance.h"

#include <Eigen/SparseCholesky>
#include <array>
#include <string>
#include <vector>

#include "backend/graph/edge_error.h"
#include "backend/graph/graph_structure.h"
#include "backend/solver/linearized_edge.h"
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
using Square = Eigen::Matrix<double, N, N>;

/// Position in (translation, rotation, log scale) of each coordinate in the solver's order.
template <int N>
std::vector<int> PublicOrder() {
  if constexpr (N == 3) return {0, 1, 2};
  if constexpr (N == 6) return {0, 1, 2, 3, 4, 5};
  if constexpr (N == 7) return {0, 1, 2, 6, 3, 4, 5};
}

}  // namespace

namespace internal {

template <int N>
class CovarianceOf final : public GraphCovariance::Impl {
 public:
  explicit CovarianceOf(const PoseGraph& graph) : graph_(graph), structure_(AnalyseGraph(graph)) {
    unknown_ = NumberRows<N>(structure_.constant, size_);
    blocks_.resize(graph.nodes().size());
    for (std::size_t k = 0; k < blocks_.size(); ++k) PoseToBlock<N>(graph.nodes()[k].pose, blocks_[k].data());
    std::vector<Eigen::Triplet<double>> triplets;
    for (std::size_t e = 0; e < graph.edges().size(); ++e) AddEdge(e, triplets);
    if (size_ == 0) return;
    Eigen::SparseMatrix<double> H(size_, size_);
    H.setFromTriplets(triplets.begin(), triplets.end());
    factor_.compute(H);
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
    Eigen::Matrix<double, N, 1> error;
    return InPublicOrder(Predicted(exact, error));
  }

  double SquaredDistance(const PoseGraphEdge& measurement) const override {
    Eigen::Matrix<double, N, 1> error;
    const Square<N> predicted = Predicted(measurement, error);
    const Square<N> S = MakeEdgeConstants<N>(measurement, GraphObjective::kChi2Log).sqrt_information;
    const Square<N> own = internal::Inverse(S.transpose() * S);
    return error.dot(internal::SolveLdlt<N>(predicted + own, error));
  }

 private:
  void AddEdge(std::size_t e, std::vector<Eigen::Triplet<double>>& triplets) const {
    const internal::EdgeEnds& ends = structure_.ends[e];
    const auto constants = MakeEdgeConstants<N>(graph_.edges()[e], GraphObjective::kChi2Log);
    AddInformation<N>(Linearize<N>(constants, blocks_[ends.from].data(), blocks_[ends.to].data()),
                      {unknown_[ends.from], unknown_[ends.to]}, triplets);
  }

  /// The columns of H^-1 that belong to node k.
  Eigen::MatrixXd Columns(std::size_t k) const {
    Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(size_, N);
    rhs.middleRows<N>(unknown_[k]).setIdentity();
    return factor_.solve(rhs);
  }
  Square<N> Rows(const Eigen::MatrixXd& columns, std::size_t k) const {
    return columns.middleRows<N>(unknown_[k]);
  }

  /// Error of a measurement at the present poses, and its covariance as far as the poses cause it.
  Square<N> Predicted(const PoseGraphEdge& edge, Eigen::Matrix<double, N, 1>& error) const {
    const std::size_t k[2] = {graph_.IndexOf(edge.from), graph_.IndexOf(edge.to)};
    if (structure_.component_of[k[0]] != structure_.component_of[k[1]]) {
      throw InputError("covariance: no edges connect node " + std::to_string(edge.from) + " with node " +
                       std::to_string(edge.to));
    }
    Square<N> J[2];
    EdgeError<N>(MakeEdgeConstants<N>(edge, GraphObjective::kChi2Log), blocks_[k[0]].data(),
                 blocks_[k[1]].data(), error, &J[0], &J[1]);
    Square<N> covariance = Square<N>::Zero();
    for (int b = 0; b < 2; ++b) {
      if (unknown_[k[b]] < 0) continue;
      const Eigen::MatrixXd columns = Columns(k[b]);
      for (int a = 0; a < 2; ++a) {
        if (unknown_[k[a]] >= 0) covariance += J[a] * Rows(columns, k[a]) * J[b].transpose();
      }
    }
    return covariance;
  }

  static Eigen::MatrixXd InPublicOrder(const Square<N>& m) {
    const std::vector<int> order = PublicOrder<N>();
    Eigen::MatrixXd out(N, N);
    for (int r = 0; r < N; ++r) {
      for (int c = 0; c < N; ++c)
        out(order[static_cast<std::size_t>(r)], order[static_cast<std::size_t>(c)]) = m(r, c);
    }
    return out;
  }

  PoseGraph graph_;
  internal::GraphStructure structure_;
  std::vector<int> unknown_;  // first row of each node; -1: held in place
  std::vector<std::array<double, BlockSize<N>()>> blocks_;
  int size_ = 0;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor_;
};

}  // namespace internal

GraphCovariance::GraphCovariance(const PoseGraph& graph) {
  switch (graph.kind()) {
    case GraphKind::kSE2:
      impl_ = std::make_unique<internal::CovarianceOf<3>>(graph);
      break;
    case GraphKind::kSE3:
      impl_ = std::make_unique<internal::CovarianceOf<6>>(graph);
      break;
    case GraphKind::kSim3:
      impl_ = std::make_unique<internal::CovarianceOf<7>>(graph);
      break;
  }
}
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
