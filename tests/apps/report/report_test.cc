// report.html and report.json, without a browser (tests/apps/browser has one).
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/report/page.h"
#include "apps/report/run_report.h"
#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

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
  result.candidate = result.best = 3;
  result.hypothesis = 0.5;
  result.proposed = true;
  result.posterior_by_location = {{1, 1e-6}, {3, 0.4}};
  result.posterior = 0.4;
  result.members.push_back({});
  result.members.back().name = "orb";
  result.verification.candidate = 3;
  result.verification.mass = 0.45;
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
  EXPECT_EQ(logged.posterior, 0.4);
  EXPECT_EQ(logged.geometry.mass, 0.45);
  EXPECT_TRUE(logged.geometry.inlier_matches.empty());
}

TEST(DetectionLog, WeightsAreSharesOfThoseThatTookPart) {
  LoopResult result;
  result.query = 0;
  for (const double weight : {1.5, 0.5, 7.0}) {
    result.members.push_back({});
    result.members.back().weight = weight;
    result.members.back().took_part = weight < 7;  // the third sits the image out
  }
  DetectionLog log;
  log.OnDetection(result);
  const std::vector<LoggedOpinion>& opinions = log.detections().front().opinions;
  EXPECT_DOUBLE_EQ(opinions[0].weight, 0.75);
  EXPECT_DOUBLE_EQ(opinions[1].weight, 0.25);
  EXPECT_EQ(opinions[2].weight, 0);
}

TEST(DetectionLog, EvidenceIsAByteForAFewImagesHoweverLongTheRun) {
  EXPECT_EQ(EvidenceByte::Of(1), EvidenceByte::kZero);
  EXPECT_EQ(EvidenceByte::Of(std::exp(2.0)), EvidenceByte::kZero + 20);
  EXPECT_EQ(EvidenceByte::Of(0), 1);
  EXPECT_EQ(EvidenceByte::Of(1e30), 255);
  constexpr int kImages = 1200;
  DetectionLog log;
  for (int i = 0; i < kImages; ++i) {
    LoopResult result;
    result.query = 10 * i;
    result.members.push_back({});
    result.members.back().took_part = true;
    for (int k = 0; k + 10 < i; ++k) {
      CandidateEvidence place;
      place.location = 10 * k;
      place.likelihood = k == 700 ? std::exp(3.0) : std::exp(-1.0);
      result.members.back().evidence.push_back(place);
    }
    log.OnDetection(result);
  }
  const LoggedDetection& early = log.detections()[400];
  EXPECT_EQ(early.group, 1u);
  EXPECT_EQ(early.opinions[0].evidence.size(), 390u);
  const LoggedDetection& last = log.detections().back();
  EXPECT_EQ(last.group, 4u);
  const std::vector<std::uint8_t>& evidence = last.opinions[0].evidence;
  ASSERT_EQ(evidence.size(), 298u);
  for (std::size_t g = 0; g < evidence.size(); ++g)
    EXPECT_EQ(evidence[g], EvidenceByte::kZero + (g == 175 ? 30 : -10)) << g;
}

// A few images, most of them new, the last of which comes back to the first.
DetectionLog ReturnLog(int images) {
  DetectionLog log;
  for (int i = 0; i < images; ++i) {
    LoopResult result;
    result.query = i;
    result.members.resize(2);
    result.members[0].name = "orb";
    result.members[0].took_part = true;
    result.members[1].name = "sift";
    for (int k = 0; k + 2 < i; ++k) result.members[0].evidence.push_back({k, 0, std::exp(-1.0), 0});
    result.reason = "the hypothesis is too weak";
    if (i + 1 == images) {
      result.members[0].evidence[0].likelihood = std::exp(4.0);
      result.hypothesis = 0.9;
      result.candidate = result.best = 0;
      result.posterior = 0.8;
      result.posterior_by_location = {{0, 0.8}};
      result.proposed = true;
      result.probability = 0.5;
      result.reason = "probably not this place";
      result.verification.candidate = 0;
      result.verification.inliers = 33;
      result.verification.mass = 0.85;
    }
    log.OnDetection(result);
  }
  return log;
}

TEST(ReportOfARun, SaysWhatEachImageWasDecidedBy) {
  constexpr int kImages = 500;
  const DetectionLog log = ReturnLog(kImages);
  RunResult run;
  run.config.loops.rule = CombinationRule::kMean;
  const Json posterior = RunReport(run, log, "ensemble")["posterior"];
  const std::size_t cells = posterior["cells"];
  EXPECT_EQ(cells, 220u);
  for (const char* list : {"t", "place_t", "images"}) EXPECT_EQ(posterior[list].size(), cells) << list;
  EXPECT_EQ(posterior["loop_threshold"], run.config.loops.loop_threshold);
  const Json& evidence = posterior["evidence"];
  ASSERT_EQ(evidence["maps"].size(), 2u);  // there is no joint filter
  EXPECT_EQ(evidence["maps"][0]["name"], "orb");
  EXPECT_EQ(evidence["maps"][0]["q"].get<std::string>().size(), 4 * ((cells * cells + 2) / 3));
  EXPECT_EQ(posterior["weights"].size(), 2u);
  EXPECT_EQ(posterior["weights"][0]["w"].back(), 1);
  EXPECT_EQ(posterior["weights"][1]["w"].back(), 0);
  const Json& image = posterior["images"].back();
  EXPECT_EQ(image["query"], kImages - 1);  // of the last column the one that says most
  EXPECT_EQ(image["new"], 0.1);
  EXPECT_EQ(image["candidate"], 0);
  EXPECT_EQ(image["row"], 0);
  EXPECT_EQ(image["probability"], 0.5);
  EXPECT_EQ(image["reason"], "probably not this place");
  EXPECT_EQ(image["geometry"]["mass"], 0.85);
  EXPECT_EQ(image["geometry"]["inliers"], 33);
  EXPECT_EQ(image["members"][0][0], 1);
  EXPECT_TRUE(image["members"][1].is_null());  // it sat out
  const Json& before = posterior["images"].front();
  EXPECT_TRUE(before["probability"].is_null());
  EXPECT_TRUE(before["geometry"].is_null());
  EXPECT_EQ(before["outcome"], "none");
  EXPECT_EQ(before["reason"], "the hypothesis is too weak");
}

TEST(ReportOfARun, HoldsWhatTheRunFound) {
  const fs::path folder = testing::FreshFolder();
  const auto run = [&](const std::string& out, const std::vector<std::string>& more) {
    const auto done = testing::RunTutti(
        testing::RunArguments(testing::TinyConfig(folder), testing::TinyTown(), folder / out, more));
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
  EXPECT_EQ((*report)["posterior"]["evidence"]["maps"].size(), 4u);
  EXPECT_EQ((*report)["posterior"]["weights"].size(), 3u);
  EXPECT_EQ((*report)["posterior"]["images"].size(), (*report)["posterior"]["cells"]);
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

TEST(ReportOfARun, ADamagedOneIsNamedWhateverIsWrong) {
  const fs::path folder = testing::FreshFolder(), file = folder / "report.json";
  const std::string format = "{\"format\": " + std::to_string(kReportFormat);
  const std::string deep = std::string(100000, '[') + std::string(100000, ']');
  const std::vector<std::string> texts = {
      "",
      "{",
      "[]",
      "7",
      "{\"format\": \"1\"}",
      format + "}",
      format + R"(, "dataset": 1, "variant": "orb"})",
      format + R"(, "dataset": "a", "variant": "orb", "gallery": []})",
      format + R"(, "dataset": "a", "variant": "orb", "gallery": {"entries": 1}})",
      format + R"(, "dataset": "a", "variant": "orb", "gallery": {"entries": [{"outcome": null}]}})",
      format + R"(, "dataset": "a", "variant": "orb", "more": )" + deep + "}"};
  for (const std::string& text : texts) {
    testing::WriteAll(file, text);
    EXPECT_THAT(testing::ErrorOf([&] { ReadRunReport(folder); }), HasSubstr(file.string()))
        << text.substr(0, 100);
  }
  testing::WriteAll(file, format + R"(, "dataset": "a", "variant": "orb"})");
  EXPECT_TRUE(ReadRunReport(folder));
}

TEST(ReportOfARun, OtherFormatsAreNotRead) {
  const fs::path folder = testing::FreshFolder();
  testing::WriteAll(folder / "report.json", "{\"format\": 99}");
  EXPECT_FALSE(ReadRunReport(folder));
  fs::remove(folder / "report.json");
  ASSERT_EQ(mkfifo((folder / "report.json").c_str(), 0600), 0);  // opened, it would wait for ever
  EXPECT_FALSE(ReadRunReport(folder));
}

}  // namespace
}  // namespace tutti
