#include "backend/uncertainty/lifted_relaxation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti::internal {
namespace {

using Relaxation = LiftedRelaxation<2>;
constexpr std::size_t kRing = 20;

// Nodes in one place that look the same way, which the ring says of each two neighbours, and the last
// measurement is off by `off` rad.
std::vector<ChordalTerm<2>> Ring(double off) {
  std::vector<ChordalTerm<2>> terms;
  for (std::size_t k = 0; k < kRing; ++k) {
    const double angle = k + 1 < kRing ? 0 : off;
    ChordalTerm<2> term;
    term.i = k;
    term.j = (k + 1) % kRing;
    term.R << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
    term.t.setZero();
    terms.push_back(term);
  }
  return terms;
}

// Headings that wind once: a local minimum of the ring.
std::vector<Relaxation::Point> Wound() {
  std::vector<Relaxation::Point> points(kRing, Relaxation::Point::Zero());
  for (std::size_t k = 0; k < kRing; ++k) {
    const double angle = 2 * M_PI * static_cast<double>(k) / kRing;
    points[k].block<2, 2>(0, 1) << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  }
  return points;
}

// The same, two nodes of it a little out of the plane.
std::vector<Relaxation::Point> Bent() {
  std::vector<Relaxation::Point> points = Wound();
  points[3](2, 1) = 0.1;
  points[8](3, 2) = 0.1;
  return points;
}

std::vector<bool> FirstHeld() {
  std::vector<bool> held(kRing, false);
  held[0] = true;
  return held;
}

// The ring's quadratic form, and a little more, which makes it definite.
Relaxation::Preconditioner Form(const std::vector<ChordalTerm<2>>& terms) {
  using Block = Eigen::Matrix3d;
  std::vector<Block> diagonal(kRing, 1e-3 * Block::Identity()), off_diagonal;
  std::vector<std::pair<int, int>> pairs;
  for (const ChordalTerm<2>& term : terms) {
    diagonal[term.i] += Block::Identity();
    diagonal[term.j] += Block::Identity();
    pairs.emplace_back(std::max(term.i, term.j), std::min(term.i, term.j));
    Block between = -Block::Identity();
    between.bottomRightCorner<2, 2>() = -(term.i > term.j ? term.R : term.R.transpose());
    off_diagonal.push_back(between);
  }
  Relaxation::Preconditioner form;
  form.Analyse(kRing, pairs);
  EXPECT_TRUE(form.Factorise(diagonal, off_diagonal));
  return form;
}

TEST(LiftedRelaxation, UnwindsARingThroughTheFourthDimension) {
  const std::vector<ChordalTerm<2>> terms = Ring(0);
  Relaxation flat(terms, FirstHeld(), Wound());
  const double wound = flat.cost();
  EXPECT_GT(wound, 1);
  flat.Minimise(Form(terms), 200, 1e-12, [] {});
  EXPECT_NEAR(flat.cost(), wound, 1e-9) << "in the plane there is no way down";
  Relaxation lifted(terms, FirstHeld(), Bent());
  lifted.Minimise(Form(terms), 1000, 1e-12, [] {});
  EXPECT_LT(lifted.cost(), 1e-6);
}

TEST(LiftedRelaxation, ItsMultipliersSumUpToTheCostWhereItIsLeast) {
  const std::vector<ChordalTerm<2>> terms = Ring(0.5);
  Relaxation lifted(terms, FirstHeld(), Bent());
  lifted.Minimise(Form(terms), 2000, 1e-12, [] {});
  // The error spreads evenly: 4 kRing (1 - cos(0.5 / kRing)).
  EXPECT_NEAR(lifted.cost(), 4 * kRing * (1 - std::cos(0.5 / kRing)), 1e-6);
  double traces = 0;
  for (const auto& multiplier : lifted.Multipliers()) traces += multiplier.trace();
  EXPECT_NEAR(traces, lifted.cost(), 1e-6);
}

TEST(LiftedRelaxation, CanBeStopped) {
  const std::vector<ChordalTerm<2>> terms = Ring(0.5);
  Relaxation relaxation(terms, FirstHeld(), Wound());
  EXPECT_THROW(relaxation.Minimise(Form(terms), 100, 1e-12, [] { throw 1; }), int);
}

}  // namespace
}  // namespace tutti::internal
