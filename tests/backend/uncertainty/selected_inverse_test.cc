#include "backend/uncertainty/selected_inverse.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

using internal::SelectedInverse;

/// A random positive definite matrix of a loopy graph, blocks of 2; some entries in the pattern are exactly
/// 0.
Eigen::SparseMatrix<double> RandomMatrix(int blocks) {
  std::mt19937 random(3);
  std::vector<Eigen::Triplet<double>> triplets;
  const auto link = [&](int a, int b) {
    const double w = 0.5 + 1e-9 * static_cast<double>(random());
    for (int k = 0; k < 2; ++k) {
      triplets.emplace_back(2 * a + k, 2 * a + k, w);
      triplets.emplace_back(2 * b + k, 2 * b + k, w);
      for (int l = 0; l < 2; ++l)
        triplets.emplace_back(2 * std::max(a, b) + k, 2 * std::min(a, b) + l, k == l ? -w : 0);
    }
  };
  for (int a = 0; a + 1 < blocks; ++a) link(a, a + 1);
  for (int a = 0; a + 7 < blocks; a += 3) link(a, a + 7);
  for (int k = 0; k < 2; ++k) triplets.emplace_back(k, k, 1.0);
  Eigen::SparseMatrix<double> H(2 * blocks, 2 * blocks);
  H.setFromTriplets(triplets.begin(), triplets.end());
  return H;
}

TEST(SelectedInverse, EqualsTheDenseInverseWhereverTheMatrixHasAnEntry) {
  const Eigen::SparseMatrix<double> H = RandomMatrix(40);
  const Eigen::SparseMatrix<double> full = H.selfadjointView<Eigen::Lower>();
  const Eigen::MatrixXd dense = testing::DenseInverse(full);
  const SelectedInverse inverse(H);
  ASSERT_TRUE(inverse.Ok());
  for (int c = 0; c < H.outerSize(); ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(H, c); it; ++it) {
      const int r = static_cast<int>(it.row());
      EXPECT_NEAR(inverse.At(r, c), dense(r, c), 1e-12) << r << ", " << c;
      EXPECT_EQ(inverse.At(r, c), inverse.At(c, r));
    }
  }
}

TEST(SelectedInverse, SaysSoIfTheMatrixIsNotPositiveDefinite) {
  Eigen::SparseMatrix<double> H = RandomMatrix(5);
  H.coeffRef(4, 4) = -1;
  EXPECT_FALSE(SelectedInverse(H).Ok());
}

}  // namespace
}  // namespace tutti
