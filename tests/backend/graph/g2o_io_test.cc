#include "tutti/backend/g2o_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <utility>

#include "core/text_reader.h"
#include "tests/backend/graph/synthetic_graph.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

std::filesystem::path GraphFile(const std::string& text) { return testing::FreshFile("graph.g2o", text); }

std::string ErrorOfText(const std::string& text, BadInformation bad = BadInformation::kRefuse) {
  return testing::ErrorOf([&] { ReadG2o(GraphFile(text), bad); });
}

constexpr const char* kVertices = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0.1\n";
constexpr const char* kEdge = "EDGE_SE2 0 1 1 0 0.1 1 0 0 1 0 1\n";

TEST(G2o, RoundTripKeepsEveryNumberOfEveryKind) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    testing::SyntheticGraphOptions options;
    options.kind = kind;
    options.noise_translation = options.noise_rotation = options.noise_log_scale = 0.01;
    options.false_loops = 3;
    PoseGraph graph = testing::MakeSyntheticGraph(options).graph;
    std::mt19937 random(1);
    const std::vector<int> used = TangentCoordinates(kind);
    Matrix7d information = Matrix7d::Zero();
    information(used, used) = testing::RandomInformation(random)(used, used);
    graph.AddLoop(2, 40, testing::RandomPose(kind, random, 3, 1), information);
    graph.SetFixed(5, true);
    const std::filesystem::path file = testing::FreshFolder() / "round.g2o";
    WriteG2o(file, graph);
    const G2oFile back = ReadG2o(file);
    EXPECT_TRUE(back.has_all_vertices);
    EXPECT_TRUE(back.warnings.empty());
    ASSERT_EQ(back.graph.kind(), kind);
    ASSERT_EQ(back.graph.nodes().size(), graph.nodes().size());
    ASSERT_EQ(back.graph.edges().size(), graph.edges().size());
    EXPECT_TRUE(back.graph.Node(5).fixed);
    for (std::size_t k = 0; k < graph.nodes().size(); ++k) {
      const Similarity &a = graph.nodes()[k].pose, &b = back.graph.nodes()[k].pose;
      EXPECT_LT((a.translation - b.translation).norm(), 1e-14);
      EXPECT_LT(LogSO3(a.rotation.conjugate() * b.rotation).norm(), 1e-14);
      EXPECT_EQ(a.scale, b.scale);
    }
    for (std::size_t e = 0; e < graph.edges().size(); ++e) {
      const PoseGraphEdge &a = graph.edges()[e], &b = back.graph.edges()[e];
      EXPECT_EQ(a.from, b.from);
      EXPECT_EQ(a.to, b.to);
      EXPECT_EQ(a.kind, b.kind);
      const Matrix7d difference = a.information - b.information;
      EXPECT_LT(difference(used, used).norm(), 1e-13 * a.information.norm());
      EXPECT_EQ(a.measurement.translation, b.measurement.translation);
    }
  }
}

TEST(G2o, ReadsTheUpperTriangleOfTheInformationByRows) {
  const G2oFile file = ReadG2o(GraphFile(std::string(kVertices) + "EDGE_SE2 0 1 1 0 0.1 10 2 3 20 4 30\n"));
  const Matrix7d& I = file.graph.edges()[0].information;
  EXPECT_EQ(I(0, 1), 2);
  EXPECT_EQ(I(1, 0), 2);
  EXPECT_EQ(I(0, 5), 3);
  EXPECT_EQ(I(5, 1), 4);
  EXPECT_EQ(I(5, 5), 30);
}

TEST(G2o, VerticesMayBeMissing) {
  const G2oFile file = ReadG2o(GraphFile("EDGE_SE2 3 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n"));
  EXPECT_FALSE(file.has_all_vertices);
  ASSERT_EQ(file.graph.nodes().size(), 3u);
  EXPECT_FALSE(file.graph.nodes()[0].has_estimate);
  EXPECT_EQ(file.graph.edges()[0].kind, EdgeKind::kLoop);
  EXPECT_EQ(file.graph.edges()[1].kind, EdgeKind::kOdometry);
}

TEST(G2o, UnknownTagsAreRefusedWithTheNumberOfTheirLinesUnlessTheyAreToBeIgnored) {
  const std::string text =
      std::string(kVertices) + "LANDMARK 1 2\n" + kEdge + "LANDMARK 3 4\nEDGE_RANGE 0 1 3\n# comment\n";
  EXPECT_THAT(ErrorOfText(text), HasSubstr("graph.g2o:3: this line has the first of the tags"));
  EXPECT_THAT(ErrorOfText(text), HasSubstr("EDGE_RANGE (1 line), LANDMARK (2 lines)"));
  EXPECT_THAT(ErrorOfText(text), HasSubstr("--ignore-unknown"));
  const G2oFile file = ReadG2o(GraphFile(text), BadInformation::kRefuse, true);
  ASSERT_EQ(file.warnings.size(), 2u);
  EXPECT_EQ(file.ignored, 3u);
  EXPECT_THAT(file.warnings[1], HasSubstr("graph.g2o:3: unknown tag 'LANDMARK', 2 lines ignored"));
  EXPECT_EQ(file.graph.edges().size(), 1u);
}

TEST(G2o, IdsKeepTheirSpellingUpTo2To64) {
  const std::string text =
      "VERTEX_SE2 6989586621679009792 0 0 0\nVERTEX_SE2 9223372036854775808 1 0 0\nVERTEX_SE2 007 2 0 0\n"
      "FIX 007\nEDGE_SE2 6989586621679009792 9223372036854775808 1 0 0 1 0 0 1 0 1\n"
      "EDGE_SE2 9223372036854775808 7 1 0 0 1 0 0 1 0 1\n";
  const std::filesystem::path again = testing::FreshFolder() / "again.g2o";
  const PoseGraph graph = ReadG2o(GraphFile(text)).graph;
  EXPECT_EQ(graph.nodes()[0].id, 6989586621679009792);
  EXPECT_TRUE(graph.Node(7).fixed);
  WriteG2o(again, graph);
  const std::string written = internal::ReadText(again, "", std::size_t{1} << 20);
  EXPECT_THAT(written, HasSubstr("VERTEX_SE2 9223372036854775808 1 0 0\nVERTEX_SE2 007 2 0 0\nFIX 007\n"));
  EXPECT_THAT(written, HasSubstr("EDGE_SE2 6989586621679009792 9223372036854775808 1 0 0 1"));
  EXPECT_THAT(ErrorOfText(text + "VERTEX_SE2 -1 0 0 0\n"), HasSubstr(":7: ids below 0 and ids of 2^63"));
}

TEST(G2o, AGraphWithoutOdometrySaysSo) {
  const G2oFile star = ReadG2o(GraphFile(
      "EDGE_SE2 0 2 1 0 0 1 0 0 1 0 1\nEDGE_SE2 1 3 1 0 0 1 0 0 1 0 1\nEDGE_SE2 0 3 1 0 0 1 0 0 1 0 1\n"));
  ASSERT_EQ(star.warnings.size(), 1u);
  EXPECT_THAT(star.warnings[0], HasSubstr("there is no odometry: all edges count as loops"));
}

TEST(G2o, TorosInformationHasItsOwnOrder) {
  const std::string toro = "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0.1\nEDGE2 0 1 1 0 0.1 ";
  const G2oFile file = ReadG2o(GraphFile(toro + "500 3 600 2000 1 2\n"));
  const Matrix7d& I = file.graph.edges()[0].information;
  EXPECT_EQ(file.graph.edges()[0].kind, EdgeKind::kOdometry);
  EXPECT_EQ(I(0, 1), 3);
  EXPECT_EQ(I(1, 1), 600);
  EXPECT_EQ(I(5, 5), 2000);
  EXPECT_EQ(I(0, 5), 1);
  EXPECT_EQ(I(5, 1), 2);
  // iSAM writes the same tag with the upper triangle by rows.
  const G2oFile isam = ReadG2o(GraphFile(toro + "500 0 0 600 0 2000\n"));
  EXPECT_EQ(isam.graph.edges()[0].information(1, 1), 600);
  EXPECT_EQ(isam.graph.edges()[0].information(5, 5), 2000);
  EXPECT_THAT(isam.warnings.at(0), HasSubstr("graph.g2o:3: the information of EDGE2 is read by rows"));
}

TEST(G2o, TorosAnglesAreRollPitchAndYawAndTheirInformationThatOfAngles) {
  const G2oFile file =
      ReadG2o(GraphFile("VERTEX3 0 0 0 0 0.3 -0.2 0.5\nVERTEX3 1 1 0 0 0 0 0\n"
                        "EDGE3 0 1 1 0 0 0.1 0.2 0.3 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 100 0 0 200 0 300\n"));
  const Eigen::Quaterniond expected = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()) *
                                      Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX());
  EXPECT_LT(LogSO3(expected.conjugate() * file.graph.nodes()[0].pose.rotation).norm(), 1e-12);
  // A small error e of the quaternion, and the same in roll, pitch and yaw, cost the same.
  const PoseGraphEdge& edge = file.graph.edges()[0];
  const Eigen::Vector3d e(1e-6, -2e-6, 3e-6);
  const Eigen::Matrix3d R = (edge.measurement.rotation * ExpSO3(2 * e)).toRotationMatrix();
  const Eigen::Vector3d angles(std::atan2(R(2, 1), R(2, 2)) - 0.1, std::asin(-R(2, 0)) - 0.2,
                               std::atan2(R(1, 0), R(0, 0)) - 0.3);
  const double by_angles = angles.dot(Eigen::Vector3d(100, 200, 300).cwiseProduct(angles));
  EXPECT_NEAR(e.dot(edge.information.block<3, 3>(3, 3) * e) / by_angles, 1, 1e-4);
}

TEST(G2o, SwitchableAndMixtureEdgesArePlainLoopsWithAWarning) {
  const std::string chain = "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n";
  const std::string component = " 0 1 1 0 0 ";
  const G2oFile file = ReadG2o(GraphFile(
      chain + "VERTEX_SWITCH 9 1\nEDGE_SWITCH_PRIOR 9 1 1\nEDGE_SE2_SWITCHABLE 0 1 9 1 0 0 4 0 0 5 0 6\n" +
      "EDGE_SE2_MAXMIX 0 2 1e-9 2 0 0 4 0 0 5 0 6\nEDGE_SE2_MIXTURE 0 1 2 EDGE_SE2 0.01" + component +
      "1e-9 0 0 1e-9 0 1e-9 EDGE_SE2 1" + component + "7 0 0 8 0 9\n"));
  ASSERT_EQ(file.graph.edges().size(), 5u);
  ASSERT_EQ(file.graph.nodes().size(), 3u);
  for (std::size_t e = 2; e < 5; ++e) EXPECT_EQ(file.graph.edges()[e].kind, EdgeKind::kLoop);
  EXPECT_EQ(file.graph.edges()[2].information(5, 5), 6);
  EXPECT_EQ(file.graph.edges()[4].information(5, 5), 9) << "not the null hypothesis";
  EXPECT_THAT(file.warnings.at(0), HasSubstr("graph.g2o:5: 3 switchable or mixture edges"));
  EXPECT_THAT(ErrorOfText(chain + "EDGE_SE2_MIXTURE 0 1 2 EDGE_SE2 1" + component +
                          "1 0 0 1 0 1 EDGE_SE2 1 0 2 1 0 0 1 0 0 1 0 1\n"),
              HasSubstr(":3: EDGE_SE2_MIXTURE has components of different measurements"));
}

TEST(G2o, AcceptsWindowsLineEndsTabsAndComments) {
  const G2oFile file = ReadG2o(
      GraphFile("# a graph\r\nVERTEX_SE2 0 0 0 0\r\nVERTEX_SE2\t1 1 0 0.1\r\nEDGE_SE2 0 1 1 0 0.1  1 0 0 "
                "1 0 1 # odometry\r\nFIX 1\r\n"));
  EXPECT_TRUE(file.graph.Node(1).fixed);
}

TEST(G2o, DamagedFilesNameTheLine) {
  const std::string good = std::string(kVertices) + kEdge;
  const std::pair<const char*, const char*> behind_it[] = {
      {"EDGE_SE2 0 1 1 0 0.1 1 0 0 1 0", "graph.g2o:4: EDGE_SE2 has 10 numbers; 11 are needed"},
      {"EDGE_SE2 0 1 1 0 zero 1 0 0 1 0 1", ":4: 'zero' is not a number"},
      {"EDGE_SE2 0 1 1 0 nan 1 0 0 1 0 1", ":4: 'nan' is not finite"},
      {"EDGE_SE2 0 1 1 0 0 1 5 0 1 0 1", ":4: its information matrix is not positive definite"},
      {"EDGE_SE2 1 1 1 0 0 1 0 0 1 0 1", ":4: the edge leads from node 1 to itself"},
      {"EDGE_SE2 0 1.5 1 0 0 1 0 0 1 0 1", ":4: '1.5' is not a node id"},
      {"EDGE_SE2 0 18446744073709551616 1 0 0 1 0 0 1 0 1", "is not a node id"},
      {"VERTEX_SE2 1 0 0 0", ":4: vertex 1 was given before"},
      {"FIX 77", ":4: FIX names node 77"},
      {"VERTEX_SE3:QUAT 5 0 0 0 0 0 0 1", ":4: VERTEX_SE3:QUAT in a graph of SE(2)"}};
  for (const auto& [line, error] : behind_it) EXPECT_THAT(ErrorOfText(good + line + "\n"), HasSubstr(error));
  const std::pair<const char*, const char*> alone[] = {
      {"VERTEX_SE3:QUAT 5 0 0 0 0 0 0 0", ":1: the quaternion is zero"},
      {"VERTEX_SE3:QUAT 5 0 0 0 0 0 0 1e300", ":1: the quaternion is too large"},
      {"VERTEX_SIM3:QUAT 5 0 0 0 0 0 0 1 -2", ":1: the scale must be positive"}};
  for (const auto& [line, error] : alone) EXPECT_THAT(ErrorOfText(line), HasSubstr(error));
}

/// A chain 0 - 1 - 2 whose second edge has eigenvalues 1, 3 and -1 (x and y are correlated too much), and a
/// loop 0 - 2 with no positive one.
const char* const kBadInformation =
    "EDGE_SE2 0 1 1 0 0  1 0 0 1 0 1\nEDGE_SE2 1 2 1 0 0  1 2 0 1 0 1\nEDGE_SE2 0 2 2 0 0  -1 0 0 0 0 -2\n";

TEST(G2o, InformationThatIsNotPositiveDefiniteIsRefusedWithTheNumberOfEdges) {
  const std::string error = ErrorOfText(kBadInformation);
  EXPECT_THAT(error,
              HasSubstr("graph.g2o:2: its information matrix is not positive definite; it is the first "
                        "of 2 of 3 edges"));
  EXPECT_THAT(error, HasSubstr("--bad-information"));
  // What else is wrong with such an edge is not forgiven.
  const std::string overflow = "EDGE_SE2 0 1 1 0 0 1e300 0 0 1 0 1\n";
  EXPECT_THROW(ReadG2o(GraphFile(kBadInformation + overflow), BadInformation::kProject), InputError);
}

TEST(G2o, InformationIsProjectedOnTheNearestPositiveSemidefiniteMatrix) {
  const G2oFile file = ReadG2o(GraphFile(kBadInformation), BadInformation::kProject);
  EXPECT_EQ(file.bad_information, 2u);
  EXPECT_EQ(file.skipped, 1u);  // nothing of the loop is positive
  ASSERT_EQ(file.graph.edges().size(), 2u);
  const Matrix7d& I = file.graph.edges()[1].information;  // the eigenvector (1, 1) / sqrt(2) keeps its 3
  EXPECT_NEAR(I(0, 0), 1.5, 1e-8);
  EXPECT_NEAR(I(0, 1), 1.5, 1e-8);
  EXPECT_NEAR(I(1, 1), 1.5, 1e-8);
  EXPECT_NEAR(I(5, 5), 1, 1e-8);
  ASSERT_FALSE(file.warnings.empty());
  EXPECT_THAT(file.warnings[0], HasSubstr("graph.g2o:2: 2 of 3 edges"));
  EXPECT_THAT(file.warnings[0], HasSubstr("negative eigenvalues count as 0; 1 have nothing positive"));
}

TEST(G2o, OfBadInformationTheDiagonalMayBeKept) {
  const G2oFile file = ReadG2o(GraphFile(kBadInformation), BadInformation::kDiagonal);
  ASSERT_EQ(file.graph.edges().size(), 2u);
  const Matrix7d& I = file.graph.edges()[1].information;
  EXPECT_EQ(I(0, 0), 1);
  EXPECT_EQ(I(0, 1), 0);
  EXPECT_EQ(I(5, 5), 1);
}

TEST(G2o, EdgesOfBadInformationMayBeSkippedIfTheGraphHoldsTogether) {
  const std::string bridge = ErrorOfText(kBadInformation, BadInformation::kSkip);
  EXPECT_THAT(bridge, HasSubstr("graph.g2o:2: without the 2 of 3 edges"));
  EXPECT_THAT(bridge, HasSubstr("falls into 2 pieces (before: 1)"));
  const std::string held = "EDGE_SE2 2 1 -1 0 0  1 0 0 1 0 1\n";
  const G2oFile file = ReadG2o(GraphFile(kBadInformation + held), BadInformation::kSkip);
  EXPECT_EQ(file.graph.edges().size(), 2u);
  EXPECT_EQ(file.skipped, 2u);
  EXPECT_THAT(file.warnings[0], HasSubstr("2 are left out"));
}

TEST(G2o, FilesThatHoldNoGraphSaySo) {
  EXPECT_THAT(ErrorOfText(""), HasSubstr("holds no edge"));
  EXPECT_THAT(ErrorOfText(std::string("\0\xff\x01garbage\n", 11)), HasSubstr(":1: holds zero bytes"));
  EXPECT_THAT(ErrorOfText("\xff\x01garbage\n"), HasSubstr("is it a g2o file?"));
  EXPECT_THAT(ErrorOfText(kVertices), HasSubstr("holds no edge"));
  EXPECT_THROW(ReadG2o("/nonexistent/graph.g2o"), InputError);
  EXPECT_THROW(ReadG2o(testing::FreshFolder()), InputError);
}

TEST(G2o, WritingIntoAMissingFolderIsAnInputError) {
  PoseGraph graph;
  EXPECT_THROW(WriteG2o("/nonexistent/folder/graph.g2o", graph), InputError);
}

}  // namespace
}  // namespace tutti
