#include "backend/robust/robust_solver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "backend/solver/robust_loss.h"
#include "backend/uncertainty/edge_prediction.h"
#include "core/numbers.h"

namespace tutti::internal {
namespace {

constexpr int kIterationsPerRound = 4;  // a round need not converge; the last one does
/// The threshold shrinks by this factor per round. It starts at the largest chi-square of a loop, so that
/// drift does not look like a false loop: about log(largest / threshold) / log(kStep) rounds.
constexpr double kStep = 4;
constexpr int kMostRounds = 60;  // 1e36 between the two; a bound for graphs that do not settle

constexpr double kSafeSigmas = 10;  // of the loops' own spread; real ones have heavy tails
/// On top of the 99 % quantile. True loops of intel, ringCity, manhattan and manhattanOlson3500 stay
/// within 3 sigma of the graph's own spread, 0.7 % of parking-garage's do not
/// (docs/backend.md, section 2).
constexpr double kStrainSigmas = 3;

}  // namespace

double ShownShare(const std::vector<double>& chi2, int dimension) {
  constexpr double kSigmas = 3;
  if (chi2.empty()) return 1;
  return std::min(1.0, kSigmas * kSigmas * Median(chi2) / ChiSquareMedian(dimension));
}

RobustSolver::RobustSolver(GraphProblem& problem, const PoseGraphOptions& options,
                           std::function<bool(int)> solve_once)
    : problem_(problem), options_(options), solve_once_(std::move(solve_once)) {
  for (std::size_t e = 0; e < problem.weights().size(); ++e) {
    if (problem.IsLoop(e)) loops_.push_back(e);
  }
}

std::vector<std::size_t> RobustSolver::LoopsIn() const {
  std::vector<std::size_t> out;
  for (const std::size_t e : loops_) {
    if (problem_.weight(e) > 0) out.push_back(e);
  }
  return out;
}

double RobustSolver::LargestChi2() const {
  double largest = 0;
  for (const std::size_t e : loops_) largest = std::max(largest, problem_.EdgeChi2(e));
  return largest;
}

bool RobustSolver::Solve(int attempt) {
  const double c2 = problem_.threshold();
  for (const std::size_t e : loops_) problem_.SetWeight(e, 1.0);
  const bool graduated = attempt == 0;
  switch (options_.robust) {
    case RobustLoss::kNone:
      return solve_once_(options_.max_iterations);
    case RobustLoss::kHuber:
      return SolveWith(new ceres::HuberLoss(std::sqrt(c2)), options_.max_iterations);
    case RobustLoss::kCauchy:
      return Graduate(graduated, [](double t) { return new ceres::CauchyLoss(std::sqrt(t)); });
    case RobustLoss::kDcs:
      return Graduate(graduated, [](double t) { return new DcsLoss(t); });
    case RobustLoss::kGnc:
      // Geman-McClure pulls less at true loops near the threshold than they deserve; DCS does not.
      return Graduate(graduated, [](double t) { return new GemanMcClureLoss(t); }) &&
             SolveWith(new DcsLoss(c2), Few()) && Sort(c2);
  }
  return false;
}

bool RobustSolver::DecideLoops(double c2) { return Sort(c2) && solve_once_(options_.max_iterations); }

bool RobustSolver::Refine() {
  const bool decides = options_.robust == RobustLoss::kGnc;
  for (int round = 0; round < kMostRounds; ++round) {
    if (!Tighten()) return false;
    if (!decides) return true;
    if (!DecideLoops(problem_.threshold())) return false;
    if (!ThresholdIsTooWide()) break;  // the converged solution may show less noise
  }
  return problem_.HasMeasurements() || DropStrained();  // which knows no landmarks
}

/// Information matrices are often right up to a factor only: where the loops fit so much better than they
/// promise that the threshold lies beyond kSafeSigmas of what the graph shows, false loops hide below it.
/// The threshold is then brought down to there, step by step, since the graph fits better as they leave.
/// Nothing to do where the user gave the threshold.
bool RobustSolver::Tighten() {
  for (int round = 0; round < kMostRounds && ThresholdIsTooWide(); ++round) {
    ++rounds_;
    problem_.SetThreshold(std::max(ShownThreshold(), problem_.threshold() / kStep));
    if (!Solve(1)) return false;
  }
  return true;
}

bool RobustSolver::ThresholdIsTooWide() const {
  return options_.robust_chi2 == 0 && ShownThreshold() <= 0.9 * problem_.threshold();
}

/// The 99 % quantile for the noise that the loops show (their median chi-square), kSafeSigmas wide.
double RobustSolver::ShownThreshold() const {
  std::vector<double> chi2;
  for (const std::size_t e : loops_) chi2.push_back(problem_.EdgeChi2(e));
  if (chi2.empty()) return problem_.threshold();
  const int n = problem_.dimension();
  return kSafeSigmas * kSafeSigmas * Median(chi2) / ChiSquareMedian(n) * ChiSquare99(n);
}

/// After DecideLoops: takes out the loops that have bent the graph. A false loop between two places that
/// little else holds together fits well where it is in; what betrays it is how much better the others fit
/// without it (LeaveOneOutChi2). Out go the loops for which that is beyond kStrainSigmas of what the loops
/// show, the worst first, and loops that they had pushed out may come back.
bool RobustSolver::DropStrained() {
  for (int round = 0; round < kMostRounds && options_.robust_chi2 == 0; ++round) {
    const double limit = DropWorst();
    if (limit == 0) break;
    ++rounds_;
    if (!solve_once_(Few())) return false;
    const double c2 = problem_.threshold();
    SetWeights([&](std::size_t e, double s) {
      return s <= (problem_.weight(e) == 0 ? std::min(limit, c2) : c2);  // else it would be back for more
    });
    if (!solve_once_(options_.max_iterations)) return false;
  }
  return true;
}

/// One round of DropStrained without the solving. The limit, 9 min(1, median / median of the distribution)
/// times the 99 % quantile: unlike ShownShare's it may lie beyond the quantile. 0 if no loop is beyond it.
double RobustSolver::DropWorst() {
  const std::vector<std::size_t> loops = LoopsIn();
  if (loops.empty()) return 0;
  const std::vector<double> chi2 = LeaveOneOutChi2(problem_, loops);
  if (chi2.empty()) return 0;
  const int n = problem_.dimension();
  const double worst = *std::max_element(chi2.begin(), chi2.end());
  const double shown = std::min(1.0, Median(chi2) / ChiSquareMedian(n));
  const double limit = kStrainSigmas * kStrainSigmas * shown * ChiSquare99(n);
  if (!(worst > limit)) return 0;
  for (std::size_t k = 0; k < loops.size(); ++k) {
    if (chi2[k] > std::max(limit, worst / 2)) problem_.SetWeight(loops[k], 0);
  }
  return limit;
}

/// DecideLoops without the convergence at the end.
bool RobustSolver::Sort(double c2) {
  constexpr int kRounds = 10;
  problem_.SetLoss(nullptr);
  for (int round = 0; round < kRounds; ++round) {
    if (!SetWeights([c2](std::size_t, double s) { return s <= c2; }) && round > 0) break;
    if (!solve_once_(Few())) return false;
  }
  return true;
}

bool RobustSolver::SolveWith(ceres::LossFunction* owned, int iterations) {
  problem_.SetLoss(owned);
  return solve_once_(iterations);
}

/// `loss`: with a threshold, from loose to tight.
bool RobustSolver::Graduate(bool graduated, const std::function<ceres::LossFunction*(double)>& loss) {
  const double c2 = problem_.threshold();
  double loose = graduated ? LargestChi2() : c2;
  for (int round = 0; loose > c2 && round < kMostRounds; ++round, loose /= kStep) {
    ++rounds_;
    problem_.SetLoss(loss(loose));
    if (round > 0) problem_.KeepTrustRegion();
    if (!solve_once_(kIterationsPerRound)) return false;
    // Loops that have come together need no further rounds.
    loose = std::min(loose, kStep * std::max(c2, LargestChi2()));
  }
  if (graduated) problem_.KeepTrustRegion();
  const bool decided_later = options_.robust == RobustLoss::kGnc;
  return SolveWith(loss(c2), decided_later ? Few() : options_.max_iterations);
}

/// Weights 0 or 1 of the loops from their positions and chi-squares; false if none changed.
bool RobustSolver::SetWeights(const std::function<bool(std::size_t, double)>& is_in) {
  bool changed = false;
  for (const std::size_t e : loops_) {
    const double weight = is_in(e, problem_.EdgeChi2(e)) ? 1.0 : 0.0;
    changed = changed || weight != problem_.weight(e);
    problem_.SetWeight(e, weight);
  }
  return changed;
}

}  // namespace tutti::internal
