#include "backend/uncertainty/lifted_relaxation.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tutti::internal {
namespace {

template <typename Points>
double Dot(const Points& a, const Points& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k].cwiseProduct(b[k]).sum();
  return sum;
}

/// a += factor * b
template <typename Points>
void Add(Points& a, double factor, const Points& b) {
  for (std::size_t k = 0; k < a.size(); ++k) a[k] += factor * b[k];
}

/// The columns of the rotation, by Gram and Schmidt.
template <typename Point>
void Orthonormalise(Point& point) {
  for (Eigen::Index c = 1; c < point.cols(); ++c) {
    for (Eigen::Index b = 1; b < c; ++b) point.col(c) -= point.col(b).dot(point.col(c)) * point.col(b);
    point.col(c).normalize();
  }
}

}  // namespace

template <int D>
LiftedRelaxation<D>::LiftedRelaxation(const std::vector<ChordalTerm<D>>& terms, std::vector<bool> anchors,
                                      std::vector<Point> start)
    : terms_(terms), anchors_(std::move(anchors)), points_(std::move(start)) {
  for (Point& point : points_) Orthonormalise(point);
  cost_ = CostOf(points_);
}

template <int D>
double LiftedRelaxation<D>::CostOf(const Points& points) const {
  double sum = 0;
  for (const ChordalTerm<D>& term : terms_) {
    const auto from = points[term.i].template rightCols<D>(), to = points[term.j].template rightCols<D>();
    sum += term.kappa * (to - from * term.R).squaredNorm() +
           term.tau * (points[term.j].col(0) - points[term.i].col(0) - from * term.t).squaredNorm();
  }
  return sum;
}

/// X Q, by the residuals of the terms: nothing cancels where they are small.
template <int D>
typename LiftedRelaxation<D>::Points LiftedRelaxation<D>::Product(const Points& v) const {
  Points out(v.size(), Point::Zero());
  for (const ChordalTerm<D>& term : terms_) {
    const auto from = v[term.i].template rightCols<D>();
    const Eigen::Matrix<double, kRank, D> rotation =
        term.kappa * (v[term.j].template rightCols<D>() - from * term.R);
    const Eigen::Matrix<double, kRank, 1> translation =
        term.tau * (v[term.j].col(0) - v[term.i].col(0) - from * term.t);
    out[term.j].col(0) += translation;
    out[term.j].template rightCols<D>() += rotation;
    out[term.i].col(0) -= translation;
    out[term.i].template rightCols<D>() -= rotation * term.R.transpose() + translation * term.t.transpose();
  }
  for (std::size_t k = 0; k < out.size(); ++k) {
    if (anchors_[k]) out[k].col(0).setZero();
  }
  return out;
}

template <int D>
std::vector<typename LiftedRelaxation<D>::Rotation> LiftedRelaxation<D>::MultipliersOf(
    const Points& product) const {
  std::vector<Rotation> out;
  out.reserve(product.size());
  for (std::size_t k = 0; k < product.size(); ++k) {
    const Rotation pull = points_[k].template rightCols<D>().transpose() * product[k].template rightCols<D>();
    out.push_back(0.5 * (pull + pull.transpose()));
  }
  return out;
}

template <int D>
void LiftedRelaxation<D>::Project(Points& v) const {
  for (std::size_t k = 0; k < v.size(); ++k) {
    const auto Y = points_[k].template rightCols<D>();
    const Rotation along = Y.transpose() * v[k].template rightCols<D>();
    v[k].template rightCols<D>() -= 0.5 * Y * (along + along.transpose());
    if (anchors_[k]) v[k].col(0).setZero();
  }
}

template <int D>
void LiftedRelaxation<D>::Precondition(const Preconditioner& form, Points& v) const {
  // A point's columns are one after the other, as the rows of the right-hand sides are.
  static_assert(sizeof(Point) == sizeof(double) * kRank * (D + 1), "points without gaps");
  static_assert(kRank == (D + 1) + 2, "SolveMany has two right-hand sides more than a block has rows");
  form.SolveMany(v.front().data());
  Project(v);
}

template <int D>
typename LiftedRelaxation<D>::Points LiftedRelaxation<D>::Step(const Preconditioner& form, double radius,
                                                               int& products, double& expected,
                                                               bool& inside) const {
  constexpr double kForcing = 0.1;  // residual at which the system counts as solved
  Points step(points_.size(), Point::Zero()), residual = gradient_, z = gradient_;
  Precondition(form, z);
  Points direction(points_.size(), Point::Zero());
  Add(direction, -1, z);
  double rz = Dot(residual, z);
  const double enough = kForcing * kForcing * rz;
  double step_norm = 0, step_direction = 0, direction_norm = rz;  // squared, in the preconditioner's metric
  expected = 0;
  inside = false;
  while (products-- > 0 && rz > enough) {
    Points bent = Product(direction);
    for (std::size_t k = 0; k < bent.size(); ++k)
      bent[k].template rightCols<D>() -= direction[k].template rightCols<D>() * multipliers_[k];
    Project(bent);
    const double curvature = Dot(direction, bent), alpha = rz / curvature;
    const double longer = step_norm + 2 * alpha * step_direction + alpha * alpha * direction_norm;
    if (!(curvature > 0) || longer >= radius * radius) {
      const double to_border = (-step_direction + std::sqrt(step_direction * step_direction +
                                                            direction_norm * (radius * radius - step_norm))) /
                               direction_norm;
      expected += to_border * rz - 0.5 * to_border * to_border * curvature;
      Add(step, to_border, direction);
      return step;
    }
    expected += 0.5 * alpha * rz;
    Add(step, alpha, direction);
    Add(residual, alpha, bent);
    step_norm = longer;
    z = residual;
    Precondition(form, z);
    const double before = std::exchange(rz, Dot(residual, z)), beta = rz / before;
    step_direction = beta * (step_direction + alpha * direction_norm);
    direction_norm = rz + beta * beta * direction_norm;
    for (std::size_t k = 0; k < direction.size(); ++k) direction[k] = beta * direction[k] - z[k];
  }
  inside = true;
  return step;
}

template <int D>
typename LiftedRelaxation<D>::Points LiftedRelaxation<D>::Moved(const Points& step) const {
  Points out = points_;
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k] += step[k];
    Orthonormalise(out[k]);
  }
  return out;
}

template <int D>
void LiftedRelaxation<D>::Minimise(const Preconditioner& form, int products, double tolerance,
                                   const std::function<void()>& check) {
  constexpr double kShortest = 1e-4;  // share of a step
  double radius = 0.1 * std::sqrt(cost_);
  while (products > 0) {
    check();
    gradient_ = Product(points_);
    multipliers_ = MultipliersOf(gradient_);
    Project(gradient_);
    double expected = 0;  // of half the cost
    bool inside = false;
    Points step = Step(form, radius, products, expected, inside);
    // A step that leads too far is shortened: the way to it was expensive.
    double share = 1, cost = 0;
    Points moved;
    for (;; share *= 0.5) {
      if (!(expected > 0) || share < kShortest) return;
      moved = Moved(step);
      cost = CostOf(moved);
      if (cost_ - cost > 0.1 * share * 2 * expected) break;
      for (Point& point : step) point *= 0.5;
    }
    if (share < 1) radius *= share;
    if (share == 1 && !inside) radius *= 2;
    const bool last = inside && cost_ - cost < tolerance * cost_;
    points_ = std::move(moved);
    cost_ = cost;
    if (last) return;
  }
}

template class LiftedRelaxation<2>;
template class LiftedRelaxation<3>;

}  // namespace tutti::internal
