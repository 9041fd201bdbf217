#include "bench/stock_ceres.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <vector>

#include "backend/graph/manifold.h"

namespace tutti {
namespace {

/// Ceres' examples/slam/pose_graph_3d/pose_graph_3d_error_term.h: (p, 2 vec(q)) whitened by S, S^T S =
/// information.
class ErrorTerm {
 public:
  explicit ErrorTerm(const PoseGraphEdge& edge) : measured_(edge.measurement) {
    const Matrix6d information = edge.information.topLeftCorner<6, 6>();
    sqrt_information_ = information.llt().matrixU();
  }

  template <typename T>
  bool operator()(const T* p_a, const T* q_a, const T* p_b, const T* q_b, T* residuals) const {
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> pa(p_a), pb(p_b);
    const Eigen::Map<const Eigen::Quaternion<T>> qa(q_a), qb(q_b);
    const Eigen::Quaternion<T> qa_inverse = qa.conjugate();
    const Eigen::Quaternion<T> delta = measured_.rotation.template cast<T>() * (qa_inverse * qb).conjugate();
    Eigen::Map<Eigen::Matrix<T, 6, 1>> out(residuals);
    out.template head<3>() = qa_inverse * (pb - pa) - measured_.translation.template cast<T>();
    out.template tail<3>() = T(2.0) * delta.vec();
    out.applyOnTheLeft(sqrt_information_.template cast<T>());
    return true;
  }

 private:
  Similarity measured_;
  Matrix6d sqrt_information_;
};

struct Block {
  Eigen::Vector3d p;
  Eigen::Quaterniond q;
};

}  // namespace

double SolveWithStockCeres(PoseGraph& graph) {
#if TUTTI_CERES_HAS_MANIFOLD
  using Quaternions = ceres::EigenQuaternionManifold;
#else
  using Quaternions = ceres::EigenQuaternionParameterization;
#endif
  std::vector<Block> blocks;
  for (const PoseGraphNode& node : graph.nodes())
    blocks.push_back({node.pose.translation, node.pose.rotation});
  ceres::Problem problem;
  auto* quaternions = new Quaternions;  // the problem owns it
  for (Block& block : blocks) {
    internal::AddBlock(problem, block.p.data(), 3, nullptr);
    internal::AddBlock(problem, block.q.coeffs().data(), 4, quaternions);
  }
  for (const PoseGraphEdge& edge : graph.edges()) {
    Block &a = blocks[graph.IndexOf(edge.from)], &b = blocks[graph.IndexOf(edge.to)];
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ErrorTerm, 6, 3, 4, 3, 4>(new ErrorTerm(edge)),
                             nullptr, a.p.data(), a.q.coeffs().data(), b.p.data(), b.q.coeffs().data());
  }
  problem.SetParameterBlockConstant(blocks.front().p.data());
  problem.SetParameterBlockConstant(blocks.front().q.coeffs().data());
  ceres::Solver::Options options;
  options.max_num_iterations = 200;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    graph.SetPose(graph.nodes()[k].id, Similarity(1.0, blocks[k].q, blocks[k].p));
  }
  return summary.final_cost;
}

}  // namespace tutti
