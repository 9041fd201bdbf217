#include "backend/solver/graph_solver.h"

#include "backend/solver/block_solver.h"
#include "backend/solver/ceres_solver.h"

namespace tutti::internal {

template <int N>
std::unique_ptr<GraphSolver<N>> MakeGraphSolver(PoseGraphSolver solver) {
  if (solver == PoseGraphSolver::kBlock) return std::make_unique<BlockSolver<N>>();
  return std::make_unique<CeresSolver<N>>();
}

template std::unique_ptr<GraphSolver<3>> MakeGraphSolver<3>(PoseGraphSolver solver);
template std::unique_ptr<GraphSolver<6>> MakeGraphSolver<6>(PoseGraphSolver solver);
template std::unique_ptr<GraphSolver<7>> MakeGraphSolver<7>(PoseGraphSolver solver);

}  // namespace tutti::internal
