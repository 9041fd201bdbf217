// What the lines of a g2o file say, before it is a graph. Private to the back end.
#pragma once

#include <cstddef>
#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "backend/graph/g2o_line.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph.h"

namespace tutti::internal {

struct G2oEdge {
  PoseGraphEdge edge;
  std::size_t line = 0;
  bool bad = false;   ///< its information is not positive definite
  bool toro = false;  ///< its information is in the order of TORO or of iSAM, as six numbers by rows
};

struct G2oMeasurement {
  PoseGraphMeasurement measurement;
  std::size_t line = 0;
  std::optional<NodeId> sensors[2];  ///< ids of parameters, of the ends that are nodes
};

/// How many lines of a sort there are, and the first.
struct LineCount {
  std::size_t count = 0, first = 0;
  void Add(std::size_t line) {
    if (count++ == 0) first = line;
  }
};

struct G2oContents {
  std::filesystem::path file;
  std::optional<GraphKind> kind;
  PoseGraph graph;            ///< vertices alone
  std::deque<G2oEdge> edges;  ///< a deque, whose memory goes as the edges enter the graph
  std::vector<G2oMeasurement> measurements;
  std::map<NodeId, Similarity> parameters;  ///< poses of sensors on their nodes
  std::map<NodeId, std::size_t> fixed;      ///< by FIX, with the line
  std::map<std::string, LineCount> unknown;
  LineCount judged;     ///< switchable and mixture edges
  LineCount not_toro;   ///< edges whose information can't be in the order of TORO
  bool by_rows = true;  ///< that of all EDGE2 can be by rows
};

/// TORO's six numbers, which were read by rows, in their places: xx xy yy tt xt yt.
Matrix7d FromToro(const Matrix7d& by_rows);

/// The graph. Throws InputError as ReadG2o.
G2oFile BuildGraph(G2oContents contents, BadInformation bad, bool ignore_unknown);

}  // namespace tutti::internal
