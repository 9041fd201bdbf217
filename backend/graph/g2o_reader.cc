#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "backend/graph/bad_information.h"
#include "backend/graph/graph_structure.h"
#include "core/text_input.h"
#include "core/text_reader.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

/// What a tag stands for.
struct Tag {
  GraphKind kind;
  bool is_edge;
};
const std::map<std::string, Tag>& KnownTags() {
  static const std::map<std::string, Tag> tags = {
      {"VERTEX_SE2", {GraphKind::kSE2, false}},        {"EDGE_SE2", {GraphKind::kSE2, true}},
      {"VERTEX_SE3:QUAT", {GraphKind::kSE3, false}},   {"EDGE_SE3:QUAT", {GraphKind::kSE3, true}},
      {"VERTEX_SIM3:QUAT", {GraphKind::kSim3, false}}, {"EDGE_SIM3:QUAT", {GraphKind::kSim3, true}}};
  return tags;
}

std::size_t PoseNumbers(GraphKind kind) {
  return kind == GraphKind::kSE2 ? 3 : kind == GraphKind::kSE3 ? 7 : 8;
}

class Reader {
 public:
  Reader(const std::filesystem::path& file, BadInformation bad) : file_(file), bad_(bad) {}

  G2oFile Read() {
    internal::TextReader in(file_, "give a readable g2o file");
    std::string text;
    while (in.Next(text)) {
      line_ = in.number();
      const std::size_t comment = text.find('#');
      if (comment != std::string::npos) text.resize(comment);
      words_ = SplitText(text, " \t\r");
      if (!words_.empty()) ReadLine();
    }
    return Build();
  }

 private:
  struct EdgeLine {
    PoseGraphEdge edge;
    bool bad = false;  // its information is not positive definite
  };

  [[noreturn]] void Fail(std::size_t line, const std::string& what) const {
    throw InputError(file_.string() + ":" + std::to_string(line) + ": " + what);
  }

  void ReadLine() {
    const std::string& tag = words_[0];
    if (tag == "FIX") return ReadFix();
    for (const char c : tag) {
      if (static_cast<unsigned char>(c) < 0x20) Fail(line_, "holds binary data; is it a g2o file?");
    }
    const auto known = KnownTags().find(tag);
    if (known == KnownTags().end()) {
      auto& [count, first] =
          unknown_.emplace(tag, std::pair<std::size_t, std::size_t>(0, line_)).first->second;
      (void)first;
      ++count;
      return;
    }
    const Tag& what = known->second;
    if (kind_ && *kind_ != what.kind) {
      Fail(line_, tag + " in a graph of " + ToString(*kind_) + "; a file holds one kind of poses");
    }
    kind_ = what.kind;
    const std::size_t n = TangentCoordinates(what.kind).size();
    const std::size_t want = 1 + (what.is_edge ? 2 + n * (n + 1) / 2 : 1) + PoseNumbers(what.kind);
    if (words_.size() != want) {
      Fail(line_, tag + " has " + std::to_string(words_.size() - 1) + " numbers; " +
                      std::to_string(want - 1) + " are needed");
    }
    what.is_edge ? ReadEdge() : ReadVertex();
  }

  int Id(std::size_t word) const {
    const std::optional<long long> value = ParseInteger(words_[word]);
    if (!value || *value < -2000000000LL || *value > 2000000000LL) {
      Fail(line_, "'" + internal::Excerpt(words_[word]) + "' is not a node id (a whole number)");
    }
    return static_cast<int>(*value);
  }

  double Number(std::size_t word) const {
    const std::optional<double> value = ParseDouble(words_[word]);
    const std::string& text = words_[word];
    if (!value && text.find(',') != std::string::npos)
      Fail(line_,
           "'" + internal::Excerpt(text) + "' has a comma; write decimal points, and blanks between numbers");
    if (!value) Fail(line_, "'" + internal::Excerpt(text) + "' is not a number");
    if (!std::isfinite(*value))
      Fail(line_, "'" + words_[word] + "' is not finite; remove or repair this line");
    return *value;
  }

  Similarity ReadPose(std::size_t word) const {
    std::array<double, 8> v{};  // read in their order, so that the first bad one is named
    for (std::size_t i = 0; i < PoseNumbers(*kind_); ++i) v.at(i) = Number(word + i);
    Similarity pose;
    if (*kind_ == GraphKind::kSE2) {
      pose.translation = Eigen::Vector3d(v[0], v[1], 0);
      pose.rotation = Eigen::Quaterniond(std::cos(0.5 * v[2]), 0, 0, std::sin(0.5 * v[2]));
      return pose;
    }
    pose.translation = Eigen::Vector3d(v[0], v[1], v[2]);
    pose.rotation = Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
    const double norm = pose.rotation.norm();
    if (norm < 1e-6) Fail(line_, "the quaternion is zero; a unit quaternion is needed");
    if (!std::isfinite(norm)) Fail(line_, "the quaternion is too large; a unit quaternion is needed");
    pose.rotation.normalize();
    if (*kind_ == GraphKind::kSim3) {
      pose.scale = v[7];
      if (pose.scale <= 0) Fail(line_, "the scale must be positive");
    }
    return pose;
  }

  void ReadVertex() {
    const int id = Id(1);
    if (!vertices_.insert(id).second)
      Fail(line_, "vertex " + std::to_string(id) + " was given before; remove one of them");
    nodes_.push_back({id, ReadPose(2), false, true});
  }

  void ReadEdge() {
    EdgeLine e{{Id(1), Id(2), ReadPose(3), Matrix7d::Zero(), EdgeKind::kOdometry}};
    if (e.edge.from == e.edge.to) Fail(line_, "the edge leads from node " + words_[1] + " to itself");
    const long long gap = static_cast<long long>(e.edge.from) - e.edge.to;
    if (gap != 1 && gap != -1) e.edge.kind = EdgeKind::kLoop;
    const std::vector<int> used = TangentCoordinates(*kind_);
    std::size_t word = 3 + PoseNumbers(*kind_);
    for (std::size_t r = 0; r < used.size(); ++r) {
      for (std::size_t c = r; c < used.size(); ++c, ++word) {
        e.edge.information(used[r], used[c]) = e.edge.information(used[c], used[r]) = Number(word);
      }
    }
    const internal::InformationFault fault = internal::FaultOf(e.edge.information, *kind_);
    e.bad = fault == internal::InformationFault::kNotPositiveDefinite;
    if (e.bad && bad_lines_++ == 0) first_bad_ = line_;
    if (!e.bad && fault != internal::InformationFault::kNone)
      Fail(line_, CheckInformation(e.edge.information, *kind_));
    edges_.push_back(e);
  }

  static std::size_t Pieces(const PoseGraph& graph) {
    return internal::AnalyseGraph(graph).components.size();
  }

  std::string HowManyBad() const {
    return std::to_string(bad_lines_) + " of " + std::to_string(edges_.size()) + " edges";
  }

  void RefuseBad() const {
    if (bad_lines_ == 0 || bad_ != BadInformation::kRefuse) return;
    Fail(first_bad_, "its information matrix is not positive definite; " +
                         (bad_lines_ == 1 ? "it is the only one"
                                          : "it is the first of " + HowManyBad() + " of which that is true") +
                         ". Repair the file, or let --bad-information of 'tutti optimize' project them, "
                         "keep their diagonals or skip them");
  }

  /// Repairs the edges that need it, and leaves out those of which nothing is left.
  void AddEdges(G2oFile& out) const {
    std::vector<PoseGraphEdge> gone;
    for (const EdgeLine& e : edges_) {
      PoseGraphEdge edge = e.edge;
      if (e.bad) edge.information = internal::Repaired(edge.information, *kind_, bad_);
      if (e.bad && edge.information.isZero(0)) {
        gone.push_back(edge);
      } else {
        out.graph.AddEdge(edge);
      }
    }
    out.bad_information = bad_lines_;
    out.skipped = gone.size();
    if (gone.empty()) return;
    PoseGraph whole = out.graph;
    for (PoseGraphEdge& edge : gone) {
      edge.information = Matrix7d::Identity();
      whole.AddEdge(edge);
    }
    const std::size_t before = Pieces(whole), after = Pieces(out.graph);
    if (after == before) return;
    Fail(first_bad_,
         "without the " + std::to_string(out.skipped) + " of " + std::to_string(edges_.size()) +
             " edges whose information matrix has to be left out, of which this is the first, the "
             "graph falls into " +
             std::to_string(after) + " pieces (before: " + std::to_string(before) + "); " +
             (bad_ == BadInformation::kSkip ? "project them instead (--bad-information "
                                              "project), or repair the file"
                                            : "repair the file"));
  }

  void ReadFix() {
    if (words_.size() < 2) Fail(line_, "FIX names no node");
    for (std::size_t word = 1; word < words_.size(); ++word) fixed_.emplace(Id(word), line_);
  }

  G2oFile Build() {
    if (edges_.empty()) {
      std::string hint;
      if (!unknown_.empty())
        hint = " (tutti does not know '" + internal::Excerpt(unknown_.begin()->first) + "')";
      throw InputError(file_.string() + ": holds no edge of a pose graph" + hint + "; is it a g2o file?");
    }
    RefuseBad();
    G2oFile out;
    out.graph = PoseGraph(*kind_);
    for (const PoseGraphNode& node : nodes_) out.graph.AddNode(node);
    std::set<int> linked, missing;
    for (const EdgeLine& e : edges_) {
      for (int id : {e.edge.from, e.edge.to}) {
        linked.insert(id);
        if (!out.graph.Has(id)) missing.insert(id);
      }
    }
    for (int id : missing) out.graph.AddNode(PoseGraphNode{id, Similarity(), false, false});
    AddEdges(out);
    for (const auto& [id, line] : fixed_) {
      if (!out.graph.Has(id))
        Fail(line, "FIX names node " + std::to_string(id) + ", which is not in the graph");
      out.graph.SetFixed(id, true);
    }
    out.has_all_vertices = missing.empty();
    Warn(out, linked.size(), missing.size());
    return out;
  }

  void Warn(G2oFile& out, std::size_t linked, std::size_t missing) const {
    for (const auto& [tag, where] : unknown_) {
      out.warnings.push_back(file_.string() + ":" + std::to_string(where.second) + ": unknown tag '" +
                             internal::Excerpt(tag) + "', " + std::to_string(where.first) +
                             (where.first == 1 ? " line" : " lines") + " ignored");
    }
    if (bad_lines_ > 0) out.warnings.push_back(WhatWasDone(out.skipped));
    if (missing > 0 && !nodes_.empty()) {
      out.warnings.push_back(file_.string() + ": " + std::to_string(missing) +
                             " nodes of edges have no vertex; their poses come from the edges");
    }
    const std::size_t alone = out.graph.nodes().size() - linked;
    if (alone > 0) {
      out.warnings.push_back(file_.string() + ": " + std::to_string(alone) +
                             " vertices have no edge and stay as they are");
    }
  }

  std::string WhatWasDone(std::size_t skipped) const {
    std::string done;
    if (bad_ == BadInformation::kProject) done = "their negative eigenvalues count as 0";
    if (bad_ == BadInformation::kDiagonal) done = "only the positive entries of their diagonals count";
    if (skipped > 0) {
      done += (done.empty() ? "" : "; ") + std::to_string(skipped) +
              (bad_ == BadInformation::kSkip ? " are left out" : " have nothing positive and are left out");
    }
    return file_.string() + ":" + std::to_string(first_bad_) + ": " + HowManyBad() +
           ", this one first, have an information matrix that is not positive definite: " + done;
  }

  std::filesystem::path file_;
  BadInformation bad_;
  std::size_t bad_lines_ = 0, first_bad_ = 0;
  std::size_t line_ = 0;
  std::vector<std::string> words_;
  std::optional<GraphKind> kind_;
  std::vector<PoseGraphNode> nodes_;
  std::set<int> vertices_;
  std::vector<EdgeLine> edges_;
  std::map<int, std::size_t> fixed_;
  std::map<std::string, std::pair<std::size_t, std::size_t>> unknown_;  ///< tag -> count, first line
};

}  // namespace

G2oFile ReadG2o(const std::filesystem::path& file, BadInformation bad) { return Reader(file, bad).Read(); }

}  // namespace tutti
