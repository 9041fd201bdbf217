// Words of the command line for the optimiser's choices.
#include <string>
#include <vector>

#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

template <typename Enum>
Enum Parse(const std::string& name, const char* what) {
  std::vector<std::string> words;
  for (const auto& [word, value] : WordsOf(Enum())) {
    if (name == word) return value;
    words.emplace_back(word);
  }
  throw InputError(std::string(what) + " '" + name + "' is unknown; did you mean '" +
                   NearestWord(name, words) + "'? There are: " + JoinText(words));
}

}  // namespace

EnumWords<GraphObjective> WordsOf(GraphObjective /*of*/) {
  return {{"chi2", GraphObjective::kChi2}, {"chi2log", GraphObjective::kChi2Log}};
}
EnumWords<RobustLoss> WordsOf(RobustLoss /*of*/) {
  return {{"none", RobustLoss::kNone},
          {"huber", RobustLoss::kHuber},
          {"cauchy", RobustLoss::kCauchy},
          {"dcs", RobustLoss::kDcs},
          {"gnc", RobustLoss::kGnc}};
}
EnumWords<GraphInit> WordsOf(GraphInit /*of*/) {
  return {{"auto", GraphInit::kAuto},
          {"file", GraphInit::kFile},
          {"odometry", GraphInit::kOdometry},
          {"chordal", GraphInit::kChordal}};
}
EnumWords<PoseGraphSolver> WordsOf(PoseGraphSolver /*of*/) {
  return {{"ceres", PoseGraphSolver::kCeres}, {"block", PoseGraphSolver::kBlock}};
}

EnumWords<BadInformation> WordsOf(BadInformation /*of*/) {
  return {{"refuse", BadInformation::kRefuse},
          {"project", BadInformation::kProject},
          {"diagonal", BadInformation::kDiagonal},
          {"skip", BadInformation::kSkip}};
}

GraphObjective ParseGraphObjective(const std::string& name) {
  return Parse<GraphObjective>(name, "objective");
}
RobustLoss ParseRobustLoss(const std::string& name) { return Parse<RobustLoss>(name, "robust loss"); }
GraphInit ParseGraphInit(const std::string& name) { return Parse<GraphInit>(name, "initialisation"); }
PoseGraphSolver ParsePoseGraphSolver(const std::string& name) {
  return Parse<PoseGraphSolver>(name, "solver");
}
BadInformation ParseBadInformation(const std::string& name) {
  return Parse<BadInformation>(name, "treatment of bad information matrices");
}
const char* ToString(BadInformation how) { return WordOf(how); }
const char* ToString(GraphObjective objective) { return WordOf(objective); }
const char* ToString(RobustLoss robust) { return WordOf(robust); }
const char* ToString(GraphInit init) { return WordOf(init); }
const char* ToString(PoseGraphSolver solver) { return WordOf(solver); }

const char* ToString(GraphStart start) {
  switch (start) {
    case GraphStart::kFile:
      return "file";
    case GraphStart::kOdometry:
      return "odometry";
    case GraphStart::kChordalRelaxation:
      return "chordal relaxation";
    case GraphStart::kChordalOptimum:
      return "chordal optimum";
  }
  return "?";
}

}  // namespace tutti
