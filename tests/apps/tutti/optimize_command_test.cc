// `tutti optimize`, end to end, through the real executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/backend/g2o_io.h"

namespace tutti {
namespace {

using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kVertices = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0.1\n";
constexpr const char* kEdge = "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n";

class OptimizeCommand : public ::testing::Test {
 protected:
  testing::ProcessResult Optimize(const std::string& graph, const std::vector<std::string>& more = {}) const {
    testing::WriteAll(folder_ / "in.g2o", graph);
    return testing::RunTutti(
        {"optimize", folder_ / "in.g2o", "--out", folder_ / "out.g2o", "--json", folder_ / "out.json"}, more);
  }
  std::string Out() const { return testing::ReadAll(folder_ / "out.g2o"); }
  nlohmann::json Json() const { return testing::ReadJson(folder_ / "out.json"); }
  void ExpectRefused(const std::string& graph, const std::string& why) const {
    const testing::ProcessResult run = Optimize(graph);
    EXPECT_EQ(run.status, 1) << why;
    EXPECT_THAT(run.output, HasSubstr("in.g2o:" + why));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out.g2o")) << why;
  }
  const std::filesystem::path folder_ = testing::FreshFolder();
};

TEST_F(OptimizeCommand, RefusesWhatIsWrongWithTheLineInWhichItIs) {
  const std::string good = std::string(kVertices) + kEdge;
  ExpectRefused(good + "EDGE_SE2 1 1 0 0 0 1 0 0 1 0 1\n", "4: the edge leads from node 1 to itself");
  ExpectRefused(good + "VERTEX_SE2 1 2 0 0\n", "4: vertex 1 was given before");
  ExpectRefused(good + "EDGE_SE2 0 1 1 0 0 0 0 0 0 0 0\n",
                "4: its information matrix is not positive definite");
  ExpectRefused(good + "EDGE_SE2 0 1 1 0 0 1 2 0 1 0 1\n",
                "4: its information matrix is not positive definite");
  ExpectRefused(good + "EDGE_SE2 0 1 1 0 0 1e300 0 0 1 0 1\n",
                "4: its information matrix has entries beyond 1e100");
  ExpectRefused(good + "EDGE_SE2 0 1 nan 0 0 1 0 0 1 0 1\n", "4: 'nan' is not finite");
  ExpectRefused(good + "EDGE_SE2 0 1 1 0 0 inf 0 0 1 0 1\n", "4: 'inf' is not finite");
  ExpectRefused("VERTEX_SE2 0 0 -inf 0\n" + std::string(kEdge), "1: '-inf' is not finite");
  ExpectRefused(good + "FIX 5\n", "4: FIX names node 5, which is not in the graph");
}

TEST_F(OptimizeCommand, SaysWhichPartsNoEdgeConnectsAndWhatHoldsEach) {
  const std::string apart =
      "VERTEX_SE2 10 5 5 0\nVERTEX_SE2 11 7 5 0\nEDGE_SE2 10 11 1 0 0 1 0 0 1 0 1\nFIX 11\n";
  const std::string run = Done(Optimize(std::string(kVertices) + "VERTEX_SE2 20 7 7 0\n" + kEdge + apart));
  EXPECT_THAT(run, HasSubstr("3 parts that no edge connects; each is held at one node: 0 (2) 20 (1) 11 (2)"));
  EXPECT_THAT(run, HasSubstr("1 vertices have no edge and stay as they are"));
  const nlohmann::json expected = {
      {{"anchor", 0}, {"nodes", 2}}, {{"anchor", 20}, {"nodes", 1}}, {{"anchor", 11}, {"nodes", 2}}};
  EXPECT_EQ(Json()["components"], expected);
  EXPECT_THAT(Out(), HasSubstr("VERTEX_SE2 10 6 5 0\n"));  // 1 m before node 11, which stays
  EXPECT_THAT(Out(), HasSubstr("VERTEX_SE2 11 7 5 0\n"));
  EXPECT_THAT(Optimize(std::string(kVertices) + kEdge).output, Not(HasSubstr("parts")));
}

TEST_F(OptimizeCommand, PlacesNodesOfEdgesWithoutAVertexAndWarns) {
  EXPECT_THAT(Done(Optimize(std::string(kVertices) + kEdge + "EDGE_SE2 1 9 1 0 0 1 0 0 1 0 1\n")),
              HasSubstr("1 nodes of edges have no vertex"));
  EXPECT_THAT(Out(), HasSubstr("VERTEX_SE2 9 2 0 0\n"));
}

TEST_F(OptimizeCommand, CountsEdgesThatAreGivenTwiceTwice) {
  const std::string twice = "EDGE_SE2 0 1 3 0 0 1 0 0 1 0 1\n", there = "EDGE_SE2 0 1 0 0 0 1 0 0 1 0 1\n";
  EXPECT_EQ(Optimize(kVertices + twice + twice + there).status, 0);
  EXPECT_NEAR(Json()["costs"]["chi2"].get<double>(), 1 + 1 + 4, 1e-9);  // at x = 2
}

TEST_F(OptimizeCommand, SaysWhichStartItTook) {
  const std::string loop = "EDGE_SE2 0 9 2 0.1 0 1 0 0 1 0 1\n";
  const std::string run = Done(Optimize(
      kVertices + std::string(kEdge) + "EDGE_SE2 1 9 1 0 1.2 1 0 0 1 0 1\n" + loop, {"--init", "chordal"}));
  EXPECT_THAT(run, HasSubstr("from the chordal optimum: "));
  EXPECT_THAT(run, HasSubstr(", taken"));
  EXPECT_THAT(run, HasSubstr("from the chordal relaxation: "));
  EXPECT_EQ(Json()["start"], "chordal optimum");
  EXPECT_EQ(Json()["starts"].size(), 2u);
}

TEST_F(OptimizeCommand, SolvesLandmarksAndPriorsAndWritesThemBack) {
  const std::string seen = "VERTEX_XY 9 0 0\nEDGE_SE2_XY 0 9 2 1 1 0 1\nEDGE_SE2_XY 1 9 1 1 1 0 1\n";
  const std::string run =
      Done(Optimize(std::string(kVertices) + kEdge + seen + "EDGE_PRIOR_SE2 0 5 0 0 1 0 0 1 0 1\n"));
  EXPECT_THAT(run, HasSubstr("2 poses in SE(2), 1 edges (0 loops)"));
  EXPECT_THAT(run, HasSubstr("1 landmarks; 3 measurements of landmarks and priors"));
  const PoseGraph out = ReadG2o(folder_ / "out.g2o").graph;
  EXPECT_NEAR(out.Node(0).pose.translation.x(), 5, 1e-9);
  EXPECT_LT((out.landmarks().at(0).position - Eigen::Vector3d(7, 1, 0)).norm(), 1e-9);
  EXPECT_EQ(out.measurements().size(), 3u);
  EXPECT_EQ(Json()["landmarks"], 1);
  EXPECT_TRUE(Json()["components"][0]["anchor"].is_null());
}

TEST_F(OptimizeCommand, RefusesTagsThatItDoesNotKnowUnlessToldToIgnoreThem) {
  const std::string graph = std::string(kVertices) + kEdge + "EDGE_RANGE 0 1 3 1\n";
  ExpectRefused(graph,
                "4: this line has the first of the tags that tutti does not know: EDGE_RANGE (1 line)");
  EXPECT_THAT(Done(Optimize(graph, {"--ignore-unknown"})),
              HasSubstr("in.g2o:4: unknown tag 'EDGE_RANGE', 1 line ignored"));
  EXPECT_EQ(Json()["ignored_lines"], 1);
}

TEST_F(OptimizeCommand, TreatsBadInformationAsItIsTold) {
  const std::string bad = "EDGE_SE2 0 1 3 0 0 1 2 0 1 0 1\n", good = kVertices + std::string(kEdge);
  const std::string text = good + bad + bad;
  ExpectRefusal(Optimize(text), {"it is the first of 2 of 3 edges"});
  for (const char* how : {"project", "diagonal", "skip"}) {
    EXPECT_THAT(Done(Optimize(text, {"--bad-information", how})), HasSubstr("in.g2o:4: 2 of 3 edges")) << how;
    EXPECT_EQ(Json()["bad_information"]["treatment"], how);
    EXPECT_EQ(Json()["bad_information"]["edges"], 2);
    EXPECT_EQ(Json()["bad_information"]["skipped"], std::string(how) == "skip" ? 2 : 0);
  }
  ExpectRefusal(Optimize(good, {"--bad-information", "projekt"}), {"did you mean 'project'?"});
  ExpectRefusal(Optimize(kVertices + bad, {"--bad-information", "skip"}), {"falls into 2 pieces"});
}

}  // namespace
}  // namespace tutti
