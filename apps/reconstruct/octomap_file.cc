#include "apps/reconstruct/written_maps.h"
#include "core/replaced_file.h"
#include "tutti/core/error.h"

#ifdef TUTTI_WITH_OCTOMAP
#include <octomap/OcTree.h>

#include <sstream>

namespace tutti {

void RequireOctomap() {}

void WriteOctomap(const std::filesystem::path& file, const OccupiedSpace& space) {
  octomap::OcTree tree(space.cell_m);
  const auto set = [&](const std::vector<Eigen::Vector3i>& cells, bool occupied) {
    for (const Eigen::Vector3i& cell : cells) {
      const Eigen::Vector3d centre = space.cell_m * (cell.cast<double>() + Eigen::Vector3d::Constant(0.5));
      const Eigen::Vector3f at = centre.cast<float>();
      tree.updateNode(octomap::point3d(at.x(), at.y(), at.z()), occupied, true);
    }
  };
  set(space.free, false);
  set(space.occupied, true);
  tree.updateInnerOccupancy();
  tree.toMaxLikelihood();
  tree.prune();
  // As AbstractOccupancyOcTree::writeBinaryConst, which prints on the terminal.
  std::ostringstream bytes;
  bytes << "# Octomap OcTree binary file\n# (feel free to add / change comments, but leave the first line as "
           "it is!)\n#\n"
        << "id " << tree.getTreeType() << "\nsize " << tree.size() << "\nres " << tree.getResolution()
        << "\ndata\n";
  tree.writeBinaryData(bytes);
  internal::WriteFile(file, bytes.str());
}

}  // namespace tutti
#else
namespace tutti {

void RequireOctomap() {
  throw InputError(
      "--octomap: this tutti was built without OctoMap; install liboctomap-dev and build it again");
}
void WriteOctomap(const std::filesystem::path&, const OccupiedSpace&) { RequireOctomap(); }

}  // namespace tutti
#endif
