// tutti.PoseGraph, OptimizationReport and Certificate
#include "tutti/backend/pose_graph.h"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/python/pickled.h"
#include "tutti/backend/certificate.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/error.h"

namespace tutti::python {
namespace {

namespace fs = std::filesystem;

using Graph = Guarded<PoseGraph>;

// An array of take(0), take(1), ...
template <class T, class Take>
py::array_t<T> Column(std::size_t size, Take take) {
  py::array_t<T> array(static_cast<py::ssize_t>(size));
  T* values = array.mutable_data();
  for (std::size_t i = 0; i < size; ++i) values[i] = take(i);
  return array;
}

// One number of each edge.
template <class T>
auto OfEdges(T EdgeOutcome::*field) {
  return [field](const PoseGraphReport& report) {
    return Column<T>(report.edges.size(), [&](std::size_t e) { return report.edges[e].*field; });
  };
}

// "chi2", "chi2log", "chordal".
py::dict CostsOf(const GraphCosts& costs) {
  py::dict all;
  all["chi2"] = costs.chi2;
  all["chi2log"] = costs.chi2log;
  all["chordal"] = costs.chordal;
  return all;
}

GraphKind KindOf(const std::string& word) {
  if (word == "se2") return GraphKind::kSE2;
  if (word == "se3") return GraphKind::kSE3;
  if (word == "sim3") return GraphKind::kSim3;
  throw InputError("PoseGraph: kind: '" + word + "' is not one of se2, se3, sim3");
}

const char* WordOfKind(GraphKind kind) {
  return kind == GraphKind::kSE2 ? "se2" : kind == GraphKind::kSE3 ? "se3" : "sim3";
}

// Planar ones may also be x, y, heading.
Similarity NodePose(const py::object& pose, GraphKind kind, const std::string& name) {
  const auto planar = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(pose);
  if (!planar) PyErr_Clear();
  if (kind != GraphKind::kSE2 || !planar || planar.ndim() != 1 || planar.shape(0) != 3)
    return kind == GraphKind::kSim3 ? SimilarityOf(pose, name) : Similarity(PoseOf(pose, name));
  return Similarity(1.0, ExpSO3({0, 0, planar.at(2)}), {planar.at(0), planar.at(1), 0});
}

// In the coordinates of the kind: 3 x 3 (x, y, heading), 6 x 6 or 7 x 7.
Matrix7d InformationOf(const py::object& information, GraphKind kind) {
  const std::vector<int> coordinates = TangentCoordinates(kind);
  const int size = static_cast<int>(coordinates.size());
  const Eigen::MatrixXd given = MatrixOf(information, "information", size);
  Matrix7d all = Matrix7d::Identity();
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const auto row = static_cast<std::size_t>(i), column = static_cast<std::size_t>(j);
      all(coordinates[row], coordinates[column]) = given(i, j);
    }
  }
  return all;
}

void AddPose(Graph& self, NodeId id, const py::object& pose, bool fixed) {
  const GraphKind kind = Locked(&PoseGraph::kind)(self);
  const Similarity S_world_node = NodePose(pose, kind, "pose of node " + std::to_string(id));
  self.Run([&](PoseGraph& graph) { graph.AddNode(id, S_world_node, fixed); });
}

void AddEdge(Graph& self, NodeId from, NodeId to, const py::object& pose, const py::object& information,
             const std::optional<std::vector<double>>& sigmas, std::optional<bool> loop) {
  const GraphKind kind = Locked(&PoseGraph::kind)(self);
  PoseGraphEdge edge;
  edge.from = from;
  edge.to = to;
  const std::string name = "edge " + std::to_string(from) + " -> " + std::to_string(to);
  edge.measurement = NodePose(pose, kind, name);
  if (information.is_none() != sigmas.has_value())
    throw py::type_error(name + ": give information, or sigmas=(translation [m], rotation [rad])");
  if (!sigmas) {
    edge.information = InformationOf(information, kind);
  } else if (sigmas->size() == 2 || sigmas->size() == 3) {
    for (const double sigma : *sigmas) {
      if (!(sigma > 0)) throw InputError(name + ": sigmas must be above 0");
    }
    edge.information = MakeInformation((*sigmas)[0], (*sigmas)[1], sigmas->size() == 3 ? (*sigmas)[2] : 1.0);
  } else {
    throw py::value_error(name +
                          ": sigmas must be (translation [m], rotation [rad]) and, for sim3, log scale");
  }
  edge.kind_by_ids = !loop.has_value();  // decided when it matters: nodes between its ends may come later
  edge.kind = loop.value_or(true) ? EdgeKind::kLoop : EdgeKind::kOdometry;
  self.Run([&](PoseGraph& graph) { graph.AddEdge(edge); });
}

std::unique_ptr<Graph> ReadGraph(const fs::path& file, const std::string& bad_information,
                                 bool ignore_unknown) {
  const BadInformation bad = ParseBadInformation(bad_information);
  G2oFile read;
  {
    const py::gil_scoped_release release;
    read = Reading(file, [&] { return ReadG2o(file, bad, ignore_unknown); });
  }
  for (const std::string& warning : read.warnings) Warn(warning);
  return std::make_unique<Graph>(std::move(read.graph));
}

py::array_t<double> NodePoses(Graph& self) {
  const auto nodes = Locked(&PoseGraph::nodes)(self);
  std::vector<Pose> poses;
  poses.reserve(nodes.size());
  for (const PoseGraphNode& node : nodes) poses.push_back(node.pose.RigidPart());
  return ArrayOf(poses);
}

py::array LandmarkIds(Graph& self) {
  const auto landmarks = Locked(&PoseGraph::landmarks)(self);
  return Column<NodeId>(landmarks.size(), [&](std::size_t k) { return landmarks[k].id; });
}

py::array_t<double> LandmarkPositions(Graph& self) {
  const auto landmarks = Locked(&PoseGraph::landmarks)(self);
  py::array_t<double> out({landmarks.size(), std::size_t{3}});
  auto rows = out.mutable_unchecked<2>();
  for (std::size_t k = 0; k < landmarks.size(); ++k) {
    for (int c = 0; c < 3; ++c) rows(static_cast<py::ssize_t>(k), c) = landmarks[k].position(c);
  }
  return out;
}

py::dict EdgesOf(Graph& self) {
  const auto edges = self.Run([](PoseGraph& graph) {
    graph.FindOdometry();
    return graph.edges();
  });
  std::vector<Pose> measurements;
  measurements.reserve(edges.size());
  for (const PoseGraphEdge& edge : edges) measurements.push_back(edge.measurement.RigidPart());
  py::dict columns;
  columns["from"] = Column<NodeId>(edges.size(), [&](std::size_t e) { return edges[e].from; });
  columns["to"] = Column<NodeId>(edges.size(), [&](std::size_t e) { return edges[e].to; });
  columns["loop"] =
      Column<bool>(edges.size(), [&](std::size_t e) { return edges[e].kind == EdgeKind::kLoop; });
  columns["measurement"] = ArrayOf(measurements);
  columns["scale"] = Column<double>(edges.size(), [&](std::size_t e) { return edges[e].measurement.scale; });
  return columns;
}

PoseGraphReport Optimize(Graph& self, const py::kwargs& keywords) {
  RunConfig config;
  config.graph = PoseGraphOptions();
  SetOptions("PoseGraph.optimize", "graph", keywords, config);
  Interrupts interrupts;
  PoseGraphReport report = self.Run([&](PoseGraph& graph) {
    graph.FindOdometry();
    return PoseGraphOptimizer(config.graph).Optimize(graph, [&] { return interrupts.Came(); });
  });
  interrupts.Rethrow();
  return report;
}

Certificate Certify(Graph& self, double certified_gap, double max_shift) {
  Interrupts interrupts;
  Certificate certificate = self.Run([&](PoseGraph& graph) {
    return CertifyOptimum(graph, {certified_gap, max_shift}, {}, [&] { return interrupts.Came(); });
  });
  interrupts.Rethrow();
  return certificate;
}

}  // namespace

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
      .def_property_readonly("chi2", OfEdges(&EdgeOutcome::chi2),
                             (std::string("(E,) float64: ") + doc::EdgeOutcome_chi2).c_str())
      .def_property_readonly("weights", OfEdges(&EdgeOutcome::weight),
                             (std::string("(E,) float64: ") + doc::EdgeOutcome_weight).c_str())
      .def_property_readonly("down_weighted", OfEdges(&EdgeOutcome::down_weighted),
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

void BindPoseGraph(py::module_& module) {
  using namespace pybind11::literals;  // NOLINT(google-build-using-namespace)
  const CertificateOptions defaults;
  RunConfig graphs;
  graphs.graph = PoseGraphOptions();
  const std::string text = std::string(doc::PoseGraph) +
                           "\n\nkind: se2, se3 or sim3 (one camera, whose scale drifts). Poses map points of "
                           "the node into the world: x, y, z [m], qx, qy, qz, qw, and for sim3 a scale; or a "
                           "matrix of 4 x 4; se2 also x, y, heading [rad].";
  const std::string optimize =
      std::string(doc::PoseGraphOptimizer_Optimize) +
      " Ctrl-C gives up; the graph then has its poses of before. Keywords, all optional; SLAM graphs that "
      "may hold false loops should use robust=\"gnc\":\n" +
      DescribeOptions("graph", graphs);
  py::class_<Graph>(module, "PoseGraph", text.c_str())
      .def(py::init([](const std::string& kind) { return std::make_unique<Graph>(PoseGraph(KindOf(kind))); }),
           "kind"_a = "se3")
      .def_static("read_g2o", &ReadGraph, "file"_a, "bad_information"_a = "refuse",
                  "ignore_unknown"_a = false,
                  (std::string("bad_information: refuse, project, diagonal or skip. ignore_unknown: lines "
                               "whose tag is not known are left out, with a warning. ") +
                   doc::ReadG2o)
                      .c_str())
      .def(
          "write_g2o",
          [](Graph& self, const fs::path& file) {
            Writing([&] { self.Run([&](PoseGraph& graph) { WriteG2o(file, graph); }); });
          },
          "file"_a, doc::WriteG2o)
      .def(
          "add_pose", &AddPose, "id"_a, "pose"_a, "fixed"_a = false,
          (std::string("A node. fixed: ") + doc::PoseGraphNode_fixed + ". " + doc::PoseGraph_AddNode).c_str())
      .def("add_edge", &AddEdge, "from_id"_a, "to_id"_a, "pose"_a, "information"_a = py::none(),
           py::kw_only(), "sigmas"_a = py::none(), "loop"_a = py::none(),
           (std::string("A measurement: pose maps points of to_id into from_id. information: inverse "
                        "covariance, (6, 6) of translation [1/m^2] and rotation [1/rad^2]; se2 (3, 3) of x, "
                        "y, heading; sim3 (7, 7), log scale last. Or sigmas=(translation [m], rotation "
                        "[rad][, log scale]). loop: robust losses act on loops alone; None: an edge whose "
                        "ids are not neighbours among those of the graph (and of one robot) is one. ") +
            doc::PoseGraph_AddEdge)
               .c_str())
      .def(
          "set_pose",
          [](Graph& self, NodeId id, const py::object& pose) {
            const GraphKind kind = Locked(&PoseGraph::kind)(self);
            const Similarity S_world_node = NodePose(pose, kind, "pose of node " + std::to_string(id));
            self.Run([&](PoseGraph& graph) { graph.SetPose(id, S_world_node); });
          },
          "id"_a, "pose"_a, "Moves a node. Raises tutti.InputError if there is no such id.")
      .def("set_fixed", Locked(&PoseGraph::SetFixed), "id"_a, "fixed"_a,
           "Whether the node is held where it is. Raises tutti.InputError if there is no such id.")
      .def(
          "pose",
          [](Graph& self, NodeId id) {
            return ArrayOf(self.Run([&](PoseGraph& graph) { return graph.Node(id).pose; }));
          },
          "id"_a,
          "(4, 4) float64: S_world_node; sim3: rotation times scale. Raises tutti.InputError if there is "
          "none.")
      .def_property_readonly(
          "kind", [](Graph& self) { return WordOfKind(Locked(&PoseGraph::kind)(self)); }, "se2, se3 or sim3")
      .def_property_readonly(
          "ids",
          [](Graph& self) {
            const auto nodes = Locked(&PoseGraph::nodes)(self);
            return Column<NodeId>(nodes.size(), [&](std::size_t k) { return nodes[k].id; });
          },
          "(N,) int64: of the nodes, in the order in which they were added. Ids of 2^63 and more in a file "
          "are negative here; write_g2o writes them as they were")
      .def_property_readonly("landmark_ids", &LandmarkIds, "(L,) int64: of the landmarks of a file")
      .def_property_readonly(
          "landmarks", &LandmarkPositions,
          "(L, 3) float64, parallel to landmark_ids: x, y, z [m] in the world; se2: z is 0")
      .def_property_readonly("poses", &NodePoses,
                             "(N, 7) float64, parallel to ids: x, y, z [m], qx, qy, qz, qw of T_world_node")
      .def_property_readonly(
          "scales",
          [](Graph& self) {
            const auto nodes = Locked(&PoseGraph::nodes)(self);
            return Column<double>(nodes.size(), [&](std::size_t k) { return nodes[k].pose.scale; });
          },
          "(N,) float64, parallel to ids: 1 unless the graph is sim3")
      .def_property_readonly(
          "edges", &EdgesOf,
          "Columns, in the order in which edges were added: from, to (E,) int64; loop (E,) bool; measurement "
          "(E, 7), x, y, z [m], qx, qy, qz, qw of T_from_to; scale (E,).")
      .def(
          "costs",
          [](Graph& self) {
            return CostsOf(self.Run([](PoseGraph& graph) { return EvaluateCosts(graph); }));
          },
          (std::string("chi2, chi2log, chordal. ") + doc::GraphCosts).c_str())
      .def("optimize", &Optimize, optimize.c_str())
      .def("certify", &Certify, "certified_gap"_a = defaults.certified_gap,
           "max_shift"_a = defaults.max_shift,
           (std::string(doc::CertifyOptimum) + " certified_gap: " + doc::CertificateOptions_certified_gap +
            ". max_shift: " + doc::CertificateOptions_max_shift)
               .c_str());
}

}  // namespace tutti::python
