// Words of the command line for the optimiser's choices.
#include <array>
#include <utility>
#include <vector>

#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

template <typename Enum>
using Names = std::vector<std::pair<const char*, Enum>>;

const Names<GraphObjective> kObjectives = {{"chi2", GraphObjective::kChi2},
                                           {"chi2log", GraphObjective::kChi2Log}};
const Names<RobustLoss> kRobust = {
    {"none", RobustLoss::kNone}, {"huber", RobustLoss::kHuber},           {"cauchy", RobustLoss::kCauchy},
    {"dcs", RobustLoss::kDcs},   {"switchable", RobustLoss::kSwitchable}, {"gnc-tls", RobustLoss::kGncTls},
    {"gnc", RobustLoss::kGnc}};
const Names<GraphInit> kInits = {{"auto", GraphInit::kAuto},
                                 {"file", GraphInit::kFile},
                                 {"odometry", GraphInit::kOdometry},
                                 {"chordal", GraphInit::kChordal}};
const Names<PoseGraphSolver> kSolvers = {{"ceres", PoseGraphSolver::kCeres},
                                         {"block", PoseGraphSolver::kBlock}};

template <typename Enum>
Enum Parse(const Names<Enum>& names, const std::string& name, const char* what) {
  std::string all;
  std::vector<std::string> words;
  for (const auto& [word, value] : names) {
    if (name == word) return value;
    words.emplace_back(word);
    all += (all.empty() ? "" : ", ") + words.back();
  }
  throw InputError(std::string(what) + " '" + name + "' is unknown; did you mean '" +
                   NearestWord(name, words) + "'? There are: " + all);
}

template <typename Enum>
const char* Name(const Names<Enum>& names, Enum value) {
  for (const auto& [word, candidate] : names) {
    if (candidate == value) return word;
  }
  return "?";
}

}  // namespace

GraphObjective ParseGraphObjective(const std::string& name) { return Parse(kObjectives, name, "objective"); }
RobustLoss ParseRobustLoss(const std::string& name) { return Parse(kRobust, name, "robust loss"); }
GraphInit ParseGraphInit(const std::string& name) { return Parse(kInits, name, "initialisation"); }
PoseGraphSolver ParsePoseGraphSolver(const std::string& name) { return Parse(kSolvers, name, "solver"); }
const char* ToString(GraphObjective objective) { return Name(kObjectives, objective); }
const char* ToString(RobustLoss robust) { return Name(kRobust, robust); }
const char* ToString(GraphInit init) { return Name(kInits, init); }
const char* ToString(PoseGraphSolver solver) { return Name(kSolvers, solver); }

const char* ToString(LoopDoubt doubt) {
  switch (doubt) {
    case LoopDoubt::kNone:
      return "";
    case LoopDoubt::kLoss:
      return "the other constraints contradict it (robust loss)";
    case LoopDoubt::kPairwise:
      return "not in the largest set of loops that agree with each other";
    case LoopDoubt::kSigma:
      return "off by more than 3 sigma after the optimisation";
  }
  return "";
}

}  // namespace tutti
