#include "apps/reconstruct/written_maps.h"
#include "core/replaced_file.h"
#include "tutti/core/error.h"

#ifdef TUTTI_WITH_OPENVDB
#include <openvdb/openvdb.h>
#include <openvdb/tools/FastSweeping.h>

#include <fstream>

namespace tutti {
namespace {

// OpenVDB gives each file a random identifier, behind magic number, versions and a flag. Here the same
// content has the same bytes.
void SetIdentifier(const std::filesystem::path& file) {
  constexpr std::streamoff kAt = 8 + 3 * 4 + 1;
  std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
  bytes.seekp(kAt);
  bytes << "00000000-0000-4000-8000-000000000000";
  bytes.flush();
  if (!bytes) throw InputError(file.string() + ": can't be written");
}

}  // namespace

void RequireOpenVdb() {}

void WriteEsdf(const std::filesystem::path& file, const OccupiedSpace& space) {
  openvdb::initialize();
  const auto half = static_cast<float>(0.5 * space.cell_m);
  const openvdb::FloatGrid::Ptr border = openvdb::FloatGrid::create(half);
  border->setTransform(openvdb::math::Transform::createLinearTransform(space.cell_m));
  auto accessor = border->getAccessor();
  for (const Eigen::Vector3i& cell : space.free) accessor.setValue({cell.x(), cell.y(), cell.z()}, half);
  for (const Eigen::Vector3i& cell : space.occupied) accessor.setValue({cell.x(), cell.y(), cell.z()}, -half);
  // The Eikonal equation over the cells that are known (H. Zhao, "A fast sweeping method for Eikonal
  // equations", 2005).
  const openvdb::FloatGrid::Ptr distances = openvdb::tools::sdfToSdf(*border);
  if (!distances) throw InputError(file.string() + ": OpenVDB found no distances: no cell is occupied");
  distances->setName("esdf");
  distances->setGridClass(openvdb::GRID_UNKNOWN);
  distances->transform().postTranslate(openvdb::Vec3d(0.5 * space.cell_m));
  internal::ReplacedFile out(file);
  try {
    openvdb::io::File vdb(out.part().string());
    vdb.write({distances});
  } catch (const openvdb::Exception& error) {
    throw InputError(file.string() + ": " + error.what());
  }
  SetIdentifier(out.part());
  out.Commit();
}

}  // namespace tutti
#else
namespace tutti {

void RequireOpenVdb() {
  throw InputError("--esdf: this tutti was built without OpenVDB; install libopenvdb-dev and build it again");
}
void WriteEsdf(const std::filesystem::path&, const OccupiedSpace&) { RequireOpenVdb(); }

}  // namespace tutti
#endif
