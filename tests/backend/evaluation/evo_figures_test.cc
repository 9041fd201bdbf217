// Every line of expected_evo.txt: what evo 1.36.5 prints for published trajectories.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>

#include "tests/support/test_data.h"
#include "tutti/backend/evaluation.h"
#include "tutti/backend/trajectory_file.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

struct EvoCall {
  bool relative = false, rotation = false;
  std::string reference, estimate;
  EvaluationOptions options;
};

// "## evo_rpe kitti REFERENCE ESTIMATE --delta 100 --delta_unit m -r angle_deg"
EvoCall ParseCall(const std::string& line) {
  const std::vector<std::string> w = SplitText(line);
  EvoCall call;
  call.relative = w.at(1) == "evo_rpe";
  call.options.by_index = w.at(2) == "kitti";
  call.options.alignment = TrajectoryAlignment::kNone;
  call.reference = w.at(3);
  call.estimate = w.at(4);
  for (std::size_t k = 5; k < w.size(); ++k) {
    if (w[k] == "-a") {
      call.options.alignment = TrajectoryAlignment::kSE3;
    } else if (w[k] == "-as") {
      call.options.alignment = TrajectoryAlignment::kSim3;
    } else if (w[k] == "--align_origin") {
      call.options.alignment = TrajectoryAlignment::kOrigin;
    } else if (w[k] == "--delta") {
      call.options.rpe_delta = std::stod(w.at(++k));
    } else if (w[k] == "--delta_unit") {
      call.options.rpe_unit = w.at(++k) == "m" ? DeltaUnit::kMetres : DeltaUnit::kFrames;
    } else if (w[k] == "--all_pairs") {
      call.options.rpe_all_pairs = true;
    } else if (w[k] == "-r" && w.at(++k) == "angle_deg") {
      call.rotation = true;
    } else {
      ADD_FAILURE() << "unknown option " << w[k] << " in: " << line;
    }
  }
  return call;
}

// " max 3.587949; mean 1.156997; ..."
std::map<std::string, double> ParseFigures(const std::string& line) {
  const std::vector<std::string> w = SplitText(line, " ;");
  std::map<std::string, double> out;
  for (std::size_t k = 0; k + 1 < w.size(); k += 2) out[w[k]] = std::stod(w[k + 1]);
  return out;
}

ErrorStatistics Measure(const std::filesystem::path& folder, const EvoCall& call) {
  const PoseFile reference = ReadPoseFile(folder / call.reference);
  const PoseFile estimate = ReadPoseFile(folder / call.estimate);
  const EvaluationReport report =
      EvaluateTrajectory(reference.trajectory, estimate.trajectory, call.options,
                         {reference.rotations_as_written, estimate.rotations_as_written});
  if (call.relative) return call.rotation ? report.rpe_rotation : report.rpe;
  return call.rotation ? report.ate_rotation : report.ate;
}

TEST(EvoFigures, EveryPublishedLineToTheLastPrintedDigit) {
  TUTTI_REQUIRE_DATA(folder, "trajectories");
  std::ifstream in(folder / "expected_evo.txt");
  std::string call_text, figures_text;
  int calls = 0;
  while (std::getline(in, call_text) && std::getline(in, figures_text)) {
    SCOPED_TRACE(call_text);
    const ErrorStatistics s = Measure(folder, ParseCall(call_text));
    const std::map<std::string, double> ours = {{"max", s.max}, {"mean", s.mean}, {"median", s.median},
                                                {"min", s.min}, {"rmse", s.rmse}, {"sse", s.sse},
                                                {"std", s.std}};
    const std::map<std::string, double> expected = ParseFigures(figures_text);
    EXPECT_EQ(expected.size(), ours.size());
    for (const auto& [name, value] : expected) EXPECT_NEAR(ours.at(name), value, 1e-6) << name;
    ++calls;
  }
  EXPECT_GE(calls, 14);
}

}  // namespace
}  // namespace tutti
