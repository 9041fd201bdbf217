#include "apps/reconstruct/navigation_files.h"
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
      tree.updateNode(octomap::point3d(Eigen::Vector3f(centre.cast<float>()).x(), static_cast<float>(centre.y()),
                                       static_cast<float>(centre.z())),
                      occupied, true);
    }
  };
  set(space.free, false);
  set(space.occupied, true);
  tree.updateInnerOccupancy();
  std::ostringstream bytes;
  if (!tree.writeBinary(bytes)) throw InputError(file.string() + ": OctoMap could not write it");
  internal::WriteFile(file, bytes.str());
}

}  // namespace tutti
#else
namespace tutti {

void RequireOctomap() {
  throw InputError("--octomap: this tutti was built without OctoMap; install liboctomap-dev and build it again");
}
void WriteOctomap(const std::filesystem::path&, const OccupiedSpace&) { RequireOctomap(); }

}  // namespace tutti
#endif
