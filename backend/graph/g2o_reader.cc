#include <cmath>
#include <utility>

#include "backend/graph/bad_information.h"
#include "backend/graph/g2o_contents.h"
#include "backend/graph/g2o_tags.h"
#include "core/text_reader.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using internal::G2oLine;
using internal::G2oTag;
using internal::LineKind;

/// TORO gives the information of roll, pitch and yaw, g2o that of the vector part of the quaternion. To first
/// order the former are J times the latter.
void EulerToQuaternion(const Similarity& measurement, Matrix7d* information) {
  const Eigen::Matrix3d R = measurement.rotation.toRotationMatrix();
  const double roll = std::atan2(R(2, 1), R(2, 2)), cos_pitch = std::hypot(R(2, 1), R(2, 2));
  const double tan_pitch = -R(2, 0) / cos_pitch;
  Matrix7d J = Matrix7d::Identity();
  J.block<3, 3>(3, 3) << 1, std::sin(roll) * tan_pitch, std::cos(roll) * tan_pitch,  //
      0, std::cos(roll), -std::sin(roll),                                            //
      0, std::sin(roll) / cos_pitch, std::cos(roll) / cos_pitch;
  J.block<3, 3>(3, 3) *= 2;  // a quaternion has half of the angle
  *information = (J.transpose() * *information * J).eval();
  *information = (0.5 * (*information + information->transpose())).eval();
}

class Reader {
 public:
  explicit Reader(const std::filesystem::path& file) : line_(file) { contents_.file = file; }

  internal::G2oContents Read(const std::function<void(std::size_t)>& progress) {
    constexpr std::size_t kOften = 100000;
    internal::TextReader in(contents_.file, "give a readable g2o file");
    std::string text;
    while (in.Next(text)) {
      if (line_.Split(text, in.number())) ReadLine();
      if (progress && in.number() % kOften == 0) progress(in.number());
    }
    return std::move(contents_);
  }

 private:
  void ReadLine() {
    const std::string& name = line_.Word(0);
    if (name == "FIX") return ReadFix();
    for (const char c : name) {
      if (static_cast<unsigned char>(c) < 0x20) line_.Fail("holds binary data; is it a g2o file?");
    }
    const G2oTag* const tag = internal::FindTag(name);
    if (tag == nullptr) return contents_.unknown[name].Add(line_.number());
    if (tag->line == LineKind::kSwitch) return;  // goes with its edge
    if (contents_.kind && *contents_.kind != tag->kind) {
      line_.Fail(name + " in a graph of " + ToString(*contents_.kind) + "; a file holds one kind of poses");
    }
    if (!contents_.kind) contents_.graph = PoseGraph(tag->kind);
    contents_.kind = tag->kind;
    switch (tag->line) {
      case LineKind::kVertex:
        return ReadVertex(*tag);
      case LineKind::kLandmark:
        return ReadLandmark();
      case LineKind::kParameters:
        return ReadParameters(*tag);
      case LineKind::kMeasurement:
        return ReadMeasurement(*tag);
      case LineKind::kMixture:
        return ReadMixture(*tag);
      default:
        return ReadEdgeLine(*tag);
    }
  }

  NodeId Id(std::size_t word) {
    bool beyond = false;
    const NodeId id = line_.Id(word, &beyond);
    (beyond ? beyond_ : id < 0 ? negative_ : beyond) = true;
    if (beyond_ && negative_)
      line_.Fail("ids below 0 and ids of 2^63 and more in one file; number its vertices anew");
    contents_.graph.SetName(id, line_.Word(word));
    return id;
  }

  void ReadVertex(const G2oTag& tag) {
    line_.Need(1 + NumbersOf(tag.form), 1 + NumbersOf(tag.form));
    const NodeId id = NewId();
    contents_.graph.AddNode(PoseGraphNode{id, line_.Pose(2, tag.form), false, true});
  }

  NodeId NewId() {
    const NodeId id = Id(1);
    if (contents_.graph.Has(id) || contents_.graph.HasLandmark(id))
      line_.Fail("vertex " + line_.Word(1) + " was given before; remove one of them");
    return id;
  }

  void ReadLandmark() {
    const std::size_t size = *contents_.kind == GraphKind::kSE2 ? 2 : 3;
    line_.Need(1 + size, 1 + size);
    const NodeId id = NewId();
    contents_.graph.AddLandmark({id, Position(2, size), false, true});
  }

  Eigen::Vector3d Position(std::size_t word, std::size_t size) const {
    Eigen::Vector3d out = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < size; ++k) out(static_cast<Eigen::Index>(k)) = line_.Number(word + k);
    return out;
  }

  /// All edges between nodes but mixtures. Some have a number more behind the ids.
  void ReadEdgeLine(const G2oTag& tag) {
    const bool judged = tag.line == LineKind::kSwitchable || tag.line == LineKind::kMaxMixture;
    const std::size_t numbers = EdgeNumbers(tag) + (judged ? 1 : 0);
    line_.Need(numbers, numbers);
    if (judged) line_.Number(3);
    ReadEdge(tag, 1, judged ? 4 : 3);
    if (!judged) return;
    contents_.edges.back().edge.kind_by_ids = false;
    contents_.judged.Add(line_.number());
  }

  static std::size_t EdgeNumbers(const G2oTag& tag) {
    const std::size_t n = tag.coordinates.size();
    return 2 + NumbersOf(tag.form) + n * (n + 1) / 2;
  }

  void ReadEdge(const G2oTag& tag, std::size_t ids, std::size_t numbers) {
    internal::G2oEdge e;
    e.line = line_.number();
    PoseGraphEdge& edge = e.edge;
    edge.from = Id(ids);
    edge.to = Id(ids + 1);
    edge.kind = EdgeKind::kLoop;
    edge.kind_by_ids = true;
    edge.measurement = line_.Pose(numbers, tag.form);
    if (edge.from == edge.to) line_.Fail("the edge leads from node " + line_.Word(ids) + " to itself");
    edge.information = line_.Upper(numbers + NumbersOf(tag.form), tag.coordinates);
    if (tag.form == internal::PoseForm::kEuler) EulerToQuaternion(edge.measurement, &edge.information);
    e.bad = IsBad(edge.information);
    e.toro = tag.line == LineKind::kToroEdge;
    if (e.toro) {
      contents_.by_rows = contents_.by_rows && !e.bad;
      e.bad = IsBad(internal::FromToro(edge.information));
      if (e.bad) contents_.not_toro.Add(e.line);
    }
    contents_.edges.push_back(std::move(e));
  }

  /// Throws for what no treatment mends.
  bool IsBad(const Matrix7d& information) const {
    const internal::InformationFault fault = internal::FaultOf(information, *contents_.kind);
    if (fault == internal::InformationFault::kNone) return false;
    if (fault == internal::InformationFault::kNotPositiveDefinite) return true;
    line_.Fail(CheckInformation(information, *contents_.kind));
  }

  /// i j n, and for each of n components: its tag, weight, i j, measurement, information.
  void ReadMixture(const G2oTag& tag) {
    if (line_.Words() < 4) line_.Need(4, 4);
    const std::size_t each = 2 + EdgeNumbers(tag);
    const std::size_t components = (line_.Words() - 4) / each;
    if (components == 0 || line_.Words() != 4 + components * each ||
        line_.Number(3) != static_cast<double>(components))
      line_.Fail(line_.Word(0) + " does not have the numbers of its " + line_.Word(3) + " components");
    std::size_t best = 0;
    for (std::size_t c = 0; c < components; ++c) {
      for (std::size_t k = 2; k < 4 + NumbersOf(tag.form); ++k) {
        if (line_.Word(4 + c * each + k) != line_.Word(4 + k))
          line_.Fail(line_.Word(0) +
                     " has components of different measurements, which tutti can't choose from; write the "
                     "one that is meant as a plain edge");
      }
      const std::size_t first = 4 + each - tag.coordinates.size() * (tag.coordinates.size() + 1) / 2;
      if (line_.Number(first + c * each) > line_.Number(first + best * each)) best = c;
    }
    ReadEdge(tag, 4 + best * each + 2, 4 + best * each + 4);
    contents_.edges.back().edge.kind_by_ids = false;
    contents_.judged.Add(line_.number());
  }

  void ReadParameters(const G2oTag& tag) {
    line_.Need(1 + NumbersOf(tag.form), 1 + NumbersOf(tag.form));
    bool beyond = false;
    contents_.parameters[line_.Id(1, &beyond)] = line_.Pose(2, tag.form);
    contents_.graph.parameter_lines.push_back(line_.Text());
  }

  void ReadMeasurement(const G2oTag& tag) {
    using What = PoseGraphMeasurement::What;
    const bool prior = tag.from == MeasurementEnd::What::kWorld;
    const std::size_t ids = prior ? 1 : 2, n = tag.coordinates.size();
    const std::size_t value = tag.what == What::kPose ? NumbersOf(tag.form) : n;
    const std::size_t numbers = ids + value + n * (n + 1) / 2;
    line_.Need(numbers + tag.sensors, numbers);
    internal::G2oMeasurement out;
    out.line = line_.number();
    PoseGraphMeasurement& m = out.measurement;
    m.what = tag.what;
    m.from = {tag.from, prior ? 0 : Id(1), {}};
    m.to = {tag.to, Id(ids), {}};
    if (!prior && m.from.id == m.to.id) line_.Fail("the edge leads from " + line_.Word(1) + " to itself");
    std::size_t word = 1 + ids;
    bool beyond = false;
    if (line_.Words() == 1 + numbers + tag.sensors) {
      for (std::size_t k = 0; k < tag.sensors; ++k) out.sensors[k] = line_.Id(word++, &beyond);
    }
    if (tag.what == What::kPose) m.value = line_.Pose(word, tag.form);
    if (tag.what == What::kPosition) m.value.translation = Position(word, n);
    if (tag.what == What::kBearing) m.bearing = line_.Number(word);
    m.information = line_.Upper(word + value, tag.coordinates);
    if (!internal::IsPositiveSemidefinite(m.information))
      line_.Fail("its information matrix is not positive semidefinite; repair or remove this line");
    m.line = line_.Text();
    contents_.measurements.push_back(std::move(out));
  }

  void ReadFix() {
    if (line_.Words() < 2) line_.Fail("FIX names no node");
    for (std::size_t word = 1; word < line_.Words(); ++word) {
      bool beyond = false;
      contents_.fixed.emplace(line_.Id(word, &beyond), line_.number());
    }
  }

  G2oLine line_;
  internal::G2oContents contents_;
  bool beyond_ = false, negative_ = false;  // ids from 2^63 on, and below 0
};

}  // namespace

G2oFile ReadG2o(const std::filesystem::path& file, BadInformation bad, bool ignore_unknown,
                const std::function<void(std::size_t)>& progress) {
  return internal::BuildGraph(Reader(file).Read(progress), bad, ignore_unknown);
}

}  // namespace tutti
