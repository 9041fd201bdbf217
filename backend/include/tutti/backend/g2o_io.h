// Pose graphs as g2o text files.
//
//   VERTEX_SE2 id x y theta                     EDGE_SE2 i j x y theta  I11 I12 I13 I22 I23 I33
//   VERTEX_SE3:QUAT id x y z qx qy qz qw        EDGE_SE3:QUAT i j x y z qx qy qz qw  I11 I12 .. I66 (21
//   numbers, by rows) VERTEX_SIM3:QUAT id x y z qx qy qz qw s     EDGE_SIM3:QUAT i j x y z qx qy qz qw s  I11
//   .. I77 (28 numbers)   [tutti's own] FIX id [id ...]
// Poses are node-to-world, measurements S_i_j. Information: upper triangle of (translation, rotation[, log
// scale]). Landmarks, priors, TORO's tags and switchable loops are read as well: docs/backend.md lists the
// tags. ReadG2o tells its argument `progress` how many lines it has read, every 100,000 lines.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/core/options.h"

#pragma GCC visibility push(default)
namespace tutti {

/// What becomes of edges whose information matrix is not positive definite. kRefuse: the file is refused.
/// kProject: the nearest positive semidefinite matrix (negative eigenvalues become 0). kDiagonal: the
/// diagonal where it is positive, no correlations. What is 0 then counts as a billionth of the largest, since
/// a matrix must have a Cholesky factor. kSkip: they are left out.
enum class BadInformation { kRefuse, kProject, kDiagonal, kSkip };
/// Words of the command line ("refuse", "project", ...).
EnumWords<BadInformation> WordsOf(BadInformation);
/// Throws InputError for another word.
BadInformation ParseBadInformation(const std::string& name);
const char* ToString(BadInformation how);

struct G2oFile {
  PoseGraph graph;
  std::vector<std::string> warnings;  ///< what was ignored, read as something else, or is missing; once each
  bool has_all_vertices =
      false;  ///< false: some or all poses are missing and must be initialised from the edges
  std::size_t bad_information = 0;  ///< edges with such a matrix
  std::size_t skipped = 0;          ///< those of them that are left out
  std::size_t ignored = 0;          ///< lines whose tag is not known
};

/// Reads a graph. Vertices may be missing; edges between poses whose ids follow each other among those of the
/// file (and of one robot, docs/backend.md) are odometry, all others loops. Throws InputError with file and
/// line for: a missing file, a line with too few or unreadable numbers, NaN, a vertex given twice, a zero
/// quaternion, an edge from a node to itself, kinds that are mixed, no edge at all, tags that are not known
/// (with the number of their lines; `ignore_unknown`: a warning), information matrices that are not positive
/// definite (kRefuse, with their number) or without which the graph falls apart.
G2oFile ReadG2o(const std::filesystem::path& file, BadInformation bad = BadInformation::kRefuse,
                bool ignore_unknown = false, const std::function<void(std::size_t)>& progress = {});

/// Writes a graph so that reading gives the same numbers (17 digits) and ids. Throws InputError when it can't
/// be written in full.
void WriteG2o(const std::filesystem::path& file, const PoseGraph& graph);

}  // namespace tutti
#pragma GCC visibility pop
