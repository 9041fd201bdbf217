#include "tutti/backend/pose_graph.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/support/error_of.h"

namespace tutti {
namespace {

PoseGraph TwoNodes() {
  PoseGraph graph;
  graph.AddNode(3, Pose());
  graph.AddNode(7, Pose());
  return graph;
}

std::string ErrorOfEdge(PoseGraph& graph, const PoseGraphEdge& edge) {
  return testing::ErrorOf([&] { graph.AddEdge(edge); });
}

/// A chain over these ids in which each node has an edge to the next one; which of them are odometry?
std::string OdometryOf(const std::vector<NodeId>& ids) {
  PoseGraph graph;
  for (const NodeId id : ids) graph.AddNode(id, Pose());
  for (std::size_t k = 1; k < ids.size(); ++k)
    graph.AddEdge({ids[k - 1], ids[k], Similarity(), Matrix7d::Identity(), EdgeKind::kLoop, true});
  graph.FindOdometry();
  std::string out;
  for (const PoseGraphEdge& edge : graph.edges()) out += edge.kind == EdgeKind::kOdometry ? 'o' : 'l';
  return out;
}

TEST(PoseGraph, OdometryJoinsNeighboursWhateverTheGapsBetweenTheIds) {
  EXPECT_EQ(OdometryOf({10, 17, 24, 1000}), "ooo");
  EXPECT_EQ(OdometryOf({-4, -1, 0, 5}), "ooo");
  EXPECT_EQ(OdometryOf({1403636579763555584, 1403636579813555456, 1403636580763555584}), "oo");
}

TEST(PoseGraph, NeighboursAreOfOneRobot) {
  const NodeId a = NodeId{'a'} << 56, b = NodeId{'b'} << 56, second = NodeId{'B'} << 48;
  EXPECT_EQ(OdometryOf({a, a + 3, b, b + 1}), "olo");
  EXPECT_EQ(OdometryOf({a, a + 1, a + second, a + second + 1}), "olo") << "gtsam::LabeledSymbol";
  EXPECT_EQ(OdometryOf({'a' << 24, ('a' << 24) + 1, 'b' << 24, ('b' << 24) + 1}), "olo");
  EXPECT_EQ(OdometryOf({0, 1, 2, 1000000, 1000001, 1000002, 2000000, 2000001}), "ooloolo");
  EXPECT_EQ(OdometryOf({0, 1, 2, NodeId{1} << 32, (NodeId{1} << 32) + 1}), "oolo");
  EXPECT_EQ(OdometryOf({0, 1000, 2000, 3000}), "ooo") << "one robot, every thousandth frame";
}

TEST(PoseGraph, FindsNodesByIdAndRefusesASecondOneAndPosesThatAreNotFinite) {
  PoseGraph graph = TwoNodes();
  EXPECT_EQ(graph.IndexOf(7), 1u);
  EXPECT_TRUE(graph.Has(3));
  EXPECT_FALSE(graph.Has(4));
  EXPECT_THROW(graph.Node(4), InputError);
  EXPECT_THROW(graph.AddNode(7, Pose()), InputError);
  Pose pose;
  pose.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(graph.AddNode(1, pose), InputError);
  EXPECT_EQ(graph.nodes().size(), 2u);
}

TEST(PoseGraph, RefusesEdgesThatAreNotUsableAndNamesThem) {
  PoseGraph graph = TwoNodes();
  PoseGraphEdge edge{3, 8, Similarity(), Matrix7d::Identity(), EdgeKind::kLoop};
  EXPECT_NE(ErrorOfEdge(graph, edge).find("edge 3 -> 8: there is no node 8"), std::string::npos);
  edge.to = 3;
  EXPECT_NE(ErrorOfEdge(graph, edge).find("to itself"), std::string::npos);
  edge.to = 7;
  edge.information(0, 0) = -1;
  EXPECT_NE(ErrorOfEdge(graph, edge).find("not positive definite"), std::string::npos);
  edge.information.setIdentity();
  edge.information(0, 1) = 0.5;
  EXPECT_NE(ErrorOfEdge(graph, edge).find("not symmetric"), std::string::npos);
  edge.information.setIdentity();
  edge.measurement.scale = 0;
  EXPECT_NE(ErrorOfEdge(graph, edge).find("not finite"), std::string::npos);
  EXPECT_TRUE(graph.edges().empty());
}

TEST(PoseGraph, InformationIsJudgedByTheCoordinatesThatItsKindUses) {
  const auto wrong = [](const Matrix7d& information, GraphKind kind, const std::string& what) {
    const std::string said = CheckInformation(information, kind);
    return what.empty() ? said.empty() : said.find(what) != std::string::npos;
  };
  const Matrix7d one = Matrix7d::Identity();
  Matrix7d singular = one, planar = Matrix7d::Zero();
  singular(0, 1) = singular(1, 0) = 1.0;  // rank one in (x, y)
  planar(0, 0) = planar(1, 1) = planar(5, 5) = 1;
  EXPECT_TRUE(wrong(singular, GraphKind::kSE3, "not positive definite"));
  EXPECT_TRUE(wrong(1e120 * one, GraphKind::kSE2, "beyond 1e100")) << "costs overflow";
  EXPECT_TRUE(wrong(1e-300 * one, GraphKind::kSE3, "above 1e-100")) << "costs vanish";
  EXPECT_TRUE(wrong(1e-20 * one, GraphKind::kSE3, ""));
  EXPECT_TRUE(wrong(planar, GraphKind::kSE2, ""));
  EXPECT_TRUE(wrong(planar, GraphKind::kSE3, "not positive definite"));
  EXPECT_TRUE(wrong(MakeInformation(1e3, 1e-5, 1e-3), GraphKind::kSim3, "")) << "very different units";
}

}  // namespace
}  // namespace tutti
