// Is a pose graph's solution the global optimum of the chordal objective (pose_graph_optimizer.h)?
//
// The objective is a quadratic form of the rotations, f = trace(Q R^T R), once the best translations are put
// in (SE-Sync: Rosen, Carlone, Bandeira, Leonard, IJRR 2019, eq. 22-24). For every block-diagonal symmetric
// matrix L, weak duality gives
//   f(any rotations) >= trace(L) + d n min(0, lambda_min(Q - L)),
// and with L = the symmetric part of the diagonal blocks of Q R^T R at our rotations, trace(L) = f(ours). So
// a certificate matrix Q - L without a negative eigenvalue proves that nothing better exists. lambda_min >=
// -eta is shown by a Cholesky factorisation of Q - L + eta I that succeeds (as in Rosen, "Accelerating
// certifiable estimation with preconditioned eigensolvers", RA-L 2022); Lanczos would bound lambda_min from
// the wrong side. Where it is negative, L comes from the relaxation, in which rotations may leave space
// (Riemannian staircase, ibid. section 4.2), and is lowered along the lowest eigenvectors until little of eta
// is left. The bound holds for all rotations and translations, of whatever rank, and wherever L comes from;
// it is one of the chordal objective (pose_graph_optimizer.h) with all weights 1, not of chi2.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"

#pragma GCC visibility push(default)
namespace tutti {

struct CertificateOptions {
  double certified_gap = 1e-6;  ///< call it the global optimum if (cost - bound) / cost is at most this [1]
  /// Give up where the smallest eigenvalue is below -(this x the largest diagonal entry) [1].
  double max_shift = 1;

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
};

/// What could be proved.
struct Certificate {
  bool available = false;           ///< false: nothing can be said; `reason` says why
  bool certified = false;           ///< certified global optimum of the chordal objective
  std::string reason;               ///< why not available, or why not certified; empty if certified
  double chordal = 0;               ///< chordal cost of the local optimum nearest to the graph's poses
  double lower_bound = 0;           ///< no poses whatsoever have a lower chordal cost
  double relative_gap = 0;          ///< (chordal - lower_bound) / chordal
  double min_eigenvalue_bound = 0;  ///< the certificate matrix has no eigenvalue below this
  double time_s = 0;
};

/// Certifies the graph's poses: polishes a copy of them for the chordal objective (solutions for chi2 and
/// chordal differ a little), then bounds the objective from below. `chordal_optimum`: what the polishing
/// would find, parallel to the nodes, if it is known (PoseGraphReport::chordal_optimum); empty: it is looked
/// for. `stop` is asked now and then: true gives up. All edges count with weight 1. SE(2) and SE(3); not
/// available for Sim(3), or where more than one node of a connected part is fixed. Throws InputError if the
/// options are not usable, or if the chordal optimum is one of another graph. Deterministic.
Certificate CertifyOptimum(const PoseGraph& graph, const CertificateOptions& options = {},
                           std::vector<Similarity> chordal_optimum = {},
                           const std::function<bool()>& stop = {});

}  // namespace tutti
#pragma GCC visibility pop
