#include "core/example_configs.h"

#include <gtest/gtest.h>

#include "tests/support/in_folder.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

TEST(ExampleConfigs, AreThoseOfTheInstallationOrElseTheSourceTrees) {
  const fs::path prefix = testing::FreshFolder();
  EXPECT_EQ(internal::ExampleConfigs(prefix / "bin"), "data/configs");
  const fs::path configs = prefix / TUTTI_DATA_FOLDER / "tutti/configs";
  fs::create_directories(configs);
  EXPECT_EQ(internal::ExampleConfigs(prefix / "bin"), configs);
  EXPECT_EQ(internal::ExampleConfigs(prefix / "libexec/tutti"), configs);
  EXPECT_EQ(internal::ExampleConfigs(prefix / "lib/x86_64-linux-gnu/tutti"), configs);
  EXPECT_EQ(internal::ExampleConfigs(prefix / "src/tutti/build/release/apps/tutti"), "data/configs")
      << "a build tree is no installation";
}

TEST(ExampleConfigs, AreFoundFromAnyWorkingFolder) {
  const testing::InFolder root("/");
  EXPECT_TRUE(std::filesystem::is_regular_file(internal::ExampleConfig("euroc_mono.yaml")));
}

TEST(ExampleConfigs, OfABuildTreeAreTheSourceTrees) {
  EXPECT_EQ(internal::ExampleConfigs(), "data/configs") << "this test runs from one";
}

}  // namespace
}  // namespace tutti
