#include "core/example_configs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/in_folder.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

TEST(ExampleConfigs, AreThoseOfTheSourceTreeFromAnyWorkingFolder) {
  const testing::InFolder root("/");
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(testing::SourceDir() / "data/configs")) {
    names.push_back(entry.path().stem().string());
    EXPECT_EQ(internal::ExampleConfig(names.back()), testing::BytesOf(entry.path())) << entry.path();
  }
  EXPECT_THAT(internal::ExampleConfigNames(), ::testing::UnorderedElementsAreArray(names));
}

TEST(ExampleConfigs, OfAnUnknownNameIsNone) { EXPECT_FALSE(internal::ExampleConfig("euroc")); }

}  // namespace
}  // namespace tutti
