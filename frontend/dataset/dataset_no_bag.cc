// In the place of dataset_bag.cc where ROS is not installed.
#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"

namespace tutti {

std::unique_ptr<Dataset> OpenBag(const std::filesystem::path& file, const DatasetOptions&) {
  throw InputError(file.string() +
                   ": is a ROS bag, and this tutti was built without them; install librosbag-storage-dev and "
                   "libsensor-msgs-dev, and build again");
}

}  // namespace tutti
