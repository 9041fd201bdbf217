#include "tutti/backend/pose_graph.h"

#include <gtest/gtest.h>

#include <limits>

#include "tutti/core/error.h"

namespace tutti {
namespace {

PoseGraph TwoNodes() {
  PoseGraph graph;
  graph.AddNode(3, Pose());
  graph.AddNode(7, Pose());
  return graph;
}

std::string ErrorOfEdge(PoseGraph& graph, const PoseGraphEdge& edge) {
  try {
    graph.AddEdge(edge);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(PoseGraph, FindsNodesById) {
  PoseGraph graph = TwoNodes();
  EXPECT_EQ(graph.IndexOf(7), 1u);
  EXPECT_TRUE(graph.Has(3));
  EXPECT_FALSE(graph.Has(4));
  EXPECT_THROW(graph.Node(4), InputError);
}

TEST(PoseGraph, RefusesASecondNodeOfTheSameId) {
  PoseGraph graph = TwoNodes();
  EXPECT_THROW(graph.AddNode(7, Pose()), InputError);
}

TEST(PoseGraph, RefusesPosesThatAreNotFinite) {
  PoseGraph graph;
  Pose pose;
  pose.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(graph.AddNode(1, pose), InputError);
  EXPECT_TRUE(graph.nodes().empty());
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

TEST(PoseGraph, RefusesASingularInformation) {
  Matrix7d information = Matrix7d::Identity();
  information(0, 1) = information(1, 0) = 1.0;  // rank one in (x, y)
  EXPECT_FALSE(CheckInformation(information, GraphKind::kSE3).empty());
}

TEST(PoseGraph, RefusesAnInformationWithWhichCostsOverflow) {
  EXPECT_NE(CheckInformation(1e120 * Matrix7d::Identity(), GraphKind::kSE2).find("beyond 1e100"),
            std::string::npos);
}

TEST(PoseGraph, RefusesAnInformationWithWhichCostsVanish) {
  EXPECT_NE(CheckInformation(1e-300 * Matrix7d::Identity(), GraphKind::kSE3).find("above 1e-100"),
            std::string::npos);
  EXPECT_EQ(CheckInformation(1e-20 * Matrix7d::Identity(), GraphKind::kSE3), "");
}

TEST(PoseGraph, JudgesOnlyTheCoordinatesThatItsKindUses) {
  Matrix7d information = Matrix7d::Zero();
  information(0, 0) = information(1, 1) = information(5, 5) = 1;
  EXPECT_TRUE(CheckInformation(information, GraphKind::kSE2).empty());
  EXPECT_FALSE(CheckInformation(information, GraphKind::kSE3).empty());
}

TEST(PoseGraph, AcceptsInformationOfVeryDifferentUnits) {
  EXPECT_TRUE(CheckInformation(MakeInformation(1e3, 1e-5, 1e-3), GraphKind::kSim3).empty());
}

}  // namespace
}  // namespace tutti
