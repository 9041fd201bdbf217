// tutti.OptimizationReport and tutti.Certificate
#include "apps/python/optimization_report.h"
#include "apps/python/pickled.h"

#include <string>

#include "tutti/backend/certificate.h"

namespace tutti::python {

py::dict CostsOf(const GraphCosts& costs) {
  py::dict all;
  all["chi2"] = costs.chi2;
  all["chi2log"] = costs.chi2log;
  all["chordal"] = costs.chordal;
  return all;
}

void BindOptimizationReport(py::module_& module) {
  using Report = PoseGraphReport;
  py::class_<Report>(module, "OptimizationReport",
                     "What PoseGraph.optimize did. Arrays are parallel to the edges.")
      .def_readonly("success", &Report::success, doc::PoseGraphReport_success)
      .def_readonly("reason", &Report::reason, doc::PoseGraphReport_reason)
      .def_readonly("termination", &Report::termination, doc::PoseGraphReport_termination)
      .def_property_readonly(
          "start", [](const Report& report) { return ToString(report.start); }, doc::PoseGraphReport_start)
      .def_readonly("iterations", &Report::iterations, doc::PoseGraphReport_iterations)
      .def_readonly("initial_objective", &Report::initial_objective, doc::PoseGraphReport_initial_objective)
      .def_readonly("objective", &Report::objective, "what was minimised, of the result")
      .def_property_readonly(
          "initial_costs", [](const Report& report) { return CostsOf(report.initial_costs); },
          "chi2, chi2log and chordal (docs/backend.md) at the start that was taken")
      .def_property_readonly(
          "costs", [](const Report& report) { return CostsOf(report.costs); }, "the same of the result")
      .def_property_readonly(
          "chi2",
          [](const Report& r) {
            return Column<double>(r.edges.size(), [&](std::size_t e) { return r.edges[e].chi2; });
          },
          (std::string("(E,) float64: ") + doc::EdgeOutcome_chi2).c_str())
      .def_property_readonly(
          "weights",
          [](const Report& r) {
            return Column<double>(r.edges.size(), [&](std::size_t e) { return r.edges[e].weight; });
          },
          (std::string("(E,) float64: ") + doc::EdgeOutcome_weight).c_str())
      .def_property_readonly(
          "down_weighted",
          [](const Report& r) {
            return Column<bool>(r.edges.size(), [&](std::size_t e) { return r.edges[e].down_weighted; });
          },
          (std::string("(E,) bool: ") + doc::EdgeOutcome_down_weighted).c_str())
      .def_readonly("time_s", &Report::time_s, doc::PoseGraphReport_time_s)
      .def("__repr__", [](const Report& report) {
        return py::str("OptimizationReport(success={}, termination='{}', iterations={}, objective={:.6g})")
            .format(report.success, report.termination, report.iterations, report.objective);
      });
  py::class_<Certificate>(module, "Certificate", doc::Certificate)
      .def(Pickled<Certificate>())
      .def_readonly("available", &Certificate::available, doc::Certificate_available)
      .def_readonly("certified", &Certificate::certified, doc::Certificate_certified)
      .def_readonly("reason", &Certificate::reason, doc::Certificate_reason)
      .def_readonly("chordal", &Certificate::chordal, doc::Certificate_chordal)
      .def_readonly("lower_bound", &Certificate::lower_bound, doc::Certificate_lower_bound)
      .def_readonly("relative_gap", &Certificate::relative_gap, doc::Certificate_relative_gap)
      .def_readonly("min_eigenvalue_bound", &Certificate::min_eigenvalue_bound,
                    doc::Certificate_min_eigenvalue_bound)
      .def_readonly("time_s", &Certificate::time_s, "[s]")
      .def("__repr__", [](const Certificate& certificate) {
        return py::str("Certificate(certified={}, relative_gap={:.3g}, reason='{}')")
            .format(certificate.certified, certificate.relative_gap, certificate.reason);
      });
}

}  // namespace tutti::python
