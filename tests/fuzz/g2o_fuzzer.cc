// Pose graphs: any bytes give a graph of finite numbers that can be written and read again, or an InputError.
// The first byte chooses what becomes of bad information matrices and of unknown tags.
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "tests/fuzz/memory_file.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/core/error.h"

namespace {

bool Finite(const tutti::Similarity& pose) {
  return pose.translation.allFinite() && pose.rotation.coeffs().allFinite() && pose.scale > 0 &&
         pose.scale < 1e300;
}

void CheckGraph(const tutti::PoseGraph& graph) {
  for (const tutti::PoseGraphNode& node : graph.nodes()) {
    if (!Finite(node.pose)) std::abort();
  }
  for (const tutti::PoseGraphEdge& edge : graph.edges()) {
    const bool good = Finite(edge.measurement) && edge.information.allFinite() && graph.Has(edge.from) &&
                      graph.Has(edge.to) && edge.from != edge.to;
    if (!good) std::abort();
  }
}

void CheckWritten(const tutti::PoseGraph& graph) {
  static const std::filesystem::path again = tutti::fuzz::ScratchPath("g2o");
  tutti::WriteG2o(again, graph);
  try {
    const tutti::G2oFile read = tutti::ReadG2o(again);
    if (read.graph.nodes().size() != graph.nodes().size() ||
        read.graph.edges().size() != graph.edges().size())
      std::abort();
  } catch (const tutti::InputError& error) {
    throw std::logic_error(error.what());  // what was written must be read
  }
  std::filesystem::remove(again);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto how = static_cast<tutti::BadInformation>(data[0] % 4);
  tutti::G2oFile read;
  try {
    read = tutti::ReadG2o(tutti::fuzz::MemoryFile(data + 1, size - 1), how, data[0] / 4 % 2 == 1);
  } catch (const tutti::InputError&) {
    return 0;
  }
  CheckGraph(read.graph);
  if (read.has_all_vertices) CheckWritten(read.graph);
  return 0;
}
