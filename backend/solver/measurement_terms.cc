#include "backend/solver/measurement_terms.h"

#include <algorithm>
#include <cmath>

#include "backend/graph/manifold.h"
#include "core/dense_solvers.h"

namespace tutti::internal {
namespace {

/// Residual of a measurement: that of an edge between its two ends, each of which is moved by its own block
/// or by none, of which a position or a bearing takes a part. Blocks: the nodes' first, then the landmarks'.
template <int N>
class MeasurementCost final : public ceres::CostFunction {
  static constexpr int kPoint = MeasurementTerms<N>::kPoint;
  using Square = Eigen::Matrix<double, N, N>;
  using Vector = Eigen::Matrix<double, N, 1>;

 public:
  MeasurementCost(const PoseGraphMeasurement& measurement, GraphObjective objective)
      : is_bearing_(measurement.what == PoseGraphMeasurement::What::kBearing),
        bearing_(measurement.bearing),
        ends_{measurement.from, measurement.to},
        edge_({0, 0, is_bearing_ ? Similarity() : measurement.value, Matrix7d::Identity()}, objective) {
    const Eigenpairs eigen = SymmetricEigen(InSolverOrder<N>(measurement.information));
    root_ = eigen.values.cwiseMax(0).cwiseSqrt().asDiagonal() * eigen.vectors.transpose();
    if (is_bearing_) root_bearing_ = std::sqrt(std::max(0.0, measurement.information(0, 0)));
    set_num_residuals(is_bearing_ ? 1 : N);
    for (const MeasurementEnd::What what : {MeasurementEnd::What::kNode, MeasurementEnd::What::kLandmark}) {
      for (std::size_t e = 0; e < 2; ++e) {
        if (ends_[e].what != what) continue;
        block_of_[e] = mutable_parameter_block_sizes()->size();
        mutable_parameter_block_sizes()->push_back(what == MeasurementEnd::What::kNode ? BlockSize<N>()
                                                                                       : kPoint);
      }
    }
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    double blocks[2][8];
    Square moved[2];  // of the end's pose by the tangent of its block; a landmark has its first columns
    for (std::size_t e = 0; e < 2; ++e) PlaceEnd(e, parameters, blocks[e], moved[e]);
    Vector error;
    Square J[2];
    edge_.Evaluate(blocks[0], blocks[1], error, &J[0], &J[1]);
    Eigen::Matrix<double, Eigen::Dynamic, N> root = root_;
    if (is_bearing_) {
      // A landmark at the sensor has no direction: it is moved by its other measurements.
      const double squared = std::max(error.template head<2>().squaredNorm(), 1e-300);
      residuals[0] = root_bearing_ * WrapAngle(std::atan2(error(1), error(0)) - bearing_);
      root = Eigen::Matrix<double, 1, N>::Zero();
      root(0, 0) = -root_bearing_ * error(1) / squared;
      root(0, 1) = root_bearing_ * error(0) / squared;
    } else {
      Eigen::Map<Vector>{residuals} = root_ * error;
    }
    for (std::size_t e = 0; jacobians != nullptr && e < 2; ++e) {
      if (ends_[e].what == MeasurementEnd::What::kWorld || jacobians[block_of_[e]] == nullptr) continue;
      const Eigen::Matrix<double, Eigen::Dynamic, N> all = root * J[e] * moved[e];
      const int columns = ends_[e].what == MeasurementEnd::What::kNode ? BlockSize<N>() : kPoint;
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> out(
          jacobians[block_of_[e]], num_residuals(), columns);
      out.setZero();  // the last column of a block on its manifold
      const int used = std::min(columns, N);
      out.leftCols(used) = all.leftCols(used);
    }
    return true;
  }

 private:
  void PlaceEnd(std::size_t e, double const* const* parameters, double* block, Square& moved) const {
    moved.setIdentity();
    Similarity pose;
    if (ends_[e].what == MeasurementEnd::What::kLandmark) {
      for (int k = 0; k < kPoint; ++k) pose.translation(k) = parameters[block_of_[e]][k];
    } else if (ends_[e].what == MeasurementEnd::What::kNode) {
      const Similarity node = BlockToPose<N>(parameters[block_of_[e]]);
      const Similarity& sensor = ends_[e].sensor;
      pose = node * sensor;
      const Eigen::Matrix3d R = node.rotation.toRotationMatrix();
      if constexpr (N == 3) {
        moved.template block<2, 1>(0, 2) = (R * Eigen::Vector3d::UnitZ().cross(sensor.translation)).head<2>();
      } else {
        moved.template block<3, 3>(0, N - 3) = -R * Skew(sensor.translation);
        moved.template block<3, 3>(N - 3, N - 3) = sensor.rotation.conjugate().toRotationMatrix();
      }
    }
    PoseToBlock<N>(pose, block);
  }

  bool is_bearing_;
  double bearing_, root_bearing_ = 0;
  MeasurementEnd ends_[2];
  EdgeError<N> edge_;
  Square root_;  // root^T root = information, which may be singular
  std::size_t block_of_[2] = {0, 0};
};

}  // namespace

template <int N>
MeasurementTerms<N>::MeasurementTerms(const PoseGraph& graph, GraphObjective objective) {
  points_.resize(graph.landmarks().size() * static_cast<std::size_t>(kPoint));
  for (const PoseGraphLandmark& landmark : graph.landmarks()) fixed_.push_back(landmark.fixed);
  for (std::size_t k = 0; k < fixed_.size(); ++k) SetLandmark(k, graph.landmarks()[k].position);
  for (const PoseGraphMeasurement& measurement : graph.measurements()) {
    Term term;
    term.cost = std::make_unique<MeasurementCost<N>>(measurement, objective);
    for (const MeasurementEnd& end : {measurement.from, measurement.to}) {
      if (end.what == MeasurementEnd::What::kNode) term.nodes.push_back(graph.IndexOf(end.id));
      if (end.what == MeasurementEnd::What::kLandmark)
        term.landmarks.push_back(graph.IndexOfLandmark(end.id));
    }
    terms_.push_back(std::move(term));
  }
}

template <int N>
Eigen::Vector3d MeasurementTerms<N>::Landmark(std::size_t k) const {
  Eigen::Vector3d out = Eigen::Vector3d::Zero();
  for (int c = 0; c < kPoint; ++c) out(c) = points_[k * kPoint + static_cast<std::size_t>(c)];
  return out;
}

template <int N>
void MeasurementTerms<N>::SetLandmark(std::size_t k, const Eigen::Vector3d& position) {
  for (int c = 0; c < kPoint; ++c) points_[k * kPoint + static_cast<std::size_t>(c)] = position(c);
}

template <int N>
std::vector<const double*> MeasurementTerms<N>::Parameters(const Term& term, const double* blocks) const {
  std::vector<const double*> out;
  for (const std::size_t k : term.nodes) out.push_back(blocks + k * static_cast<std::size_t>(BlockSize<N>()));
  for (const std::size_t k : term.landmarks) out.push_back(points_.data() + k * kPoint);
  return out;
}

template <int N>
double MeasurementTerms<N>::Chi2(const double* blocks) const {
  double sum = 0;
  for (const Term& term : terms_) {
    Eigen::Matrix<double, N, 1> residual = Eigen::Matrix<double, N, 1>::Zero();
    term.cost->Evaluate(Parameters(term, blocks).data(), residual.data(), nullptr);
    sum += residual.squaredNorm();
  }
  return sum;
}

template <int N>
void MeasurementTerms<N>::AddTo(ceres::Problem& problem, double* blocks) {
  for (std::size_t k = 0; k < fixed_.size(); ++k) {
    AddBlock(problem, points_.data() + k * kPoint, kPoint, nullptr);
    if (fixed_[k]) problem.SetParameterBlockConstant(points_.data() + k * kPoint);
  }
  for (const Term& term : terms_) {
    std::vector<double*> parameters;
    for (const std::size_t k : term.nodes)
      parameters.push_back(blocks + k * static_cast<std::size_t>(BlockSize<N>()));
    for (const std::size_t k : term.landmarks) parameters.push_back(points_.data() + k * kPoint);
    problem.AddResidualBlock(term.cost.get(), nullptr, parameters);
  }
}

template class MeasurementTerms<3>;
template class MeasurementTerms<6>;
template class MeasurementTerms<7>;

namespace {

template <int N>
double Chi2As(const PoseGraph& graph, GraphObjective objective, const std::vector<Similarity>& poses) {
  const std::size_t nodes = graph.nodes().size(), size = static_cast<std::size_t>(BlockSize<N>());
  MeasurementTerms<N> terms(graph, objective);
  std::vector<double> blocks(nodes * size);
  for (std::size_t k = 0; k < nodes; ++k) PoseToBlock<N>(poses[k], &blocks[k * size]);
  for (std::size_t k = nodes; k < poses.size(); ++k) terms.SetLandmark(k - nodes, poses[k].translation);
  return terms.Chi2(blocks.data());
}

}  // namespace

double MeasurementChi2(const PoseGraph& graph, GraphObjective objective,
                       const std::vector<Similarity>& poses) {
  return graph.kind() == GraphKind::kSE2 ? Chi2As<3>(graph, objective, poses)
                                         : Chi2As<6>(graph, objective, poses);
}

}  // namespace tutti::internal
