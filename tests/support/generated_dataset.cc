#include "tests/support/generated_dataset.h"

#include "data/synthetic/synthetic_world.h"
#include "tests/support/made_once.h"
#include "tests/support/rendered_world.h"

namespace tutti::testing {

std::filesystem::path GeneratedDataset(const SyntheticOptions& options) {
  return MadeOnce("dataset-" + DigestOf(TextOf(options)), TUTTI_RENDERER,
                  [&](const std::filesystem::path& folder) {
                    SyntheticWriteOptions write;
                    write.threads = 2;
                    WriteSyntheticDataset(SyntheticWorld(options), folder, write);
                  });
}

}  // namespace tutti::testing
