#include <algorithm>
#include <string>
#include <utility>

#include "backend/graph/bad_information.h"
#include "backend/graph/g2o_contents.h"
#include "backend/graph/graph_structure.h"
#include "core/dense_solvers.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

/// Makes the graph of what was read; the class only keeps what its steps share.
class Builder {
 public:
  Builder(G2oContents contents, BadInformation bad, bool ignore_unknown)
      : c_(std::move(contents)), bad_(bad), ignore_unknown_(ignore_unknown), line_(c_.file) {}

  G2oFile Build() {
    if (c_.edges.empty() && c_.measurements.empty()) {
      std::string hint;
      if (!c_.unknown.empty()) hint = " (tutti does not know '" + Excerpt(c_.unknown.begin()->first) + "')";
      throw InputError(c_.file.string() + ": holds no edge of a pose graph" + hint + "; is it a g2o file?");
    }
    RefuseUnknown();
    MoveSensorEdges();
    all_edges_ = c_.edges.size();
    DecideToro();
    RefuseBad();
    const std::size_t missing = AddMissing();
    AddMeasurements();
    AddEdges();
    c_.graph.FindOdometry();
    for (const auto& [id, line] : c_.fixed) {
      if (!c_.graph.Has(id) && !c_.graph.HasLandmark(id))
        line_.Fail(line, "FIX names node " + c_.graph.NameOf(id) + ", which is not in the graph");
      c_.graph.SetFixed(id, true);
    }
    Warn(missing);
    out_.has_all_vertices = missing == 0;
    out_.bad_information = bad_edges_.count;
    out_.graph = std::move(c_.graph);
    return std::move(out_);
  }

 private:
  void RefuseUnknown() const {
    if (c_.unknown.empty() || ignore_unknown_) return;
    std::string which;
    std::size_t first = 0;
    for (const auto& [tag, lines] : c_.unknown) {
      if (first == 0 || lines.first < first) first = lines.first;
      which += (which.empty() ? "" : ", ") + Excerpt(tag) + " (" + std::to_string(lines.count) +
               (lines.count == 1 ? " line)" : " lines)");
    }
    line_.Fail(first, "this line has the first of the tags that tutti does not know: " + which +
                          ". Without them the result would be another one. Remove these lines, or let "
                          "--ignore-unknown of 'tutti optimize' leave them out");
  }

  void DecideToro() {
    const bool by_rows = c_.not_toro.count > 0 && c_.by_rows;
    for (G2oEdge& e : c_.edges) {
      if (e.toro && by_rows) e.bad = false;
      if (e.toro && !by_rows) e.edge.information = FromToro(e.edge.information);
      if (e.bad) bad_edges_.Add(e.line);
    }
    if (by_rows)
      Warn(c_.not_toro.first,
           "the information of EDGE2 is read by rows (iSAM), since in the order of TORO "
           "(xx xy yy tt xt yt) it is not positive definite");
  }

  /// An edge between sensors is one between their nodes: with P the sensor at its second end, its error E
  /// becomes P E P^-1, to first order A e.
  void MoveSensorEdges() {
    std::vector<G2oMeasurement> others;
    for (G2oMeasurement& m : c_.measurements) {
      const PoseGraphMeasurement& measured = m.measurement;
      if (measured.what != PoseGraphMeasurement::What::kPose ||
          measured.from.what == MeasurementEnd::What::kWorld) {
        others.push_back(std::move(m));
        continue;
      }
      const Similarity first = Sensor(m, 0), second = Sensor(m, 1);
      const Eigen::Matrix3d R = second.rotation.toRotationMatrix();
      const double angle = *c_.kind == GraphKind::kSE2 ? 1 : 2;  // of a quaternion's vector part
      Matrix7d A = Matrix7d::Identity();
      A.topLeftCorner<3, 3>() = A.block<3, 3>(3, 3) = R;
      A.block<3, 3>(0, 3) = angle * Skew(second.translation) * R;
      const Matrix7d back = Inverse(A);
      G2oEdge e;
      e.line = m.line;
      e.edge = {measured.from.id,
                measured.to.id,
                first * measured.value * second.Inverse(),
                back.transpose() * measured.information * back,
                EdgeKind::kLoop,
                true};
      e.edge.information = (0.5 * (e.edge.information + e.edge.information.transpose())).eval();
      e.bad = FaultOf(e.edge.information, *c_.kind) != InformationFault::kNone;
      c_.edges.push_back(std::move(e));
    }
    c_.measurements = std::move(others);
  }

  void RefuseBad() {
    if (bad_edges_.count == 0 || bad_ != BadInformation::kRefuse) return;
    line_.Fail(bad_edges_.first,
               "its information matrix is not positive definite; " +
                   (bad_edges_.count == 1 ? "it is the only one"
                                          : "it is the first of " + HowManyBad() + " of which that is true") +
                   ". Repair the file, or let --bad-information of 'tutti optimize' project them, "
                   "keep their diagonals or skip them");
  }

  /// Nodes and landmarks without a vertex; the number of nodes.
  std::size_t AddMissing() {
    std::vector<std::pair<MeasurementEnd, std::size_t>> ends;
    const auto use = [&](const MeasurementEnd& end, std::size_t line) {
      const bool node = end.what == MeasurementEnd::What::kNode;
      if (end.what == MeasurementEnd::What::kWorld) return;
      if (node ? c_.graph.HasLandmark(end.id) : c_.graph.Has(end.id))
        line_.Fail(line, c_.graph.NameOf(end.id) + " is a " + (node ? "landmark" : "pose") + ", not a " +
                             (node ? "pose" : "landmark") + " as this line needs; number them differently");
      if (node ? !c_.graph.Has(end.id) : !c_.graph.HasLandmark(end.id)) ends.emplace_back(end, line);
    };
    for (const G2oEdge& e : c_.edges) {
      for (const NodeId id : {e.edge.from, e.edge.to}) use({MeasurementEnd::What::kNode, id, {}}, e.line);
    }
    for (const G2oMeasurement& m : c_.measurements) {
      use(m.measurement.from, m.line);
      use(m.measurement.to, m.line);
    }
    std::stable_sort(ends.begin(), ends.end(),
                     [](const auto& a, const auto& b) { return a.first.id < b.first.id; });
    const std::size_t before = c_.graph.nodes().size();
    for (const auto& [end, line] : ends) AddMissingEnd(end, line);
    return c_.graph.nodes().size() - before;
  }

  void AddMissingEnd(const MeasurementEnd& end, std::size_t line) {
    const bool node = end.what == MeasurementEnd::What::kNode;
    if (node ? c_.graph.HasLandmark(end.id) : c_.graph.Has(end.id))
      line_.Fail(line, c_.graph.NameOf(end.id) + " is a pose in one line and a landmark in another");
    if (c_.graph.Has(end.id) || c_.graph.HasLandmark(end.id)) return;
    if (node) {
      c_.graph.AddNode(PoseGraphNode{end.id, Similarity(), false, false});
    } else {
      c_.graph.AddLandmark({end.id, Eigen::Vector3d::Zero(), false, false});
    }
  }

  Similarity Sensor(const G2oMeasurement& measured, std::size_t k) const {
    if (!measured.sensors[k]) return {};
    const auto found = c_.parameters.find(*measured.sensors[k]);
    if (found != c_.parameters.end()) return found->second;
    line_.Fail(measured.line, "refers to the parameters " + std::to_string(*measured.sensors[k]) +
                                  ", which no PARAMS line of the file has");
  }

  void AddMeasurements() {
    for (G2oMeasurement& m : c_.measurements) {
      PoseGraphMeasurement& measurement = m.measurement;
      const bool prior = measurement.from.what == MeasurementEnd::What::kWorld;
      (prior ? measurement.to : measurement.from).sensor = Sensor(m, 0);
      c_.graph.AddMeasurement(measurement);
    }
    std::vector<char> placed(c_.graph.landmarks().size(), 0);
    for (const G2oMeasurement& m : c_.measurements) {
      if (m.measurement.what != PoseGraphMeasurement::What::kPosition) continue;
      for (const MeasurementEnd& end : {m.measurement.from, m.measurement.to}) {
        if (end.what == MeasurementEnd::What::kLandmark) placed[c_.graph.IndexOfLandmark(end.id)] = 1;
      }
    }
    for (std::size_t k = 0; k < placed.size(); ++k) {
      if (placed[k] == 0 && !c_.graph.landmarks()[k].has_estimate)
        throw InputError(c_.file.string() + ": landmark " + c_.graph.NameOf(c_.graph.landmarks()[k].id) +
                         " has bearings but no vertex; add one, from which they are solved");
    }
  }

  /// Repairs the edges that need it, and leaves out those of which nothing is left.
  void AddEdges() {
    std::vector<PoseGraphEdge> gone;
    for (; !c_.edges.empty(); c_.edges.pop_front()) {
      PoseGraphEdge& edge = c_.edges.front().edge;
      const bool bad = c_.edges.front().bad;
      if (bad) edge.information = Repaired(edge.information, *c_.kind, bad_);
      if (bad && edge.information.isZero(0)) {
        gone.push_back(edge);
      } else {
        c_.graph.AddEdge(edge);
      }
    }
    out_.skipped = gone.size();
    if (gone.empty()) return;
    PoseGraph whole = c_.graph;
    for (PoseGraphEdge& edge : gone) {
      edge.information = Matrix7d::Identity();
      whole.AddEdge(edge);
    }
    const std::size_t before = AnalyseGraph(whole).components.size(),
                      after = AnalyseGraph(c_.graph).components.size();
    if (after == before) return;
    line_.Fail(bad_edges_.first,
               "without the " + std::to_string(gone.size()) + " of " + std::to_string(all_edges_) +
                   " edges whose information matrix has to be left out, of which this is the first, the "
                   "graph falls into " +
                   std::to_string(after) + " pieces (before: " + std::to_string(before) + "); " +
                   (bad_ == BadInformation::kSkip ? "project them instead (--bad-information "
                                                    "project), or repair the file"
                                                  : "repair the file"));
  }

  void Warn(std::size_t line, const std::string& what) {
    out_.warnings.push_back(c_.file.string() + (line > 0 ? ":" + std::to_string(line) : "") + ": " + what);
  }

  void Warn(std::size_t missing) {
    for (const auto& [tag, lines] : c_.unknown) {
      out_.ignored += lines.count;
      Warn(lines.first, "unknown tag '" + Excerpt(tag) + "', " + std::to_string(lines.count) +
                            (lines.count == 1 ? " line" : " lines") + " ignored");
    }
    if (bad_edges_.count > 0) Warn(bad_edges_.first, WhatWasDone());
    if (c_.judged.count > 0)
      Warn(c_.judged.first,
           std::to_string(c_.judged.count) +
               " switchable or mixture edges are read as plain loops, and their switches are left "
               "out; let a robust loss judge them (--robust gnc, or switchable)");
    if (missing > 0 && missing < c_.graph.nodes().size())
      Warn(0, std::to_string(missing) + " nodes of edges have no vertex; their poses come from the edges");
    WarnOfOrder();
  }

  /// Nodes that nothing holds, and a graph without odometry.
  void WarnOfOrder() {
    std::vector<char> linked(c_.graph.nodes().size(), 0);
    bool odometry = false, by_ids = false;
    for (const PoseGraphEdge& edge : c_.graph.edges()) {
      linked[c_.graph.IndexOf(edge.from)] = linked[c_.graph.IndexOf(edge.to)] = 1;
      odometry = odometry || edge.kind == EdgeKind::kOdometry;
      by_ids = by_ids || edge.kind_by_ids;
    }
    std::vector<char> seen(c_.graph.landmarks().size(), 0);
    for (const PoseGraphMeasurement& m : c_.graph.measurements()) {
      for (const MeasurementEnd& end : {m.from, m.to}) {
        if (end.what == MeasurementEnd::What::kNode) linked[c_.graph.IndexOf(end.id)] = 1;
        if (end.what == MeasurementEnd::What::kLandmark) seen[c_.graph.IndexOfLandmark(end.id)] = 1;
      }
    }
    const auto alone = std::count(linked.begin(), linked.end(), 0) + std::count(seen.begin(), seen.end(), 0);
    if (alone > 0) Warn(0, std::to_string(alone) + " vertices have no edge and stay as they are");
    if (by_ids && !odometry)
      Warn(0,
           "no edge joins two poses whose ids follow each other, so there is no odometry: all edges count as "
           "loops, and a robust loss may reject each of them");
  }

  std::string WhatWasDone() const {
    std::string done;
    if (bad_ == BadInformation::kProject) done = "their negative eigenvalues count as 0";
    if (bad_ == BadInformation::kDiagonal) done = "only the positive entries of their diagonals count";
    if (out_.skipped > 0) {
      done += (done.empty() ? "" : "; ") + std::to_string(out_.skipped) +
              (bad_ == BadInformation::kSkip ? " are left out" : " have nothing positive and are left out");
    }
    return HowManyBad() +
           ", this one first, have an information matrix that is not positive definite: " + done;
  }

  std::string HowManyBad() const {
    return std::to_string(bad_edges_.count) + " of " + std::to_string(all_edges_) + " edges";
  }

  G2oContents c_;
  BadInformation bad_;
  bool ignore_unknown_;
  G2oLine line_;  // for its messages
  G2oFile out_;
  std::size_t all_edges_ = 0;
  LineCount bad_edges_;
};

}  // namespace

Matrix7d FromToro(const Matrix7d& by_rows) {
  const double n[6] = {by_rows(0, 0), by_rows(0, 1), by_rows(0, 5),
                       by_rows(1, 1), by_rows(1, 5), by_rows(5, 5)};
  Matrix7d out = Matrix7d::Zero();
  out(0, 0) = n[0];
  out(0, 1) = out(1, 0) = n[1];
  out(1, 1) = n[2];
  out(5, 5) = n[3];
  out(0, 5) = out(5, 0) = n[4];
  out(1, 5) = out(5, 1) = n[5];
  return out;
}

G2oFile BuildGraph(G2oContents contents, BadInformation bad, bool ignore_unknown) {
  return Builder(std::move(contents), bad, ignore_unknown).Build();
}

}  // namespace tutti::internal
