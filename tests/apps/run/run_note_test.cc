#include "apps/run/runner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/run/outputs.h"
#include "tests/support/error_of.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

TEST(RunNote, HasTheRequestAgain) {
  RunRequest request;
  request.dataset = "/data/drive";
  request.config = "car.yaml";
  request.checkpoint_s = 5;
  request.keep = true;
  const std::string note = NoteOf(request);
  EXPECT_EQ(DatasetOfNote(note), "/data/drive");
  const RunRequest again = RequestOf(note, "map");
  EXPECT_EQ(again.dataset, request.dataset);
  EXPECT_EQ(again.config, request.config);
  EXPECT_EQ(again.checkpoint_s, request.checkpoint_s);
  EXPECT_TRUE(again.keep);
}

// A checkpoint may come from anywhere: the map goes into the folder that --resume was given.
TEST(RunNote, NamesNoFileThatIsWritten) {
  RunRequest request;
  request.dataset = "/data/drive";
  request.save_map = "/home/somebody/map.tutti";
  std::string elsewhere;
  EXPECT_EQ(RequestOf(NoteOf(request), "map", &elsewhere).save_map, kMap);
  EXPECT_EQ(elsewhere, "/home/somebody/map.tutti");
  request.save_map = kMap;
  elsewhere.clear();
  EXPECT_EQ(RequestOf(NoteOf(request), "map", &elsewhere).save_map, kMap);
  request.save_map.reset();
  EXPECT_FALSE(RequestOf(NoteOf(request), "map", &elsewhere).save_map);
  EXPECT_EQ(elsewhere, "");
}

// Whoever has a map may have written anything there.
TEST(RunNote, OfSomebodyElseHasNoDataSet) {
  for (const char* note :
       {"", "found in the attic", "[1]", "{}", R"({"dataset": 5})", R"({"dataset": null})"}) {
    EXPECT_EQ(DatasetOfNote(note), "") << note;
    EXPECT_THAT(testing::ErrorOf([&] { RequestOf(note, "some.map"); }),
                HasSubstr("some.map: is no checkpoint of tutti run"))
        << note;
  }
}

}  // namespace
}  // namespace tutti
