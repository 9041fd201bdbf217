// `tutti loops` and `tutti compare-loops`, end to end, through the real executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/loops_fixture.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using testing::kEmptySheet;
using testing::kLoopImages;
using testing::kLoopPlaces;
using ::testing::Not;
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;
using testing::WriteAll;

class LoopsCommand : public testing::LoopsFixture {};

TEST_F(LoopsCommand, WritesEverythingThatScriptsRelyOn) {
  WriteImages();
  const std::string run = Done(Run(Truth(TruePairs()), out_));
  ExpectAllFiles(out_);
  const nlohmann::json r = Json(out_ / "results.json");
  EXPECT_EQ(r["images"], kLoopImages);
  EXPECT_EQ(r["rows_with_loop"], 5);
  EXPECT_EQ(r["accepted"]["false"], 0);
  EXPECT_GT(r["recall_at_100_precision"].get<double>(), 0.5);
  for (const std::string& key :
       SplitText("images_damaged recall_at_100_precision_posterior area_under_curve "
                 "area_under_curve_posterior best_f1 best_f1_posterior at_default_threshold "
                 "at_default_threshold_posterior ms_per_image stage_ms_median protocol "
                 "recall_at_100_precision_ranked area_under_curve_ranked best_f1_ranked f1_at_default "
                 "f1_at_default_posterior calibration_error calibration_error_ranked "
                 "calibration_error_posterior calibration_images",
                 " "))
    EXPECT_TRUE(r.contains(key)) << key;
  EXPECT_EQ(r["protocol"]["rule"], "joint");
  EXPECT_EQ(r["protocol"]["tolerance_frames"], 0);
  // Nothing that was refused counts: what is verified was accepted.
  EXPECT_LE(r["recall_at_100_precision"], r["at_default_threshold"]["recall"]);
  EXPECT_GE(r["recall_at_100_precision_ranked"], r["recall_at_100_precision"]);
  for (const char* suffix : {"", "_ranked", "_posterior"}) {
    int images = 0;
    for (const nlohmann::json& bin : r[std::string("reliability") + suffix])
      images += bin["images"].get<int>();
    EXPECT_EQ(images, r[std::string("calibration_images") + suffix]);
    EXPECT_EQ(r[std::string("reliability") + suffix].size(), 10u);
  }
  EXPECT_THAT(run, AllOf(HasSubstr("ranked"), HasSubstr("calibration error"), HasSubstr("over n images")));
  EXPECT_FALSE(fs::exists(out_ / "dump_candidates.csv"));
  EXPECT_THAT(ReadAll(out_ / "hypotheses.csv"),
              StartsWith("image,file,hypothesis,candidate,posterior,probability,proposed,"));
  EXPECT_THAT(ReadAll(out_ / "precision_recall.svg"),
              AllOf(HasSubstr("with verification"), HasSubstr("posterior only"), HasSubstr("ranked behind"),
                    HasSubstr("\nrecall\n")));
}

// The area and the recall before the first false positive, from the curve's file again.
TEST_F(LoopsCommand, TheCurvesFileHoldsWhatTheFiguresAreReadFrom) {
  WriteImages();
  ASSERT_EQ(Run(Truth({{15, 0}, {16, 1}, {18, 3}}), out_).status, 0);
  const nlohmann::json r = Json(out_ / "results.json");
  std::istringstream csv(ReadAll(out_ / "precision_recall.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line, "curve,threshold,rejected,precision,recall,true_positives,false_positives");
  double area[3] = {0, 0, 0}, recall[3] = {0, 0, 0}, recall_before[3] = {0, 0, 0};
  while (std::getline(csv, line)) {
    const std::vector<std::string> cells = SplitText(line, ",");
    ASSERT_EQ(cells.size(), 7u) << line;
    const int k = cells[0] == "verified" ? 0 : cells[0] == "posterior" ? 1 : 2;
    if (k != 2) {
      EXPECT_EQ(cells[2], "0") << line;
    }
    const double precision = *ParseDouble(cells[3]), r_here = *ParseDouble(cells[4]);
    area[k] += precision * (r_here - recall_before[k]);
    recall_before[k] = r_here;
    if (cells[6] == "0") recall[k] = r_here;
  }
  EXPECT_NEAR(area[0], r["area_under_curve"].get<double>(), 1e-6);
  EXPECT_NEAR(area[1], r["area_under_curve_posterior"].get<double>(), 1e-6);
  EXPECT_NEAR(area[2], r["area_under_curve_ranked"].get<double>(), 1e-6);
  EXPECT_NEAR(recall[0], r["recall_at_100_precision"].get<double>(), 1e-6);
  EXPECT_NEAR(recall[2], r["recall_at_100_precision_ranked"].get<double>(), 1e-6);
  EXPECT_NEAR(recall[1], r["recall_at_100_precision_posterior"].get<double>(), 1e-6);
}

TEST_F(LoopsCommand, TheTableHoldsEveryRuleWithItsOwnFolder) {
  WriteImages();
  const fs::path truth = Truth(TruePairs());
  const auto run = Run(truth, out_, {"--table"});
  ASSERT_EQ(run.status, 0) << run.output;
  const std::vector<std::string> rules = {"joint", "mean", "log-pool", "product", "majority",
                                          "naive", "surf", "sift",     "orb"};
  const nlohmann::json table = Json(out_ / "table.json");
  EXPECT_EQ(table["rules"].size(), rules.size());
  for (const std::string& rule : rules) {
    ExpectAllFiles(out_ / rule);
    const nlohmann::json alone = Json(out_ / rule / "results.json");
    EXPECT_EQ(alone["protocol"]["rule"], rule);
    for (const auto& [key, value] : table["rules"][rule].items()) EXPECT_EQ(value, alone[key]) << key;
    EXPECT_THAT(ReadAll(out_ / "table.csv"), HasSubstr("\n" + rule + ","));
    EXPECT_THAT(run.output, HasSubstr("| " + rule + " "));
  }
  EXPECT_THAT(
      ReadAll(out_ / "table.md"),
      AllOf(HasSubstr("20 of " + images_.string()), HasSubstr("5 with a loop"), HasSubstr(truth.string()),
            HasSubstr("tolerance 0 frames"), HasSubstr("the newest 10 images"),
            HasSubstr("chosen after the fact"), HasSubstr("McNemar (exact binomial)"),
            HasSubstr("| recall at 100 % precision, ranked |"), HasSubstr("| F1 at the default "),
            HasSubstr("| calibration error "), HasSubstr("(n = ")));
  EXPECT_THAT(ReadAll(out_ / "table.csv"),
              AllOf(HasSubstr(",recall_at_100_precision_ranked,"), HasSubstr(",f1_at_default,"),
                    HasSubstr(",calibration_error_posterior,")));
  ASSERT_EQ(table["significance"].size(), 12u);
  for (const nlohmann::json& test : table["significance"]) {
    EXPECT_EQ(test["images"], 5);
    EXPECT_GE(test["mcnemar"]["p"].get<double>(), 0);
    EXPECT_LE(test["mcnemar"]["p"].get<double>(), 1);
    EXPECT_LE(test["t_test"]["p"].get<double>(), 1);
  }
  // A run of that rule alone gives the same bytes.
  ASSERT_EQ(Run(truth, folder_ / "naive", {"--rule", "naive"}).status, 0);
  EXPECT_EQ(ReadAll(folder_ / "naive" / "hypotheses.csv"), ReadAll(out_ / "naive" / "hypotheses.csv"));
}

TEST_F(LoopsCommand, TheDumpSaysWhatEachCandidateLookedLike) {
  WriteImages();
  const fs::path truth = Truth(TruePairs());
  ASSERT_EQ(Run(truth, out_, {"--dump"}).status, 0);
  std::istringstream candidates(ReadAll(out_ / "dump_candidates.csv"));
  std::string line;
  std::getline(candidates, line);
  EXPECT_EQ(line,
            "image,location,truth,combined_posterior,surf_score,surf_likelihood,surf_posterior,sift_score,"
            "sift_likelihood,sift_posterior,orb_score,orb_likelihood,orb_posterior");
  int loops = 0;
  while (std::getline(candidates, line)) {
    const std::vector<std::string> cells = SplitText(line, ",");
    ASSERT_EQ(cells.size(), 13u) << line;
    const int image = std::stoi(cells[0]), location = std::stoi(cells[1]);
    EXPECT_LT(location, image - 9);  // short-term memory is no candidate
    EXPECT_EQ(cells[2], image == location + kLoopPlaces ? "loop" : "none");
    loops += cells[2] == "loop" ? 1 : 0;
    EXPECT_GT(*ParseDouble(cells[4]) + *ParseDouble(cells[7]) + *ParseDouble(cells[10]), 0) << line;
    for (const std::size_t likelihood : {5u, 8u, 11u})  // few words speak against a place, down to 1 / e
      EXPECT_GE(*ParseDouble(cells[likelihood]), 0.36) << line;
  }
  EXPECT_EQ(loops, 5);

  std::istringstream verification(ReadAll(out_ / "dump_verification.csv"));
  std::getline(verification, line);
  EXPECT_EQ(line,
            "image,candidate,truth,order,late,similar,accepted,chosen,type,matches,inliers,mass,coverage,"
            "expected_inliers,log_nfa,motion_spread,hypothesis,reason");
  int chosen = 0;
  while (std::getline(verification, line)) {
    const std::vector<std::string> cells = SplitText(line, ",");
    ASSERT_GE(cells.size(), 18u) << line;
    if (cells[7] == "1") {
      EXPECT_EQ(cells[5], "1") << line;
      EXPECT_EQ(cells[8], "fundamental");
      EXPECT_EQ(cells[17], "\"\"") << line;
      ++chosen;
    }
  }
  const nlohmann::json accepted = Json(out_ / "results.json")["accepted"];
  EXPECT_EQ(chosen, accepted["true"].get<int>() + accepted["false"].get<int>());
  // Looking on changes nothing.
  ASSERT_EQ(Run(truth, folder_ / "silent").status, 0);
  EXPECT_EQ(ReadAll(folder_ / "silent" / "hypotheses.csv"), ReadAll(out_ / "hypotheses.csv"));
}

TEST_F(LoopsCommand, ADumpOfImagesWithoutFeaturesHasNoCandidates) {
  fs::create_directories(images_);
  for (int i = 0; i < 15; ++i)
    cv::imwrite((images_ / (std::to_string(i) + ".png")).string(), cv::Mat(120, 160, CV_8U, cv::Scalar(90)));
  Done(Run(Truth({}, 15), out_, {"--dump"}));
  for (const char* name : {"dump_candidates.csv", "dump_verification.csv"}) {
    const std::string text = ReadAll(out_ / name);
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << name;
  }
  const nlohmann::json r = Json(out_ / "results.json");
  EXPECT_TRUE(r["calibration_error"].is_null());
  EXPECT_EQ(r["f1_at_default"], 1);  // nothing to find, nothing said
}

TEST_F(LoopsCommand, NumbersAreThoseOfAllImagesAlsoWithAStride) {
  WriteImages();
  Done(Run(Truth(TruePairs()), out_, {"--stride", "5", "--keep-posterior", "--dump"}));
  std::istringstream lines(ReadAll(out_ / "hypotheses.csv"));
  std::string line;
  std::getline(lines, line);
  int image = 0;
  for (; std::getline(lines, line); image += 5) {
    const std::string number = std::to_string(image);
    std::string start = number;
    start.append(",\"").append(number).append(".png\"");
    EXPECT_THAT(line, StartsWith(start));
  }
  EXPECT_EQ(image, kLoopImages);
  for (const char* file : {"posteriors.csv", "dump_candidates.csv", "dump_verification.csv"}) {
    std::istringstream table(ReadAll(out_ / file));
    std::getline(table, line);
    while (std::getline(table, line)) {
      const std::vector<std::string> cells = SplitText(line, ",");
      EXPECT_EQ(*ParseInteger(cells[0]) % 5, 0) << file << ": " << line;
      EXPECT_EQ(*ParseInteger(cells[1]) % 5, 0) << file << ": " << line;
    }
  }
}

TEST_F(LoopsCommand, ATableOfOneRuleIsAContradiction) {
  WriteImages(2);
  ExpectRefusal(Run(Truth({}, 2), out_, {"--table", "--rule", "mean"}), {"--table", "--rule"});
}

TEST_F(LoopsCommand, NothingWrongGivesAContactSheetThatSaysNone) {
  WriteImages(13);  // all of different places
  ASSERT_EQ(Run(Truth({}, 13), out_).status, 0);
  EXPECT_EQ(PictureSize(out_ / "contact_sheet.png").height, kEmptySheet);
}

TEST_F(LoopsCommand, OneImageAloneIsARunAndATable) {
  WriteImages(1);
  const fs::path truth = folder_ / "pairs.txt";
  WriteAll(truth, "0\n");
  Done(Run(truth, out_));
  ExpectAllFiles(out_);
  EXPECT_THAT(ReadAll(out_ / "precision_recall.svg"),
              AllOf(HasSubstr("the curves are empty"), Not(HasSubstr("nan"))));
  const auto table = Run(truth, out_, {"--table"});
  ASSERT_EQ(table.status, 0) << table.output;
  EXPECT_EQ(Json(out_ / "table.json")["significance"][0]["mcnemar"]["p"], 1.0);
}

TEST_F(LoopsCommand, AnOutputFolderThatCantBeMadeIsOneLine) {
  WriteImages(1);
  WriteAll(folder_ / "pairs.txt", "0\n");
  ExpectRefusal(Run(folder_ / "pairs.txt", "/proc/tutti-out"), {"/proc/tutti-out"});
}

TEST_F(LoopsCommand, CtrlCWritesTheImagesSoFar) {
  WriteImages();
  const auto run = testing::RunTuttiAndSignal(
      {"loops", "--images", images_, "--ground-truth", Truth(TruePairs()).string(), "--out", out_}, " 20%",
      SIGINT);
  EXPECT_EQ(run.status, 130) << run.output;
  EXPECT_LT(Json(out_ / "results.json")["images"].get<int>(), kLoopImages);
  ExpectAllFiles(out_);
}

TEST_F(LoopsCommand, AForeignFolderIsRefusedAndAnEarlierResultReplaced) {
  WriteImages();
  ExpectRefusal(Run(Truth(TruePairs()), images_), {"choose another --out"});
  EXPECT_FALSE(fs::exists(images_ / "results.json"));
  ASSERT_EQ(Run(Truth(TruePairs()), out_, {"--rule", "orb", "--dump"}).status, 0);
  EXPECT_EQ(Run(Truth(TruePairs()), out_, {"--rule", "orb"}).status, 0);
  EXPECT_FALSE(fs::exists(out_ / "dump_candidates.csv"));  // it was the earlier run's
  ExpectAllFiles(out_);
}

class CompareLoops : public testing::LoopsFixture {};

std::string SmallTable(double joint, double naive, double surf) {
  nlohmann::json table;
  table["best_single"] = {{"verified", "surf"}, {"posterior", "surf"}};
  for (const auto& [rule, recall] : std::vector<std::pair<std::string, double>>{
           {"joint", joint}, {"mean", surf}, {"naive", naive}, {"surf", surf}})
    table["rules"][rule] = {{"recall_at_100_precision", recall},
                            {"recall_at_100_precision_posterior", recall}};
  return table.dump();
}

TEST_F(CompareLoops, CompareLoopsIsThePairedTTestOverTheSets) {
  // joint - naive: 0.3, 0.2, 0.1, 0.3, 0.1: their mean 0.2, deviation 0.1, t = 0.2 / (0.1 / sqrt 5) = 4.4721.
  // With four degrees of freedom and x = t / sqrt(4 + t^2), p = 1 - x (3 - x^2) / 2 = 0.0111.
  const std::vector<std::pair<double, double>> recalls = {
      {0.8, 0.5}, {0.9, 0.7}, {0.7, 0.6}, {0.7, 0.4}, {0.9, 0.8}};
  const std::string out = (folder_ / "t.json").string();
  std::vector<std::string> arguments = {"compare-loops", "--out", out};
  for (const auto& [joint, naive] : recalls) {
    arguments.push_back((folder_ / (std::to_string(arguments.size()) + ".json")).string());
    WriteAll(arguments.back(), SmallTable(joint, naive, joint));
  }
  Done(RunTutti(arguments));
  const nlohmann::json tests = Json(out);
  ASSERT_EQ(tests.size(), 8u);
  EXPECT_EQ(tests[1]["a"], "joint");
  EXPECT_EQ(tests[1]["b"], "naive");
  EXPECT_EQ(tests[1]["sets"], 5);
  EXPECT_NEAR(tests[1]["t"].get<double>(), 4.4721, 1e-4);
  EXPECT_NEAR(tests[1]["p"].get<double>(), 0.0111, 1e-4);
  EXPECT_EQ(tests[2]["b"], "best single");
  EXPECT_EQ(tests[2]["p"], 1.0);  // no difference at all
  // Four sets are too few for a p.
  arguments.pop_back();
  const std::string few = Done(RunTutti(arguments));
  EXPECT_FALSE(Json(out)[1].contains("p"));
  EXPECT_THAT(few, HasSubstr("p is given from 5 sets on"));
}

TEST_F(CompareLoops, CompareLoopsRefusesWhatIsNoTable) {
  WriteAll(folder_ / "1.json", "[1, 2");
  WriteAll(folder_ / "2.json", R"({"rules": {}, "best_single": {}})");
  for (const char* name : {"1.json", "2.json", "none.json"}) {
    ExpectRefusal(RunTutti({"compare-loops", folder_ / name}), {name});
  }
}

}  // namespace
}  // namespace tutti
