// import tutti: the module that tutti/__init__.py takes everything from.
#include "apps/python/bindings.h"
#include "tutti/slam/version.h"

// What another one's signature names is bound before it.
PYBIND11_MODULE(_tutti, module) {
  using namespace tutti::python;      // NOLINT(google-build-using-namespace)
  module.attr("__name__") = "tutti";  // where the classes are for those who read their names
  module.doc() = "Visual SLAM and loop closure. docs/python.md explains it.";
  module.attr("__version__") = tutti::kVersion;
  BindErrors(module);
  BindCamera(module);
  BindConfig(module);
  BindTrajectories(module);
  BindLoopResult(module);
  BindLoopDetector(module);
  BindDataset(module);
  BindOptimizationReport(module);
  BindPoseGraph(module);
  BindSlamSystem(module);
  BindTrajectoryCloser(module);
  BindEvaluation(module);
  SetSignatures(module);
}
