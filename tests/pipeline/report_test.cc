// report.html and report.json, without a browser (tests/browser has one).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "executable.h"
#include "test_data.h"
#include "tiny_town.h"
#include "tutti/report/comparison_report.h"
#include "tutti/report/detection_log.h"
#include "tutti/report/page.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::ordered_json;

Json Page(const std::string& text) {
  return {{"kind", "run"}, {"title", text}, {"subtitle", text}, {"runs", Json::array()}};
}

TEST(ReportPage, TextsStayTextsWhateverTheyHold) {
  if (!ReportsAvailable()) GTEST_SKIP() << "built without the chart library: " << ReportsMissing();
  const std::string attack =
      "</script><script>alert(1)</script><!--<img src=x onerror=alert(2)> @script@ \xff";
  const std::string page = ReportPage(Page(attack));
  EXPECT_THAT(page, AllOf(Not(HasSubstr("alert(1)</script>")), Not(HasSubstr("<img src=x")),
                          HasSubstr("\\u003c/script>\\u003cscript>alert(1)"), HasSubstr("@script@")));
  const std::size_t begin = page.find("id=\"data\">") + 10, end = page.find("</script>", begin);
  const Json back = Json::parse(page.substr(begin, end - begin));
  EXPECT_THAT(back["title"].get<std::string>(), HasSubstr("</script><script>alert(1)</script><!--<img"));
}

TEST(ReportPage, LoadsNothingFromANetwork) {
  if (!ReportsAvailable()) GTEST_SKIP() << "built without the chart library: " << ReportsMissing();
  const std::string page = ReportPage(Page("a"));
  EXPECT_THAT(page,
              AllOf(HasSubstr("default-src 'none'"), Not(HasSubstr("src=\"http")), Not(HasSubstr("href="))));
  EXPECT_LT(page.size(), 3u << 20);
}

TEST(ReportPage, WithoutTheChartLibraryAnOldPageGoesAndTheReasonIsSaid) {
  const fs::path file = testing::FreshFolder() / "report.html";
  testing::WriteAll(file, "old");
  WriteReportPage(file, Page("new"));
  EXPECT_EQ(fs::exists(file), ReportsAvailable());
  if (ReportsAvailable()) {
    EXPECT_THAT(testing::ReadAll(file), HasSubstr("new"));
  }
  EXPECT_THAT(ReportsMissing(), AllOf(HasSubstr("configure and build"), HasSubstr("SVG")));
}

TEST(ComparisonPage, ShowsTheFirstRunOfEachVariantAndFewPictures) {
  const auto run = [](const std::string& variant, int seed) {
    Json entries = Json::array();
    for (int i = 0; i < 5; ++i) entries.push_back({{"outcome", "accepted"}, {"title", std::to_string(i)}});
    return Json{{"dataset", "d"},
                {"variant", variant},
                {"seed", seed},
                {"gallery", {{"note", ""}, {"entries", entries}}}};
  };
  const Json page =
      ComparisonPage("t", {{"d", {"variant"}, {{"orb"}}, {"note"}, {"stage [s]"}, {{"read"}}}},
                     {run("orb", 1), run("orb", 2), run("ensemble", 1)}, {"orb, seed 3: killed"});
  ASSERT_EQ(page["runs"].size(), 2u);
  EXPECT_EQ(page["runs"][0]["seed"], 1);
  EXPECT_EQ(page["runs"][0]["gallery"]["entries"].size(), 2u);
  EXPECT_EQ(page["tables"][0]["notes"][0], "note");
  EXPECT_EQ(page["tables"][0]["stage_header"][0], "stage [s]");
  EXPECT_EQ(page["tables"][0]["stage_rows"][0][0], "read");
  EXPECT_EQ(page["failures"][0], "orb, seed 3: killed");
}

TEST(DetectionLog, KeepsWhatIsWorthALook) {
  DetectionLog log;
  LoopResult result;
  result.query = 7;
  result.candidate = 3;
  result.hypothesis = 0.5;
  result.proposed = true;
  result.posterior_by_location = {{1, 1e-6}, {3, 0.4}};
  result.members.push_back({});
  result.members.back().name = "orb";
  for (int i = 0; i < 500; ++i) result.verification.inlier_matches.push_back({});
  result.verification.reason = "too few inliers";
  log.OnDetection(result);
  ASSERT_EQ(log.detections().size(), 1u);
  const LoggedDetection& logged = log.detections().front();
  EXPECT_EQ(logged.candidate, 3);
  EXPECT_EQ(logged.reason, "too few inliers");
  ASSERT_EQ(logged.opinions.size(), 2u);
  EXPECT_FALSE(logged.opinions[0].took_part);
  EXPECT_EQ(logged.opinions[1].name, "ensemble");
  ASSERT_EQ(logged.opinions[1].posterior.size(), 1u);
  EXPECT_EQ(logged.opinions[1].posterior[0].first, 3);
  EXPECT_EQ(logged.matches.size(), DetectionLog::kMostMatches);
}

TEST(ReportOfARun, HoldsWhatTheRunFound) {
  const fs::path folder = testing::FreshFolder();
  const auto run = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> words = {"run",
                                      "--config",
                                      testing::TinyConfig(folder).string(),
                                      "--dataset",
                                      testing::TinyTown().string(),
                                      "--out",
                                      (folder / out).string()};
    words.insert(words.end(), more.begin(), more.end());
    const auto done = testing::RunTutti(words);
    EXPECT_EQ(done.status, 0) << done.output;
    if (!ReportsAvailable()) {
      EXPECT_THAT(done.output, HasSubstr("built without Node"));
    }
  };
  run("a", {});
  const auto report = ReadRunReport(folder / "a");
  ASSERT_TRUE(report);
  EXPECT_EQ((*report)["variant"], "ensemble");
  EXPECT_EQ((*report)["slam"]["x"].size(), static_cast<std::size_t>(testing::kTinyFrames));
  EXPECT_EQ((*report)["reference"]["x"].size(), static_cast<std::size_t>(testing::kTinyFrames));
  EXPECT_EQ((*report)["errors"]["slam"]["error"].size(), static_cast<std::size_t>(testing::kTinyFrames));
  EXPECT_EQ((*report)["posterior"]["maps"].size(), 4u);  // three members and the ensemble
  EXPECT_EQ((*report)["configuration"]["seed"], 1);
  EXPECT_FALSE((*report)["configuration"]["versions"]["OpenCV"].get<std::string>().empty());
  EXPECT_EQ(fs::exists(folder / "a" / "report.html"), ReportsAvailable());
  run("a", {"--no-report"});  // an older report goes: it is of another run
  EXPECT_FALSE(fs::exists(folder / "a" / "report.html"));
  EXPECT_FALSE(fs::exists(folder / "a" / "report.json"));
  run("b", {"--no-loops"});
  EXPECT_EQ((*ReadRunReport(folder / "b"))["variant"], "odometry");
  EXPECT_TRUE((*ReadRunReport(folder / "b"))["posterior"].is_null());
}

TEST(ReportOfARun, OtherFormatsAreNotRead) {
  const fs::path folder = testing::FreshFolder();
  for (const char* text : {"", "{", "[]", "{\"format\": 99}"}) {
    testing::WriteAll(folder / "report.json", text);
    EXPECT_FALSE(ReadRunReport(folder)) << text;
  }
}

}  // namespace
}  // namespace tutti
