#include "core/example_configs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

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
    std::ifstream in(entry.path());
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    EXPECT_EQ(internal::ExampleConfig(names.back()), text) << entry.path();
  }
  EXPECT_THAT(internal::ExampleConfigNames(), ::testing::UnorderedElementsAreArray(names));
}

TEST(ExampleConfigs, OfAnUnknownNameIsNone) { EXPECT_FALSE(internal::ExampleConfig("euroc")); }

}  // namespace
}  // namespace tutti
